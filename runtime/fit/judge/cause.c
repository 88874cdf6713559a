/* Texts that explain residuals. */
#include "cause.h"

#include <math.h>
#include <stdio.h>

#include "finding.h"
#include "rival.h"

// a larger empty share of the shape, or a larger volume of labels or points beside it: the fit lies
// beside the shape of the data
#define LOST 0.2
#define LOST_POINTS 0.5
// residuals far beyond their limit have another cause than voxels of the maps, unless these are
// longer than this multiple of theirs
#define MUCH_COARSER 2.0
// from this share on, nearly all contradictions have one sign
#define NEARLY_ALL 0.8
// images: with fewer samples like the inside than this share, they hold none
#define LIKE_INSIDE_MIN 0.01
// values within so many standard deviations of the mean are like the inside
#define LIKE_INSIDE_SD 2.0

static const char *data_name(const fit_problem *p)
{
    return p->target->kind == SDM_FIT_POINTS ? "points" : fit_is_image(p) ? "image" : "labels";
}

// whether the fit lies beside the shape of the data
static bool is_lost(const fit_problem *p, const fit_misfit *m, const fit_suspects *other)
{
    const bool image = fit_is_image(p), points = p->target->kind == SDM_FIT_POINTS;
    return (image && other->no_shape) || m->empty > LOST ||
           (!image && m->missing > (points ? LOST_POINTS : LOST));
}

// image: whether the fit has no tissue of the inside within the shape
static bool is_absent(const fit_problem *p)
{
    const fit_observation *o = &p->observation;
    bool absent = fit_is_image(p) && o->n_in > 0;
    for (size_t i = 0; i < o->n_in; i++) absent = absent && p->absent[i];
    return absent;
}

// whether some voxels near the shape have values like the inside
static bool has_inside_values(const fit_problem *p)
{
    const sdm_fit_law *inside = &p->observation.tissue[0];
    size_t n = 0;
    for (size_t i = 0; i < p->samples.n; i++)
        n += fabs((double)p->samples.value[i] - inside->mean) < LIKE_INSIDE_SD * inside->sd;
    return (double)n > LIKE_INSIDE_MIN * (double)p->samples.n;
}

// text[size] = where the data contradict the shape most, and how; "": no neighbourhood stands out
static void name_place(const fit_problem *p, const fit_worst_place *worst, char *text, size_t size)
{
    char place[FIT_PLACE_NAME];
    *text = '\0';
    if (!(worst->chi_square > 0)) return;
    snprintf(text, size, ", most at %s, where the data show %s than the shape%s",
             sdm_fit_name_place(&p->state, worst->world, place), worst->more ? "more" : "less",
             worst->same > NEARLY_ALL ? ", as in nearly all places that deviate" : "");
}

// writes why the residuals inside the shape may be too large, the most probable cause first
static void name_cause(const fit_problem *p, const fit_misfit *m, const fit_suspects *other,
                       char *cause, size_t size)
{
    const fit_coarseness *coarse = other->coarse;
    const double voxel = fit_longest_edge(&p->maps.grid);
    // voxels that are a little too coarse do not explain residuals far beyond their limit
    const bool far = other->far && voxel < MUCH_COARSER * coarse->limit;
    if (is_absent(p) && !has_inside_values(p))
        snprintf(cause, size,
                 "the image near the shape holds no values like those given for the inside (mean "
                 "%.4g, sd %.3g)",
                 p->observation.tissue[0].mean, p->observation.tissue[0].sd);
    else if (is_absent(p))
        snprintf(cause, size,
                 "within the shape no values are like those given for the inside (mean %.4g, sd "
                 "%.3g), beside it some are: a wrong start, or the values of the inside and the "
                 "outside are exchanged",
                 p->observation.tissue[0].mean, p->observation.tissue[0].sd);
    else if (is_lost(p, m, other))
        snprintf(cause, size,
                 "the fit is not on the shape of the %s: a wrong start, or another shape%s%.200s",
                 data_name(p), other->bounds->n_wanted ? "; " : "",
                 other->bounds->n_wanted ? other->bounds->text : "");
    else if (other->bounds->n_wanted)
        snprintf(cause, size, "%.300s", other->bounds->text);
    else if (voxel > coarse->limit) // else the check of the voxels passes
        snprintf(
            cause, size,
            "%sthe voxels of the maps, %.2g mm, are coarse beside %s: try exact maps with voxels "
            "of %.2g mm (sdm_fit_source.grid)%s",
            far ? "another shape lies there, or " : "", voxel, coarse->detail, coarse->advice,
            far ? "" : ", or another shape lies there");
    else
        snprintf(cause, size,
                 "%s%s, or the object differs from the model (then say by how much it may: "
                 "sdm_fit_opts.tolerance)",
                 other->refused ? "another shape lies there"
                 : fit_is_image(p)
                     ? m->worst[1].more
                           ? "the texture of the image is coarse, the fit stopped beside the best "
                             "place, another shape or a part that this one lacks lies there"
                           : "the texture of the image is coarse, the fit stopped beside the best "
                             "place, the image lacks a part of the shape or shows another one"
                     : "the data have errors of their own, the fit stopped beside the best place, "
                       "another shape lies there",
                 p->opts->kept ? ", a kept parameter has another value" : "");
}

void sdm_fit_residuals_explain(const fit_problem *p, const fit_misfit *m, const fit_suspects *other,
                               char text[FIT_CAUSE_MAX])
{
    char place[FIT_PLACE_MAX] = "", cause[FIT_CAUSE_MAX - FIT_PLACE_MAX - 2];
    if (!is_lost(p, m, other)) name_place(p, &m->worst[1], place, sizeof place);
    name_cause(p, m, other, cause, sizeof cause);
    snprintf(text, FIT_CAUSE_MAX, "%s: %s", place, cause);
}

void sdm_fit_beside_explain(const fit_problem *p, const fit_misfit *m, char text[FIT_CAUSE_MAX])
{
    const fit_worst_place *worst = &m->worst[0];
    char place[FIT_PLACE_MAX];
    name_place(p, worst, place, sizeof place);
    snprintf(text, FIT_CAUSE_MAX, "%s: look there at a picture of the fit; %s", place,
             fit_is_image(p)
                 ? "other things of the inside's material (sdm_fit_opts.cavity), or another shape"
             : worst->more ? "the shape is too thin or too short, or the data show another one"
                           : "the shape is too thick or too long, or the data show another one");
}
