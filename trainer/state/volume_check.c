/* Compares volumes of the model's maps and of their surfaces with those of the meshes. */
#include "volume_check.h"

#include <math.h>

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

/* *volume = the volume of the mesh of held-out shape i; 0: the grid cuts it. */
static sdm_status mesh_volume(const trainer *t, size_t i, double *volume, sdm_error *err)
{
    const dataset *d = &t->data;
    sdm_exact *e = NULL;
    double area;
    const sdm_status s =
        trainer_exact_within(d, d->holdout_params + i * d->n_params, t->n_threads, &e, err);
    *volume = 0;
    if (e) sdm_mesh_sums(sdm_exact_surface(e), volume, &area);
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
