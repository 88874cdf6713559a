/* How far a shape reaches over the ranges of its parameters, how thin it is, and a grid for it. */
#pragma once

#include "sdm/grid.h"
#include "sdm/mesh.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* low[3] and high[3] = lowest and highest coordinates (mm) of `shape` over several
 * parameter vectors: the middle of the ranges; their corners, all of them for at most 6 parameters,
 * else 64 random ones; and `samples` random vectors (Sobol' points, which follow the distributions
 * that the shape states; 0 is allowed). From the farthest of these shapes a short search moves the
 * uniformly distributed parameters. In random corners a normally distributed parameter has a random
 * value instead of the end of its range, because many of them at their ends make a shape that never
 * occurs.
 * range[n_params]: lowest and highest value of each parameter, within those of the shape; NULL: the
 * shape's own. The result depends on the arguments only. Other shapes of the ranges may reach a
 * little further. SDM_E_ARG, SDM_E_RANGE (a range is empty or wider than the shape's), and the
 * errors of sdm_instance_mesh(). [any thread] */
sdm_status sdm_shape_box(const sdm_instance *shape, const double (*range)[2], size_t samples,
                         uint64_t seed, double low[3], double high[3], sdm_error *err);

/* *mm = thickness of the thinnest part (sdm_part.thick of part_audit.h) of `samples` random shapes
 * (Sobol' points, as above); NaN: none is known. range as above. SDM_E_ARG, SDM_E_RANGE, and the
 * errors of sdm_instance_mesh() and sdm_mesh_audit(). [any thread] */
sdm_status sdm_shape_thickness(const sdm_instance *shape, const double (*range)[2], size_t samples,
                               uint64_t seed, double *mm, sdm_error *err);

/* The same of the shapes that a survey (shape_survey.h) looks at: the default values, the corners
 * of the ranges, and the first `samples` random ones of the distributions (NULL: those of the
 * shape); of large meshes as many as sdm_survey_samples(). Shapes whose mesh fails, or two walls of
 * which lie on each other, do not count. n_threads: 0: the default of OpenMP; the result is the
 * same for any number. SDM_E_RANGE, SDM_E_NOMEM. */
sdm_status sdm_shape_thickness_ends(const sdm_instance *shape, const double (*range)[2],
                                    const sdm_distribution *distribution, size_t samples,
                                    uint64_t seed, int n_threads, double *mm, sdm_error *err);

/* Grids that follow the thinnest part of a shape have so many voxels across it. */
#define SDM_GRID_THIN_VOXELS 3

/* Fits to good data need so many voxels across the thinnest part, or across the largest ball in the
 * shape, and voxels of at most SDM_GRID_FIT_DATA times the standard deviation of the blur of an
 * image, or the voxels of labels. A spacing that is advised or promised for them is this part of
 * the largest that passes: the fitted shape may be thinner than those that were measured. */
#define SDM_GRID_FIT_VOXELS 4
#define SDM_GRID_FIT_DATA 1.5
#define SDM_GRID_FIT_ADVISED 0.8

/* Returns how far the point x (mm) lies beyond the outer voxel centres of the grid along the axis
 * where it is farthest, in mm; 0: within them. beyond[axis][side], unless NULL, is raised to the
 * distance below the first voxel (side 0) and above the last one (side 1). [any thread] */
double sdm_grid_beyond(const sdm_grid *g, const double x[3], double beyond[3][2]);

/* The same of the vertices of the triangles of the mesh. [any thread] */
double sdm_grid_mesh_beyond(const sdm_grid *g, const sdm_mesh *m, double beyond[3][2]);

/* along[axis] = length of the grid over that of the grid which holds the box low[3] .. high[3] (mm)
 * with a margin of SDM_GRID_MARGIN voxels of the same spacing. Returns their product: how many
 * times as many voxels the grid has; NaN: the box is empty. [any thread] */
double sdm_grid_surplus(const sdm_grid *g, const double low[3], const double high[3],
                        double along[3]);

/* The largest spacing of the grid, mm. */
static inline double sdm_grid_coarsest(const sdm_grid *g)
{
    double most = g->spacing[0];
    for (int i = 1; i < 3; i++)
        if (g->spacing[i] > most) most = g->spacing[i];
    return most;
}

/* Voxels between the box and the boundary of the grid. */
#define SDM_GRID_MARGIN 3

/* *out = a grid around the box low[3] .. high[3] (mm) with a margin of SDM_GRID_MARGIN voxels.
 * spacing[3] (mm), or NULL: the same along all axes, such that the longest edge of the grid has at
 * most `voxels` (at least 2 SDM_GRID_MARGIN + 2) voxels, rounded up to two digits. The origin is
 * rounded to a tenth of the spacing or finer. SDM_E_ARG: the box is empty or a point, or the grid
 * is too large. [any thread] */
sdm_status sdm_grid_around(const double low[3], const double high[3], int voxels,
                           const double spacing[3], sdm_grid *out, sdm_error *err);

/* Moves the origin of a grid of sdm_grid_around() along each axis by at most half a voxel, where
 * flat faces of the shapes lie on or near a plane of voxel centres: there rounding alone decides
 * which voxels are inside. The faces that count are perpendicular to the axis and have the same
 * place in `samples` random shapes (Sobol' points, as above). Of eight places, an eighth of a
 * voxel apart, the origin takes the one with the largest sum over these faces of the area times the
 * distance from the closest plane (a quarter of a voxel is enough). The size of the grid stays, so
 * that its margin is 2.4 voxels or more. Without such faces, or if they have less than a hundredth
 * of the area, nothing moves. range as above. SDM_E_ARG, SDM_E_RANGE, SDM_E_NOMEM, and the errors
 * of sdm_instance_mesh(). [any thread] */
sdm_status sdm_grid_avoid_faces(const sdm_instance *shape, const double (*range)[2], size_t samples,
                                uint64_t seed, sdm_grid *g, sdm_error *err);

/* Flat faces that lie on planes of voxel centres: these voxels have the distance 0, so that
 * rounding alone decides whether they are inside. */
typedef struct sdm_face_hits {
    bool axis[3]; /* axis[a]: flat faces perpendicular to axis a of the grid lie on such planes */
    /* part of the volume in the half voxels behind these faces: by so much counts of voxels may be
     * off; 0: there are none */
    double share;
    sdm_grid moved; /* the grid, moved by up to half a voxel along these axes to avoid the faces */
} sdm_face_hits;

/* A smaller share is not worth a message. */
#define SDM_FACE_HITS_MIN 0.01

/* *out = the hits of one mesh. SDM_E_ARG, SDM_E_NOMEM. [any thread] */
sdm_status sdm_grid_face_hits(const sdm_mesh *m, const sdm_grid *g, sdm_face_hits *out,
                              sdm_error *err);

/* *out = the hits of faces that have the same place in `samples` random shapes, as above. [any
 * thread] */
sdm_status sdm_grid_family_hits(const sdm_instance *shape, const double (*range)[2], size_t samples,
                                uint64_t seed, const sdm_grid *g, sdm_face_hits *out,
                                sdm_error *err);

#ifdef __cplusplus
}
#endif
