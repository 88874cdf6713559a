/* The share of the shape seen through a Gaussian point spread G of sd s is a = G * [distance < 0].
   On the grid of the map it is made in three steps: an edge of sd s0, half a voxel, drawn by the
   distance itself, the discrete Gaussian (Lindeberg 1990), which keeps its variance whatever the
   grid and whose derivative by it is half the discrete Laplacian, and between the voxels cubic
   B-splines, which spread by h^2 / 3 along an axis with voxels of h. The Gaussian has what is left,
   s^2 - s0^2 - h^2 / 3, and where that is negative undoes as much of the splines. So the share has
   continuous second derivatives, and without an inverse filter (Unser, Aldroubi and Eden 1993) it
   is 0 or 1 a few voxels from the surface, and does not ring. */
#include "map_fields.h"

#include <math.h>
#include <string.h>

#include "blur.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"

static size_t fields_of(const fit_maps *m, bool derivatives)
{
    return derivatives ? m->n_params + (m->share ? 2 : 1) : 1;
}

sdm_status sdm_fit_maps_create(const sdm_fit_source *source, bool share, const sdm_fit_opts *opts,
                               fit_maps *out, sdm_error *err)
{
    fit_maps *m = out;
    *m = (fit_maps){.source = source,
                    .share = share,
                    .exact = !source->model,
                    .n_threads = opts->n_threads,
                    .cancelled = opts->cancelled,
                    .user = opts->user};
    if (source->model) {
        m->grid = sdm_model_get_info(source->model)->grid;
        m->n_params = sdm_model_get_info(source->model)->n_params;
    } else {
        m->grid = source->grid;
        (void)sdm_instance_params(source->shape, &m->n_params);
    }
    m->n_voxels = sdm_grid_count(&m->grid);
    m->least_blur = 0.5 * fmax(m->grid.spacing[0], fmax(m->grid.spacing[1], m->grid.spacing[2]));
    size_t jacobian, fields;
    sdm_status s = sdm_mul(m->n_voxels, m->n_params, &jacobian, err);
    if (!s) s = sdm_mul(m->n_voxels, fields_of(m, true), &fields, err);
    if (!s) s = SDM_ALLOC(&m->values, m->n_voxels, "map", err);
    if (!s) s = SDM_ALLOC(&m->jacobian, jacobian, "derivatives of the map", err);
    if (!s) s = SDM_ALLOC(&m->distance, m->n_voxels, "map", err);
    if (!s) s = SDM_ALLOC(&m->packed, fields, "fields of the map", err);
    if (!s) s = SDM_ALLOC(&m->spare, fields, "fields of the map", err);
    if (s) sdm_fit_maps_dispose(m);
    return s;
}

void sdm_fit_maps_dispose(fit_maps *m)
{
    sdm_free(m->values);
    sdm_free(m->jacobian);
    sdm_free(m->distance);
    sdm_free(m->packed);
    sdm_free(m->spare);
    *m = (fit_maps){0};
}

static bool outside_of_network(const sdm_model_info *info, const double *params)
{
    for (size_t k = 0; k < info->n_params; k++)
        if (!(params[k] >= info->params[k].min && params[k] <= info->params[k].max)) return true;
    return false;
}

static sdm_status make_exact(fit_maps *m, const double *params, bool derivatives, sdm_error *err)
{
    const sdm_exact_opts o = {
        .n_threads = m->n_threads, .cancelled = m->cancelled, .user = m->user};
    const sdm_instance *shape = m->source->shape;
    if (derivatives)
        return sdm_exact_shape_jacobian(shape, params, &o, &m->grid, m->values, m->jacobian, NULL,
                                        err);
    return sdm_exact_shape_map(shape, params, &o, &m->grid, m->values, NULL, err);
}

// always with derivatives: such maps change smoothly with the parameters
static sdm_status make_by_network(fit_maps *m, const double *params, sdm_error *err)
{
    const sdm_generate_opts o = {.policy = SDM_RANGE_REFUSE, .n_threads = m->n_threads};
    return sdm_generate_jacobian(m->source->model, params, &o, m->values, m->jacobian, NULL, err);
}

sdm_status sdm_fit_maps_at(fit_maps *m, const double *params, bool derivatives, sdm_error *err)
{
    if (m->cancelled && m->cancelled(m->user))
        return sdm_fail(err, SDM_E_CANCELLED, "fit stopped on request");
    const double from = sdm_clock();
    const bool outside = !m->exact && m->source->policy == SDM_RANGE_EXACT &&
                         outside_of_network(sdm_model_get_info(m->source->model), params);
    const bool exact = m->exact || outside;
    const sdm_status s =
        exact ? make_exact(m, params, derivatives, err) : make_by_network(m, params, err);
    *(exact ? &m->n_exact : &m->n_network) += 1;
    *(exact ? &m->seconds_exact : &m->seconds_network) += sdm_clock() - from;
    m->n_outside += outside;
    for (size_t v = 0; v < m->n_voxels && !s; v++) m->distance[v] = (double)m->values[v];
    return s;
}

/* (1 + s0^2/2 Laplacian) f at voxel v = (i, j, k): f through a Gaussian of sd s0, to first order.
   It makes the drawn edge that of the curved surface seen through s0, not of its tangent plane. The
   border repeats. */
static double smoothed(const sdm_grid *g, const float *f, size_t v, const int64_t index[3],
                       double s0)
{
    const size_t step[3] = {1, (size_t)g->n[0], (size_t)g->n[0] * (size_t)g->n[1]};
    double sum = (double)f[v];
    for (int a = 0; a < 3; a++) {
        const double w = 0.5 * (s0 / g->spacing[a]) * (s0 / g->spacing[a]);
        const double before = (double)(index[a] > 0 ? f[v - step[a]] : f[v]);
        const double after = (double)(index[a] + 1 < g->n[a] ? f[v + step[a]] : f[v]);
        sum += w * (before + after - 2 * (double)f[v]);
    }
    return sum;
}

// sd of a Gaussian beyond which nothing of it is left in a double
#define FAR 8.0

// the edge of sd s0 and, where wanted, its derivatives, packed
static void draw_row(const fit_maps *m, int64_t row)
{
    const sdm_grid *g = &m->grid;
    const double s0 = m->least_blur, scale = 0.39894228040143268 / s0; // 1 / (s0 sqrt(2 pi))
    int64_t index[3] = {0, row % g->n[1], row / g->n[1]};
    for (index[0] = 0; index[0] < g->n[0]; index[0]++) {
        const size_t v = (size_t)(row * g->n[0] + index[0]);
        double *f = m->packed + v * m->n_fields;
        const double x = smoothed(g, m->values, v, index, s0) / s0;
        f[0] = fabs(x) < FAR ? 0.5 * erfc(x * 0.70710678118654752) : x < 0;
        if (m->n_fields == 1) continue;
        const double slope = fabs(x) < FAR ? -scale * exp(-0.5 * x * x) : 0;
        for (size_t k = 0; k < m->n_params; k++)
            f[1 + k] =
                slope == 0 ? 0 : slope * smoothed(g, m->jacobian + k * m->n_voxels, v, index, s0);
        f[1 + m->n_params] = 0;
    }
}

static void pack_row(const fit_maps *m, int64_t row)
{
    for (int64_t i = 0; i < m->grid.n[0]; i++) {
        const size_t v = (size_t)(row * m->grid.n[0] + i);
        double *f = m->packed + v * m->n_fields;
        f[0] = m->distance[v];
        for (size_t k = 1; k < m->n_fields; k++)
            f[k] = (double)m->jacobian[(k - 1) * m->n_voxels + v];
    }
}

void sdm_fit_maps_pack(fit_maps *m, double blur, bool derivatives)
{
    const int64_t rows = m->grid.n[1] * m->grid.n[2];
    const int n_threads = sdm_threads(m->n_threads);
    (void)n_threads; // without OpenMP
    m->n_fields = fields_of(m, derivatives);
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (int64_t row = 0; row < rows; row++) {
        if (m->share)
            draw_row(m, row);
        else
            pack_row(m, row);
    }
    const double drawn = m->share ? m->least_blur : 0,
                 variance = fmax(blur * blur - drawn * drawn, 0);
    sdm_fit_blur(&m->grid, m->n_fields, variance, m->share, n_threads, &m->packed, &m->spare);
    if (m->share && derivatives)
        sdm_fit_laplacian(&m->grid, m->n_fields, blur, n_threads, m->packed);
}
