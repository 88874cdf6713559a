/* Phantoms: test images of a shape with known parameters and pose, as a CT scanner would show it.

   The exact distance gives the share of every tissue in a voxel (partial volume). The shares
   determine mean and texture of the image. A Gaussian point spread G (over the box of the voxel)
   blurs it, and noise is added:

       image = G * (sum of share_k mean_k) + sqrt(G * (sum of share_k sd_k^2)) xi + noise eta

   with the tissues k = inside, outside, air, and random fields xi (texture) and eta (noise) of mean
   0 and variance 1; G * is the convolution with G. */
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

/* Image values of one tissue (HU): mean, and standard deviation of its texture. */
typedef struct sdm_tissue {
    double mean, sd;
} sdm_tissue;

/* Start from sdm_phantom_defaults(). */
typedef struct sdm_phantom_opts {
    /* Inside and outside of the shape's surface; by default fluid and bone. */
    sdm_tissue inside, outside;
    sdm_tissue air; /* tissue in the air cells */
    /* Probability, 0 .. 1, that a cube of edge air_mm of a lattice contains an air cell; 0: none.
     */
    double air_share;
    double air_mm; /* diameter of an air cell, which is a ball, mm */
    /* Least distance of the air from the surface, mm. There is no air inside the surface. */
    double air_clear_mm;
    /* Standard deviation of the point spread along the grid axes, mm; at most 64 voxels. */
    double blur[3];
    /* The texture xi is white noise smoothed by a Gaussian of this standard deviation, mm, at most
       64 voxels; 0: not smoothed. */
    double texture_mm;
    double noise; /* standard deviation of the noise, HU */
    /* true: the noise eta is white noise smoothed by a Gaussian of width `blur`; false: white
       noise. */
    bool noise_is_blurred;
    /* Number of sub-voxels along the shortest edge of a voxel, 1 .. 16; longer edges have more. */
    int supersampling;
    uint64_t seed; /* seed of the random fields and the air cells */
    int n_threads; /* 0: the OpenMP default; the same bits for every value */
    /* Called now and then by any thread; true stops with SDM_E_CANCELLED. May be NULL. */
    bool (*cancelled)(void *user);
    void *user;
} sdm_phantom_opts;

/* Typical of cone-beam CT of the inner ear: fluid 40, bone 1300, air -880 HU, with standard
   deviations of 170, 270 and 150 HU including a noise of 150 HU; blur 0.15 mm; no air cells. */
SDM_API sdm_phantom_opts sdm_phantom_defaults(void);

/* values[nz][ny][nx] = the image; label[nz][ny][nx] = 1 where the signed distance at the voxel's
   centre is negative, else 0. One of the two may be NULL. The shape at p[n_params] (NULL: its
   defaults) is placed in the world by `pose` (NULL: identity); opts may be NULL.
   Shape, air cells and blur depend on world positions only, so a part of a grid shows the same part
   of the image. The random fields are numbered by voxel and differ. The same arguments give the
   same image. SDM_E_ARG names the option, SDM_E_RANGE the parameter; also the errors of
   sdm_instance_mesh() and sdm_exact_create(). [any thread] */
SDM_API sdm_status sdm_phantom_make(const sdm_instance *shape, const double *p,
                                    const sdm_pose *pose, const sdm_phantom_opts *opts,
                                    const sdm_grid *grid, float *values, uint8_t *label,
                                    sdm_error *err);

/* p[n_params] = random parameters, each from its distribution
   (sdm_instance_distributions()). [any thread] */
SDM_API void sdm_phantom_random_params(const sdm_instance *shape, uint64_t seed, double *p);

/* A random pose: rotation about a random axis by an angle uniform in 0 .. max_angle (rad), and a
   translation uniform in the ball of radius max_mm. [any thread] */
SDM_API sdm_pose sdm_phantom_random_pose(double max_angle, double max_mm, uint64_t seed);

#ifdef __cplusplus
}
#endif
#endif
