/* Computes exact maps, one at a time. A workbench is the memory that one thread needs; maps can be
 * packed to 16 bits. */
#pragma once

#include "dataset.h"

typedef struct workbench {
    sdm_mesh mesh;
    float *exact;   /* exact map, map order */
    bool inside;    /* a voxel of it is inside the shape */
    float *map;     /* [n_voxels] target, map order; NULL: the exact map is the target */
    float *blocked; /* [n_voxels], block order */
} workbench;

/* Call trainer_workbench_dispose() also after an error. */
sdm_status trainer_workbench_create(workbench *w, const dataset *d, sdm_error *err);
void trainer_workbench_dispose(workbench *w);

/* Sets w->exact and w->inside: the exact map of the shape at p[n_params], mm, from d->store where
   it has the map. One thread. */
sdm_status trainer_workbench_exact(workbench *w, const dataset *d, const double *p, sdm_error *err);

/* blocked[n_voxels] = the map that the network learns (the exact map, or d->target) at p[n_params]
   in block order, mm. One thread. */
sdm_status trainer_workbench_map(workbench *w, const dataset *d, const double *p, float *blocked,
                                 sdm_error *err);

/* As trainer_workbench_map(), but with 16-bit integers: distance = *scale * packed[i], mm. */
sdm_status trainer_workbench_packed_map(workbench *w, const dataset *d, const double *p,
                                        int16_t *packed, float *scale, sdm_error *err);
