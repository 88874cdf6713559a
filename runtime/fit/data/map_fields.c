/* Maps of the shape and their fields.

   The share at a voxel is a = G * [distance < 0], the inside convolved with a Gaussian point spread
   G of sd s. It is computed in three steps. (1) At each voxel of the map, which has the spacing h,
   a Gaussian tail function of the distance gives an edge of sd s0 = h / 2. (2) The discrete
   Gaussian (Lindeberg 1990) smooths the edge: its variance is exact on every grid, and its
   derivative by the variance is half the discrete Laplacian. (3) Between the voxels cubic B-splines
   interpolate, which adds h^2 / 3 of variance along an axis. The discrete Gaussian therefore has
   the variance s^2 - s0^2 - h^2 / 3; where that is negative, it sharpens. The share has continuous
   second derivatives. Its values are used as the B-spline coefficients, without the inverse filter
   of interpolation (Unser, Aldroubi and Eden 1993): so it is exactly 0 or 1 a few voxels from the
   surface and does not ring. */
#include "map_fields.h"

#include <math.h>
#include <string.h>

#include "blur.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"
#include "sdm/internal/vec3.h"

static size_t field_count(const fit_maps *m, bool derivatives)
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
    // grid and parameters of the network or of the exact maps
    if (source->model) {
        m->grid = sdm_model_get_info(source->model)->grid;
        m->n_params = sdm_model_get_info(source->model)->n_params;
    } else {
        m->grid = source->grid;
        (void)sdm_instance_params(source->shape, &m->n_params);
    }
    m->n_voxels = sdm_grid_count(&m->grid);
    m->min_blur = 0.5 * fit_longest_edge(&m->grid);
    // memory for map, derivatives and fields
    size_t jacobian, fields;
    sdm_status s = sdm_mul(m->n_voxels, m->n_params, &jacobian, err);
    if (!s) s = sdm_mul(m->n_voxels, field_count(m, true), &fields, err);
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
    sdm_shape_surface_dispose(&m->surface);
    sdm_free(m->values);
    sdm_free(m->jacobian);
    sdm_free(m->distance);
    sdm_free(m->packed);
    sdm_free(m->spare);
    sdm_fit_maps_between_end(m);
    *m = (fit_maps){0};
}

void sdm_fit_maps_between_end(fit_maps *m)
{
    if (m->between) sdm_fit_maps_dispose(m->between);
    sdm_free(m->between);
    m->between = NULL;
}

sdm_status sdm_fit_maps_between_begin(fit_maps *m, const sdm_fit_opts *opts, sdm_error *err)
{
    const double half[3] = {0.5, 0.5, 0.5};
    sdm_status s = SDM_ALLOC(&m->between, 1, "maps", err);
    if (!s) s = sdm_fit_maps_create(m->source, m->share, opts, m->between, err);
    if (s) {
        sdm_free(m->between);
        m->between = NULL;
        return s;
    }
    sdm_grid_world(&m->grid, half, m->between->grid.origin);
    return SDM_OK;
}

static bool outside_network_range(const sdm_model_info *info, const double *params)
{
    for (size_t k = 0; k < info->n_params; k++)
        if (!(params[k] >= info->params[k].min && params[k] <= info->params[k].max)) return true;
    return false;
}

static sdm_status map_make_exact(fit_maps *m, const double *params, bool derivatives,
                                 sdm_error *err)
{
    const sdm_exact_opts o = {
        .n_threads = m->n_threads, .cancelled = m->cancelled, .user = m->user};
    const sdm_instance *shape = m->source->shape;
    m->has_voxels = false;
    if (fit_maps_direct(m))
        return sdm_shape_surface_make(shape, params, derivatives, &o, &m->surface, err);
    if (derivatives)
        return sdm_exact_shape_jacobian(shape, params, &o, &m->grid, m->values, m->jacobian, NULL,
                                        err);
    return sdm_exact_shape_map(shape, params, &o, &m->grid, m->values, NULL, err);
}

// Derivatives are computed even where they are not needed: only sdm_generate_jacobian() gives a map
// that changes smoothly with the parameters.
static sdm_status map_make_network(fit_maps *m, const double *params, sdm_error *err)
{
    const sdm_generate_opts o = {.policy = SDM_RANGE_REFUSE, .n_threads = m->n_threads};
    return sdm_generate_jacobian(m->source->model, params, &o, m->values, m->jacobian, NULL, err);
}

sdm_status sdm_fit_maps_make(fit_maps *m, const double *params, bool derivatives, sdm_error *err)
{
    if (m->cancelled && m->cancelled(m->user))
        return sdm_fail(err, SDM_E_CANCELLED, "fit stopped on request");
    const double from = sdm_clock();
    // network or exact engine
    const bool outside = !m->exact && m->source->policy == SDM_RANGE_EXACT &&
                         outside_network_range(sdm_model_get_info(m->source->model), params);
    const bool exact = m->exact || outside;
    const sdm_status s =
        exact ? map_make_exact(m, params, derivatives, err) : map_make_network(m, params, err);
    m->made_exact = exact;
    memcpy(m->params, params, m->n_params * sizeof *params);
    *(exact ? &m->n_exact : &m->n_network) += 1;
    *(exact ? &m->seconds_exact : &m->seconds_network) += sdm_clock() - from;
    m->n_outside += outside;
    for (size_t v = 0; v < m->n_voxels && !s && !fit_maps_direct(m); v++)
        m->distance[v] = (double)m->values[v];
    if (s || !m->between) return s;
    return sdm_fit_maps_between_make(m, params, derivatives, err);
}

// to = from half a voxel farther along an axis, by cubic convolution (Keys 1981); values of the
// border continue beyond it. step: between neighbours along the axis, of which there are n
static void move_by_half(const float *from, size_t n_voxels, size_t step, size_t n, float *to)
{
    for (size_t v = 0; v < n_voxels; v++) {
        const size_t i = v / step % n, before = i > 0 ? step : 0, next = i + 1 < n ? step : 0,
                     last = i + 2 < n ? 2 * step : next;
        to[v] = (float)(0.5625 * ((double)from[v] + (double)from[v + next]) -
                        0.0625 * ((double)from[v - before] + (double)from[v + last]));
    }
}

// to[n_voxels] = from[n_voxels] at the middle between eight voxels; scratch[n_voxels]
static void interpolate_between(const sdm_grid *g, const float *from, float *scratch, float *to)
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1], nz = (size_t)g->n[2], n = nx * ny * nz;
    move_by_half(from, n, 1, nx, to);
    move_by_half(to, n, nx, ny, scratch);
    move_by_half(scratch, n, nx * ny, nz, to);
}

sdm_status sdm_fit_maps_between_make(fit_maps *m, const double *params, bool derivatives,
                                     sdm_error *err)
{
    fit_maps *b = m->between;
    b->exact = m->made_exact;
    if (b->exact) {
        const sdm_status s = sdm_fit_maps_make(b, params, derivatives, err);
        m->n_exact += b->n_exact;
        m->seconds_exact += b->seconds_exact;
        b->n_exact = 0;
        b->seconds_exact = 0;
        return s;
    }
    float *scratch = (float *)b->packed; // sdm_fit_maps_pack() fills it anew
    interpolate_between(&m->grid, m->values, scratch, b->values);
    for (size_t k = 0; k < m->n_params && derivatives; k++)
        interpolate_between(&m->grid, m->jacobian + k * m->n_voxels, scratch,
                            b->jacobian + k * m->n_voxels);
    for (size_t v = 0; v < m->n_voxels; v++) b->distance[v] = (double)b->values[v];
    return SDM_OK;
}

sdm_status sdm_fit_maps_voxels(fit_maps *m, sdm_error *err)
{
    const shape_surface *surface = &m->surface;
    if (!fit_maps_direct(m) || m->has_voxels) return SDM_OK;
    const double from = sdm_clock();
    const sdm_exact_layers layers = {.values = m->values};
    const sdm_status s =
        surface->velocity ? sdm_exact_map_derivative(surface->engine, &m->grid, surface->velocity,
                                                     m->n_params, &layers, m->jacobian, err)
                          : sdm_exact_map(surface->engine, &m->grid, m->values, err);
    for (size_t v = 0; v < m->n_voxels && !s; v++) m->distance[v] = (double)m->values[v];
    m->has_voxels = !s;
    m->seconds_exact += sdm_clock() - from;
    return s;
}

/* (1 + s0^2/2 Laplacian) f at voxel v, whose indices are index[3]: f convolved with a Gaussian of
   sd s0 (mm), to order s0^2. With the distance smoothed in this way, share_row() gives the blurred
   edge of the curved surface, not that of its tangent plane. Values of the border continue beyond
   it. */
static double voxel_smoothed(const sdm_grid *g, const float *f, size_t v, const int64_t index[3],
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

// number of sd beyond which the tail of a Gaussian is negligible in double precision
#define GAUSSIAN_END 8.0

// writes the share, an edge of sd s0, and if n_fields > 1 its derivatives to one row of `packed`
static void share_row(const fit_maps *m, int64_t row)
{
    const sdm_grid *g = &m->grid;
    const double s0 = m->min_blur, scale = 0.39894228040143268 / s0; // 1 / (s0 sqrt(2 pi))
    int64_t index[3] = {0, row % g->n[1], row / g->n[1]};
    for (index[0] = 0; index[0] < g->n[0]; index[0]++) {
        const size_t v = (size_t)(row * g->n[0] + index[0]);
        double *f = m->packed + v * m->n_fields;
        const double x = voxel_smoothed(g, m->values, v, index, s0) / s0;
        f[0] = fabs(x) < GAUSSIAN_END ? 0.5 * erfc(x * 0.70710678118654752) : x < 0;
        if (m->n_fields == 1) continue;
        const double slope = fabs(x) < GAUSSIAN_END ? -scale * exp(-0.5 * x * x) : 0;
        for (size_t k = 0; k < m->n_params; k++)
            f[1 + k] = slope == 0
                           ? 0
                           : slope * voxel_smoothed(g, m->jacobian + k * m->n_voxels, v, index, s0);
        f[1 + m->n_params] = 0;
    }
}

// writes the signed distance and its derivatives to one row of `packed`
static void distance_row(const fit_maps *m, int64_t row)
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
    (void)n_threads; // unused without OpenMP
    if (fit_maps_direct(m)) return;
    m->n_fields = field_count(m, derivatives);
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (int64_t row = 0; row < rows; row++) {
        if (m->share)
            share_row(m, row);
        else
            distance_row(m, row);
    }
    // variance of the blur that the edge of share_row() lacks; see the top of the file
    const double drawn = m->share ? m->min_blur : 0,
                 variance = fmax(blur * blur - drawn * drawn, 0);
    sdm_fit_blur(&m->grid, m->n_fields, variance, m->share, n_threads, &m->packed, &m->spare);
    if (m->share && derivatives)
        sdm_fit_laplacian(&m->grid, m->n_fields, blur, n_threads, m->packed);
    if (m->between) sdm_fit_maps_pack(m->between, blur, derivatives);
}

fit_field sdm_fit_maps_field(const fit_maps *maps)
{
    return (fit_field){.grid = &maps->grid,
                       .packed = maps->packed,
                       .n_fields = maps->n_fields,
                       .distance = !maps->share};
}

fit_field sdm_fit_maps_distances(const fit_maps *maps)
{
    return (fit_field){
        .grid = &maps->grid, .packed = maps->distance, .n_fields = 1, .distance = true};
}

static void voxel_centre(const sdm_grid *g, size_t voxel, double x[3])
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
    const double index[3] = {(double)(voxel % nx), (double)(voxel / nx % ny),
                             (double)(voxel / nx / ny)};
    sdm_grid_world(g, index, x);
}

sdm_status sdm_fit_extent(const fit_maps *maps, fit_extent *out, sdm_error *err)
{
    double n = 0, sum[3] = {0, 0, 0}, x[3];
    for (size_t v = 0; v < maps->n_voxels; v++) {
        if (!(maps->distance[v] < 0)) continue;
        voxel_centre(&maps->grid, v, x);
        n++;
        for (int k = 0; k < 3; k++) sum[k] += x[k];
    }
    if (!(n > 1))
        return sdm_fail(err, SDM_E_QUALITY,
                        "%s voxel of the map lies inside the shape: its voxels, %.3g mm, are too "
                        "large for the shape, or its grid lies elsewhere",
                        n > 0 ? "only one" : "no", fit_longest_edge(&maps->grid));
    *out = (fit_extent){.volume = n * maps->grid.spacing[0] * maps->grid.spacing[1] *
                                  maps->grid.spacing[2]};
    for (int k = 0; k < 3; k++) out->centre[k] = sum[k] / n;
    for (size_t v = 0; v < maps->n_voxels; v++) {
        if (!(maps->distance[v] < 0)) continue;
        voxel_centre(&maps->grid, v, x);
        out->reach = fmax(out->reach, sqrt(v3_dist2(x, out->centre)));
    }
    return SDM_OK;
}

double sdm_fit_inradius(const fit_maps *maps)
{
    double least = 0;
    for (size_t v = 0; v < maps->n_voxels; v++) least = fmin(least, maps->distance[v]);
    return -least;
}
