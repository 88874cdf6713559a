/* Are the meshes alike, whole, and the right way out? */
#include "teller.h"

#include <math.h>
#include <string.h>

#include "part_turns.h"
#include "report/report_audit.h"
#include "sdm/internal/config.h"
#include "sdm/internal/same_triangles.h"

static void tell_failed(teller *t)
{
    const sdm_survey_count *c = &t->s->found.failed;
    sdm_mesh mesh = {0};
    sdm_error why = {0};
    sdm_text text = {0};
    if (!c->shapes) return;
    sdm_text_add(&text, "no mesh ");
    teller_add_share(t->s, c, &text);
    // the audit refuses some meshes that a shape can make
    if (teller_make(t->s, c->worst, &mesh, &why))
        (void)sdm_mesh_audit(&mesh, &(sdm_audit){0}, &why);
    sdm_mesh_dispose(&mesh);
    sdm_text_add(&text, ": %s", why.text);
    teller_tell(t, SDM_E_MESH, &text);
}

static void tell_open(teller *t)
{
    sdm_text text = {0};
    const sdm_survey_count *c = &t->s->found.open;
    if (!c->shapes) return;
    const sdm_part_audit *audit = teller_audit(t, c->worst);
    teller_add_count(t->s, c, "open or badly oriented edges", &text);
    sdm_text_add(&text, ": ");
    if (audit) cli_describe_open(audit, &text);
    teller_tell(t, SDM_E_MESH, &text);
}

/* Appends "'a', 'b' and 'c'": the parameters that turn the part over; "the parameters" if no single
 * one does. */
static void add_turners(const sdm_param *params, const cli_part_turn *turn, sdm_text *text)
{
    if (!turn->n) sdm_text_add(text, "the parameters");
    for (size_t i = 0; i < turn->n; i++)
        sdm_text_add(text, "%s'%s'",
                     !i                ? ""
                     : i + 1 < turn->n ? ", "
                                       : " and ",
                     params[turn->by[i].param].name);
}

/* The next number of three digits on the way to the side where the part is right. */
static double round_safe(const cli_turn_param *by)
{
    if (by->safe == 0) return 0;
    const double unit = pow(10, floor(log10(fabs(by->safe))) - 2), n = by->safe / unit;
    return unit * (by->above ? floor(n) : ceil(n));
}

/* Appends which ranges to narrow. */
static void add_narrower(const sdm_param *params, const cli_part_turn *turn, sdm_text *text)
{
    size_t told = 0;
    for (size_t i = 0; i < turn->n; i++) {
        const cli_turn_param *by = &turn->by[i];
        if (!isfinite(by->safe)) continue;
        sdm_text_add(text, "%s of '%s' %s at %.3g", told++ ? ", or that" : "; let the range",
                     params[by->param].name, by->above ? "end" : "begin", round_safe(by));
    }
    if (told > 1) sdm_text_add(text, " (one of them is enough)");
    if (told) return;
    sdm_text_add(text, "; narrow the range%s", turn->n == 1 ? " of " : "s");
    if (turn->n > 1) sdm_text_add(text, " of ");
    if (turn->n) add_turners(params, turn, text);
}

/* Appends why a part turns over, and how to mend it. */
static void add_turn_cause(const sdm_param *params, const cli_part_turn *turn, sdm_text *text)
{
    switch (turn->cause) {
    case CLI_TURN_ORDER:
        sdm_text_add(text,
                     ": mesh() writes its triangles in another order there: look for an if on ");
        add_turners(params, turn, text);
        break;
    case CLI_TURN_VERTICES:
        sdm_text_add(text, ": its vertices jump there: look for an if on ");
        add_turners(params, turn, text);
        break;
    case CLI_TURN_LENGTH:
        sdm_text_add(text, ": a length of this part becomes negative there");
        add_narrower(params, turn, text);
        sdm_text_add(text, ", or limit the length in mesh()");
    }
}

/* Appends where a part turns over that is right in other shapes. */
static void add_turn(const teller *t, size_t wrong, const sdm_part_audit *audit, sdm_text *text)
{
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    cli_part_turn turn;
    sdm_text_add(text, "in the other shapes the vertices are in the right order: ");
    if (!cli_find_part_turn(t->s->shape, &t->s->found, wrong, audit, t->end, &turn)) {
        sdm_text_add(text,
                     "look in mesh() for an if that swaps them, and for a length that becomes "
                     "negative here");
        return;
    }
    if (turn.n)
        sdm_text_add(text, "here part %zu turns over where ", turn.part + 1);
    else
        sdm_text_add(text, "part %zu turns over on the way here from ", turn.part + 1);
    if (!turn.n) teller_add_params(t->s, turn.right, SIZE_MAX, text);
    for (size_t i = 0; i < turn.n; i++) {
        const cli_turn_param *by = &turn.by[i];
        sdm_text_add(text, "%s'%s' ", i ? " and " : "", params[by->param].name);
        if (isfinite(by->back))
            sdm_text_add(text, "is between about %.4g and %.4g", fmin(by->value, by->back),
                         fmax(by->value, by->back));
        else
            sdm_text_add(text, "%s about %.3g", by->above ? "rises above" : "falls below",
                         by->value);
    }
    add_turn_cause(params, &turn, text);
}

static void tell_inside_out(teller *t)
{
    const sdm_survey_count *c = &t->s->found.inside_out;
    if (!c->shapes) return;
    const sdm_part_audit *audit = teller_audit(t, c->worst);
    if (!audit) {
        teller_tell_count(t, SDM_E_QUALITY, c, "parts that are inside out");
        return;
    }
    sdm_text text = {0};
    cli_describe_inside_out(audit, &text);
    // in other shapes it may be another part
    sdm_text_add(&text, " (at ");
    teller_add_params(t->s, c->worst, SIZE_MAX, &text);
    sdm_text_add(&text, "; parts are inside out ");
    teller_add_share(t->s, c, &text);
    sdm_text_add(&text, "); ");
    if (c->shapes == teller_count_tested(t->s))
        sdm_text_add(&text, CLI_MEND_SHAPE);
    else
        add_turn(t, c->worst, audit, &text);
    sdm_text_add(&text, TELLER_MEND_FIRST);
    teller_tell(t, SDM_E_QUALITY, &text);
}

static void tell_turned(teller *t)
{
    const sdm_survey_count *c = &t->s->found.turned;
    sdm_text text = {0};
    if (!c->shapes || t->s->found.inside_out.shapes > 0) return; // tell_inside_out() has told them
    const sdm_part_audit *audit = teller_audit(t, c->worst);
    if (!audit) {
        teller_tell_count(t, SDM_E_QUALITY, c, "parts that are inside out and that maps turn");
        return;
    }
    const bool whole = cli_is_turned(audit);
    cli_describe_turned(audit, &text);
    // in other shapes it may be another part
    sdm_text_add(&text, " (at ");
    teller_add_params(t->s, c->worst, SIZE_MAX, &text);
    sdm_text_add(&text, "; %s inside out ", whole ? "meshes are" : "parts are");
    teller_add_share(t->s, c, &text);
    sdm_text_add(&text, "); %s", whole ? CLI_MEND_WHOLE : CLI_MEND_SHAPE);
    teller_tell(t, SDM_E_QUALITY, &text);
}

/* Has the mesh with these parameters other triangles than `m`? false: it cannot be made. */
static bool is_rewired(const teller *t, const double *p, const sdm_mesh *m)
{
    sdm_mesh mesh = {0};
    const bool other =
        !sdm_instance_mesh(t->s->shape, p, &mesh, NULL) && !sdm_mesh_same_triangles(&mesh, m);
    sdm_mesh_dispose(&mesh);
    return other;
}

/* Appends the parameters of shape `from` that change its triangles by themselves, if they get the
 * values of shape `to`: ": 'a', 'b' change them". Returns how many there are. */
static size_t add_changers(const teller *t, size_t from, size_t to, sdm_text *text)
{
    const sdm_shape_survey *f = &t->s->found;
    const size_t n = f->n_params;
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    double p[SDM_MAX_PARAMS];
    sdm_mesh mesh = {0};
    size_t told = 0;
    if (n > SDM_MAX_PARAMS || !teller_make(t->s, from, &mesh, NULL)) return 0;
    for (size_t k = 0; k < n && told < PARAMS_TOLD; k++) {
        memcpy(p, f->p + from * n, n * sizeof *p);
        p[k] = f->p[to * n + k];
        if (p[k] != f->p[from * n + k] && is_rewired(t, p, &mesh))
            sdm_text_add(text, "%s'%s'", told++ ? ", " : ": ", params[k].name);
    }
    if (told) sdm_text_add(text, " change%s them", told > 1 ? "" : "s");
    sdm_mesh_dispose(&mesh);
    return told;
}

/* Appends the parameters that change the triangles between the first shape and another one. */
static void add_cause(const teller *t, size_t other, sdm_text *text)
{
    if (!add_changers(t, other, 0, text)) (void)add_changers(t, 0, other, text);
}

void tell_sizes(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    sdm_text text = {0};
    if (f->resized.shapes) {
        sdm_text_add(&text,
                     "the numbers of vertices and triangles change: %zu and %zu at first, others ",
                     f->n_vert, f->n_tri);
        teller_add_share(t->s, &f->resized, &text);
        sdm_text_add(&text, ", for example %.0f vertices at ", f->resized.amount);
        teller_add_params(t->s, f->resized.worst, SIZE_MAX, &text);
        add_cause(t, f->resized.worst, &text);
        sdm_text_add(
            &text, "; derivatives need the same numbers everywhere: choose them by options, not by "
                   "parameters");
        teller_tell(t, SDM_E_QUALITY, &text);
    } else if (f->rewired.shapes) {
        sdm_text_add(&text, "the triangles get other vertices ");
        teller_add_share(t->s, &f->rewired, &text);
        sdm_text_add(&text, ", for example at ");
        teller_add_params(t->s, f->rewired.worst, SIZE_MAX, &text);
        add_cause(t, f->rewired.worst, &text);
        sdm_text_add(&text, "; derivatives need the same triangles everywhere");
        teller_tell(t, SDM_E_QUALITY, &text);
    }
}

void tell_parts(teller *t)
{
    tell_failed(t);
    tell_open(t);
    tell_inside_out(t);
    tell_turned(t);
}
