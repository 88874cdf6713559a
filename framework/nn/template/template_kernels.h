/* The inner loops of the `template` network, one table for each instruction set. Each of
   template_kernels_*.c compiles the same source, template_kernels_simd.h, without contraction of
   a * b + c, so that all instruction sets give the same bits. A row is a run of voxels along x. */
#pragma once

#include <stddef.h>
#include <stdint.h>

/* Rows have room for a multiple of SDM_TEMPLATE_LANES voxels, and for that many more. */
#define SDM_TEMPLATE_LANES 8

/* A lattice of nodes of a template map, fewer than 2^30. */
typedef struct template_level {
    const float *nodes;     /* [nz][ny][nx][4]: distance, gradient */
    int32_t n[3];           /* at least 2 along each axis */
    float half;             /* half of the spacing, mm */
    float scale, offset[3]; /* index in this lattice = scale * (index in `near`) + offset */
} template_level;

/* A map on the lattice of the correction. */
typedef struct template_correction {
    const float *map; /* [nz][ny][nx], mm */
    int32_t n[3];
    float scale, offset[3]; /* as in template_level */
} template_correction;

/* Weights that expand values at nodes, `step` voxels apart, into voxels: cubic B-splines, or
 * linear. */
typedef struct template_expansion {
    int step;                           /* 2 .. SDM_TEMPLATE_LANES */
    float cubic[4][SDM_TEMPLATE_LANES]; /* weights of four nodes for each voxel of a cell */
    float linear[SDM_TEMPLATE_LANES];   /* weight of the second of two nodes */
} template_expansion;

typedef struct template_table {
    /* c[0 .. n_c - 1][cells * step] = combinations of nodes: the first 3 by cubic B-splines of
       points[cells + 3][4], the others linear in metric[cells + 3][8] (n_c = 3 or 9). Up to
       SDM_TEMPLATE_LANES - 1 more elements of each row are written. */
    void (*expand)(const template_expansion *e, size_t cells, const float *points,
                   const float *metric, size_t n_c, float *const *c);
    /* f[n] = distance and g[3][n] = gradient of the template at the indices u[3][n] in the lattice
       `near`, interpolated in `l`; indices outside the lattice are clamped. */
    void (*lookup)(const template_level *l, size_t n, const float *const *u, float *f,
                   float *const *g);
    /* out[n] = f / sqrt(q), q = (g^T G g + e t) / (g^T g + e), t = trace(G) / 3, e = 1e-3, with
       G = (xx, yy, zz, yz, xz, xy) in metric[6][n]. out may be f. */
    void (*normalise)(size_t n, const float *f, const float *const *g, const float *const *metric,
                      float *out);
    /* out[n] += the map at the indices u[3][n], trilinear. */
    void (*correct)(const template_correction *c, size_t n, const float *const *u, float *out);
    /* value[4][4][4] = a function in a block of 4 x 4 x 4 voxels, cubic interpolation (Hermite)
       from its value and slopes by blocks at the eight corners, the voxels (0, 0, 0) .. (4, 4, 4):
       corner[x][4], and the same `line` floats further along y and `plane` floats along z. */
    void (*block)(const float *corner, size_t line, size_t plane, float *value);
} template_table;

extern const template_table sdm_template_generic;
#if defined(__x86_64__)
extern const template_table sdm_template_avx2, sdm_template_avx512;
#endif
