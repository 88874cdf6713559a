/* Compares maps of a store with those that this program makes. */
#include <math.h>
#include <string.h>

#include "data/workbench.h"
#include "sdm/memory.h"

/* Compares map i of the store. */
static sdm_status compare_map(const sdm_map_store *store, const dataset *d, workbench *w, size_t i,
                              float *map, sdm_error *err)
{
    bool found = true;
    const sdm_stored_map m = sdm_map_store_map(store, i);
    sdm_status s = sdm_map_store_read(store, m.p, map, &found, err);
    if (!s) s = trainer_workbench_exact(w, d, m.p, err);
    if (s || !memcmp(map, w->exact, d->n_voxels * sizeof *map)) return s;
    double largest = 0;
    for (size_t v = 0; v < d->n_voxels; v++) {
        const double by = fabs((double)map[v] - (double)w->exact[v]);
        if (by > largest) largest = by;
    }
    return sdm_fail(err, SDM_E_CONFIG,
                    "%s: map %zu differs from the one that this program makes by up to %.2g mm: "
                    "another version of sdmgen (%s there, " SDM_VERSION_TEXT
                    " here) or of the shape made it: make the dataset again in another folder",
                    m.file, m.number, largest, m.version);
}

sdm_status sdm_map_store_compare(const sdm_map_store *store, const sdm_config *config,
                                 const sdm_instance *shape, sdm_error *err)
{
    enum { MAPS = 4 };
    const size_t all = sdm_map_store_maps(store), n = all < MAPS ? all : MAPS;
    const dataset d = {
        .shape = shape, .grid = &config->grid, .n_voxels = sdm_grid_count(&config->grid)};
    workbench w = {0};
    float *map = NULL;
    sdm_status s = trainer_workbench_create(&w, &d, err);
    if (!s) s = SDM_ALLOC(&map, d.n_voxels, "map", err);
    for (size_t i = 0; i < n && !s; i++) s = compare_map(store, &d, &w, i * all / n, map, err);
    sdm_free(map);
    trainer_workbench_dispose(&w);
    return s;
}
