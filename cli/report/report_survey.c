/* Tells the findings of a survey of shapes. */
#include "report_survey.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "part_turns.h"
#include "report_audit.h"
#include "sdm/internal/box.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/train.h"
#include "terminal.h"

enum { PARAMS_TOLD = 6, NOTICE_SAMPLES = 32 };

/* Where the lines go. */
typedef struct teller {
    const cli_survey *s;
    cli_tell *tell;
    void *user;
    bool failed; /* memory is short */
} teller;

/* Tells the text and frees it. */
static void tell(teller *t, sdm_status weight, sdm_text *text)
{
    t->failed = t->failed || text->failed;
    if (!t->failed) t->tell(t->user, weight, text->data);
    sdm_text_dispose(text);
}

/* Appends "a=4.4 alpha=0.5" of shape `index`: some of its parameters, without number `skip`. */
static void add_params(const cli_survey *s, size_t index, size_t skip, sdm_text *out)
{
    size_t n, told = 0;
    const sdm_param *params = sdm_instance_params(s->shape, &n);
    for (size_t i = 0; i < n && told < PARAMS_TOLD; i++)
        if (i != skip)
            sdm_text_add(out, "%s%s=%.6g", told++ ? " " : "", params[i].name,
                         s->found.p[index * n + i]);
    if (n > PARAMS_TOLD + (skip < n)) sdm_text_add(out, " ...");
}

/* Makes the mesh of shape `index`; false: it cannot be made, for the reason in *err. */
static bool make(const cli_survey *s, size_t index, sdm_mesh *mesh, sdm_error *err)
{
    return !sdm_instance_mesh(s->shape, s->found.p + index * s->found.n_params, mesh, err);
}

static size_t count_tested(const cli_survey *s) { return s->found.n - s->found.untested; }

/* "in 3 of 145 shapes" */
static void add_share(const cli_survey *s, const sdm_survey_count *c, sdm_text *text)
{
    if (c->shapes == count_tested(s))
        sdm_text_add(text, "in all %zu shapes", c->shapes);
    else
        sdm_text_add(text, "in %zu of %zu shapes", c->shapes, count_tested(s));
}

/* "WHAT in 3 of 145 shapes, up to 12 at a=1 b=2" */
static void add_count(const cli_survey *s, const sdm_survey_count *c, const char *what,
                      sdm_text *text)
{
    sdm_text_add(text, "%s ", what);
    add_share(s, c, text);
    sdm_text_add(text, ", up to %.6g at ", c->amount);
    add_params(s, c->worst, SIZE_MAX, text);
}

static void tell_failed(teller *t)
{
    const sdm_survey_count *c = &t->s->found.failed;
    sdm_mesh mesh = {0};
    sdm_error why = {0};
    sdm_text text = {0};
    if (!c->shapes) return;
    sdm_text_add(&text, "no mesh ");
    add_share(t->s, c, &text);
    // the audit refuses some meshes that a shape can make
    if (make(t->s, c->worst, &mesh, &why)) (void)sdm_mesh_audit(&mesh, &(sdm_audit){0}, &why);
    sdm_mesh_dispose(&mesh);
    sdm_text_add(&text, ": %s", why.text);
    tell(t, SDM_E_MESH, &text);
}

/* Audits the parts of the shape of which the finding is the worst. false: there is no mesh; *out is
 * disposed of by the caller in any case. */
static bool audit_worst(const teller *t, const sdm_survey_count *c, sdm_part_audit *out)
{
    sdm_mesh mesh = {0};
    *out = (sdm_part_audit){0};
    const bool made =
        make(t->s, c->worst, &mesh, NULL) && !sdm_part_audit_make(&mesh, false, out, NULL);
    sdm_mesh_dispose(&mesh);
    return made;
}

/* Meshes that are not the same when they are made again. Other findings may follow from it. */
static void tell_repeat(teller *t)
{
    const sdm_repeat *r = &t->s->found.repeat;
    const size_t n = t->s->found.n_params;
    sdm_text text = {0};
    // tell_failed() names the vertex that is not written
    if (!r->unlike || (r->cause == SDM_REPEAT_UNSET && t->s->found.failed.shapes)) return;
    if (r->cause == SDM_REPEAT_BEHIND)
        sdm_text_add(&text, "mesh() reads p[%zu], but the last parameter is p[%zu], '%s'; ",
                     r->param, n - 1, sdm_instance_params(t->s->shape, NULL)[n - 1].name);
    else
        sdm_text_add(&text, "meshes have other bits when they are made again%s, for example at ",
                     r->cause == SDM_REPEAT_THREADS ? " by several threads at once" : "");
    if (r->cause != SDM_REPEAT_BEHIND) {
        add_params(t->s, r->first, SIZE_MAX, &text);
        sdm_text_add(&text, "; ");
    }
    sdm_text_add(&text, "%s; mend this first: other lines may follow from it",
                 sdm_repeat_advice(r->cause));
    tell(t, SDM_E_QUALITY, &text);
}

static void tell_open(teller *t)
{
    sdm_text text = {0};
    const sdm_survey_count *c = &t->s->found.open;
    sdm_part_audit audit;
    if (!c->shapes) return;
    add_count(t->s, c, "open or badly oriented edges", &text);
    sdm_text_add(&text, ": ");
    if (audit_worst(t, c, &audit)) cli_describe_open(&audit, &text);
    tell(t, SDM_E_MESH, &text);
    sdm_part_audit_dispose(&audit);
}

/* Vertices of no triangle. Other findings may follow from them. */
static void tell_unused(teller *t)
{
    const sdm_survey_count *c = &t->s->found.unused;
    sdm_part_audit audit;
    sdm_text text = {0};
    if (!c->shapes) return;
    if (audit_worst(t, c, &audit)) {
        cli_describe_unused(&audit, &text);
        sdm_text_add(&text, " (");
        add_share(t->s, c, &text);
        sdm_text_add(&text, "); mend this first: other lines may follow from it");
        tell(t, SDM_E_QUALITY, &text);
    }
    sdm_part_audit_dispose(&audit);
}

/* Appends where a part turns over that is right in other shapes: by itself, a length that becomes
 * negative does that. */
static void add_turn(const teller *t, size_t wrong, const sdm_part_audit *audit, sdm_text *text)
{
    const sdm_shape_survey *f = &t->s->found;
    cli_part_turn turn;
    sdm_text_add(text, "in the other shapes the vertices are in the right order: ");
    if (!cli_find_part_turn(t->s->shape, f, wrong, audit, &turn)) {
        sdm_text_add(text, "a length of the part becomes negative here; narrow the ranges, or "
                           "limit the length in mesh()");
        return;
    }
    const bool one = turn.param < f->n_params;
    const char *name = one ? sdm_instance_params(t->s->shape, NULL)[turn.param].name : "";
    if (one) {
        sdm_text_add(text, "here part %zu turns over where '%s' %s about %.3g", turn.part + 1, name,
                     turn.above ? "rises above" : "falls below", turn.value);
    } else {
        sdm_text_add(text, "part %zu turns over on the way here from ", turn.part + 1);
        add_params(t->s, turn.right, SIZE_MAX, text);
    }
    sdm_text_add(text,
                 ": a length of this part becomes negative there; narrow the range%s%s%s, or "
                 "limit the length in mesh()",
                 one ? " of '" : "s", name, one ? "'" : "");
}

static void tell_inside_out(teller *t)
{
    const sdm_survey_count *c = &t->s->found.inside_out;
    sdm_part_audit audit;
    if (!c->shapes) return;
    if (audit_worst(t, c, &audit)) {
        sdm_text text = {0};
        cli_describe_inside_out(&audit, &text);
        // in other shapes it may be another part
        sdm_text_add(&text, " (at ");
        add_params(t->s, c->worst, SIZE_MAX, &text);
        sdm_text_add(&text, "; parts are inside out ");
        add_share(t->s, c, &text);
        sdm_text_add(&text, "); ");
        if (c->shapes == count_tested(t->s))
            sdm_text_add(&text, CLI_MEND_SHAPE);
        else
            add_turn(t, c->worst, &audit, &text);
        tell(t, SDM_E_QUALITY, &text);
    }
    sdm_part_audit_dispose(&audit);
}

static void tell_turned(teller *t)
{
    const sdm_survey_count *c = &t->s->found.turned;
    sdm_text text = {0};
    if (!c->shapes || t->s->found.inside_out.shapes > 0) return; // tell_inside_out() has told them
    add_count(t->s, c, "parts that are inside out and that the exact engine turns", &text);
    sdm_text_add(&text, "; for each of these parts: " CLI_MEND_SHAPE);
    tell(t, SDM_E_QUALITY, &text);
}

static void tell_crossing(teller *t)
{
    const sdm_survey_count *c = &t->s->found.crossing;
    sdm_part_audit audit;
    if (!c->shapes || t->s->found.inside_out.shapes > 0) return;
    if (audit_worst(t, c, &audit)) {
        sdm_text text = {0};
        if (cli_describe_folded(&audit, &text)) {
            sdm_text_add(&text, " (");
            add_share(t->s, c, &text);
            sdm_text_add(&text, ", most at ");
            add_params(t->s, c->worst, SIZE_MAX, &text);
            sdm_text_add(&text, ")");
            tell(t, SDM_E_QUALITY, &text);
        } else {
            sdm_text_dispose(&text);
        }
    }
    sdm_part_audit_dispose(&audit);
}

/* Appends "; does mesh() give 'bend' (60 .. 270 deg) to cos() or sin()? ...", for the parameters in
 * degrees that need a conversion. */
static void add_degrees(const cli_survey *s, sdm_text *text)
{
    size_t n, told = 0;
    const sdm_param *params = sdm_instance_params(s->shape, &n);
    for (size_t i = 0; i < n; i++)
        if (sdm_survey_is_degree(&params[i]))
            sdm_text_add(text, "%s'%s' (%g .. %g %s)", told++ ? ", " : "; does mesh() give ",
                         params[i].name, params[i].min, params[i].max, params[i].unit);
    if (told) sdm_text_add(text, " to cos() or sin()? These want rad (times 0.017453)");
}

/* An angle in degrees that goes to cos() or sin(). Other findings may follow from it. */
static void tell_swings(teller *t)
{
    const sdm_survey_scale *c = &t->s->found.scale;
    const sdm_param *p = &sdm_instance_params(t->s->shape, NULL)[c->angle];
    sdm_text text = {0};
    if (!c->swings) return;
    if (c->poles)
        sdm_text_add(
            &text,
            "the vertices move beyond all bounds %zu times, at %.4g, %.4g and so on, while the "
            "parameter '%s' goes from %g to %g%s%s, as tan() of so many rad does",
            c->swings, c->pole[0], c->pole[1], p->name, p->min, p->max, *p->unit ? " " : "",
            p->unit);
    else
        sdm_text_add(
            &text,
            "the vertices turn back %zu times while the parameter '%s' goes from %g to %g%s%s, as "
            "cos() and sin() of so many rad do",
            c->swings, p->name, p->min, p->max, *p->unit ? " " : "", p->unit);
    sdm_text_add(&text, "; if these are degrees, multiply them by 0.017453 in mesh(); mend this "
                        "first: other lines may follow from it");
    tell(t, SDM_E_QUALITY, &text);
}

/* A part that winds around its inside more than once, such as a ring whose angle is too large. */
static void tell_wound(teller *t)
{
    const sdm_survey_count *c = &t->s->found.wound;
    sdm_mesh mesh = {0};
    sdm_part_audit audit = {0};
    size_t most = 0;
    // in a warning of a training the turns of a spiral are wanted
    if (!c->shapes || (t->s->brief && !sdm_survey_winds_wrongly(&t->s->found))) return;
    if (make(t->s, c->worst, &mesh, NULL) &&
        !sdm_part_audit_make(&mesh, !t->s->brief, &audit, NULL)) {
        sdm_text text = {0};
        double turns = 0;
        for (size_t i = 0; i < audit.n; i++) {
            const double winding = sdm_survey_part_winding(&mesh, &audit, i);
            if (winding > turns) turns = winding, most = i;
        }
        cli_name_part(&audit, most, &text);
        sdm_text_add(&text,
                     "winds around its inside more than once: it encloses %.3g mm^3, %.3g times "
                     "the volume that it fills, and %zu pairs of its triangles meet (at ",
                     fabs(audit.part[most].volume), c->amount, audit.part[most].crossed);
        add_params(t->s, c->worst, SIZE_MAX, &text);
        sdm_text_add(&text, "; parts wind more than once ");
        add_share(t->s, c, &text);
        sdm_text_add(&text, ")");
        if (!t->s->found.scale.swings) add_degrees(t->s, &text);
        // the mistake may lie in mesh(), not in a parameter
        if (!t->s->found.scale.degrees && !t->s->found.scale.swings)
            sdm_text_add(&text, "; does a tube go round more than once, or is an angle in degrees, "
                                "such as 360 * j / n, given to cos() or sin()? These want rad");
        tell(t, sdm_survey_winds_wrongly(&t->s->found) ? SDM_E_QUALITY : SDM_OK, &text);
    }
    sdm_part_audit_dispose(&audit);
    sdm_mesh_dispose(&mesh);
}

/* Inner walls that pass through each other, and where they begin to. */
static void tell_folded(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    const sdm_survey_count *c = &f->folded;
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    sdm_text text = {0};
    if (!c->shapes) return;
    const double *p = f->p + c->worst * f->n_params;
    sdm_text_add(&text, "walls pass through each other ");
    sdm_text_add(&text, "in %zu of the %zu shapes that were followed from the default shape",
                 c->shapes, f->fold_tested);
    sdm_text_add(&text, ": on the way from the default shape to ");
    add_params(t->s, c->worst, SIZE_MAX, &text);
    sdm_text_add(&text, " %.2g %% of the surface turns over, at about", 100 * c->amount);
    for (size_t i = 0; i < f->n_params && i < PARAMS_TOLD; i++)
        sdm_text_add(&text, " %s=%.3g", params[i].name, f->p[i] + f->folded_at * (p[i] - f->p[i]));
    sdm_text_add(&text,
                 "; is a wall thicker than the shape is wide? Narrow the ranges, or limit the "
                 "wall in mesh()");
    tell(t, SDM_E_QUALITY, &text);
}

static void tell_sizes(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    sdm_text text = {0};
    if (f->resized.shapes) {
        sdm_text_add(&text,
                     "the numbers of vertices and triangles change: %zu and %zu at first, others ",
                     f->n_vert, f->n_tri);
        add_share(t->s, &f->resized, &text);
        sdm_text_add(&text, ", for example %.0f vertices at ", f->resized.amount);
        add_params(t->s, f->resized.worst, SIZE_MAX, &text);
        sdm_text_add(
            &text, "; derivatives need the same numbers everywhere: choose them by options, not by "
                   "parameters");
        tell(t, SDM_E_QUALITY, &text);
    } else if (f->rewired.shapes) {
        sdm_text_add(&text, "the triangles get other vertices ");
        add_share(t->s, &f->rewired, &text);
        sdm_text_add(&text, ", for example at ");
        add_params(t->s, f->rewired.worst, SIZE_MAX, &text);
        sdm_text_add(&text, "; derivatives need the same triangles everywhere");
        tell(t, SDM_E_QUALITY, &text);
    }
}

static void tell_jumps(teller *t)
{
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    for (size_t k = 0; k < t->s->found.n_params && t->s->found.jump; k++) {
        const sdm_survey_jump *j = &t->s->found.jump[k];
        sdm_text text = {0};
        if (j->kind == SDM_BREAK_NONE) continue;
        if (j->kind == SDM_BREAK_JUMP)
            sdm_text_add(&text, "vertex %zu jumps by %.3g mm", j->vertex, j->mm);
        else
            sdm_text_add(&text, "the %s",
                         j->kind == SDM_BREAK_SIZES ? "number of vertices or triangles changes"
                                                    : "triangles change");
        sdm_text_add(&text, " at %s=%.6g%s", params[k].name, j->value,
                     t->s->found.n_params > 1 ? ", with " : "");
        add_params(t->s, j->shape, k, &text);
        sdm_text_add(&text, "; a network cannot learn jumps");
        tell(t, SDM_E_QUALITY, &text);
    }
}

/* Appends the keys of a grid that holds the shapes, with voxels that show their thinnest part. */
static void add_proposal(const cli_survey *s, sdm_text *text)
{
    sdm_text use = {0};
    if (!s->config) return;
    sdm_config config = *s->config;
    if (s->found.thin.shapes > 0) {
        const double most = 0.5 * sdm_grid_coarsest(s->grid) / s->found.thin.amount,
                     unit = pow(10, floor(log10(most)) - 1), spacing = floor(most / unit) * unit;
        for (int a = 0; a < 3; a++) config.grid.spacing[a] = fmin(config.grid.spacing[a], spacing);
    }
    if (!sdm_train_grid_proposal(&config, s->shape, &use, NULL))
        sdm_text_add(text, "; use %s", use.data);
    sdm_text_dispose(&use);
}

static void tell_cut(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    sdm_text text = {0};
    bool beyond = false;
    if (!t->s->grid) return;
    for (int a = 0; a < 3; a++) beyond = beyond || f->beyond[a][0] > 0 || f->beyond[a][1] > 0;
    if (!beyond) return;
    const sdm_box grid = sdm_box_of_grid(t->s->grid);
    sdm_text_add(&text,
                 "over the parameters the shape reaches from (%.4g, %.4g, %.4g) to (%.4g, %.4g, "
                 "%.4g) mm; the grid covers (%.4g, %.4g, %.4g) to (%.4g, %.4g, %.4g) mm and cuts ",
                 f->low[0], f->low[1], f->low[2], f->high[0], f->high[1], f->high[2], grid.min[0],
                 grid.min[1], grid.min[2], grid.max[0], grid.max[1], grid.max[2]);
    if (f->cut.shapes)
        sdm_text_add(&text, f->cut.shapes < f->n_samples ? "%.2g %% of the shapes" : "all shapes",
                     fmin(99, 100.0 * (double)f->cut.shapes / (double)f->n_samples));
    else
        sdm_text_add(&text, "only shapes at the corners of the ranges");
    const char *between = " (by up to ";
    for (int a = 0; a < 3; a++)
        for (int side = 0; side < 2; side++) {
            if (!(f->beyond[a][side] > 0)) continue;
            sdm_text_add(&text, "%s%.3g mm at the %s end of %c", between, f->beyond[a][side],
                         side ? "upper" : "lower", "xyz"[a]);
            between = ", ";
        }
    sdm_text_add(&text, ")");
    add_proposal(t->s, &text);
    tell(t, f->cut.shapes ? SDM_E_QUALITY : SDM_OK, &text);
}

/* One line about a grid that is far larger than the shapes. */
static void tell_large_grid(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    sdm_text text = {0};
    // tell_unit() explains shapes that are small because they are in another unit
    if (!(f->surplus > SDM_SURVEY_SURPLUS_MAX) || f->scale.odd_size) return;
    sdm_text_add(&text,
                 "the grid has %.3g times as many voxels as a grid around the shapes with a margin "
                 "of %d voxels: it is %.2g times as long along x, %.2g along y, %.2g along z",
                 f->surplus, SDM_GRID_MARGIN, f->surplus_along[0], f->surplus_along[1],
                 f->surplus_along[2]);
    add_proposal(t->s, &text);
    tell(t, SDM_E_QUALITY, &text);
}

void cli_describe_hits(const sdm_face_hits *h, sdm_text *text)
{
    const char *between = "";
    sdm_text_add(text, "flat faces lie exactly on planes of voxel centres along ");
    for (int a = 0; a < 3; a++) {
        if (!h->axis[a]) continue;
        sdm_text_add(text, "%s%c", between, "xyz"[a]);
        between = " and ";
    }
    sdm_text_add(text,
                 ": distances are right, but these voxels have the distance 0 and count as inside "
                 "or outside by rounding; labels and counts of voxels may be off by %.2g %% of the "
                 "volume",
                 fmin(99, 100 * h->share));
}

/* One line about faces that stay where voxel centres are. */
static void tell_hits(teller *t)
{
    const sdm_face_hits *h = &t->s->found.hits;
    const sdm_grid *g = &h->moved;
    sdm_text text = {0};
    if (!(h->share >= SDM_FACE_HITS_MIN)) return;
    cli_describe_hits(h, &text);
    sdm_text_add(&text, "; with grid.centre: [");
    for (int a = 0; a < 3; a++)
        sdm_text_add(&text, "%s%.10g", a ? ", " : "",
                     g->origin[a] + 0.5 * (double)(g->n[a] - 1) * g->spacing[a]);
    sdm_text_add(&text, "] (and without grid.origin) they lie between the planes");
    tell(t, SDM_OK, &text);
}

/* One line about the thinnest part of the shape in which it is thinnest. */
static void tell_thin(teller *t)
{
    const sdm_survey_count *c = &t->s->found.thin;
    sdm_text text = {0};
    sdm_mesh mesh = {0};
    sdm_part_audit audit = {0};
    // tell_tiny() and tell_unit() explain parts and shapes in another unit
    if (!c->shapes || t->s->found.tiny.shapes >= c->shapes || t->s->found.scale.odd_size ||
        t->s->found.scale.odd_speed)
        return;
    if (make(t->s, c->worst, &mesh, NULL) && !sdm_part_audit_make(&mesh, false, &audit, NULL)) {
        cli_describe_thin(&audit, sdm_part_audit_thinnest(&audit), sdm_grid_coarsest(t->s->grid),
                          &text);
        sdm_text_add(&text, " (the thinnest of all, at ");
        add_params(t->s, c->worst, SIZE_MAX, &text);
        sdm_text_add(&text, "; parts are too thin ");
        add_share(t->s, c, &text);
        sdm_text_add(&text, ")");
        if (t->s->config) {
            const double spacing = 0.5 * sdm_part_audit_thickness(&audit);
            sdm_text_add(&text, "; use grid: {spacing: %.2g}", spacing);
            sdm_train_add_price(t->s->config, t->s->found.n_params, t->s->grid, spacing, &text);
        }
        tell(t, SDM_E_QUALITY, &text);
    }
    sdm_part_audit_dispose(&audit);
    sdm_mesh_dispose(&mesh);
}

/* One line about parts a thousand times shorter than others. */
static void tell_tiny(teller *t)
{
    const sdm_survey_count *c = &t->s->found.tiny;
    sdm_text text = {0};
    sdm_part_audit audit;
    size_t part[2] = {0};
    if (!c->shapes) return;
    if (audit_worst(t, c, &audit) && sdm_survey_part_lengths(&audit, &part[0], &part[1]) > 0) {
        cli_name_part(&audit, part[0], &text);
        sdm_text_add(&text, "is %.0f times smaller than ", c->amount);
        cli_name_part(&audit, part[1], &text);
        sdm_text_add(&text, "at ");
        add_params(t->s, c->worst, SIZE_MAX, &text);
        sdm_text_add(&text, " (");
        add_share(t->s, c, &text);
        sdm_text_add(
            &text,
            "): are the vertices of one of them in another unit than mm? Multiply "
            "those in m by 1000, those in um by 0.001; if it is a leftover speck, remove it");
        tell(t, SDM_E_QUALITY, &text);
    }
    sdm_part_audit_dispose(&audit);
}

/* One line about parts without thickness. */
static void tell_flat(teller *t)
{
    const sdm_survey_count *c = &t->s->found.flat;
    sdm_text text = {0};
    sdm_mesh mesh = {0};
    sdm_part_audit audit = {0};
    size_t i = 0;
    // tell_tiny(), tell_unit() and tell_params() explain lengths in m
    if (!c->shapes || t->s->found.tiny.shapes >= c->shapes || t->s->found.narrow ||
        t->s->found.scale.odd_size)
        return;
    if (make(t->s, c->worst, &mesh, NULL) && !sdm_part_audit_make(&mesh, false, &audit, NULL)) {
        while (i + 1 < audit.n && !sdm_survey_part_is_flat(&audit, i)) i++;
        if (audit.part[i].state == SDM_PART_FLAT || audit.part[i].doubled)
            sdm_text_add(&text, "walls lie on each other at ");
        else
            sdm_text_add(&text,
                         "part %zu of %zu has walls %.2g mm apart, less than a thousandth of the "
                         "shape, at ",
                         i + 1, audit.n, audit.part[i].thick);
        add_params(t->s, c->worst, SIZE_MAX, &text);
        sdm_text_add(&text, " (");
        add_share(t->s, c, &text);
        sdm_text_add(&text, "): no grid shows it; let the range of its thickness begin higher, or "
                            "are its vertices in m?");
        tell(t, SDM_E_QUALITY, &text);
    }
    sdm_part_audit_dispose(&audit);
    sdm_mesh_dispose(&mesh);
}

/* One line if the vertices are hardly in mm. */
static void tell_unit(teller *t)
{
    const sdm_survey_scale *c = &t->s->found.scale;
    sdm_text text = {0};
    // the size and the speed are those of a part in another unit: tell_tiny() has told it
    if ((!c->odd_size && !c->odd_speed) || t->s->found.tiny.shapes) return;
    if (c->odd_size) sdm_text_add(&text, "the shape is %.3g mm in size", c->size);
    if (c->odd_speed)
        sdm_text_add(&text, "%s1 mm of the parameter '%s' moves its vertices by %.2g mm",
                     c->odd_size ? ", " : "", sdm_instance_params(t->s->shape, NULL)[c->param].name,
                     c->speed);
    sdm_text_add(&text, "; the unit of sdmgen is mm");
    // an angle in degrees that tan() or a division makes huge
    if (c->degrees && c->size > SDM_SURVEY_SIZE_MAX)
        add_degrees(t->s, &text);
    else if (c->unit && !c->swings)
        sdm_text_add(&text, ": if the vertices are in %s, multiply them by %g", c->unit,
                     c->unit_mm);
    tell(t, SDM_E_QUALITY, &text);
}

/* Parameters that hardly move a vertex, angles in degrees, and units that sdmgen does not know. */
static void tell_params(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    for (size_t k = 0; k < f->n_params; k++) {
        const char *unit = params[k].unit;
        sdm_text slow = {0}, other = {0};
        // all parameters are slow if the vertices are in another unit: tell_unit() says so; one
        // with a threshold moves vertices there alone: tell_jumps()
        const bool jumps = f->jump && f->jump[k].kind != SDM_BREAK_NONE;
        if (f->speed[k] == 0) {
            sdm_text_add(&slow, "the parameter '%s' moves no vertex: does mesh() use it?",
                         params[k].name);
            tell(t, SDM_E_QUALITY, &slow);
        } else if (f->still && f->still[k]) {
            sdm_text_add(
                &slow,
                "the parameter '%s' moves no part of the surface: it moves vertices inside "
                "of other parts alone",
                params[k].name);
            tell(t, SDM_E_QUALITY, &slow);
        } else if (sdm_survey_is_slow(f, t->s->shape, k) && !f->scale.odd_speed && !jumps) {
            sdm_text_add(&slow,
                         "1 mm of the parameter '%s' moves no vertex by more than %.2g mm: are the "
                         "vertices of a part in another unit than mm?",
                         params[k].name, f->speed[k]);
            tell(t, SDM_E_QUALITY, &slow);
        } else if (sdm_survey_is_narrow(f, t->s->shape, k)) {
            sdm_text_add(&slow,
                         "the parameter '%s' ranges from %g to %g mm, which moves no vertex of a "
                         "shape of %.3g mm by more than %.2g mm",
                         params[k].name, params[k].min, params[k].max, f->scale.size,
                         f->speed[k] * (params[k].max - params[k].min));
            // an angle that is taken for rad makes shapes too large
            if (f->scale.degrees)
                add_degrees(t->s, &slow);
            else if (!f->scale.swings)
                sdm_text_add(&slow, ": are these m (times 1000)?");
            tell(t, SDM_E_QUALITY, &slow);
        }
        // tell_swings() has named it
        if (f->scale.swings && f->scale.angle == k) continue;
        if (sdm_survey_is_odd_angle(&params[k])) {
            sdm_text_add(&other,
                         "the parameter '%s' ranges from %g to %g rad: are these degrees (times "
                         "0.017453)?",
                         params[k].name, params[k].min, params[k].max);
            tell(t, SDM_E_QUALITY, &other);
        }
        if (sdm_survey_is_radian(&params[k])) {
            sdm_text_add(&other,
                         "the parameter '%s' has the unit %s, but ranges from %g to %g: are these "
                         "rad? Then its unit is \"rad\"",
                         params[k].name, unit, params[k].min, params[k].max);
            tell(t, SDM_E_QUALITY, &other);
            continue;
        }
        if (sdm_survey_is_other_length(&params[k])) {
            sdm_text_add(&other,
                         "the parameter '%s' has the unit %s: sdmgen counts in mm; give its range, "
                         "its default and its unit in mm",
                         params[k].name, unit);
            tell(t, SDM_E_QUALITY, &other);
            continue;
        }
        if (t->s->brief || !strcmp(unit, "mm") || !strcmp(unit, "rad") || !strcmp(unit, "sd") ||
            !*unit)
            continue;
        sdm_text_add(&other,
                     "the unit '%s' of the parameter '%s' is none that sdmgen knows: mm, rad, sd "
                     "(standard deviations) or none at all",
                     unit, params[k].name);
        if (sdm_survey_is_degree(&params[k]))
            sdm_text_add(&other,
                         "; mesh() must multiply it by 0.017453 before it calls cos() or sin()");
        tell(t, SDM_OK, &other);
    }
}

static void tell_callbacks(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    if (f->velocity_error > SDM_SURVEY_VELOCITY_LIMIT) {
        sdm_text text = {0};
        sdm_text_add(&text,
                     "velocity() is off by %.3g of the largest velocity by %s, at vertex %zu and ",
                     f->velocity_error, params[f->velocity_param].name, f->velocity_vertex);
        add_params(t->s, f->velocity_shape, SIZE_MAX, &text);
        sdm_text_add(&text, "; compared with differences of meshes");
        tell(t, SDM_E_QUALITY, &text);
    }
}

/* Appends "; 12 of them within part 1 of 2 (...) alone; ..." about the part of shape `c->worst`
 * that meets itself most. */
static void add_crossed(const teller *t, const sdm_survey_count *c, sdm_text *text)
{
    sdm_part_audit audit;
    size_t most = 0;
    if (audit_worst(t, c, &audit) && audit.n) {
        for (size_t i = 1; i < audit.n; i++)
            if (audit.part[i].crossed > audit.part[most].crossed) most = i;
        if (audit.part[most].crossed) {
            // pairs that share a vertex are no overlaps
            sdm_text_add(text, "; %.0f of them within ",
                         fmin((double)audit.part[most].crossed, c->amount));
            cli_name_part(&audit, most, text);
            sdm_text_add(text,
                         "alone: exact --shape %s --certify -o x.nrrd, at these parameters, finds "
                         "what faces the wrong way there",
                         sdm_instance_shape(t->s->shape)->name);
        }
    }
    sdm_part_audit_dispose(&audit);
}

/* Groups of parts that meet no other group, the smallest of one shape, and how far it lies from the
 * others. */
static void tell_apart(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    sdm_mesh mesh = {0};
    sdm_part_audit audit = {0};
    sdm_text text = {0};
    if (!f->apart.shapes) return;
    add_count(t->s, &f->apart, "groups of parts that meet no other part", &text);
    sdm_text_add(&text, ": ");
    if (make(t->s, f->apart.worst, &mesh, NULL) && !sdm_part_audit_make(&mesh, false, &audit, NULL))
        cli_describe_apart(&mesh, &audit, &text);
    tell(t, SDM_OK, &text);
    sdm_part_audit_dispose(&audit);
    sdm_mesh_dispose(&mesh);
}

/* Two parts that meet in some of the shapes: where they begin to, and which parameter decides. */
static void tell_meeting(teller *t)
{
    const sdm_survey_meeting *c = &t->s->found.meeting;
    const sdm_survey_count first = {.worst = c->shape[1]};
    sdm_part_audit audit = {0};
    sdm_text text = {0};
    if (!c->pairs) return;
    if (audit_worst(t, &first, &audit) && c->part[1] < audit.n) {
        for (int i = 0; i < 2; i++) {
            sdm_text_add(&text, "%s", i ? "and " : "");
            cli_name_part(&audit, c->part[i], &text);
        }
        sdm_text_add(&text, "meet in %zu of %zu shapes and lie apart in the others: ", c->meet,
                     c->meet + c->apart);
        const char *name = sdm_instance_params(t->s->shape, NULL)[c->param].name;
        if (10 * c->odd <= c->meet + c->apart) {
            sdm_text_add(&text, "'%s' decides, they meet %s about %s=%.3g", name,
                         c->below ? "up to" : "from", name, c->value);
        } else {
            sdm_text_add(&text, "they meet at ");
            add_params(t->s, c->shape[1], SIZE_MAX, &text);
            sdm_text_add(&text, ", not at ");
            add_params(t->s, c->shape[0], SIZE_MAX, &text);
        }
        if (c->pairs > 1) sdm_text_add(&text, "; so do %zu other pairs of parts", c->pairs - 1);
        sdm_text_add(&text,
                     "; the surface joins or splits there, where a network errs most: if this is "
                     "not meant, narrow the ranges");
        tell(t, SDM_OK, &text);
    }
    sdm_part_audit_dispose(&audit);
}

static void tell_notes(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    const struct {
        const sdm_survey_count *count;
        const char *what, *after;
    } notes[] = {{&f->overlaps, "overlaps (pairs of triangles that meet)", ": the union counts"},
                 {&f->degenerate, "triangles without area", ""},
                 {&f->duplicate, "triangles given twice", ": they count once"}};
    for (size_t i = 0; i < sizeof notes / sizeof *notes; i++) {
        sdm_text text = {0};
        const size_t n = notes[i].count->shapes;
        // where all shapes overlap themselves, it is likely to be wanted
        if (!n || (notes[i].count == &f->overlaps && t->s->brief && n == f->n)) continue;
        add_count(t->s, notes[i].count, notes[i].what, &text);
        sdm_text_add(&text, "%s", notes[i].after);
        const bool twins = notes[i].count == &f->duplicate && sdm_survey_has_twins(f);
        if (twins) sdm_text_add(&text, "; do two parts lie in the same place?");
        if (notes[i].count == &f->overlaps) add_crossed(t, notes[i].count, &text);
        // the first shape with overlaps is not the default shape
        if (notes[i].count == &f->overlaps && f->overlaps_begin)
            sdm_text_add(&text,
                         "; the default shape has none: look at slices there (exact -o x.png)");
        tell(t, twins ? SDM_E_QUALITY : SDM_OK, &text);
    }
}

/* Appends ", 3 of 4 THINGS" if some were left out. */
static void add_untested(size_t untested, size_t n, const char *things, sdm_text *text)
{
    if (untested)
        sdm_text_add(text, "%s%zu of %zu %s", text->data ? ", " : "", untested, n, things);
}

void cli_survey_untested(const cli_survey *s, sdm_text *text)
{
    const sdm_shape_survey *f = &s->found;
    add_untested(f->untested, f->n, "shapes", text);
    add_untested(f->fold_untested, f->fold_tested + f->fold_untested,
                 "ways on which walls may pass through each other", text);
    add_untested(f->lines_untested, f->lines, "lines along a parameter, for jumps", text);
    if (f->box_untested)
        sdm_text_add(text, "%sthe search for the largest shape", text->data ? ", " : "");
    if (s->grid && f->untested) sdm_text_add(text, ", flat faces on planes of voxel centres");
}

/* What was left out for want of time. */
static void tell_untested(teller *t)
{
    sdm_text left = {0}, text = {0};
    cli_survey_untested(t->s, &left);
    if (left.data) {
        sdm_text_add(&text,
                     "not tested for want of time: %s; --samples N tests N random shapes, however "
                     "long it takes",
                     left.data);
        tell(t, SDM_OK, &text);
    }
    t->failed = t->failed || left.failed;
    sdm_text_dispose(&left);
}

sdm_status cli_survey_tell(const cli_survey *s, cli_tell *tell_line, void *user, sdm_error *err)
{
    teller t = {.s = s, .tell = tell_line, .user = user};
    tell_repeat(&t);
    tell_swings(&t);
    tell_failed(&t);
    tell_open(&t);
    tell_unused(&t);
    tell_inside_out(&t);
    tell_crossing(&t);
    tell_turned(&t);
    tell_wound(&t);
    tell_folded(&t);
    tell_tiny(&t);
    tell_flat(&t);
    tell_sizes(&t);
    tell_jumps(&t);
    tell_unit(&t);
    tell_params(&t);
    tell_cut(&t);
    tell_large_grid(&t);
    tell_thin(&t);
    tell_hits(&t);
    tell_callbacks(&t);
    tell_notes(&t);
    tell_apart(&t);
    tell_meeting(&t);
    tell_untested(&t);
    return t.failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory for the findings") : SDM_OK;
}

static void notice(void *user, sdm_status weight, const char *line)
{
    (void)user;
    if (weight)
        cli_warn("%s", line);
    else
        cli_notice("%s", line);
}

void cli_notice_survey(const sdm_config *c, const sdm_instance *shape)
{
    double min[SDM_MAX_PARAMS], max[SDM_MAX_PARAMS], range[SDM_MAX_PARAMS][2];
    sdm_distribution distribution[SDM_MAX_PARAMS];
    size_t n;
    sdm_instance_params(shape, &n);
    if (n > SDM_MAX_PARAMS || sdm_train_ranges(c, shape, min, max, NULL) ||
        sdm_train_distributions(c, shape, min, max, distribution, NULL))
        return;
    for (size_t i = 0; i < n; i++) {
        range[i][0] = min[i];
        range[i][1] = max[i];
    }
    const sdm_survey_opts opts = {.range = (const double(*)[2])range,
                                  .distribution = distribution,
                                  .samples = sdm_survey_samples(shape, NOTICE_SAMPLES),
                                  .seed = c->seed,
                                  .grid = &c->grid,
                                  .brief = true,
                                  .n_threads = (int)c->threads,
                                  .cancelled = cli_interrupted};
    cli_survey s = {.shape = shape, .grid = &c->grid, .config = c, .brief = true};
    if (sdm_shape_survey_make(shape, &opts, &s.found, NULL)) return;
    (void)cli_survey_tell(&s, notice, NULL, NULL);
    sdm_shape_survey_dispose(&s.found);
}
