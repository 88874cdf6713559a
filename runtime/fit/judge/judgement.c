/* The checks, each a figure and a limit. The most basic ones come first: their texts are the most
 * helpful ones. */
#include "judgement.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "blob.h"
#include "bounds.h"
#include "cause.h"
#include "coverage.h"
#include "far_labels.h"
#include "finding.h"
#include "fit/points/shared_errors.h"
#include "fit/solver/unknowns_cost.h"
#include "offset.h"
#include "outlying.h"
#include "rival.h"
#include "sdm/internal/fit_finding.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/shared.h"
#include "suffice.h"

// the sd of a tissue may exceed the robust sd by this factor where the shape is right; the sd of
// the texture and the tails of a distribution that is not Gaussian make up the difference
#define WIDER_MAX 1.3
// empty and missing volumes up to this share of that of the shape are below what labels, points and
// the grids of maps resolve
#define VOLUME_MIN 0.05
// the same for images with the older observation model, which is biased where they are blurred
#define VOLUME_MIN_BIASED 0.2
// residuals that contradict less than this share of the volume leave doubt, but refuse no fit
#define SERIOUS_MIN 0.02
// a refusal tells that more than this share of the shape is empty, rather than the residuals there
#define EMPTY_TOLD 0.2
// voxels larger than this share of the radius of the largest ball inside explain residuals
#define COARSE 0.5
// the same where the voxels are so large: only residuals beyond this multiple of their limit
#define THIN_BEYOND 1.2
// labels and points: residuals beyond this multiple of their limit refuse the fit
#define FAR_BEYOND 3.0
// the same where they contradict little of the volume
#define VERY_FAR_BEYOND 6.0
// a standard deviation with two digits is right to this factor
#define PRINTED 1.05
// largest share of points that may belong to another surface
#define STRAY_MAX 0.35
// the same where the data want a parameter beyond its bound: these points may show the rest
#define STRAY_AT_BOUND_MAX 0.02
// part of a voxel by which the border of the maps may be inside the shape
#define BORDER_MAX 0.1
// largest fraction of the shapes of its family that a good network's grid cuts
#define CUT_MAX 0.05
// largest change of a parameter by exact maps, in standard deviations, that is not told
#define NETWORK_ERROR_MAX 1.0

// voxels nearer to the surface than this multiple of the point spread hardly show the background
#define MARGIN_OVER_BLUR 4.0

// the tissue with the largest weight
static const sdm_fit_law *main_law(const sdm_fit_law *law, size_t n)
{
    size_t most = 0;
    for (size_t i = 1; i < n; i++)
        if (law[i].weight > law[most].weight) most = i;
    return &law[most];
}

// Gain in log-likelihood by the shape, as of independent voxels, less the cost of its unknowns. The
// covariance of the score, which noise_factor belongs to, is that of the few voxels at the surface;
// the robust correlations of all others are the steadier measure.
static double evidence_of(const fit_problem *p, const sdm_fit_result *r, double factor)
{
    return (p->information.log_likelihood - r->log_likelihood_without) / factor -
           sdm_fit_unknowns_cost(p, r, (double)p->samples.n / factor);
}

// evidence, contrast, cavities, field of view, convergence
static void check_basics(const fit_problem *p, const sdm_fit_result *r, sdm_fit_verdict *v)
{
    const sdm_fit_opts *o = p->opts;
    const sdm_fit_appearance *a = &r->appearance, *b = &o->appearance;
    const double in = main_law(a->inside, a->n_inside)->mean,
                 out = main_law(a->outside, a->n_outside)->mean;
    const bool darker =
        main_law(b->inside, b->n_inside)->mean < main_law(b->outside, b->n_outside)->mean;
    sdm_fit_judge_add(
        v, SDM_FIT_CHECK_CONVERGED, r->converged, SDM_FIT_FAILED, (double)r->n_iterations, NAN,
        "not converged after %zu iterations (%.120s); allow more of them, or give a nearer start",
        r->n_iterations, r->reason);
    if (fit_is_image(p)) {
        sdm_fit_judge_add(
            v, SDM_FIT_CHECK_NO_SHAPE, r->evidence > SDM_FIT_PREFERRED, SDM_FIT_FAILED, r->evidence,
            SDM_FIT_PREFERRED,
            "the image shows no such shape near the start: explaining it without one is %s by %.3g "
            "(log-likelihood of independent voxels); %scheck the start pose, whether the inside is "
            "%s than the outside in this image, and whether it shows this shape at all",
            r->evidence < 0 ? "better" : "worse only", fabs(r->evidence),
            r->blur * MARGIN_OVER_BLUR > o->margin ? "the blur hides the background within the "
                                                     "margin: give a margin of four times the "
                                                     "point spread (sdm_fit_opts.margin), or "
                                                   : "",
            darker ? "darker" : "brighter");
        sdm_fit_judge_add(
            v, SDM_FIT_CHECK_CONTRAST, (in < out) == darker, SDM_FIT_FAILED, in - out, 0,
            "the contrast is the opposite of the start's: inside %.4g, outside %.4g, but the start "
            "says that the inside is %s; give tissue values of this kind of image",
            in, out, darker ? "darker" : "brighter");
    }
    const double widest = sdm_fit_inradius(&p->maps);
    if (r->n_cavity)
        sdm_fit_judge_add(
            v, SDM_FIT_CHECK_CAVITY, widest < o->cavity, SDM_FIT_FAILED, widest, o->cavity,
            "the fitted shape holds a ball of %.3g mm, but spaces that hold one of %.3g mm were "
            "left out (sdm_fit_opts.cavity): give a radius above that of the shape",
            widest, o->cavity);
    if (p->target->kind != SDM_FIT_POINTS)
        sdm_fit_judge_add(
            v, SDM_FIT_CHECK_IN_IMAGE, r->inside_share >= o->least_inside, SDM_FIT_FAILED,
            r->inside_share, o->least_inside,
            "only %.0f %% of the shape lies in the image, need %.0f %% (sdm_fit_opts.least_inside)",
            100 * r->inside_share, 100 * o->least_inside);
}

static bool has_passed(const sdm_fit_verdict *v, sdm_fit_check_kind kind)
{
    const sdm_fit_finding *x = sdm_fit_finding_of(v, kind);
    return !x || x->grade == SDM_FIT_PASSED;
}

// Parameters at an end of their range. Where the data want more and do not match the shape as it
// is, or are longer by a length that was measured, the fit has not found the shape of the data. In
// an image, residuals beside the shape and a second material outside show together that the shape
// goes on there.
static void check_bounds(const fit_problem *p, const fit_misfit *m, const fit_at_bounds *b,
                         const sdm_fit_result *r, sdm_fit_verdict *v)
{
    const bool noise = m->n_units[1] > 0 && m->chi_square[1] <= m->limit[1],
               matched =
                   r->outliers <= STRAY_AT_BOUND_MAX &&
                   (noise || has_passed(v, SDM_FIT_CHECK_RESIDUALS)) &&
                   has_passed(v, SDM_FIT_CHECK_EMPTY) && has_passed(v, SDM_FIT_CHECK_MISSING) &&
                   has_passed(v, SDM_FIT_CHECK_PATCH) && has_passed(v, SDM_FIT_CHECK_COVERED) &&
                   (has_passed(v, SDM_FIT_CHECK_BESIDE) || has_passed(v, SDM_FIT_CHECK_OUTSIDE)),
               refused = b->n_wanted && (!matched || b->far) && !(p->opts->tolerance > 0);
    const sdm_fit_grade grade = refused ? SDM_FIT_FAILED : SDM_FIT_DOUBTFUL;
    const char *hint = b->n_wanted ? b->text : b->hint;
    if (b->measured)
        sdm_fit_judge_add(v, SDM_FIT_CHECK_BOUNDS, false, grade, (double)b->n, 0,
                          "%s; widen the range in the table of the shape and in shape.ranges, or "
                          "this is another shape",
                          b->text);
    else
        sdm_fit_judge_add(v, SDM_FIT_CHECK_BOUNDS, !b->n, grade, (double)b->n, 0,
                          "%zu of %zu parameters at an end of their range (%s)%s%s%s", b->n,
                          p->n_params, b->names, *hint ? ": " : "", hint,
                          !refused ? ""
                          : b->n > 1
                              ? ", and do not match the shape as it is: the fit is likely to "
                                "have run away from a wrong start; or a wider range, or "
                                "another shape (sdm_fit_opts.tolerance accepts a difference)"
                              : ", and do not match the shape as it is: a wrong start, a "
                                "wider range, or another shape (sdm_fit_opts.tolerance "
                                "accepts a difference)");
}

/* Whether the options state a standard deviation that covers all errors of the points, as printed:
 * shared ones, too. */
static bool is_stated(const fit_problem *p, const fit_shared_errors *e)
{
    return e->n && p->opts->keep_appearance && PRINTED * p->opts->point_sd >= e->all;
}

/* Doubts a fit to points that lie off the surface together with their neighbours, where this makes
 * more than half of the mean square distance. Returns whether it did. */
static bool doubt_shared_errors(const fit_problem *p, const fit_shared_errors *e,
                                sdm_fit_verdict *v)
{
    if (is_stated(p, e) || !e->n || e->ratio <= e->limit) return false;
    sdm_fit_judge_add(v, SDM_FIT_CHECK_RESIDUALS, false, SDM_FIT_DOUBTFUL, e->ratio, e->limit,
                      "neighbouring points scatter by %.2g mm, all points by %.2g mm about the "
                      "surface: the shape differs from the object, or the scanner errs alike over "
                      "neighbouring points; if you know that it errs by so much, keep this "
                      "standard deviation (sdm_fit_opts.point_sd, sdm_fit_opts.keep_appearance)",
                      e->near, e->all);
    return true;
}

// The residuals on both sides of the surface. The older observation model is biased in blurred
// images, and labels and points show a surface with errors of their own: their residuals are not
// noise alone, so that only a multiple of the limit refuses the fit.
static void check_residuals(const fit_problem *p, const fit_misfit *own, const fit_misfit *feet,
                            const fit_shared_errors *shared, fit_coarseness coarse,
                            const fit_at_bounds *bounds, sdm_fit_verdict *v)
{
    const fit_misfit *m = own;
    const double voxel = fit_longest_edge(&p->maps.grid), beyond = m->chi_square[1] / m->limit[1];
    const bool image = fit_is_image(p), points = p->target->kind == SDM_FIT_POINTS,
               serious = m->empty + m->missing > SERIOUS_MIN,
               thin = voxel > COARSE * sdm_fit_inradius(&p->maps),
               refused = image ? p->maps.share && (serious || (thin && beyond > THIN_BEYOND))
                               : beyond > (serious ? FAR_BEYOND : VERY_FAR_BEYOND);
    const sdm_fit_grade inside =
        refused && !(p->opts->tolerance > 0) ? SDM_FIT_FAILED : SDM_FIT_DOUBTFUL;
    if (points && m->few && !refused) {
        sdm_fit_check_sparse_points(p, v);
        return;
    }
    if (points && !refused && sdm_fit_doubt_given_scatter(p, shared, v)) return;
    // errors as large as a neighbourhood are judged by the places to which the points belong
    if (points && !refused && feet->chi_square[1] / feet->limit[1] < beyond) m = feet;
    if (points && m->chi_square[1] <= m->limit[1] && doubt_shared_errors(p, shared, v)) return;
    if (points && m->chi_square[1] <= m->limit[1] && !is_stated(p, shared) &&
        feet->scatter_chi_square > feet->limit[1]) {
        sdm_fit_judge_add(v, SDM_FIT_CHECK_RESIDUALS, false, SDM_FIT_DOUBTFUL,
                          feet->scatter_chi_square, feet->limit[1],
                          "neighbourhoods of points lie %.2g times as far off the surface as the "
                          "scatter of the points explains: another shape lies there, or "
                          "neighbouring points share their errors, as those of a segmentation do",
                          sqrt(feet->scatter_chi_square));
        return;
    }
    char why[FIT_CAUSE_MAX];
    sdm_fit_residuals_explain(p, m,
                              &(fit_suspects){.refused = refused,
                                              .far = beyond > FAR_BEYOND,
                                              .no_shape = !has_passed(v, SDM_FIT_CHECK_NO_SHAPE),
                                              .coarse = &coarse,
                                              .bounds = bounds},
                              why);
    const bool passed = m->chi_square[1] <= m->limit[1],
               white = points && passed && feet->scatter_chi_square <= feet->limit[1];
    sdm_fit_judge_add(
        v, SDM_FIT_CHECK_RESIDUALS, passed, inside,
        white ? feet->scatter_chi_square : m->chi_square[1], white ? feet->limit[1] : m->limit[1],
        "the residuals inside the shape are not noise, they deviate by %.2g times what noise "
        "explains%s",
        sqrt(m->chi_square[1]), why);
    if (points) return;
    sdm_fit_beside_explain(p, m, why);
    sdm_fit_judge_add(
        v, SDM_FIT_CHECK_BESIDE, m->chi_square[0] <= m->limit[0], SDM_FIT_DOUBTFUL,
        m->chi_square[0], m->limit[0],
        "the residuals beside the shape are not noise: neighbourhoods deviate by %.2g times what "
        "noise explains%s",
        sqrt(m->chi_square[0]), why);
}

// the volumes that the data contradict
static void check_volumes(const fit_problem *p, const fit_misfit *m, const sdm_fit_result *r,
                          sdm_fit_verdict *v)
{
    const bool points = p->target->kind == SDM_FIT_POINTS;
    const char *what = fit_is_image(p) ? "image" : "labels";
    const bool biased = fit_is_image(p) && !p->maps.share;
    const double most = fmax(p->opts->tolerance, biased ? VOLUME_MIN_BIASED : VOLUME_MIN),
                 beside = fit_is_image(p) ? fmax(p->opts->beside, most) : most;
    if (points)
        sdm_fit_judge_add(v, SDM_FIT_CHECK_EMPTY, m->empty <= most, SDM_FIT_FAILED, m->empty, most,
                          "points lie inside the shape: the space between them and its surface is "
                          "%.3g %% of its volume, allowed %.0f %% (sdm_fit_opts.tolerance)",
                          100 * m->empty, 100 * most);
    else
        sdm_fit_judge_add(v, SDM_FIT_CHECK_EMPTY, m->empty <= most, SDM_FIT_FAILED, m->empty, most,
                          "%.3g %% of the volume of the shape is empty in the %s, allowed %.0f %% "
                          "(sdm_fit_opts.tolerance)",
                          100 * m->empty, what, 100 * most);
    const double stray = fmax(p->opts->tolerance, STRAY_MAX);
    if (points && r->outliers > stray)
        sdm_fit_judge_add(v, SDM_FIT_CHECK_MISSING, false, SDM_FIT_FAILED, r->outliers, stray,
                          "%.3g %% of the points lie on no surface of the shape, allowed %.0f %% "
                          "(sdm_fit_opts.tolerance)",
                          100 * r->outliers, 100 * stray);
    else if (points)
        sdm_fit_judge_add(v, SDM_FIT_CHECK_MISSING, m->missing <= beside, SDM_FIT_FAILED,
                          m->missing, beside,
                          "points lie outside of the shape: the space between them and its surface "
                          "is as large as %.3g %% of its volume, allowed %.0f %% "
                          "(sdm_fit_opts.tolerance)",
                          100 * m->missing, 100 * beside);
    else
        sdm_fit_judge_add(
            v, SDM_FIT_CHECK_MISSING, m->missing <= beside, SDM_FIT_FAILED, m->missing, beside,
            "beside the shape the %s hold%s as much of its material as %.3g %% of its volume, "
            "allowed %.0f %% (%s)",
            what, fit_is_image(p) ? "s" : "", 100 * m->missing, 100 * beside,
            fit_is_image(p) ? "sdm_fit_opts.beside" : "sdm_fit_opts.tolerance");
}

// Doubts a fit to labels whose checks "empty" and "missing" pass, although some voxels far from the
// surface contradict the shape.
static void check_far_labels(const fit_problem *p, const fit_misfit *m, sdm_fit_verdict *v)
{
    if (p->opts->tolerance > 0) return;
    const fit_far_labels far = sdm_fit_far_labels(p, m->beyond);
    for (int inside = 0; inside < 2; inside++) {
        const sdm_fit_check_kind kind = inside ? SDM_FIT_CHECK_EMPTY : SDM_FIT_CHECK_MISSING;
        char depth[60] = "";
        if (!has_passed(v, kind) || !(far.voxels[inside] > 0)) continue;
        if (far.depth[inside] > 0)
            snprintf(depth, sizeof depth, ", up to %.2g mm from its surface", far.depth[inside]);
        sdm_fit_judge_add(v, kind, false, SDM_FIT_DOUBTFUL, far.share[inside], far.limit,
                          "%.0f voxels far from the surface, those near it not counted, %s%s: the "
                          "data may %s (sdm_fit_opts.tolerance accepts a difference)",
                          far.voxels[inside],
                          inside ? "lie inside the shape and do not have the label"
                                 : "have the label and lie outside of the shape",
                          depth,
                          inside ? "lack a part of the shape" : "have a part that the shape lacks");
    }
}

// of the tissues outside that were given, the one whose mean is nearest to `mean`, in its
// deviations
static const sdm_fit_law *nearest_law(const sdm_fit_appearance *a, double mean)
{
    const sdm_fit_law *near = &a->outside[0];
    for (size_t i = 1; i < a->n_outside; i++) {
        const sdm_fit_law *l = &a->outside[i];
        if (fabs(mean - l->mean) / l->sd < fabs(mean - near->mean) / near->sd) near = l;
    }
    return near;
}

// the tissues against the robust statistics, and against the values at the start
static void check_tissues(const fit_problem *p, const fit_residuals *s, const sdm_fit_result *r,
                          sdm_fit_verdict *v)
{
    const sdm_fit_appearance *a = &r->appearance;
    const sdm_fit_law *law[2] = {main_law(a->outside, a->n_outside),
                                 main_law(a->inside, a->n_inside)},
                      *given = main_law(p->opts->appearance.inside, p->opts->appearance.n_inside);
    // beside the shape of the data, the tissues are those of other places
    const char *lost = v->grade == SDM_FIT_FAILED
                           ? "the fit is not on the shape of the data, as from a wrong start, or "
                           : "";
    for (int side = 1; side >= 0; side--) {
        const double wider = law[side]->sd / s->spread[side];
        if (!isfinite(wider) || (side ? a->n_inside : a->n_outside) > 2) continue;
        sdm_fit_judge_add(
            v, side ? SDM_FIT_CHECK_INSIDE : SDM_FIT_CHECK_OUTSIDE, wider <= WIDER_MAX,
            SDM_FIT_DOUBTFUL, wider, WIDER_MAX,
            "the values %s spread by %.3g, but most of them by %.3g only: %sa second material "
            "lies there, or the maps are too coarse for the walls",
            side ? "inside" : "outside", law[side]->sd, s->spread[side], lost);
    }
    const sdm_fit_law *near[2] = {nearest_law(&p->opts->appearance, law[0]->mean), given};
    double off[2];
    for (int side = 0; side < 2; side++)
        off[side] = fabs(law[side]->mean - near[side]->mean) / near[side]->sd;
    const int side = off[1] >= off[0];
    sdm_fit_judge_add(
        v, SDM_FIT_CHECK_GIVEN, off[side] <= FIT_GIVEN_MAX, SDM_FIT_DOUBTFUL, off[side],
        FIT_GIVEN_MAX,
        "the %s has the mean %.4g, the start %.4g: %sother values than those of this kind of image "
        "were given",
        side ? "inside" : "outside", law[side]->mean, near[side]->mean, lost);
}

// how deep inside the shape the border of its map is, mm; 0: the border is outside
static double border_depth(const fit_maps *m)
{
    const int64_t *n = m->grid.n;
    double least = 0;
    for (int64_t k = 0; k < n[2]; k++)
        for (int64_t j = 0; j < n[1]; j++) {
            const bool all = !k || k == n[2] - 1 || !j || j == n[1] - 1;
            const double *row = m->distance + (k * n[1] + j) * n[0];
            for (int64_t i = 0; i < n[0]; i += all ? 1 : n[0] > 1 ? n[0] - 1 : 1)
                least = fmin(least, row[i]);
        }
    return -least;
}

// whether the maps show the whole shape, and whether their network is any good
static void check_maps(const fit_problem *p, sdm_fit_verdict *v)
{
    const double depth = border_depth(&p->maps),
                 most = BORDER_MAX * fit_longest_edge(&p->maps.grid);
    sdm_fit_judge_add(
        v, SDM_FIT_CHECK_GRID, depth <= most, SDM_FIT_FAILED, depth, most,
        "the grid of the %s cuts the fitted shape, its surface ends open there: a grid that "
        "reaches at least %.2g mm farther is needed%s",
        p->source->model ? "model" : "maps", depth,
        p->source->model ? " (train with grid: auto)" : "");
    if (!p->source->model || p->maps.exact) return;
    const sdm_model_quality *q = &sdm_model_get_info(p->source->model)->quality;
    if (!*q->grade) return;
    // the share of cut shapes is no figure of a network that is poor for other reasons
    const bool poor = !strcmp(q->grade, "poor"), cut = q->cut > CUT_MAX, no_figure = poor && !cut;
    char cuts[80] = "";
    if (cut)
        snprintf(cuts, sizeof cuts, ", and its grid cuts %.0f %% of the shapes of its family",
                 100 * q->cut);
    sdm_fit_judge_add(v, SDM_FIT_CHECK_NETWORK, !poor && !cut, SDM_FIT_DOUBTFUL,
                      no_figure ? NAN : q->cut, no_figure ? NAN : CUT_MAX,
                      "the training graded this network %s%s: train it again (docs/symptoms.md)",
                      q->grade, cuts);
}

// Whether the error of the network moves a parameter by more than the data determine it. A polish
// is no remedy where its maps, on the grid of the network, may turn out too coarse.
static void check_network_error(const fit_problem *p, fit_coarseness coarse, sdm_fit_result *r)
{
    sdm_fit_verdict *v = &r->verdict;
    if (isnan(r->network_error_sd)) return;
    const size_t k = r->network_error_param;
    const sdm_model_param *param = &sdm_model_get_info(p->source->model)->params[k];
    const bool passed = r->network_error_sd <= NETWORK_ERROR_MAX, known = passed || !r->at_bound[k];
    char by[120] = ", which is at the end of its range";
    if (known)
        snprintf(by, sizeof by,
                 " by about %.2g%s%s, %.2g times the standard deviation by the data alone",
                 r->network_error, *param->unit ? " " : "", param->unit, r->network_error_sd);
    char remedy[120] = "a polish with exact maps (sdm_fit_opts.max_polish_iterations) ends it";
    // a polish of points has exact distances, no maps
    if (p->target->kind != SDM_FIT_POINTS && !*coarse.cause &&
        fit_longest_edge(&p->maps.grid) > SDM_GRID_FIT_ADVISED * coarse.limit) {
        if (!passed) r->advised_voxel_mm = coarse.advice;
        snprintf(remedy, sizeof remedy,
                 "exact maps with voxels of %.2g mm (sdm_fit_source.grid) end it", coarse.advice);
    }
    sdm_fit_judge_add(v, SDM_FIT_CHECK_NETWORK_ERROR, passed, SDM_FIT_DOUBTFUL,
                      known ? r->network_error_sd : NAN, known ? NETWORK_ERROR_MAX : NAN,
                      "exact maps would move '%s'%s: the error of the network limits this fit; "
                      "the printed standard deviations contain an estimate of it; %s",
                      param->name, by, remedy);
}

// The finding that explains a refusal: the first one that failed. Points that show too little come
// before it; where a large part of the shape is not in the data, that it is not, instead of the
// residuals that this makes; where the image shows a shape, a grid that cuts it; and a parameter
// that the data want beyond its range by a length that was measured. That the iterations did not
// converge explains nothing where another check failed: they do not converge on another shape.
// NULL: none failed.
static const sdm_fit_finding *reason(const sdm_fit_verdict *v, const fit_at_bounds *bounds)
{
    const sdm_fit_finding *why = NULL;
    for (size_t i = 0; i < v->n_findings; i++) {
        const sdm_fit_finding *x = &v->findings[i];
        if (x->grade != SDM_FIT_FAILED) continue;
        const bool cut = x->kind == SDM_FIT_CHECK_GRID && why && why->kind > SDM_FIT_CHECK_CONTRAST,
                   little = x->kind == SDM_FIT_CHECK_DATA || x->kind == SDM_FIT_CHECK_SIZE,
                   beyond = x->kind == SDM_FIT_CHECK_BOUNDS && bounds->measured,
                   empty = x->kind == SDM_FIT_CHECK_EMPTY && x->figure > EMPTY_TOLD && why &&
                           why->kind == SDM_FIT_CHECK_RESIDUALS;
        if (!why || why->kind == SDM_FIT_CHECK_CONVERGED || cut || little || beyond || empty)
            why = x;
    }
    return why;
}

sdm_status sdm_fit_judge(const fit_problem *p, sdm_fit_result *r, double *factor, sdm_error *err)
{
    sdm_fit_verdict *v = &r->verdict;
    fit_residuals residuals;
    fit_misfit misfit, feet = {0};
    fit_shared_errors shared = {0};
    sdm_status s = sdm_fit_residuals_create(p, &residuals, err);
    const double robust = s ? 0 : sdm_fit_residual_correlation(&residuals);
    *factor = robust > 0 ? robust : fmax(r->noise_factor, 1);
    if (fit_is_image(p)) r->evidence = evidence_of(p, r, *factor);
    fit_coarseness coarse = sdm_fit_coarseness(p, fit_is_image(p) ? r->blur : 0);
    if (!r->converged) coarse.blind = false; // the shape may be small on its way
    fit_at_bounds bounds = sdm_fit_at_bounds(p, r, *factor);
    const bool points = p->target->kind == SDM_FIT_POINTS, labels = fit_is_labels(p);
    if (!s && labels) s = sdm_fit_measure_beyond(p, r, &bounds, err);
    check_basics(p, r, v);
    check_maps(p, v);
    check_network_error(p, coarse, r);
    if (!s) s = sdm_fit_misfit(p, &residuals, &misfit, err);
    if (!s && points) sdm_fit_residuals_use_feet(p, &residuals);
    if (!s && points) s = sdm_fit_misfit(p, &residuals, &feet, err);
    if (!s && points) s = sdm_fit_shared_errors(p, residuals.used, &shared, err);
    if (!s) {
        check_residuals(p, &misfit, &feet, &shared, coarse, &bounds, v);
        check_volumes(p, &misfit, r, v);
        if (labels) check_far_labels(p, &misfit, v);
        v->n_units = misfit.n_units[0] + misfit.n_units[1];
        v->chi_square = misfit.noise_chi_square;
    }
    if (!s && points) s = sdm_fit_check_points(p, &residuals, r->noise_factor, v, err);
    if (!s && points) s = sdm_fit_check_coverage(p, r, coarse, v, err);
    if (!s && points && has_passed(v, SDM_FIT_CHECK_PATCH)) s = sdm_fit_check_outlying(p, v, err);
    // strays that form a surface belong to the data: they show how long these are
    if (!s && points && !has_passed(v, SDM_FIT_CHECK_PATCH))
        s = sdm_fit_measure_beyond(p, r, &bounds, err);
    if (!s && fit_is_image(p)) check_tissues(p, &residuals, r, v);
    if (!s && (points || p->given_labels) && !p->is_rival && v->grade != SDM_FIT_FAILED)
        s = sdm_fit_check_offset(p, v, err);
    if (!s) check_bounds(p, &misfit, &bounds, r, v);
    if (!s) sdm_fit_check_voxels(p, coarse, r);
    if (!s && labels) sdm_fit_check_labels(p, coarse.thinnest, v);
    if (!s) sdm_fit_check_determined(p, r, v);
    sdm_fit_residuals_dispose(&residuals);
    if (!s) s = sdm_fit_check_blob(p, *factor, v, err);
    const sdm_fit_finding *why = s ? NULL : reason(v, &bounds);
    if (s || !why) return s;
    // the shape of the data may lie beyond the range of a parameter
    const bool other = why->kind == SDM_FIT_CHECK_RESIDUALS || why->kind == SDM_FIT_CHECK_EMPTY ||
                       why->kind == SDM_FIT_CHECK_MISSING;
    const char *hint = bounds.n_wanted ? bounds.text : other ? bounds.hint : "";
    const bool more = *hint && !strstr(why->text, hint);
    return sdm_fail(err, SDM_E_QUALITY, "%s%s%s", why->text, more ? "; " : "", more ? hint : "");
}

double sdm_fit_compare(const sdm_fit_result *fit, const sdm_fit_result *rival)
{
    const bool one = fit->verdict.n_units > 0, other = rival->verdict.n_units > 0;
    if (!one || !other) return one ? INFINITY : other ? -INFINITY : NAN;
    const double overdispersion = fmax(fmin(fit->verdict.chi_square, rival->verdict.chi_square), 1);
    if (!isnan(fit->evidence) && !isnan(rival->evidence))
        return (fit->evidence - rival->evidence) / overdispersion;
    const double n = 0.5 * (double)(fit->verdict.n_units + rival->verdict.n_units);
    return sdm_fit_units_gain(n, fit->verdict.chi_square, rival->verdict.chi_square);
}
