/* Test images with known truth: what a CT scanner would see of a shape in a given pose.

   The share of every tissue in a voxel (partial volume) comes from the exact distance; the shares
   give mean and texture; a Gaussian point spread blurs; noise is added: image = G * (sum of share_k
   mean_k) + sqrt(G * (sum of share_k sd_k^2)) xi + noise eta with the tissues k = inside, outside,
   air, the point spread G (over the voxel's box) and random fields xi, eta of mean 0 and
   variance 1. */
#ifndef SDM_PHANTOM_H
#define SDM_PHANTOM_H

#include <stdbool.h>
#include <stdint.h>

#include "sdm/grid.h"
#include "sdm/pose.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Values of one tissue, in the unit of the image (HU): mean, and standard deviation of its texture.
 */
typedef struct sdm_tissue {
    double mean, sd;
} sdm_tissue;

/* sdm_phantom_defaults() fills it. */
typedef struct sdm_phantom_opts {
    sdm_tissue inside, outside; /* of the shape's surface: fluid and bone */
    sdm_tissue air;             /* in the air cells */
    double air_share;    /* air cells: probability, 0 .. 1, that a cube of a lattice of air_mm holds
                            one; 0: none */
    double air_mm;       /* diameter of an air cell, a ball, mm */
    double air_clear_mm; /* no air inside the surface and nearer to it than this, mm */
    double blur[3]; /* sd of the point spread along the axes of the grid, mm; at most 64 voxels */
    double texture_mm;     /* xi: white noise smoothed with a Gaussian of this sd, mm; at most 64
                              voxels; 0: white */
    double noise;          /* sd of the noise */
    bool noise_is_blurred; /* eta: white noise smoothed as `blur` says; false: white */
    int supersampling;     /* 1 .. 16 sub-voxels along the shortest edge of a voxel, more along the
                              longer ones */
    uint64_t seed;         /* of the random fields and the air cells */
    int n_threads;         /* 0: the OpenMP default; the same bits for every value */
    bool (*cancelled)(void *user); /* asked now and then by any thread; true stops with
                                      SDM_E_CANCELLED; may be NULL */
    void *user;
} sdm_phantom_opts;

/* As in cone-beam CT of the inner ear: fluid 40, bone 1300, air -880 HU, of sd 170, 270 and 150 HU
   with the noise of 150 HU; blur of 0.15 mm; no air cells. */
SDM_API sdm_phantom_opts sdm_phantom_defaults(void);

/* values[nz][ny][nx] = the image, label[nz][ny][nx] = 1 where the signed distance at the voxel's
   centre is negative, else 0; one of the two may be NULL. The shape at p[n_params] (NULL: its
   defaults) lies in the world at `pose` (NULL: identity); opts may be NULL. Air cells and
   everything beyond the grid that the point spread reaches are those of the world: a part of a grid
   shows the part of the image, but for the random fields, which are numbered by voxel.
   Deterministic in the arguments. SDM_E_ARG names the option, SDM_E_RANGE the parameter; errors of
   sdm_instance_mesh() and sdm_exact_create(). [any thread] */
SDM_API sdm_status sdm_phantom_make(const sdm_instance *shape, const double *p,
                                    const sdm_pose *pose, const sdm_phantom_opts *opts,
                                    const sdm_grid *grid, float *values, uint8_t *label,
                                    sdm_error *err);

/* p[n_params], each uniform in its range. [any thread] */
SDM_API void sdm_phantom_random_params(const sdm_instance *shape, uint64_t seed, double *p);

/* A turn about a random axis by an angle uniform in 0 .. max_angle (rad) and a translation uniform
   in the ball of max_mm. [any thread] */
SDM_API sdm_pose sdm_phantom_random_pose(double max_angle, double max_mm, uint64_t seed);

#ifdef __cplusplus
}
#endif
#endif
