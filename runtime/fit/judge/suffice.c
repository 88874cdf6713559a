/* Number and extent of the points of a fit; size of the voxels of its maps. */
#include "suffice.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "finding.h"
#include "fit/data/shape_details.h"
#include "fit/trust/posterior.h"
#include "noise.h"
#include "sdm/internal/fit_finding.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

// smallest median distance of the points from their middle, over the reach of the shape
#define SPREAD_MIN 0.1

// longest edge of a voxel that shows the thinnest part at all, over its thickness: sdm_too_thin()
#define VOXEL_DIAGONAL 1.4142
// from this edge on, over the radius of the largest ball inside, voxels miss the shape
#define VOXEL_OVER_RADIUS_FAR 2
// the point spread of an image has at least this standard deviation, in voxels of the image: a fit
// may find a narrower one
#define BLUR_OVER_IMAGE_VOXEL 0.5
// parts that are thicker than this many voxels of the limit do not ask for it
#define FINER_THAN_THIN 16
// a point spread so little beyond the smallest one of the maps counts as that
#define LIMIT_ERROR 0.05

// scatter of points about the surface, over the radius of the largest ball inside, from which on
// residuals that agree with their neighbours show another shape
#define SCATTER_OVER_RADIUS 0.05

// points for each unknown that also test the fit: with fewer, most shapes pass close by all points
#define POINTS_PER_UNKNOWN 3

// points whose standard deviation is known: excess of the mean square of their distances that
// chance explains, in standard deviations of it; once in a thousand fits
#define BY_CHANCE 3.1

// largest number of rigid motions that leave a surface in place: the rotations of a ball
#define SYMMETRIES_MAX 3

/* Number of unknowns that the data alone determine: parameters without a distribution of their own,
 * and the pose. Motions that the data leave open count as symmetries of the shape. */
static size_t free_unknowns(const fit_problem *p)
{
    const sdm_fit_opts *o = p->opts;
    size_t n = 0, pose = 0;
    for (size_t k = 0; k < p->n_params; k++)
        n += !fit_param_is_kept(p, k) &&
             (p->distribution[k].kind != SDM_DISTRIBUTION_NORMAL || !(o->prior_sd > 0));
    if (!o->keep_pose && !(o->prior_rotation_sd > 0)) pose += 3;
    if (!o->keep_pose && !(o->prior_translation_sd > 0)) pose += 3;
    size_t open = p->n_motions < SYMMETRIES_MAX ? p->n_motions : SYMMETRIES_MAX;
    if (open > pose) open = pose;
    return n + pose - open;
}

/* *wide = median distance (mm) of the points from their coordinate-wise median: outliers hardly
 * change it. */
static sdm_status spread(const fit_problem *p, double *wide, sdm_error *err)
{
    const double *x = p->target->points;
    const size_t n = p->target->n_points;
    double middle[3], *list = NULL;
    const sdm_status s = SDM_ALLOC(&list, n, "points of the fit", err);
    if (s) return s;
    for (size_t a = 0; a < 3; a++) {
        for (size_t i = 0; i < n; i++) list[i] = x[3 * i + a];
        middle[a] = sdm_fit_median(list, n);
    }
    for (size_t i = 0; i < n; i++) list[i] = sqrt(v3_dist2(x + 3 * i, middle));
    *wide = sdm_fit_median(list, n);
    sdm_free(list);
    return SDM_OK;
}

sdm_status sdm_fit_check_points(const fit_problem *p, const fit_residuals *s, double noise_factor,
                                sdm_fit_verdict *v, sdm_error *err)
{
    const size_t unknowns = free_unknowns(p);
    size_t n = 0;
    for (size_t i = 0; i < s->n; i++) n += s->used[i];
    fit_extent e = {.reach = 0};
    double wide;
    (void)sdm_fit_extent(&p->maps, &e, NULL);
    const sdm_status status = spread(p, &wide, err);
    if (status) return status;
    // points whose residuals agree with those of their neighbours tell little more than one of them
    const double independent = (double)n / fmax(noise_factor, 1);
    // residuals of a surface that fits are small and agree, too: they are errors of triangles and
    // maps
    const bool scattered = p->state.point_sd > SCATTER_OVER_RADIUS * sdm_fit_inradius(&p->maps);
    if (n >= unknowns && scattered && independent < (double)unknowns)
        sdm_fit_judge_add(v, SDM_FIT_CHECK_DATA, false, SDM_FIT_DOUBTFUL, independent,
                          (double)unknowns,
                          "%zu points count as few as %.2g independent ones, less than the %zu "
                          "unknowns, because whole neighbourhoods lie on one side of the surface: "
                          "the points show another shape than this, and the standard deviations "
                          "cannot be trusted",
                          n, independent, unknowns);
    else if (n < unknowns)
        sdm_fit_judge_add(v, SDM_FIT_CHECK_DATA, false, SDM_FIT_FAILED, (double)n, (double)unknowns,
                          "%zu points on the surface cannot determine %zu unknowns: give at least "
                          "as many, or keep the parameters or the pose",
                          n, unknowns);
    else
        sdm_fit_judge_add(v, SDM_FIT_CHECK_DATA, n >= POINTS_PER_UNKNOWN * unknowns,
                          SDM_FIT_DOUBTFUL, (double)n, (double)(POINTS_PER_UNKNOWN * unknowns),
                          "%zu points on the surface hardly determine %zu unknowns: other shapes "
                          "pass as close by them; give at least %zu points, or keep the parameters "
                          "or the pose",
                          n, unknowns, POINTS_PER_UNKNOWN * unknowns);
    sdm_fit_judge_add(v, SDM_FIT_CHECK_SIZE, wide >= SPREAD_MIN * e.reach, SDM_FIT_FAILED, wide,
                      SPREAD_MIN * e.reach,
                      "the points lie within %.2g mm of their middle, but the fitted shape reaches "
                      "%.3g mm from its own: they show too little of it, or their unit is not mm",
                      wide, e.reach);
    return SDM_OK;
}

/* The distances of the points from the surface beside their standard deviation as given. */
typedef struct given_scatter {
    double rms;   /* root mean square of the distances, mm */
    double over;  /* mean square of the distances over the given variance */
    double limit; /* of `over`: a right fit exceeds it once in a thousand times */
} given_scatter;

/* together: so many points share their error. */
static given_scatter scatter_of(const fit_problem *p, double together)
{
    const double network = sdm_fit_network_error(p);
    // the sum of the squares of n - unknowns normal errors
    double sum = 0;
    for (size_t i = 0; i < p->samples.n; i++) sum += p->samples.field[i] * p->samples.field[i];
    const double free = fmax((double)p->samples.n - (double)free_unknowns(p), 1);
    return (given_scatter){.rms = sqrt(sum / free),
                           .over = sum / free /
                                   (p->state.point_sd * p->state.point_sd + network * network),
                           .limit = 1 + BY_CHANCE * sqrt(2 * together / free)};
}

sdm_status sdm_fit_points_sd(const fit_problem *p, double *sd, sdm_error *err)
{
    double *list = NULL;
    const sdm_status s = SDM_ALLOC(&list, p->samples.n, "distances of the points", err);
    if (s) return s;
    memcpy(list, p->samples.field, p->samples.n * sizeof *list);
    *sd = sdm_fit_robust_sd(list, p->samples.n, 0);
    sdm_free(list);
    return SDM_OK;
}

// the standard deviation of the points over the given one, and over the root of the limit, from
// which on the two contradict each other
#define SCATTER_FAILED 2.0
// share of the points that tell it, the nearest ones; mean square of so many normal errors over
// their variance
#define NEAREST_SHARE 0.9
#define NEAREST_SQUARE 0.6230

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* *sd = standard deviation of normal errors with the mean square of the NEAREST_SHARE nearest
 * points: outliers hardly change it, another shape in a part of the points does. */
static sdm_status trimmed_sd(const fit_problem *p, double *sd, sdm_error *err)
{
    const size_t n = (size_t)ceil(NEAREST_SHARE * (double)p->samples.n);
    double *list = NULL, sum = 0;
    const sdm_status s = SDM_ALLOC(&list, p->samples.n, "distances of the points", err);
    if (s) return s;
    for (size_t i = 0; i < p->samples.n; i++) list[i] = fabs(p->samples.field[i]);
    qsort(list, p->samples.n, sizeof *list, by_size);
    for (size_t i = 0; i < n; i++) sum += list[i] * list[i];
    *sd = sqrt(sum / ((double)n * NEAREST_SQUARE));
    sdm_free(list);
    return SDM_OK;
}

/* Do the points contradict the given standard deviation, without the outliers? The scatter of the
 * nearest points does far beyond its precision; so does the error that neighbours share, which is a
 * part of the given one. */
static bool is_contradicted(const fit_problem *p, given_scatter g, const fit_shared_errors *shared)
{
    const double most = SCATTER_FAILED * hypot(p->state.point_sd, sdm_fit_network_error(p));
    double sd;
    if (!(g.over > g.limit) || p->opts->tolerance > 0) return false;
    if (shared && shared->n &&
        shared->all * shared->all - shared->near * shared->near > most * most)
        return true;
    return !trimmed_sd(p, &sd, NULL) && sd > most * sqrt(g.limit);
}

static void add_scatter(const fit_problem *p, given_scatter g, const fit_shared_errors *shared,
                        sdm_fit_verdict *v)
{
    sdm_fit_judge_add(v, SDM_FIT_CHECK_RESIDUALS, g.over <= g.limit,
                      is_contradicted(p, g, shared) ? SDM_FIT_FAILED : SDM_FIT_DOUBTFUL, g.over,
                      g.limit,
                      "the points scatter by %.2g mm about the surface, but %.2g mm are given as "
                      "their standard deviation: another shape, or their standard deviation is "
                      "larger",
                      g.rms, p->state.point_sd);
}

void sdm_fit_check_sparse_points(const fit_problem *p, sdm_fit_verdict *v)
{
    if (!p->opts->keep_appearance) {
        sdm_fit_judge_add(v, SDM_FIT_CHECK_RESIDUALS, false, SDM_FIT_DOUBTFUL, NAN, NAN,
                          "the points lie too far apart to tell their scatter from errors of the "
                          "shape: nothing tests this fit; if you know the standard deviation of "
                          "the points (sdm_fit_opts.point_sd), keep it "
                          "(sdm_fit_opts.keep_appearance)");
        return;
    }
    add_scatter(p, scatter_of(p, 1), NULL, v);
}

bool sdm_fit_doubt_given_scatter(const fit_problem *p, const fit_shared_errors *shared,
                                 sdm_fit_verdict *v)
{
    if (!p->opts->keep_appearance) return false;
    const given_scatter g = scatter_of(p, fmax(p->noise_factor, 1));
    if (g.over <= g.limit) return false;
    add_scatter(p, g, shared, v);
    return true;
}

/* What the fitted shape needs: measured at the shape itself, where it is known. */
static fit_details shape_details(const fit_problem *p, double most)
{
    const fit_maps *m = &p->maps;
    const sdm_model *model = p->source->model;
    fit_details d;
    if (p->source->shape && !sdm_fit_shape_details(m, p->state.params, most, &d, NULL)) return d;
    return sdm_fit_map_details(m, model ? sdm_model_get_info(model)->quality.thickness_mm : NAN);
}

static void coarseness_limit(fit_coarseness *c, double limit, const char *detail)
{
    if (limit < c->limit) c->limit = limit, c->detail = detail;
}

/* The point spread at the start, where it is not a default one and narrower than the maps show; 0:
 * no such one was given. */
static double given_blur(const fit_problem *p)
{
    const double blur = p->opts->blur,
                 voxel = fmax(fit_longest_edge(&p->maps.grid), fit_longest_edge(&p->target->grid));
    const bool is_default =
        blur == sdm_fit_defaults().blur || blur == sdm_fit_defaults_for(voxel).blur;
    return is_default || blur > p->maps.min_blur ? 0 : blur;
}

/* Longest edge of voxels that show the data. */
static fit_coarseness data_limit(const fit_problem *p, double blur)
{
    fit_coarseness c = {.limit = INFINITY, .advice = INFINITY, .detail = "", .thinnest = NAN};
    const double image = fit_longest_edge(&p->target->grid);
    if (fit_is_labels(p))
        coarseness_limit(&c, SDM_GRID_FIT_DATA * image, "the voxels of the labels");
    if (!(blur > 0)) return c;
    // an image hardly shows a point spread below half of its voxels, and maps with coarse voxels
    // show none below half of theirs: finer ones may find a narrower one, the one that is given or,
    // without it, any
    const double narrow = BLUR_OVER_IMAGE_VOXEL * image;
    const bool bound = !p->opts->keep_blur && blur <= p->maps.min_blur * (1 + LIMIT_ERROR);
    const double least = bound ? given_blur(p) : blur;
    coarseness_limit(&c, SDM_GRID_FIT_DATA * fmax(least, narrow), "the point spread of the image");
    return c;
}

/* Number of voxels of this edge in the grid of the maps. */
static double voxels_of(const fit_maps *m, double edge)
{
    double n = 1;
    for (int a = 0; a < 3; a++) n *= (double)m->grid.n[a] * m->grid.spacing[a] / edge;
    return n;
}

/* Names the length that asks for voxels of `limit` mm. */
static void name_cause(const fit_problem *p, const fit_details *d, double limit, double of_data,
                       char *text, size_t size)
{
    const double thin = fmin(isnan(d->thinnest) ? INFINITY : d->thinnest, 2 * d->radius);
    const sdm_instance *shape = p->source->shape;
    size_t n = 0, k = 0;
    if (of_data <= limit) {
        snprintf(
            text, size,
            "they want voxels of %.2g mm, where the fitted shape is about %.3g mm long: is one "
            "of both in another unit?",
            limit, 2 * p->extent.reach);
        return;
    }
    if (thin > FINER_THAN_THIN * limit) {
        snprintf(text, size,
                 "they want voxels of %.2g mm: is a length of the shape in another unit?", limit);
        return;
    }
    const sdm_param *params = shape ? sdm_instance_params(shape, &n) : NULL;
    if (shape) k = sdm_fit_thinning_param(shape, p->state.params, thin);
    const int used =
        snprintf(text, size, "the thinnest part of the fitted shape is %.2g mm thick", thin);
    if (k < n)
        snprintf(text + used, size - (size_t)used, ": '%.40s' is at %.3g%s%.10s", params[k].name,
                 p->state.params[k], *params[k].unit ? " " : "", params[k].unit);
}

fit_coarseness sdm_fit_coarseness(const fit_problem *p, double blur)
{
    if (fit_maps_direct(&p->maps))
        return (fit_coarseness){
            .limit = INFINITY, .advice = INFINITY, .detail = "", .thinnest = NAN};
    fit_coarseness c = data_limit(p, blur);
    const double of_data = c.limit;
    const fit_details d = shape_details(p, c.limit);
    coarseness_limit(&c, d.edge, "the details of the shape");
    coarseness_limit(&c, 2 * d.radius / SDM_GRID_FIT_VOXELS, "the thickness of the shape");
    coarseness_limit(&c, d.thinnest / VOXEL_DIAGONAL, "the thinnest part of the shape");
    c.blind = fit_longest_edge(&p->maps.grid) > VOXEL_OVER_RADIUS_FAR * sdm_fit_inradius(&p->maps);
    c.advice = SDM_GRID_FIT_ADVISED * c.limit;
    c.thinnest = d.thinnest;
    if (voxels_of(&p->maps, c.advice) > FIT_SENSIBLE_VOXELS)
        name_cause(p, &d, c.limit, of_data, c.cause, sizeof c.cause);
    return c;
}

void sdm_fit_check_voxels(const fit_problem *p, fit_coarseness coarse, sdm_fit_result *r)
{
    const double voxel = fit_longest_edge(&p->maps.grid);
    if (p->opts->keep_params || fit_maps_direct(&p->maps)) return;
    char remedy[sizeof coarse.cause];
    memcpy(remedy, coarse.cause, sizeof remedy);
    if (!*remedy)
        snprintf(remedy, sizeof remedy,
                 "exact maps with voxels of %.2g mm (sdm_fit_source.grid), %g times the limit, "
                 "show it",
                 coarse.advice, SDM_GRID_FIT_ADVISED);
    if (voxel > coarse.limit && !*coarse.cause) r->advised_voxel_mm = coarse.advice;
    sdm_fit_judge_add(
        &r->verdict, SDM_FIT_CHECK_VOXELS, !(voxel > coarse.limit),
        coarse.blind ? SDM_FIT_FAILED : SDM_FIT_DOUBTFUL, voxel, coarse.limit,
        "the voxels of the maps are coarse beside %s: parameters may be biased; their "
        "standard deviations contain an estimate of this error, which may be too "
        "small; %s",
        coarse.detail, remedy);
}

void sdm_fit_check_labels(const fit_problem *p, double thinnest, sdm_fit_verdict *v)
{
    if (p->opts->keep_params) return;
    const double voxel = fit_longest_edge(&p->target->grid), thick = thinnest;
    if (!isfinite(thick)) return;
    // a parameter at a bound shows that the fit has missed the part
    bool missed = false;
    for (size_t k = 0; k < p->n_params; k++)
        missed = missed || (!fit_param_is_kept(p, k) &&
                            !(p->state.params[k] > p->low[k] && p->state.params[k] < p->high[k]));
    sdm_fit_judge_add(v, SDM_FIT_CHECK_DATA, voxel <= thick,
                      missed ? SDM_FIT_FAILED : SDM_FIT_DOUBTFUL, voxel, thick,
                      "the voxels of the labels, %.3g mm, are longer than the thinnest part of the "
                      "shape is thick, %.3g mm: they hardly show it, and parameters of this part "
                      "and of its neighbours are not to be trusted%s; finer labels are needed",
                      voxel, thick, missed ? ", one of which ends at its bound" : "");
}

void sdm_fit_check_determined(const fit_problem *p, const sdm_fit_result *r, sdm_fit_verdict *v)
{
    size_t known = 0, open = 0, counted = 0;
    if (p->opts->keep_params || v->grade == SDM_FIT_FAILED) return;
    for (size_t k = 0; k < p->n_params; k++) {
        if (fit_param_is_kept(p, k)) continue;
        known += !r->by_prior[k];
        // a distribution of its own says enough of a parameter
        if (p->distribution[k].kind == SDM_DISTRIBUTION_NORMAL && p->opts->prior_sd > 0) continue;
        counted++, open += r->by_prior[k];
    }
    if (known && 2 * open >= counted && open) {
        // the finding on the number of points stays the first reason
        char before[sizeof v->findings->text + 2] = "";
        const sdm_fit_finding *points = sdm_fit_finding_of(v, SDM_FIT_CHECK_DATA);
        if (points && *points->text) snprintf(before, sizeof before, "%s; ", points->text);
        sdm_fit_judge_add(v, SDM_FIT_CHECK_DATA, false, SDM_FIT_DOUBTFUL, (double)(counted - open),
                          (double)(counted / 2 + 1),
                          "%s%zu of %zu parameters are not determined by the data: their standard "
                          "deviations are those of the priors",
                          before, open, counted);
    }
    if (known) return;
    sdm_fit_judge_add(v, SDM_FIT_CHECK_DATA, false, SDM_FIT_FAILED, 0, 1,
                      "the data determine none of the %zu parameters: their standard deviations "
                      "are those of the priors",
                      p->n_params);
}
