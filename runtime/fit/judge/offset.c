/* An offset of the surface is one more unknown, which a fit takes as 0. One step of Newton's method
   from there tells its value. Its deviation is that of its score, summed over the cubes of a coarse
   lattice, so that errors which neighbours share do not count as many; and of the steps of labels,
   which may be the same on a whole face. */
#include "offset.h"

#include <math.h>
#include <stdlib.h>

#include "finding.h"
#include "fit/solver/open_motions.h"
#include "fit/trust/influence.h"
#include "fit/trust/label_steps.h"
#include "fit/trust/posterior.h"
#include "sdm/internal/heap.h"

// edge of a cube, over the reach of the shape
#define CUBE_OVER_REACH 0.25
// fewer cubes tell no deviation
#define CUBES_MIN 8
// an offset is tested if the unknowns of the fit explain at most this share of it
#define EXPLAINED_MAX 0.95
// standard deviations from which on an offset is doubtful, and from which on it refuses the fit
#define SD_DOUBTFUL 4.0
#define SD_REFUSED 6.0
// smallest offset that refuses a fit: over the largest radius; labels: in voxels, an error of their
// surface that a segmentation with another threshold may have. Half of it is doubtful
#define OFFSET_OVER_RADIUS 0.03
#define OFFSET_OF_LABELS 0.2
// interpolation of the distance from a ball between voxels of edge h errs by h^2 / (6 radius)
#define INTERPOLATION (1.0 / 6)

/* The sums of a cube: score of the offset, and its information. */
typedef struct cube {
    uint64_t number;
    double score, information;
} cube;

static int by_number(const void *a, const void *b)
{
    const cube *x = a, *y = b;
    return (x->number > y->number) - (x->number < y->number);
}

/* A sample of the band: its likelihood; its derivatives by the columns; derivative of the field by
 * an offset outward. */
typedef struct sample {
    fit_likelihood likelihood;
    const float *column;
    double slope;
} sample;

// false: sample i lies outside the band
static bool sample_get(const fit_problem *p, size_t i, sample *out)
{
    const fit_samples *s = &p->samples;
    if (s->row[i] == SIZE_MAX) return false;
    const double slope = sqrt(sdm_fit_slope_squared(p, i));
    out->column = s->jacobian + s->row[i] * s->n_columns;
    out->slope = p->maps.share ? slope : -slope;
    sdm_fit_likelihood(&p->observation, (double)s->value[i], fit_sample_weights(s, i), s->field[i],
                       true, &out->likelihood);
    return true;
}

// weight[N]: change of the unknowns by an offset of 1 mm, taken with the other sign; false: the
// information of the unknowns is singular
static bool unknowns_explain(const fit_problem *p, double *matrices, double *weight)
{
    const size_t n = p->information.n_unknowns, nc = p->samples.n_columns;
    double cross[FIT_UNKNOWNS_MAX] = {0};
    if (!sdm_fit_influence(p, true, matrices, matrices + n * n)) return false;
    for (size_t i = 0; i < p->samples.n; i++) {
        sample x;
        if (!sample_get(p, i, &x)) continue;
        const double *information = x.likelihood.complete;
        for (size_t k = 0; k < nc; k++) cross[k] += information[0] * x.slope * (double)x.column[k];
        for (size_t k = nc; k < n; k++) cross[k] += information[1 + k - nc] * x.slope;
    }
    for (size_t a = 0; a < n; a++) {
        weight[a] = 0;
        for (size_t b = 0; b < n; b++) weight[a] += matrices[a * n + b] * cross[b];
    }
    return true;
}

static uint64_t cube_of(const double x[3], const double origin[3], double edge)
{
    uint64_t number = 0;
    for (size_t a = 0; a < 3; a++) {
        const double k = fmin(fmax(floor((x[a] - origin[a]) / edge), -1e5), 1e5);
        number = number << 20 | ((uint64_t)((int64_t)k + (1 << 19)) & 0xfffff);
    }
    return number;
}

/* What the samples tell of the offset: its information; the part that no unknown explains; its
 * score, and the variance of the score by the scatter of the cubes. */
typedef struct offset {
    size_t n_cubes;
    double all, information, score, variance;
} offset;

// the sums over the cubes of list[n], one for each sample
static void cubes_unite(cube *list, size_t n, offset *out)
{
    qsort(list, n, sizeof *list, by_number);
    for (size_t i = 0; i < n; i++) out->score += list[i].score;
    for (size_t i = 0; i < n; i++) out->information += list[i].information;
    const double mm = out->score / out->information;
    for (size_t from = 0, to; from < n; from = to) {
        double rest = 0;
        for (to = from; to < n && list[to].number == list[from].number; to++)
            rest += list[to].score - mm * list[to].information;
        out->variance += rest * rest;
        out->n_cubes++;
    }
}

static sdm_status offset_measure(const fit_problem *p, const double *weight, offset *out,
                                 sdm_error *err)
{
    const size_t n = p->information.n_unknowns, nc = p->samples.n_columns;
    const double edge = CUBE_OVER_REACH * p->extent.reach;
    size_t count = 0;
    cube *list = NULL;
    const sdm_status s = SDM_ALLOC(&list, p->samples.n_band, "offset of the surface", err);
    *out = (offset){0};
    for (size_t i = 0; i < p->samples.n && !s; i++) {
        sample x;
        if (!sample_get(p, i, &x)) continue;
        const fit_likelihood *r = &x.likelihood;
        double slope = x.slope, score = 0;
        for (size_t k = 0; k < nc; k++) slope -= weight[k] * (double)x.column[k];
        for (size_t k = nc; k < n; k++) score -= weight[k] * r->score[1 + k - nc];
        out->all += r->complete[0] * x.slope * x.slope;
        list[count++] = (cube){cube_of(p->samples.world + 3 * i, p->extent.centre, edge),
                               score + r->score[0] * slope, r->complete[0] * slope * slope};
    }
    if (!s) cubes_unite(list, count, out);
    sdm_free(list);
    return s;
}

/* *variance = that of the score by the steps of labels: the offset is the only unknown of the
 * voxels near the surface. */
static sdm_status steps_variance(const fit_problem *p, const double *weight, double *variance,
                                 sdm_error *err)
{
    fit_neighbours v;
    sdm_status s = sdm_fit_neighbours_create(p, &v, err);
    const size_t n = v.n_unknowns;
    size_t count = 0;
    for (size_t i = 0; i < p->samples.n && !s; i++) {
        sample x;
        if (!sdm_fit_in_inner_band(p, i) || !sample_get(p, i, &x)) continue;
        double score = -x.likelihood.complete[0] * x.slope * x.slope;
        for (size_t k = 0; k < n; k++) score -= weight[k] * (double)v.model_score[count * n + k];
        v.model_score[count++] = (float)score;
    }
    v.n_unknowns = 1;
    *variance = 0;
    if (!s) s = sdm_fit_label_steps(p, &v, variance, err);
    sdm_fit_neighbours_dispose(&v);
    return s;
}

// the smallest offset that refuses a fit, mm
static double least_refused(const fit_problem *p)
{
    const double h = fit_longest_edge(&p->maps.grid), radius = sdm_fit_inradius(&p->maps);
    const double maps =
        fit_maps_direct(&p->maps) ? 0 : sdm_fit_network_error(p) + INTERPOLATION * h * h / radius;
    if (p->target->kind == SDM_FIT_POINTS) return OFFSET_OVER_RADIUS * radius + maps;
    return OFFSET_OF_LABELS * fmax(h, fit_longest_edge(&p->target->grid)) + maps;
}

static void add_finding(const fit_problem *p, double mm, double sd, sdm_fit_verdict *v)
{
    const bool points = p->target->kind == SDM_FIT_POINTS;
    const double least = least_refused(p), most = fmax(SD_DOUBTFUL * sd, 0.5 * least),
                 refused = fmax(SD_REFUSED * sd, least);
    const bool fails = fabs(mm) > refused && !(p->opts->tolerance > 0);
    sdm_fit_judge_add(
        v, SDM_FIT_CHECK_OFFSET, fabs(mm) <= most, fails ? SDM_FIT_FAILED : SDM_FIT_DOUBTFUL,
        fabs(mm), fails ? refused : most,
        "the surface of the %s lies %.2g mm %s of the shape's on average, %.2g standard deviations "
        "of this: a wall or another size that is no parameter is %s than in the shape, another "
        "shape, or %s (sdm_fit_opts.tolerance accepts a difference)",
        points ? "points" : "labels", fabs(mm), mm > 0 ? "outside" : "inside", fabs(mm) / sd,
        mm > 0 ? "thicker" : "thinner",
        points ? "points that all lie on one side of the surface, as from a wrong threshold"
               : "labels that are too wide or too narrow by a part of a voxel, as from a wrong "
                 "threshold");
}

sdm_status sdm_fit_check_offset(const fit_problem *p, sdm_fit_verdict *v, sdm_error *err)
{
    const size_t n = p->information.n_unknowns;
    double *matrices = NULL, weight[FIT_UNKNOWNS_MAX], steps = 0;
    offset o;
    sdm_status s = SDM_ALLOC(&matrices, 4 * n * n, "matrices of the fit", err);
    const bool known = !s && unknowns_explain(p, matrices, weight);
    sdm_free(matrices);
    if (!s && known) s = offset_measure(p, weight, &o, err);
    if (s || !known || !(o.information > (1 - EXPLAINED_MAX) * o.all) || o.n_cubes < CUBES_MIN)
        return s;
    if (p->given_labels) s = steps_variance(p, weight, &steps, err);
    if (!s) add_finding(p, o.score / o.information, sqrt(o.variance + steps) / o.information, v);
    return s;
}
