/* How well a model holds volumes: errors of distances alone do not tell. */
#pragma once

#include "trainer.h"

/* Errors over the volume of the mesh, on a few held-out shapes that lie within the grid: root mean
   square, and the largest. NaN: no shape lies within the grid, or not measured. */
typedef struct volume_check {
    double map, map_max; /* of the volume of the model's map, sdm_map_volume() */
    /* of the volume inside the surface of this map, as `generate` writes it to a file (.stl): it
       cuts edges, so it mostly encloses too little */
    double surface, surface_max;
} volume_check;

/* Measures m. [t->n_threads threads; the same bits for any number] */
sdm_status trainer_volume_check(const trainer *t, const sdm_model *m, volume_check *out,
                                sdm_error *err);

/* Sets *out to figures that are not known. */
void trainer_volumes_unknown(volume_check *out);

/* *error = the relative error (root mean square) of differences of volumes of exact maps over
   `step` to either side along parameter k, compared with those of the meshes, on up to
   `shapes` held-out shapes; NaN: the grid cuts all, or the parameter changes no volume.
   [t->n_threads threads; the same bits for any number] */
sdm_status trainer_derivative_of_voxels(const trainer *t, size_t k, double step, size_t shapes,
                                        double *error, sdm_error *err);
