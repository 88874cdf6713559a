/* Computes exact maps, one at a time, or takes them from the store. */
#include "workbench.h"

#include <math.h>

#include "sdm/memory.h"

sdm_status trainer_workbench_create(workbench *w, const dataset *d, sdm_error *err)
{
    sdm_status s = SDM_ALLOC(&w->exact, sdm_grid_count(d->grid), "exact map", err);
    if (!s && d->target.make) s = SDM_ALLOC(&w->map, d->n_voxels, "exact map", err);
    return s ? s : SDM_ALLOC(&w->blocked, d->n_voxels, "exact map", err);
}

void trainer_workbench_dispose(workbench *w)
{
    sdm_mesh_dispose(&w->mesh);
    sdm_free(w->exact);
    sdm_free(w->map);
    sdm_free(w->blocked);
    *w = (workbench){0};
}

/* Computes the map that w->exact is to hold. */
static sdm_status make_exact(workbench *w, const dataset *d, const double *p, sdm_error *err)
{
    sdm_status s = sdm_instance_mesh(d->shape, p, &w->mesh, err);
    if (s) return s;
    const sdm_exact_opts opts = {.n_threads = 1};
    sdm_exact *exact = NULL;
    s = sdm_exact_create(&w->mesh, &opts, &exact, err);
    if (!s) s = sdm_exact_map(exact, d->grid, w->exact, err);
    sdm_exact_free(exact);
    return s ? sdm_fail_in(err, s, "shape '%s'", sdm_instance_shape(d->shape)->name) : SDM_OK;
}

sdm_status trainer_workbench_exact(workbench *w, const dataset *d, const double *p, sdm_error *err)
{
    bool found = false;
    sdm_status s = SDM_OK;
    if (d->store) s = sdm_map_store_read(d->store, p, w->exact, &found, err);
    if (!s && !found) s = make_exact(w, d, p, err);
    if (s) return s;
    w->inside = false;
    for (size_t i = 0, n = sdm_grid_count(d->grid); i < n; i++) w->inside |= w->exact[i] < 0;
    return SDM_OK;
}

sdm_status trainer_workbench_map(workbench *w, const dataset *d, const double *p, float *blocked,
                                 sdm_error *err)
{
    sdm_status s = trainer_workbench_exact(w, d, p, err);
    if (!s && d->target.make) s = d->target.make(d->target.user, p, w->exact, w->map, err);
    if (s) return s;
    if (d->target.make)
        sdm_pod_gather(d->target.grid, d->blocks, d->n_blocks, w->map, blocked);
    else
        sdm_pod_gather(d->grid, d->blocks, d->n_blocks, w->exact, blocked);
    return SDM_OK;
}

sdm_status trainer_workbench_packed_map(workbench *w, const dataset *d, const double *p,
                                        int16_t *packed, float *scale, sdm_error *err)
{
    const sdm_status s = trainer_workbench_map(w, d, p, w->blocked, err);
    if (s) return s;
    float largest = 0;
    for (size_t i = 0; i < d->n_voxels; i++) {
        const float v = fabsf(w->blocked[i]);
        largest = v > largest ? v : largest;
    }
    if (!(largest > 0)) largest = 1;
    *scale = largest / 32767.0f;
    const float inverse = 32767.0f / largest;
    // adding and subtracting 1.5 * 2^23 rounds to the nearest integer
    for (size_t i = 0; i < d->n_voxels; i++)
        packed[i] = (int16_t)(int32_t)((w->blocked[i] * inverse + 12582912.0f) - 12582912.0f);
    return SDM_OK;
}
