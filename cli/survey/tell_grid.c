/* Does the grid suit the shapes? */
#include "teller.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "report/report_audit.h"
#include "sdm/internal/box.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/train.h"

/* Appends the keys of a grid that holds the shapes, with voxels that show their thinnest part. */
static void add_proposal(const cli_survey *s, sdm_text *text)
{
    sdm_text use = {0};
    if (!s->config) return;
    sdm_config config = *s->config;
    if (s->found.thin.shapes > 0 && !s->found.inside_out.shapes) {
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
    teller_tell(t, f->cut.shapes ? SDM_E_QUALITY : SDM_OK, &text);
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
    teller_tell(t, SDM_E_QUALITY, &text);
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
    teller_tell(t, SDM_OK, &text);
}

/* Is the thinnest part told? tell_tiny() and tell_unit() explain parts and shapes in another unit,
 * tell_inside_out() parts that take away from others. */
static bool is_thin(const cli_survey *s)
{
    const sdm_shape_survey *f = &s->found;
    return f->thin.shapes && !f->inside_out.shapes && f->tiny.shapes < f->thin.shapes &&
           !f->scale.odd_size && !f->scale.odd_speed;
}

double cli_survey_thin_spacing(const cli_survey *s)
{
    char text[32];
    if (!is_thin(s) || sdm_survey_mend_first(&s->found)) return NAN;
    snprintf(text, sizeof text, "%.2g", 0.5 * sdm_grid_coarsest(s->grid) / s->found.thin.amount);
    return strtod(text, NULL);
}

/* One line about the thinnest part of the shape in which it is thinnest. */
static void tell_thin(teller *t)
{
    const sdm_survey_count *c = &t->s->found.thin;
    sdm_text text = {0};
    if (!is_thin(t->s)) return;
    const sdm_part_audit *audit = teller_audit(t, c->worst);
    if (!audit) {
        teller_tell_count(t, SDM_E_QUALITY, c, "parts too thin for the grid");
        return;
    }
    cli_describe_thin(audit, sdm_part_audit_thinnest(audit), sdm_grid_coarsest(t->s->grid), &text);
    sdm_text_add(&text, " (the thinnest of all, at ");
    teller_add_params(t->s, c->worst, SIZE_MAX, &text);
    sdm_text_add(&text, "; parts are too thin ");
    teller_add_share(t->s, c, &text);
    sdm_text_add(&text, ")");
    const bool fitted = t->s->config && t->s->config->grid_fitted;
    if (fitted)
        sdm_text_add(&text, "; grid: auto makes up to 1,000,000 voxels to show a part, as far as "
                            "data.memory_gb holds their maps");
    if (t->s->config) {
        const double spacing = 0.5 * sdm_part_audit_thickness(audit);
        sdm_text_add(&text, "; use grid: {spacing: %.2g}", spacing);
        sdm_train_add_price(t->s->config, t->s->found.n_params, t->s->grid, spacing, &text);
    }
    // a check of a grid that cannot be finer passes; a training warns
    teller_tell(t, fitted && !t->s->brief ? SDM_OK : SDM_E_QUALITY, &text);
}

void tell_grid(teller *t)
{
    tell_cut(t);
    tell_large_grid(t);
    tell_thin(t);
    tell_hits(t);
}
