/* One thread's bench for making exact maps. */
#ifndef SDM_PRODUCE_H
#define SDM_PRODUCE_H

#include "dataset.h"

typedef struct workbench {
    sdm_mesh mesh;
    float *map;     /* map order */
    float *blocked; /* block order */
} workbench;

sdm_status workbench_create(workbench *w, const dataset *d, sdm_error *err);
void workbench_dispose(workbench *w);

/* The exact map at p in block order, mm; one thread. */
sdm_status workbench_map(workbench *w, const dataset *d, const double *p, float *blocked,
                         sdm_error *err);

/* The same as 16-bit integers with a scale. */
sdm_status workbench_packed_map(workbench *w, const dataset *d, const double *p, int16_t *packed,
                                float *scale, sdm_error *err);

#endif
