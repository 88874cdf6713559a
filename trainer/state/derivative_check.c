/* Compares the model with exact maps and meshes at the held-out shapes, and beside them along each
 * parameter. */
#include "derivative_check.h"

#include <math.h>
#include <string.h>

#include "data/surface_check.h"
#include "kind.h"
#include "sdm/exact.h"
#include "sdm/internal/model_threads.h"
#include "sdm/internal/part_audit.h"
#include "sdm/map.h"
#include "sdm/memory.h"

/* Shapes whose volumes are compared; the most whose derivatives are, and the number of parameters
   of all of them together. */
enum { VOLUMES = 20, SHAPES = 4, SHAPES_TIMES_PARAMS = 32 };

/* Differences are taken over this part of a range to either side: larger than the errors of
   meshes, smaller than the curvature of the maps. */
static const double STEP = 0.005;

/* The least change of the volume over the range of a parameter, over the volume. */
static const double VOLUME_CHANGE = 0.05;

static const size_t JACOBIAN_BYTES = 1000000000;

/* The exact shape at some parameters; of one that the grid cuts no more is known. */
typedef struct exact_shape {
    double volume; // mm^3
    float *map;    // NULL: not wanted
    bool cut;      // by the grid
} exact_shape;

/* Sums over the shapes, for one parameter. */
typedef struct slope_sums {
    double error, size;               // squares: of maps
    double volume_error, volume_size; // of volumes
} slope_sums;

static sdm_status exact_make(const dataset *d, const double *p, exact_shape *out, sdm_error *err)
{
    const sdm_exact_opts opts = {.n_threads = 1};
    sdm_mesh mesh = {0};
    sdm_exact *e = NULL;
    sdm_status s = sdm_instance_mesh(d->shape, p, &mesh, err);
    out->cut = !s && trainer_is_cut(&mesh, d->grid);
    if (!s && !out->cut) s = sdm_exact_create(&mesh, &opts, &e, err);
    if (!s && !out->cut) {
        double area;
        sdm_mesh_sums(sdm_exact_surface(e), &out->volume, &area);
        if (out->map) s = sdm_exact_map(e, d->grid, out->map, err);
    }
    sdm_exact_free(e);
    sdm_mesh_dispose(&mesh);
    return s;
}

/* Memory of one check. */
typedef struct check_memory {
    float *values, *jacobian, *adjoint; // of the model: [voxels], [n_params][voxels], [voxels]
    void *scratch;
    exact_shape *beside; // [n_params][2] the exact shapes on both sides along each parameter
} check_memory;

static void memory_dispose(check_memory *c, size_t n_params)
{
    for (size_t i = 0; i < 2 * n_params && c->beside; i++) sdm_free(c->beside[i].map);
    sdm_free(c->beside);
    sdm_free(c->scratch);
    sdm_free(c->adjoint);
    sdm_free(c->jacobian);
    sdm_free(c->values);
}

static sdm_status memory_create(const trainer *t, const sdm_model *m, bool slopes, check_memory *c,
                                sdm_error *err)
{
    const size_t n = sdm_grid_count(t->data.grid), n_params = t->data.n_params;
    const size_t bytes = sdm_model_scratch_bytes_threads(m, 1, t->n_threads),
                 more = slopes ? sdm_model_jacobian_scratch_bytes_threads(m, t->n_threads) : 0;
    sdm_status s = SDM_ALLOC(&c->values, n, "volumes", err);
    if (!s) s = sdm_alloc(&c->scratch, bytes > more ? bytes : more, 1, "volumes", err);
    if (!slopes) return s;
    if (!s) s = SDM_ALLOC(&c->jacobian, n * n_params, "derivatives", err);
    if (!s) s = SDM_ALLOC(&c->adjoint, n, "derivatives", err);
    if (!s) s = SDM_ALLOC(&c->beside, 2 * n_params, "derivatives", err);
    for (size_t i = 0; i < 2 * n_params && !s; i++)
        s = SDM_ALLOC(&c->beside[i].map, n, "derivatives", err);
    return s;
}

/* Adds up the errors of the volume of held-out shape i; *n counts it unless the grid cuts it. */
static sdm_status check_volume(const trainer *t, const sdm_model *m, size_t i, check_memory *c,
                               double *square, double *largest, size_t *n, sdm_error *err)
{
    const dataset *d = &t->data;
    const double *p = d->holdout_params + i * d->n_params;
    exact_shape exact = {0};
    double volume = 0;
    sdm_status s = exact_make(d, p, &exact, err);
    if (s || exact.cut || !(exact.volume > 0)) return s;
    sdm_model_forward_threads(m, p, 1, c->values, c->scratch, t->n_threads);
    s = sdm_map_volume(d->grid, c->values, t->n_threads, &volume, err);
    const double error = volume / exact.volume - 1;
    *square += error * error;
    *largest = fmax(*largest, fabs(error));
    ++*n;
    return s;
}

/* Makes c->beside for the shape at p, on all threads. */
static sdm_status beside_make(const trainer *t, const double *p, check_memory *c, sdm_error *err)
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
        const sdm_status s = exact_make(d, q, &c->beside[i], &own);
        if (s)
#pragma omp critical(sdm_derivative_check)
            if (i < failed) {
                failed = i, status = s;
                if (err) *err = own;
            }
    }
    return status;
}

/* Adds up the errors of the derivatives at p. */
static sdm_status check_slopes(const trainer *t, const sdm_model *m, const double *p,
                               check_memory *c, slope_sums *sums, size_t *n, sdm_error *err)
{
    const dataset *d = &t->data;
    const size_t voxels = sdm_grid_count(d->grid);
    const float near_mm = (float)(0.5 * trainer_dataset_voxel(d));
    sdm_status s = beside_make(t, p, c, err);
    for (size_t k = 0; k < 2 * d->n_params && !s; k++)
        if (c->beside[k].cut) return SDM_OK;
    if (s) return s;
    sdm_model_jacobian_threads(m, p, c->values, c->jacobian, c->scratch, t->n_threads);
    s = sdm_map_volume_adjoint(d->grid, c->values, t->n_threads, c->adjoint, err);
    if (s) return s;
    double volume[SDM_POD_MAX_PARAMS];
    sdm_jacobian_transposed_times(c->jacobian, d->n_params, voxels, c->adjoint, volume);
    for (size_t k = 0; k < d->n_params; k++) {
        const exact_shape *low = &c->beside[2 * k], *high = low + 1;
        const double range = d->max[k] - d->min[k], over = 2 * STEP * range;
        for (size_t v = 0; v < voxels; v++) {
            if (fabsf(0.5f * (low->map[v] + high->map[v])) > near_mm) continue;
            const double exact = ((double)high->map[v] - (double)low->map[v]) / over,
                         error = (double)c->jacobian[k * voxels + v] - exact;
            sums[k].error += error * error;
            sums[k].size += exact * exact;
        }
        const double exact = (high->volume - low->volume) / over,
                     least = VOLUME_CHANGE * 0.5 * (high->volume + low->volume) / range;
        sums[k].volume_error += (volume[k] - exact) * (volume[k] - exact);
        sums[k].volume_size += fmax(exact * exact, least * least);
    }
    ++*n;
    return SDM_OK;
}

/* The largest errors of all parameters. */
static void take_largest(const slope_sums *sums, size_t n, derivative_check *out)
{
    for (size_t k = 0; k < n; k++) {
        const double slope = sqrt(sums[k].error / sums[k].size),
                     volume = sqrt(sums[k].volume_error / sums[k].volume_size);
        out->slopes[k] = slope, out->volume_slopes[k] = volume;
        if (!(slope <= out->slope) && isfinite(slope)) out->slope = slope, out->slope_param = k;
        if (!(volume <= out->volume_slope) && isfinite(volume))
            out->volume_slope = volume, out->volume_slope_param = k;
    }
}

void trainer_derivatives_unknown(derivative_check *out)
{
    *out = (derivative_check){.volume = NAN, .volume_max = NAN, .slope = NAN, .volume_slope = NAN};
}

static size_t least_of(size_t a, size_t b) { return a < b ? a : b; }

sdm_status trainer_derivative_check(const trainer *t, const sdm_model *m, derivative_check *out,
                                    sdm_error *err)
{
    const dataset *d = &t->data;
    const size_t bytes = d->n_params * sdm_grid_count(d->grid) * sizeof(float);
    // the exact maps on both sides take twice as much
    const bool slopes = 3 * bytes <= JACOBIAN_BYTES && !t->kind->slow;
    const size_t wanted = least_of(SHAPES, 1 + (SHAPES_TIMES_PARAMS - 1) / d->n_params);
    check_memory c = {0};
    slope_sums sums[SDM_POD_MAX_PARAMS] = {{0}};
    double square = 0, largest = 0, p[SDM_POD_MAX_PARAMS];
    size_t n = 0, n_slopes = 0;
    trainer_derivatives_unknown(out);
    sdm_status s = memory_create(t, m, slopes, &c, err);
    for (size_t i = 0; i < least_of(d->n_holdout, 4 * VOLUMES) && n < VOLUMES && !s; i++)
        s = check_volume(t, m, i, &c, &square, &largest, &n, err);
    for (size_t i = 0; slopes && i < least_of(d->n_holdout, 4 * wanted) && n_slopes < wanted && !s;
         i++) {
        for (size_t k = 0; k < d->n_params; k++) {
            const double step = STEP * (d->max[k] - d->min[k]);
            p[k] = fmin(fmax(d->holdout_params[i * d->n_params + k], d->min[k] + step),
                        d->max[k] - step);
        }
        s = check_slopes(t, m, p, &c, sums, &n_slopes, err);
    }
    memory_dispose(&c, d->n_params);
    if (s) return s;
    if (n) out->volume = sqrt(square / (double)n), out->volume_max = largest;
    if (n_slopes) take_largest(sums, d->n_params, out);
    return SDM_OK;
}
