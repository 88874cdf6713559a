/* Choice of the samples, and evaluation of the field at them. */
#include "samples.h"

#include <math.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"
#include "sdm/internal/vec3.h"

void sdm_fit_to_shape(const fit_state *s, const double x[3], double y[3])
{
    const double d[3] = {x[0] - s->translation[0], x[1] - s->translation[1],
                         x[2] - s->translation[2]};
    for (int k = 0; k < 3; k++)
        y[k] = s->rotation[k] * d[0] + s->rotation[3 + k] * d[1] + s->rotation[6 + k] * d[2];
}

void sdm_fit_to_world(const fit_state *s, const double y[3], double x[3])
{
    for (int k = 0; k < 3; k++)
        x[k] = s->rotation[3 * k] * y[0] + s->rotation[3 * k + 1] * y[1] +
               s->rotation[3 * k + 2] * y[2] + s->translation[k];
}

double sdm_fit_field_at(const fit_field *f, const fit_state *s, const double x[3])
{
    double y[3];
    sdm_fit_to_shape(s, x, y);
    return sdm_fit_interpolate(f, y);
}

double sdm_fit_maps_at(const fit_maps *maps, const fit_state *s, const double x[3])
{
    const fit_field f = sdm_fit_maps_field(maps);
    double y[3];
    if (!fit_maps_direct(maps)) {
        const double here = sdm_fit_field_at(&f, s, x);
        return maps->between ? 0.5 * (here + sdm_fit_maps_at(maps->between, s, x)) : here;
    }
    sdm_fit_to_shape(s, x, y);
    return sdm_exact_point(maps->surface.engine, y, NULL, NULL, NULL);
}

// whether the region contains x (world, mm)
static bool region_contains(const sdm_fit_opts *o, const fit_region *r, const double x[3])
{
    for (int k = 0; o->use_box && k < 3; k++)
        if (!(x[k] >= o->box_min[k] && x[k] <= o->box_max[k])) return false;
    if (!(sqrt(v3_dist2(x, r->centre)) <= r->radius)) return false;
    if (!r->follow) return true;
    const fit_field f = sdm_fit_maps_distances(r->follow);
    return sdm_fit_field_at(&f, r->state, x) <= r->margin;
}

// range of voxel indices whose centres may lie in the ball: from[3], inclusive and a multiple of
// the stride, to[3], exclusive
static void region_voxels(const sdm_grid *g, const fit_region *r, size_t stride, int64_t from[3],
                          int64_t to[3])
{
    double c[3];
    sdm_grid_index(g, r->centre, c);
    for (int a = 0; a < 3; a++) {
        const double w = r->radius / g->spacing[a], n = (double)g->n[a];
        from[a] = (int64_t)fmin(fmax(floor(c[a] - w), 0), n);
        to[a] = (int64_t)fmin(fmax(ceil(c[a] + w) + 1, 0), n);
        from[a] -= from[a] % (int64_t)stride;
    }
}

static sdm_status samples_grow(fit_samples *samples, sdm_error *err)
{
    const size_t was = samples->capacity, now = was ? 2 * was : 65536;
    sdm_status s = sdm_grow((void **)&samples->world, 3 * was, 3 * now, sizeof *samples->world,
                            "voxels of the fit", err);
    if (!s)
        s = sdm_grow((void **)&samples->value, was, now, sizeof *samples->value,
                     "voxels of the fit", err);
    if (!s)
        s = sdm_grow((void **)&samples->voxel, was, now, sizeof *samples->voxel,
                     "voxels of the fit", err);
    if (!s)
        s = sdm_grow((void **)&samples->field, was, now, sizeof *samples->field,
                     "voxels of the fit", err);
    if (!s)
        s = sdm_grow((void **)&samples->row, was, now, sizeof *samples->row, "voxels of the fit",
                     err);
    if (!s) samples->capacity = now;
    return s;
}

static sdm_status samples_append(fit_samples *samples, const double x[3], float value, size_t voxel,
                                 bool *changed, sdm_error *err)
{
    if (samples->n == samples->capacity) {
        const sdm_status s = samples_grow(samples, err);
        if (s) return s;
    }
    const size_t i = samples->n++;
    if (samples->voxel[i] != voxel) *changed = true;
    for (size_t k = 0; k < 3; k++) samples->world[3 * i + k] = x[k];
    samples->value[i] = value;
    samples->voxel[i] = voxel;
    return SDM_OK;
}

static sdm_status voxels_choose(const sdm_fit_target *target, const sdm_fit_opts *opts,
                                const fit_region *region, size_t stride, fit_samples *samples,
                                bool *changed, sdm_error *err)
{
    const sdm_grid *g = &target->grid;
    const int64_t step = (int64_t)stride;
    int64_t from[3], to[3];
    region_voxels(g, region, stride, from, to);
    for (int64_t k = from[2]; k < to[2]; k += step)
        for (int64_t j = from[1]; j < to[1]; j += step)
            for (int64_t i = from[0]; i < to[0]; i += step) {
                // voxels whose centre lies in the region
                double x[3];
                sdm_grid_world(g, (const double[3]){(double)i, (double)j, (double)k}, x);
                if (!region_contains(opts, region, x)) continue;
                // NaN voxels are skipped, infinite ones are an error
                const size_t voxel = (size_t)((k * g->n[1] + j) * g->n[0] + i);
                const float value = target->values[voxel];
                if (isnan(value)) {
                    samples->n_nan++;
                    continue;
                }
                if (isinf(value))
                    return sdm_fail(err, SDM_E_FORMAT,
                                    "voxel (%lld, %lld, %lld) of the image is infinite; NaN marks "
                                    "voxels without a value",
                                    (long long)i, (long long)j, (long long)k);
                // stop when the limit is exceeded
                const sdm_status s = samples_append(samples, x, value, voxel, changed, err);
                if (s || (region->max_samples && samples->n > region->max_samples)) return s;
            }
    return SDM_OK;
}

sdm_status sdm_fit_samples_choose(const sdm_fit_target *target, const sdm_fit_opts *opts,
                                  const fit_region *region, size_t stride, fit_samples *samples,
                                  bool *changed, sdm_error *err)
{
    const size_t before = samples->n;
    bool differ = false;
    sdm_status s = SDM_OK;
    samples->n = samples->n_nan = 0;
    samples->beyond.on = opts->open_end && target->kind != SDM_FIT_POINTS;
    samples->beyond.margin = opts->margin;
    if (target->kind == SDM_FIT_POINTS) {
        for (size_t i = 0; i < target->n_points && !s; i += stride)
            s = samples_append(samples, target->points + 3 * i, 0, i, &differ, err);
    } else {
        s = voxels_choose(target, opts, region, stride, samples, &differ, err);
    }
    *changed = differ || samples->n != before;
    if (*changed) samples->n_outside = 0;
    return s;
}

void sdm_fit_samples_dispose(fit_samples *s)
{
    sdm_free(s->world);
    sdm_free(s->value);
    sdm_free(s->voxel);
    sdm_free(s->field);
    sdm_free(s->row);
    sdm_free(s->log_weight);
    sdm_free(s->jacobian);
    sdm_free(s->beyond.weight);
    sdm_free(s->beyond.row);
    sdm_free(s->beyond.jacobian);
    *s = (fit_samples){0};
}

// One row of the Jacobian: derivatives of the field at x of the world, with its gradient in the
// shape's frame and its derivatives by parameters and blur. With y = R^T (x - t), rotating the
// shape by a small w about the world's axes moves y by -R^T (w x (x - t)).
void sdm_fit_jacobian_row(const fit_maps *maps, const fit_state *state, const double x[3],
                          const double gradient[3], const double *rest, float *columns)
{
    double g[3]; // in the world
    for (int k = 0; k < 3; k++)
        g[k] = state->rotation[3 * k] * gradient[0] + state->rotation[3 * k + 1] * gradient[1] +
               state->rotation[3 * k + 2] * gradient[2];
    const double d[3] = {x[0] - state->translation[0], x[1] - state->translation[1],
                         x[2] - state->translation[2]};
    const size_t n = maps->n_params;
    for (size_t k = 0; k < n; k++) columns[k] = (float)rest[k];
    // derivative by rotation: g x (x - t); by translation: -g
    float *turn = columns + fit_at_rotation(n), *shift = columns + fit_at_translation(n);
    for (int k = 0; k < 3; k++) {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        turn[k] = (float)(g[a] * d[b] - g[b] * d[a]);
        shift[k] = (float)-g[k];
    }
    columns[fit_at_blur(n)] = maps->share ? (float)rest[n] : 0;
}

// numbers the samples of the band and allocates their rows, a quarter more than needed
static sdm_status rows_number(fit_samples *samples, const fit_maps *maps,
                              const fit_observation *obs, sdm_error *err)
{
    samples->n_band = 0;
    for (size_t i = 0; i < samples->n; i++)
        samples->row[i] = sdm_fit_in_band(obs, samples->field[i]) ? samples->n_band++ : SIZE_MAX;
    samples->n_columns = fit_columns(maps->n_params);
    if (samples->n_band <= samples->band_capacity) return SDM_OK;
    const size_t room = samples->n_band + samples->n_band / 4;
    size_t count;
    sdm_status s = sdm_mul(room, samples->n_columns, &count, err);
    sdm_free(samples->jacobian);
    samples->jacobian = NULL;
    samples->band_capacity = 0;
    if (!s) s = SDM_ALLOC(&samples->jacobian, count, "derivatives at the voxels", err);
    if (!s) samples->band_capacity = room;
    return s;
}

// the distances from the surface, and their derivatives
static sdm_status evaluate_direct(fit_samples *samples, const fit_maps *maps,
                                  const fit_observation *obs, const fit_state *state,
                                  sdm_error *err)
{
    const size_t n = samples->n;
    double *memory = NULL;
    uint32_t *triangle = NULL;
    sdm_status s = SDM_ALLOC(&memory, 9 * n, "distances of the points", err);
    if (!s) s = SDM_ALLOC(&triangle, n, "distances of the points", err);
    if (!s) {
        double *x = memory;
        const sdm_exact_at at = {.distance = samples->field,
                                 .gradient = memory + 3 * n,
                                 .closest = memory + 6 * n,
                                 .triangle = triangle};
        for (size_t i = 0; i < n; i++) sdm_fit_to_shape(state, samples->world + 3 * i, x + 3 * i);
        s = sdm_exact_points(maps->surface.engine, x, n, &at, err);
        if (!s) s = rows_number(samples, maps, obs, err);
        for (size_t i = 0; i < n && !s; i++) {
            double by[FIT_PARAMS_MAX];
            if (samples->row[i] == SIZE_MAX) continue;
            sdm_shape_surface_derivatives(&maps->surface, triangle[i], at.closest + 3 * i,
                                          at.gradient + 3 * i, by);
            sdm_fit_jacobian_row(maps, state, samples->world + 3 * i, at.gradient + 3 * i, by,
                                 samples->jacobian + samples->row[i] * samples->n_columns);
        }
    }
    sdm_free(memory);
    sdm_free(triangle);
    return s;
}

// gradient[3] and rest[n_fields - 1]: the means of those given and those of the maps between
static void add_between(const fit_maps *between, const double y[3], double gradient[3],
                        double *rest)
{
    const fit_field f = sdm_fit_maps_field(between);
    double g[3], r[FIT_FIELDS_MAX];
    (void)sdm_fit_interpolate_all(&f, y, g, r);
    for (int k = 0; k < 3; k++) gradient[k] = 0.5 * (gradient[k] + g[k]);
    for (size_t k = 0; k + 1 < f.n_fields; k++) rest[k] = 0.5 * (rest[k] + r[k]);
}

sdm_status sdm_fit_samples_evaluate(fit_samples *samples, const fit_maps *maps,
                                    const fit_observation *obs, const fit_state *state,
                                    sdm_error *err)
{
    if (fit_maps_direct(maps)) return evaluate_direct(samples, maps, obs, state, err);
    // field of every sample
    const fit_field f = sdm_fit_maps_field(maps);
    const int n_threads = sdm_threads(maps->n_threads);
    (void)n_threads; // unused without OpenMP
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = samples->n * slice / FIT_SLICES; i < samples->n * (slice + 1) / FIT_SLICES;
             i++)
            samples->field[i] = sdm_fit_maps_at(maps, state, samples->world + 3 * i);
    // derivatives, one row for each sample of the band
    const sdm_status s = rows_number(samples, maps, obs, err);
    if (s) return s;
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = samples->n * slice / FIT_SLICES; i < samples->n * (slice + 1) / FIT_SLICES;
             i++) {
            double y[3], gradient[3], rest[FIT_FIELDS_MAX];
            if (samples->row[i] == SIZE_MAX) continue;
            sdm_fit_to_shape(state, samples->world + 3 * i, y);
            (void)sdm_fit_interpolate_all(&f, y, gradient, rest);
            if (maps->between) add_between(maps->between, y, gradient, rest);
            sdm_fit_jacobian_row(maps, state, samples->world + 3 * i, gradient, rest,
                                 samples->jacobian + samples->row[i] * samples->n_columns);
        }
    return SDM_OK;
}
