/* Coarse maps: every second voxel of the grid along each axis. */
#include "coarse_maps.h"

#include <math.h>

#include "fit/solver/objective.h"

// edge of a coarse voxel over that of a fine one
enum { COARSER = 2 };

// the voxels of *g with even indices, and one more where its last one is between them
static sdm_grid coarse_grid(const sdm_grid *g)
{
    sdm_grid coarse = *g;
    for (int a = 0; a < 3; a++) {
        coarse.n[a] = g->n[a] / COARSER + 1;
        coarse.spacing[a] = COARSER * g->spacing[a];
    }
    return coarse;
}

sdm_status sdm_fit_coarse_maps_begin(fit_problem *p, fit_maps *fine, sdm_error *err)
{
    const bool narrow = !(sdm_fit_field_blur(p) >= COARSER * fit_longest_edge(&p->maps.grid));
    *fine = p->maps;
    if (!fine->exact || fit_maps_direct(fine) || narrow) return SDM_OK;
    const sdm_fit_source source = {.shape = fine->source->shape, .grid = coarse_grid(&fine->grid)};
    fit_maps coarse;
    const sdm_status s = sdm_fit_maps_create(&source, fine->share, p->opts, &coarse, err);
    if (s) return s;
    coarse.source = fine->source;
    coarse.points = fine->points;
    p->maps = coarse;
    p->maps_params[0] = p->maps_blur = NAN;
    return SDM_OK;
}

void sdm_fit_coarse_maps_end(fit_problem *p, fit_maps *fine)
{
    if (p->maps.values == fine->values) {
        *fine = p->maps;
    } else {
        fine->n_exact += p->maps.n_exact;
        fine->seconds_exact += p->maps.seconds_exact;
        sdm_fit_maps_dispose(&p->maps);
        p->maps_params[0] = p->maps_blur = NAN;
    }
    p->maps = *fine;
}
