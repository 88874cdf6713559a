/* Choice of the voxels, and sampling at them. */
#include "samples.h"

#include <math.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"

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
    return sdm_fit_sample(f, y);
}

static double distance_between(const double a[3], const double b[3])
{
    const double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

static void voxel_at(const sdm_grid *g, size_t voxel, double x[3])
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
        voxel_at(&maps->grid, v, x);
        n++;
        for (int k = 0; k < 3; k++) sum[k] += x[k];
    }
    if (!(n > 0))
        return sdm_fail(
            err, SDM_E_QUALITY,
            "no voxel of the map lies inside the shape: its grid is too coarse or lies elsewhere");
    *out = (fit_extent){.volume = n * maps->grid.spacing[0] * maps->grid.spacing[1] *
                                  maps->grid.spacing[2]};
    for (int k = 0; k < 3; k++) out->centre[k] = sum[k] / n;
    for (size_t v = 0; v < maps->n_voxels; v++) {
        if (!(maps->distance[v] < 0)) continue;
        voxel_at(&maps->grid, v, x);
        out->reach = fmax(out->reach, distance_between(x, out->centre));
    }
    return SDM_OK;
}

double sdm_fit_inradius(const fit_maps *maps)
{
    double least = 0;
    for (size_t v = 0; v < maps->n_voxels; v++) least = fmin(least, maps->distance[v]);
    return -least;
}

static bool in_region(const sdm_fit_opts *o, const fit_region *r, const double x[3])
{
    for (int k = 0; o->use_box && k < 3; k++)
        if (!(x[k] >= o->box_min[k] && x[k] <= o->box_max[k])) return false;
    if (!(distance_between(x, r->centre) <= r->radius)) return false;
    if (!r->follow) return true;
    const fit_field f = {
        .grid = &r->follow->grid, .packed = r->follow->distance, .n_fields = 1, .distance = true};
    return sdm_fit_field_at(&f, r->state, x) <= r->margin;
}

// voxels of the grid around the ball: first and one past the last along each axis, multiples of the
// stride
static void range_of(const sdm_grid *g, const fit_region *r, size_t stride, int64_t from[3],
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

static sdm_status grow(fit_sites *s, sdm_error *err)
{
    const size_t was = s->capacity, now = was ? 2 * was : 65536;
    sdm_status status =
        sdm_grow((void **)&s->world, 3 * was, 3 * now, sizeof *s->world, "voxels of the fit", err);
    if (!status)
        status = sdm_grow((void **)&s->value, was, now, sizeof *s->value, "voxels of the fit", err);
    if (!status)
        status = sdm_grow((void **)&s->voxel, was, now, sizeof *s->voxel, "voxels of the fit", err);
    if (!status)
        status = sdm_grow((void **)&s->field, was, now, sizeof *s->field, "voxels of the fit", err);
    if (!status)
        status = sdm_grow((void **)&s->slot, was, now, sizeof *s->slot, "voxels of the fit", err);
    if (!status) s->capacity = now;
    return status;
}

static sdm_status put(fit_sites *s, const double x[3], float value, size_t voxel, bool *changed,
                      sdm_error *err)
{
    if (s->n == s->capacity) {
        const sdm_status status = grow(s, err);
        if (status) return status;
    }
    const size_t i = s->n++;
    if (s->voxel[i] != voxel) *changed = true;
    for (size_t k = 0; k < 3; k++) s->world[3 * i + k] = x[k];
    s->value[i] = value;
    s->voxel[i] = voxel;
    return SDM_OK;
}

static sdm_status choose_voxels(const sdm_fit_target *target, const sdm_fit_opts *opts,
                                const fit_region *region, size_t stride, fit_sites *s,
                                bool *changed, sdm_error *err)
{
    const sdm_grid *g = &target->grid;
    const int64_t step = (int64_t)stride;
    int64_t from[3], to[3];
    range_of(g, region, stride, from, to);
    for (int64_t k = from[2]; k < to[2]; k += step)
        for (int64_t j = from[1]; j < to[1]; j += step)
            for (int64_t i = from[0]; i < to[0]; i += step) {
                double x[3];
                sdm_grid_world(g, (const double[3]){(double)i, (double)j, (double)k}, x);
                if (!in_region(opts, region, x)) continue;
                const size_t voxel = (size_t)((k * g->n[1] + j) * g->n[0] + i);
                const float value = target->values[voxel];
                if (isnan(value)) {
                    s->n_nan++;
                    continue;
                }
                if (isinf(value))
                    return sdm_fail(err, SDM_E_FORMAT,
                                    "voxel (%lld, %lld, %lld) of the image is infinite; NaN marks "
                                    "voxels without a value",
                                    (long long)i, (long long)j, (long long)k);
                const sdm_status status = put(s, x, value, voxel, changed, err);
                if (status || (region->most && s->n > region->most)) return status;
            }
    return SDM_OK;
}

sdm_status sdm_fit_sites_choose(const sdm_fit_target *target, const sdm_fit_opts *opts,
                                const fit_region *region, size_t stride, fit_sites *sites,
                                bool *changed, sdm_error *err)
{
    const size_t before = sites->n;
    bool differ = false;
    sdm_status s = SDM_OK;
    sites->n = sites->n_nan = 0;
    if (target->kind == SDM_FIT_POINTS) {
        for (size_t i = 0; i < target->n_points && !s; i++)
            s = put(sites, target->points + 3 * i, 0, i, &differ, err);
    } else {
        s = choose_voxels(target, opts, region, stride, sites, &differ, err);
    }
    *changed = differ || sites->n != before;
    if (*changed) sites->n_outside = 0;
    return s;
}

void sdm_fit_sites_dispose(fit_sites *s)
{
    sdm_free(s->world);
    sdm_free(s->value);
    sdm_free(s->voxel);
    sdm_free(s->field);
    sdm_free(s->slot);
    sdm_free(s->place);
    sdm_free(s->columns);
    *s = (fit_sites){0};
}

// derivatives of the field at x: y = R^T (x - t), and turning the shape by w about the world's axes
// moves y by -R^T (w x (x - t))
static void fill_columns(const fit_maps *maps, const fit_field *f, const fit_state *state,
                         const double x[3], float *columns)
{
    double y[3], gradient[3], g[3];
    double rest[FIT_FIELDS_MAX];
    sdm_fit_to_shape(state, x, y);
    (void)sdm_fit_sample_all(f, y, gradient, rest);
    for (int k = 0; k < 3; k++)
        g[k] = state->rotation[3 * k] * gradient[0] + state->rotation[3 * k + 1] * gradient[1] +
               state->rotation[3 * k + 2] * gradient[2];
    const double d[3] = {x[0] - state->translation[0], x[1] - state->translation[1],
                         x[2] - state->translation[2]};
    const size_t n = maps->n_params;
    for (size_t k = 0; k < n; k++) columns[k] = (float)rest[k];
    float *turn = columns + fit_at_rotation(n), *shift = columns + fit_at_translation(n);
    for (int k = 0; k < 3; k++) {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        turn[k] = (float)(g[a] * d[b] - g[b] * d[a]);
        shift[k] = (float)-g[k];
    }
    columns[fit_at_blur(n)] = maps->share ? (float)rest[n] : 0;
}

fit_field sdm_fit_field(const fit_maps *maps)
{
    return (fit_field){.grid = &maps->grid,
                       .packed = maps->packed,
                       .n_fields = maps->n_fields,
                       .distance = !maps->share};
}

sdm_status sdm_fit_sites_sample(fit_sites *s, const fit_maps *maps, const fit_laws *laws,
                                const fit_state *state, sdm_error *err)
{
    const fit_field f = sdm_fit_field(maps);
    const int n_threads = sdm_threads(maps->n_threads);
    (void)n_threads; // without OpenMP
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = s->n * slice / FIT_SLICES; i < s->n * (slice + 1) / FIT_SLICES; i++)
            s->field[i] = sdm_fit_field_at(&f, state, s->world + 3 * i);
    s->n_near = 0;
    for (size_t i = 0; i < s->n; i++)
        s->slot[i] = sdm_fit_near(laws, s->field[i]) ? s->n_near++ : SIZE_MAX;
    s->n_columns = fit_columns(maps->n_params);
    if (s->n_near > s->near_capacity) {
        const size_t room = s->n_near + s->n_near / 4;
        size_t count;
        sdm_status status = sdm_mul(room, s->n_columns, &count, err);
        sdm_free(s->columns);
        s->columns = NULL;
        s->near_capacity = 0;
        if (!status) status = SDM_ALLOC(&s->columns, count, "derivatives at the voxels", err);
        if (status) return status;
        s->near_capacity = room;
    }
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = s->n * slice / FIT_SLICES; i < s->n * (slice + 1) / FIT_SLICES; i++)
            if (s->slot[i] != SIZE_MAX)
                fill_columns(maps, &f, state, s->world + 3 * i,
                             s->columns + s->slot[i] * s->n_columns);
    return SDM_OK;
}
