/* Compares volumes of maps and of their surfaces with those of the meshes. */
#include "volume_check.h"

#include <math.h>
#include <string.h>

#include "data/surface_check.h"
#include "sdm/internal/model_threads.h"
#include "sdm/internal/part_audit.h"
#include "sdm/isosurface.h"
#include "sdm/map.h"
#include "sdm/memory.h"

/* Shapes whose volumes are compared. */
enum { SHAPES = 20 };

/* Relative errors of one kind of volume. */
typedef struct volume_sums {
    double square, largest;
} volume_sums;

static void add(volume_sums *sums, double volume, double exact)
{
    const double error = volume / exact - 1;
    sums->square += error * error;
    sums->largest = fmax(sums->largest, fabs(error));
}

/* *e, *volume = the exact engine at p, which the caller frees, and the volume of its mesh; NULL and
 * 0: the grid cuts the mesh. */
static sdm_status open_mesh(const trainer *t, const double *p, sdm_exact **e, double *volume,
                            sdm_error *err)
{
    double area;
    *e = NULL;
    *volume = 0;
    const sdm_status s = trainer_exact_within(&t->data, p, t->n_threads, e, err);
    if (*e) sdm_mesh_sums(sdm_exact_surface(*e), volume, &area);
    return s;
}

/* *volume = the volume of the mesh of held-out shape i; 0: the grid cuts it. */
static sdm_status mesh_volume(const trainer *t, size_t i, double *volume, sdm_error *err)
{
    sdm_exact *e;
    const sdm_status s =
        open_mesh(t, t->data.holdout_params + i * t->data.n_params, &e, volume, err);
    sdm_exact_free(e);
    return s;
}

/* Adds up the errors of held-out shape i, whose mesh has the volume `exact`. */
static sdm_status check_shape(const trainer *t, const sdm_model *m, size_t i, double exact,
                              float *values, void *scratch, volume_sums *map, volume_sums *surface,
                              sdm_error *err)
{
    const dataset *d = &t->data;
    sdm_mesh mesh = {0};
    double volume = 0, area;
    sdm_model_forward_threads(m, d->holdout_params + i * d->n_params, 1, values, scratch,
                              t->n_threads);
    sdm_status s = sdm_map_volume(d->grid, values, t->n_threads, &volume, err);
    if (!s) add(map, volume, exact);
    if (!s) s = sdm_isosurface(d->grid, values, 0, &mesh, NULL, err);
    if (!s) {
        sdm_mesh_sums(&mesh, &volume, &area);
        add(surface, volume, exact);
    }
    sdm_mesh_dispose(&mesh);
    return s;
}

void trainer_volumes_unknown(volume_check *out) { *out = (volume_check){NAN, NAN, NAN, NAN}; }

sdm_status trainer_volume_check(const trainer *t, const sdm_model *m, volume_check *out,
                                sdm_error *err)
{
    const dataset *d = &t->data;
    volume_sums map = {0}, surface = {0};
    float *values = NULL;
    void *scratch = NULL;
    size_t n = 0;
    trainer_volumes_unknown(out);
    sdm_status s = SDM_ALLOC(&values, sdm_grid_count(d->grid), "volumes", err);
    if (!s)
        s = sdm_alloc(&scratch, sdm_model_scratch_bytes_threads(m, 1, t->n_threads), 1, "volumes",
                      err);
    for (size_t i = 0; i < d->n_holdout && i < 4 * SHAPES && n < SHAPES && !s; i++) {
        double exact;
        s = mesh_volume(t, i, &exact, err);
        if (s || !(exact > 0)) continue;
        s = check_shape(t, m, i, exact, values, scratch, &map, &surface, err);
        n++;
    }
    sdm_free(scratch);
    sdm_free(values);
    if (!s && n)
        *out = (volume_check){sqrt(map.square / (double)n), map.largest,
                              sqrt(surface.square / (double)n), surface.largest};
    return s;
}

/* *map, *mesh = the volumes of the exact map and of the mesh at p, mm^3; *cut: the grid cuts it. */
static sdm_status volumes_at(const trainer *t, const double *p, float *values, double *map,
                             double *mesh, bool *cut, sdm_error *err)
{
    const dataset *d = &t->data;
    sdm_exact *e;
    sdm_status s = open_mesh(t, p, &e, mesh, err);
    *cut = !e;
    if (!s && e) s = sdm_exact_map(e, d->grid, values, err);
    if (!s && e) s = sdm_map_volume(d->grid, values, t->n_threads, map, err);
    sdm_exact_free(e);
    return s;
}

/* Differences of both volumes over `step` to either side of held-out shape i along parameter k.
 * *cut: the grid cuts one of these shapes. */
static sdm_status differences(const trainer *t, size_t i, size_t k, double step, float *values,
                              double *map, double *mesh, bool *cut, sdm_error *err)
{
    const dataset *d = &t->data;
    double p[SDM_POD_MAX_PARAMS], maps[2], meshes[2];
    sdm_status s = SDM_OK;
    memcpy(p, d->holdout_params + i * d->n_params, d->n_params * sizeof *p);
    const double at = fmin(fmax(p[k], d->min[k] + step), d->max[k] - step);
    *cut = false;
    for (int side = 0; side < 2 && !s && !*cut; side++) {
        p[k] = fmin(fmax(at + (side ? step : -step), d->min[k]), d->max[k]);
        s = volumes_at(t, p, values, &maps[side], &meshes[side], cut, err);
    }
    if (s || *cut) return s;
    *map = maps[1] - maps[0], *mesh = meshes[1] - meshes[0];
    return SDM_OK;
}

sdm_status trainer_derivative_of_voxels(const trainer *t, size_t k, double step, size_t shapes,
                                        double *error, sdm_error *err)
{
    const dataset *d = &t->data;
    double off = 0, size = 0;
    float *values = NULL;
    size_t n = 0;
    *error = NAN;
    sdm_status s = SDM_ALLOC(&values, sdm_grid_count(d->grid), "derivatives", err);
    for (size_t i = 0; i < d->n_holdout && i < 4 * shapes && n < shapes && !s; i++) {
        double map, mesh;
        bool cut;
        s = differences(t, i, k, step, values, &map, &mesh, &cut, err);
        if (s || cut) continue;
        off += (map - mesh) * (map - mesh), size += mesh * mesh, n++;
    }
    sdm_free(values);
    if (!s && size > 0) *error = sqrt(off / size);
    return s;
}
