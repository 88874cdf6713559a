/* How well the voxels of the grid can hold the shape, whatever the network: exact maps are compared
   with the exact surface between the voxels. */
#pragma once

#include "dataset.h"
#include "sdm/exact.h"

typedef struct surface_check {
    /* Root mean square of exact maps, interpolated trilinearly at points of the exact surface,
       where the distance is 0, mm. */
    double rms_mm;
    /* Fraction of the surface where no ball with the radius of a voxel fits into the shape: there
       it is thinner than two voxels, or has an edge or a corner. */
    double thin;
    /* Thickness of the thinnest part of the compared shapes (part_audit.h), mm; NaN: not known. */
    double thickness_mm;
    /* Fraction of all held-out shapes with vertices beyond the outer voxel centres: their surfaces
       end open at the border of the grid. */
    double cut;
    /* Fraction of the compared shapes with parts that are inside out and that the engine does not
       turn: they take away from the parts that they overlap. */
    double inside_out;
    /* Fraction of the compared shapes with open or badly oriented edges. */
    double open;
} surface_check;

/* Does the mesh reach beyond the outer voxel centres of the grid? */
bool trainer_is_cut(const sdm_mesh *m, const sdm_grid *g);

/* *out = the exact engine of the shape at p[n_params], with n_threads threads; NULL: the grid cuts
   this shape. Free it with sdm_exact_free(). [any thread] */
sdm_status trainer_exact_within(const dataset *d, const double *p, int n_threads, sdm_exact **out,
                                sdm_error *err);

/* *param = the first parameter of which the mesh has other numbers of vertices or other triangles
   at the ends of its range, with the other parameters of the first held-out shape; n_params: there
   is none. Errors of sdm_instance_mesh(). */
sdm_status trainer_find_triangles_param(const dataset *d, size_t *param, sdm_error *err);

/* Compares a few held-out shapes at random points of their surfaces that lie inside the grid;
   rms_mm and thin are NaN if there is no such point. `cut` is of all held-out shapes. [n_threads
   threads; the same bits for any number] */
sdm_status trainer_surface_check(const dataset *d, int n_threads, surface_check *out,
                                 sdm_error *err);
