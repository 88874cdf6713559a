/* Compares derivatives of the model with differences of exact distances and of meshes, beside the
 * held-out shapes along each parameter. */
#include "derivative_check.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "data/surface_check.h"
#include "kind.h"
#include "progress.h"
#include "sdm/internal/model_threads.h"
#include "sdm/internal/part_audit.h"
#include "sdm/map.h"
#include "sdm/memory.h"
#include "sdm/model.h"
#include "volume_check.h"

/* Of those that hardly change the volume so many are named. */
enum { SMALL_NAMED = 4 };

/* From this error on, over the size of the derivative, its sign may be wrong: the error of a single
   shape is often twice the root mean square. */
static const double SIGN_WRONG = 0.5;

/* Larger errors are not told apart. */
static const double ERROR_MOST = 10;

/* Shapes that are compared: so many, unless the number of parameters of all of them together
   exceeds the second, but at least the third. Voxels near the surface of each of them. */
enum { SHAPES = 32, SHAPES_TIMES_PARAMS = 384, SHAPES_LEAST = 4, POINTS = 1000 };

/* No further shape is begun after this part of a budget of time. */
static const double BUDGET = 0.05;

/* Differences are taken over this part of a range to either side: larger than the errors of
   meshes, smaller than the curvature of the maps. */
static const double STEP = 0.005;

/* The least change of the volume over the range of a parameter, over the volume. */
static const double VOLUME_CHANGE = 0.05;

/* A parameter that changes the volume by a smaller part of it does not change it: rounding. */
static const double VOLUME_SAME = 1e-6;

/* A parameter that moves no point near the surface by this part of a voxel over its range moves
   none of the surface: what is left are rounding errors, over which no error can be told. */
static const double STILL = 1e-3;

/* Shapes on which exact maps are compared for one of n parameters. */
static size_t voxels_shapes(size_t n)
{
    enum { EACH = 8, ALL = 64, LEAST = 2 };
    return n * EACH <= ALL ? EACH : n * LEAST < ALL ? ALL / n : LEAST;
}

static const size_t JACOBIAN_BYTES = 1000000000;

/* Voxels near the surface of a shape. */
typedef struct near_voxels {
    size_t n, index[POINTS];
    double x[POINTS][3]; // mm
} near_voxels;

/* The exact shape beside another one; of one that the grid cuts no more is known. */
typedef struct shape_beside {
    double volume;           // mm^3
    double distance[POINTS]; // at near_voxels.x, mm
    bool cut;                // by the grid
} shape_beside;

/* Sums over the shapes, for one parameter. */
typedef struct slope_sums {
    double error, size;              // squares: of maps
    double largest;                  // exact derivative of a distance
    double volume_error;             // of volumes
    double volume_own, volume_scale; // exact derivatives; volumes over the range
} slope_sums;

/* Memory of one check. */
typedef struct check_memory {
    float *values, *jacobian, *adjoint; // of the model: [voxels], [n_params][voxels], [voxels]
    float *exact;                       // [voxels]
    void *scratch;
    near_voxels *near;
    shape_beside *beside; // [n_params][2] on both sides along each parameter
} check_memory;

static void memory_dispose(check_memory *c)
{
    sdm_free(c->beside);
    sdm_free(c->near);
    sdm_free(c->scratch);
    sdm_free(c->exact);
    sdm_free(c->adjoint);
    sdm_free(c->jacobian);
    sdm_free(c->values);
}

static sdm_status memory_create(const trainer *t, const sdm_model *m, check_memory *c,
                                sdm_error *err)
{
    const size_t n = sdm_grid_count(t->data.grid), n_params = t->data.n_params,
                 bytes = sdm_model_jacobian_scratch_bytes_threads(m, t->n_threads);
    sdm_status s = SDM_ALLOC(&c->values, n, "derivatives", err);
    if (!s) s = SDM_ALLOC(&c->jacobian, n * n_params, "derivatives", err);
    if (!s) s = SDM_ALLOC(&c->adjoint, n, "derivatives", err);
    if (!s) s = SDM_ALLOC(&c->exact, n, "derivatives", err);
    if (!s) s = sdm_alloc(&c->scratch, bytes, 1, "derivatives", err);
    if (!s) s = SDM_ALLOC(&c->near, 1, "derivatives", err);
    if (!s) s = SDM_ALLOC(&c->beside, 2 * n_params, "derivatives", err);
    return s;
}

/* Fills c->near for the shape at p. *cut: the grid cuts it. */
static sdm_status near_make(const trainer *t, const double *p, check_memory *c, bool *cut,
                            sdm_error *err)
{
    const dataset *d = &t->data;
    const size_t voxels = sdm_grid_count(d->grid), nx = (size_t)d->grid->n[0],
                 ny = (size_t)d->grid->n[1];
    const double near_mm = 0.5 * trainer_dataset_voxel(d);
    const sdm_exact_layers layers = {.values = c->exact, .band_mm = near_mm};
    sdm_exact *e;
    size_t all = 0, k = 0;
    sdm_status s = trainer_exact_within(d, p, t->n_threads, &e, err);
    *cut = !e;
    if (e) s = sdm_exact_map_layers(e, d->grid, &layers, err);
    sdm_exact_free(e);
    if (s || *cut) return s;
    for (size_t v = 0; v < voxels; v++) all += fabsf(c->exact[v]) < (float)near_mm;
    near_voxels *near = c->near;
    near->n = 0;
    // evenly spread over the voxels in their order
    for (size_t v = 0; v < voxels && near->n < POINTS; v++) {
        if (!(fabsf(c->exact[v]) < (float)near_mm) || k++ * POINTS < near->n * all) continue;
        const double index[3] = {(double)(v % nx), (double)(v / nx % ny), (double)(v / nx / ny)};
        near->index[near->n] = v;
        sdm_grid_world(d->grid, index, near->x[near->n++]);
    }
    return SDM_OK;
}

/* The shape at q at the voxels. */
static sdm_status beside_make(const dataset *d, const double *q, const near_voxels *near,
                              shape_beside *out, sdm_error *err)
{
    const sdm_exact_at at = {.distance = out->distance};
    sdm_exact *e;
    double area;
    sdm_status s = trainer_exact_within(d, q, 1, &e, err);
    out->cut = !e;
    if (e) {
        sdm_mesh_sums(sdm_exact_surface(e), &out->volume, &area);
        s = sdm_exact_points(e, near->x[0], near->n, &at, err);
    }
    sdm_exact_free(e);
    return s;
}

/* Makes c->beside for the shape at p, on all threads. */
static sdm_status beside_make_all(const trainer *t, const double *p, check_memory *c,
                                  sdm_error *err)
{
    const dataset *d = &t->data;
    const int64_t n = 2 * (int64_t)d->n_params;
    sdm_status status = SDM_OK;
    int64_t failed = n; // the first neighbour that failed, whichever thread is first
#pragma omp parallel for schedule(dynamic) num_threads(t->n_threads)
    for (int64_t i = 0; i < n; i++) {
        const size_t k = (size_t)i / 2;
        double q[SDM_POD_MAX_PARAMS];
        sdm_error own = {0};
        memcpy(q, p, d->n_params * sizeof *q);
        q[k] += (i % 2 ? 1 : -1) * STEP * (d->max[k] - d->min[k]);
        q[k] = fmin(fmax(q[k], d->min[k]), d->max[k]); // rounding may lead beyond
        const sdm_status s = beside_make(d, q, c->near, &c->beside[i], &own);
        if (s)
#pragma omp critical(sdm_derivative_check)
            if (i < failed) {
                failed = i, status = s;
                if (err) *err = own;
            }
    }
    return status;
}

/* Adds up the errors of the derivatives by parameter k. volume: derivative of the volume of the
 * model's map. */
static void add_slopes(const trainer *t, const check_memory *c, size_t k, double volume,
                       slope_sums *sums)
{
    const dataset *d = &t->data;
    const shape_beside *low = &c->beside[2 * k], *high = low + 1;
    const double range = d->max[k] - d->min[k], over = 2 * STEP * range;
    const float *slope = c->jacobian + k * sdm_grid_count(d->grid);
    for (size_t i = 0; i < c->near->n; i++) {
        const double exact = (high->distance[i] - low->distance[i]) / over,
                     error = (double)slope[c->near->index[i]] - exact;
        sums->error += error * error;
        sums->size += exact * exact;
        sums->largest = fmax(sums->largest, fabs(exact));
    }
    const double exact = (high->volume - low->volume) / over,
                 scale = 0.5 * (high->volume + low->volume) / range;
    sums->volume_error += (volume - exact) * (volume - exact);
    sums->volume_own += exact * exact;
    sums->volume_scale += scale * scale;
}

/* Adds up the errors of the derivatives at p; *n counts the shape unless the grid cuts it. */
static sdm_status check_slopes(const trainer *t, const sdm_model *m, const double *p,
                               check_memory *c, slope_sums *sums, size_t *n, sdm_error *err)
{
    const dataset *d = &t->data;
    double volume[SDM_POD_MAX_PARAMS];
    bool cut;
    sdm_status s = near_make(t, p, c, &cut, err);
    if (s || cut) return s;
    s = beside_make_all(t, p, c, err);
    for (size_t k = 0; k < 2 * d->n_params && !s; k++)
        if (c->beside[k].cut) return SDM_OK;
    if (s) return s;
    sdm_model_jacobian_threads(m, p, c->values, c->jacobian, c->scratch, t->n_threads);
    s = sdm_map_volume_adjoint(d->grid, c->values, t->n_threads, c->adjoint, err);
    if (s) return s;
    sdm_jacobian_transposed_times(c->jacobian, d->n_params, sdm_grid_count(d->grid), c->adjoint,
                                  volume);
    for (size_t k = 0; k < d->n_params; k++) add_slopes(t, c, k, volume[k], &sums[k]);
    ++*n;
    return SDM_OK;
}

/* The largest errors of all parameters. */
static void take_largest(const dataset *d, const slope_sums *sums, derivative_check *out)
{
    for (size_t k = 0; k < d->n_params; k++) {
        const double range = d->max[k] - d->min[k];
        out->still[k] = !(sums[k].largest * range > STILL * trainer_dataset_voxel(d));
        // of a parameter that changes the volume enough this is the figure of the list, too
        const double slope = out->still[k] ? NAN : sqrt(sums[k].error / sums[k].size),
                     least = VOLUME_CHANGE * VOLUME_CHANGE * sums[k].volume_scale,
                     volume = sqrt(sums[k].volume_error / fmax(sums[k].volume_own, least)),
                     change = sqrt(sums[k].volume_own / sums[k].volume_scale);
        out->slopes[k] = slope, out->volume_slopes[k] = volume;
        // of a parameter that changes nothing any error is infinitely large
        const double none = volume > SDM_DERIVATIVE_BAD ? INFINITY : NAN;
        out->volume_own[k] =
            change > VOLUME_SAME ? sqrt(sums[k].volume_error / sums[k].volume_own) : none;
        out->volume_small[k] = change < VOLUME_CHANGE;
        if (!(slope <= out->slope) && isfinite(slope)) out->slope = slope, out->slope_param = k;
        if (!(volume <= out->volume_slope) && isfinite(volume))
            out->volume_slope = volume, out->volume_slope_param = k;
    }
}

void trainer_derivatives_unknown(derivative_check *out)
{
    *out = (derivative_check){.slope = NAN, .volume_slope = NAN};
}

/* Is the error of the derivative of the volume by parameter k too large, and not for want of a
 * change of the volume? */
static bool is_bad(const derivative_check *c, size_t k)
{
    return !c->volume_small[k] && c->volume_own[k] > SDM_DERIVATIVE_BAD;
}

/* Sets out->voxels_slopes: whether voxels or the network cause each error of the volume. */
static sdm_status find_voxels_slopes(const trainer *t, derivative_check *out, sdm_error *err)
{
    const dataset *d = &t->data;
    size_t bad = 0;
    sdm_status s = SDM_OK;
    for (size_t k = 0; k < d->n_params; k++) {
        out->voxels_slopes[k] = NAN;
        bad += is_bad(out, k);
    }
    for (size_t k = 0; k < d->n_params && !s; k++)
        if (is_bad(out, k))
            s = trainer_derivative_of_voxels(t, k, STEP * (d->max[k] - d->min[k]),
                                             voxels_shapes(bad), &out->voxels_slopes[k], err);
    return s;
}

static size_t shapes_wanted(size_t n_params)
{
    const size_t n = SHAPES_TIMES_PARAMS / n_params;
    return n < SHAPES_LEAST ? SHAPES_LEAST : n < SHAPES ? n : SHAPES;
}

/* true: the measurement, which began at `start`, is over after n shapes. */
static bool is_over(const trainer *t, double start, size_t n)
{
    const double seconds = 60 * BUDGET * t->config->train.minutes;
    return n >= shapes_wanted(t->data.n_params) ||
           (n >= SHAPES_LEAST && trainer_by_time(t) && trainer_seconds(t) - start > seconds);
}

sdm_status trainer_derivative_check(const trainer *t, const sdm_model *m, derivative_check *out,
                                    sdm_error *err)
{
    const dataset *d = &t->data;
    const double start = trainer_seconds(t);
    const size_t most = 4 * shapes_wanted(d->n_params);
    check_memory c = {0};
    slope_sums sums[SDM_POD_MAX_PARAMS] = {{0}};
    double p[SDM_POD_MAX_PARAMS];
    trainer_derivatives_unknown(out);
    if (t->kind->slow || d->n_params * sdm_grid_count(d->grid) * sizeof(float) > JACOBIAN_BYTES)
        return SDM_OK;
    sdm_status s = memory_create(t, m, &c, err);
    for (size_t i = 0; i < d->n_holdout && i < most && !is_over(t, start, out->shapes) && !s; i++) {
        for (size_t k = 0; k < d->n_params; k++) {
            const double step = STEP * (d->max[k] - d->min[k]);
            p[k] = fmin(fmax(d->holdout_params[i * d->n_params + k], d->min[k] + step),
                        d->max[k] - step);
        }
        s = check_slopes(t, m, p, &c, sums, &out->shapes, err);
    }
    memory_dispose(&c);
    if (s || !out->shapes) return s;
    take_largest(d, sums, out);
    return find_voxels_slopes(t, out, err);
}

/* true: parameter a comes before b in the list. */
static bool is_worse(const double *error, size_t a, size_t b)
{
    return error[a] > error[b] || (error[a] == error[b] && a < b);
}

/* The worst parameter after `last` (n: the first one); n: none. */
static size_t next_worst(const double *error, size_t n, size_t last)
{
    size_t worst = n;
    for (size_t k = 0; k < n; k++)
        if (error[k] > SDM_DERIVATIVE_BAD && (last == n || is_worse(error, last, k)) &&
            (worst == n || is_worse(error, k, worst)))
            worst = k;
    return worst;
}

/* Lists at most `most` parameters within `room` characters; `of` follows the first error. */
static void list(const sdm_param *p, const double *error, size_t n, const char *of, size_t most,
                 size_t room, char *text)
{
    size_t used = 0, named = 0;
    text[0] = '\0';
    for (size_t k = next_worst(error, n, n); k < n; k = next_worst(error, n, k)) {
        char one[160];
        const bool over = error[k] > ERROR_MOST;
        const int length =
            snprintf(one, sizeof one, "%s%.60s: off by %s%.0f %%%s", used ? "; by " : "", p[k].name,
                     over ? "over " : "", 100 * (over ? ERROR_MOST : error[k]), used ? "" : of);
        const bool fits = used + (size_t)length + sizeof "; ..." <= room && named++ < most;
        used += (size_t)snprintf(text + used, room - used, "%s", fits ? one : "; ...");
        if (!fits) return;
    }
}

void trainer_list_derivatives(const sdm_param *p, const double *error, size_t n,
                              char text[SDM_VERDICT_LIST])
{
    list(p, error, n, "", n, SDM_VERDICT_LIST, text);
}

/* The cause of an error of derivatives of the volume, of which exact maps on the same voxels have
 * this part. */
static int cause_of(double voxels)
{
    return voxels > SDM_DERIVATIVE_BAD ? 0 : voxels > 0.5 * SDM_DERIVATIVE_BAD ? 1 : 2;
}

void trainer_list_causes(const sdm_param *p, const double *error, const double *voxels, size_t n,
                         char text[SDM_VERDICT_LIST])
{
    // flat faces along planes of voxels err on each grid: a finer one is no safe advice
    static const char *const causes[] = {": the voxels cause it", ": the voxels cause a part",
                                         ": the network errs"};
    enum { ROOM = SDM_VERDICT_LIST - 60 };
    const size_t first = next_worst(error, n, n);
    const bool single = first == n || next_worst(error, n, first) == n;
    size_t used = 0;
    text[0] = '\0';
    for (int r = 0; r < 3; r++) {
        bool some = false;
        for (size_t k = first; k < n; k = next_worst(error, n, k)) {
            char one[120], name[72] = "";
            if (!(voxels[k] >= 0) || cause_of(voxels[k]) != r) continue;
            if (!single) snprintf(name, sizeof name, " for %.60s", p[k].name);
            const int length =
                snprintf(one, sizeof one, voxels[k] >= 0.1 ? "%s%.0f %%%s" : "%s%.2g %%%s",
                         some   ? ", "
                         : used ? "; by "
                                : "",
                         100 * voxels[k], name);
            if (used + (size_t)length >= ROOM) break;
            used += (size_t)snprintf(text + used, SDM_VERDICT_LIST - used, "%s", one);
            some = true;
        }
        if (some) used += (size_t)snprintf(text + used, SDM_VERDICT_LIST - used, "%s", causes[r]);
        if (used >= ROOM) return;
    }
}

void trainer_list_still(const sdm_param *p, const bool *still, size_t n,
                        char text[SDM_VERDICT_LIST])
{
    static const char more[] = ", ...";
    size_t used = 0;
    text[0] = '\0';
    for (size_t k = 0; k < n; k++) {
        char one[80];
        if (!still[k]) continue;
        const int length = snprintf(one, sizeof one, "%s%.60s", used ? ", " : "", p[k].name);
        const bool fits = used + (size_t)length + sizeof more <= SDM_VERDICT_LIST;
        used += (size_t)snprintf(text + used, SDM_VERDICT_LIST - used, "%s", fits ? one : more);
        if (!fits) return;
    }
}

void trainer_list_small(const sdm_param *p, const double *error, size_t n,
                        char text[SDM_VERDICT_LIST])
{
    static const char why[] = ": these parameters hardly change the volume",
                      single[] = ": this parameter hardly changes the volume",
                      sign[] = ", and the sign may be wrong";
    const size_t worst = next_worst(error, n, n),
                 room = SDM_VERDICT_LIST - sizeof why - sizeof sign;
    list(p, error, n, " of their own size", SMALL_NAMED, room, text);
    if (worst == n) return;
    const size_t used = strlen(text);
    const bool several = next_worst(error, n, worst) < n;
    snprintf(text + used, SDM_VERDICT_LIST - used, "%s%s", several ? why : single,
             error[worst] < SIGN_WRONG ? "" : sign);
}
