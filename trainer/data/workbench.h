/* Computes exact maps, one at a time. A workbench is the memory that one thread needs; maps can be
 * packed to 16 bits. */
#pragma once

#include "dataset.h"

typedef struct workbench {
    sdm_mesh mesh;
    float *map;     /* [n_voxels], map order */
    float *blocked; /* [n_voxels], block order */
} workbench;

/* Call trainer_workbench_dispose() also after an error. */
sdm_status trainer_workbench_create(workbench *w, const dataset *d, sdm_error *err);
void trainer_workbench_dispose(workbench *w);

/* blocked[n_voxels] = exact map of the shape at p[n_params] in block order, mm. One thread. */
sdm_status trainer_workbench_map(workbench *w, const dataset *d, const double *p, float *blocked,
                                 sdm_error *err);

/* As trainer_workbench_map(), but with 16-bit integers: distance = *scale * packed[i], mm. */
sdm_status trainer_workbench_packed_map(workbench *w, const dataset *d, const double *p,
                                        int16_t *packed, float *scale, sdm_error *err);
