/* The inner loops of the `template` network, one table for each instruction set. Each of
   template_kernels_*.c compiles the same source, template_kernels_simd.h, without contraction of
   a * b + c, so that all instruction sets give the same bits. A row is an array with an element for
   each voxel. */
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

/* Weights that expand values at stations into the four voxels between two of them: cubic B-splines,
   or linear. */
typedef struct template_expansion {
    float cubic[4][4]; /* weights of four stations for each voxel */
    float linear[4];   /* weight of the second of two stations */
} template_expansion;

/* Rows of a part's distance f s + r at n points and of its derivatives: template f with the
   gradient g, factor s of the metric, correction r. by_u, df, dg, dr: by the index u; dg[a]: by
   u[a]. */
typedef struct template_slope_rows {
    float *f, *g[3], *df[3], *dg[3][3];
    float *factor, *by_u[3], *by_metric[6]; /* of s */
    float *dr[3];
} template_slope_rows;

typedef struct template_table {
    /* c[n_c][64] = combinations of stations in a block of 16 lines of four voxels: the first three
       by cubic B-splines of points[line][4 stations][4], the others linear in metric[line][2
       stations][8] (n_c = 3 or 9). stride: floats from one line to the next. */
    void (*expand)(const template_expansion *e, const float *points, const float *metric,
                   size_t stride, size_t n_c, float *const *c);
    /* out[n][4] and then out[n][8] = the points[4][n][4] and the metric[2][n][8] of neighbouring
       layers of n stations, combined for voxel `phase` between them. */
    void (*combine)(const template_expansion *e, const float *points, const float *metric, size_t n,
                    size_t phase, float *out);
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
    /* f, g, df, dg of *out: of the template at the indices u[3][n], as for `lookup`. */
    void (*lookup_slopes)(const template_level *l, size_t n, const float *const *u,
                          const template_slope_rows *out);
    /* factor, by_u, by_metric of *r from its g and dg and from metric[6][n]: the factor 1 / sqrt(q)
       of `normalise`. */
    void (*factor_slopes)(size_t n, const float *const *metric, const template_slope_rows *r);
    /* out[3][n] = the derivatives by u of the map that `correct` adds. */
    void (*correct_slopes)(const template_correction *c, size_t n, const float *const *u,
                           float *const *out);
    /* sum[64] = a[0] b[0] + ... + a[n-1] b[n-1], n > 0 rows of 64 each. */
    void (*sum_products)(size_t n, const float *const *a, const float *const *b, float *sum);
    /* How many of the 64 sums base + slope . offset[3][64] are larger than value[64]? */
    int32_t (*count_above)(float base, const float slope[3], const float *const *offset,
                           const float *value);
    /* The smallest of |value[64]|, none of which is NAN. */
    float (*least)(const float *value);
    /* value[4][4][4] = a function in a block of 4 x 4 x 4 voxels, cubic interpolation (Hermite)
       from its value and slopes by blocks at the eight corners, the voxels (0, 0, 0) .. (4, 4, 4):
       corner[x][4], and the same `line` floats further along y and `plane` floats along z. */
    void (*block)(const float *corner, size_t line, size_t plane, float *value);
    /* sum[4][4] = the sums over 4 x 4 x 4 control points of their values (four floats) times
       weights: products of weights[a][0] along the axes, and with weights[a][1] in place of
       weights[a][0] for one axis a = 0, 1, 2. control: the first of them; the same `line` floats
       further along y and `plane` floats along z. */
    void (*displace)(const float *control, size_t line, size_t plane, const float (*weights)[2][4],
                     float (*sum)[4]);
} template_table;

extern const template_table sdm_template_generic;
#if defined(__x86_64__)
extern const template_table sdm_template_avx2, sdm_template_avx512;
#endif
