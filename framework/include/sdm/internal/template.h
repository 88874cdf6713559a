/* The `template` network: exact distance maps of the parts of a shape at its default parameters
   (the templates) are carried along with the parts as the parameters change.

     g       = functions phi(x)       numbers that vary smoothly with the parameters: the frames of
                                      all parts and the amplitudes of their warps; x, phi as in
                                      sdm/internal/pod.h
     T_c     = T_parent . R_c         the frame of part c moves it from its place in the default
                                      shape to its place in the shape; R_c is relative to the parent
     U_c(y)  = sum over modes m of a_m mode_m(y)           the warp, cubic B-splines on a lattice
                                      (free-form deformation; Rueckert et al. 1999)
     x       = T_c(y + U_c(y))        carries a point y of the template to the point x of the map
     d_c(x)  = d0_c(y) / |grad_x d0_c(y(x))| + r(y)
     map     = min over the parts c of d_c
   d_c is interpolated between the corners of a block of 4 x 4 x 4 voxels if the part is rigid and
   the block lies beyond the lattice `near`, or if the part has a warp and the block lies 4 voxels
   from its surface; between 3 and 4 voxels the interpolation is blended in.

   d0_c is the exact map of part c at the default parameters. The quotient is the distance to first
   order (Taubin 1994): it is exact on the surface, with its gradient. The correction r is a `pod`
   network on a coarse grid in the frame of the template; only a network of one part may have it.
   The minimum is the exact distance of the union outside of it; inside it is a bound,
   abs(minimum) <= abs(distance).
   Carrying a template along is registration-based model reduction (Taddei 2020; Iollo and Taddei
   2022) and a deep implicit template (Zheng et al. 2021) with the plug-in's vertices in place of
   learned correspondences.

   Letters: P parameters, F terms of phi, N numbers in g, M modes of a warp. Lengths in mm. */
#pragma once

#include "sdm/internal/pod.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_TEMPLATE_MAX_PARTS 32
#define SDM_TEMPLATE_MAX_MODES 256
/* Nodes of a lattice: along an axis, and all together (indices of four floats have 32 bits). */
#define SDM_TEMPLATE_MAX_SIDE 4096
#define SDM_TEMPLATE_MAX_NODES (1 << 28)

/* The relative frame R_c of a part. With the pivot p, which lies still in the parent's frame but
   for the translation t, and the rotation matrix R of the rotation vector w:
     none    R_c(x) = x
     rigid   R_c(x) = R (x - p) + p + t                 numbers: w[3], t[3]
     affine  R_c(x) = R (I + S) (x - p) + p + t         numbers: w[3], t[3], S[6] = the symmetric
                                                        stretch xx, yy, zz, yz, xz, xy */
typedef enum sdm_template_frame {
    SDM_FRAME_NONE = 0,
    SDM_FRAME_RIGID = 1,
    SDM_FRAME_AFFINE = 2
} sdm_template_frame;

/* Number of numbers of a frame in g. */
static inline size_t sdm_template_frame_numbers(sdm_template_frame f)
{
    return f == SDM_FRAME_RIGID ? 6 : f == SDM_FRAME_AFFINE ? 12 : 0;
}

/* A regular lattice of points along the axes of the world: origin + spacing * (i, j, k). */
typedef struct sdm_lattice {
    uint32_t n[3];
    double origin[3], spacing;
} sdm_lattice;

static inline size_t sdm_lattice_count(const sdm_lattice *l)
{
    return (size_t)l->n[0] * l->n[1] * l->n[2];
}

/* A part. All arrays belong to the caller. */
typedef struct sdm_template_part {
    int parent;               /* an earlier part, or -1: the world */
    sdm_template_frame frame; /* type of its frame */
    double pivot[3];          /* p, default shape */
    size_t numbers;           /* index in g of the first number of its frame */
    size_t n_modes;           /* M; 0: no warp */
    size_t amplitudes;        /* index in g of the first amplitude a_m */
    sdm_lattice warp;         /* control points of the B-splines, at least 4 along each axis */
    const float *modes;       /* [M][nz][ny][nx][3] control displacements, mm */
    /* The template on two lattices: `near` around the surface, and the coarser `far` wherever the
       map may need it. Each node has the distance and its gradient, [nz][ny][nx][4]. */
    sdm_lattice near, far;
    const float *near_nodes, *far_nodes;
    /* Largest amount (mm) by which the distance falls below its tangent at a point outside of the
       part within sag_reach (mm): d0(y + v) >= d0(y) + grad d0(y) . v - sag for d0(y) > 0 and
       abs(v) <= sag_reach; 0 for convex parts. far_sag: the same for d0(y) >= far_from (mm). */
    double sag, sag_reach, far_sag, far_from;
} sdm_template_part;

/* Content of a model file. */
typedef struct sdm_template_spec {
    const sdm_model_info *info;
    size_t n_parts, n_numbers, n_terms;
    size_t degree;           /* total degree of phi; n_terms = sdm_poly_count(P, degree) */
    const double *functions; /* [N][F] */
    const sdm_template_part *parts;
    /* The model file of the `pod` network r; NULL: none. Its grid lies in the template's frame. */
    const uint8_t *correction;
    size_t correction_size;
} sdm_template_spec;

/* *bytes = a model file of *size bytes, to be freed with sdm_free(). SDM_E_NOMEM. [any thread] */
sdm_status sdm_template_build(const sdm_template_spec *spec, uint8_t **bytes, size_t *size,
                              sdm_error *err);

/* x[n][3] = the points to which the first part carries the template's points y[n][3] at the
   parameters params[P] of a template model. SDM_E_NOMEM. [any thread] */
sdm_status sdm_template_carry(const sdm_model *m, const double *params, const double *y, size_t n,
                              double *x, sdm_error *err);

#ifdef __cplusplus
}
#endif
