/* The inner loops of the `template` network, one table for each instruction set. Each of
   template_kernels_*.c compiles the same source, template_kernels_simd.h, without contraction of
   a * b + c, so that all instruction sets give the same bits. A row is an array with an element for
   each voxel. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Rows have room for a multiple of SDM_TEMPLATE_LANES voxels, and for that many more. */
#define SDM_TEMPLATE_LANES 8

/* A lattice of nodes of a template map, fewer than 2^30. */
typedef struct template_level {
    const float *nodes; /* [nz][ny][nx][4]: distance, gradient */
    int32_t n[3];       /* at least 2 along each axis */
    float half;         /* half of the spacing, mm */
    float scale,
        offset[3]; /* index in this lattice = scale * (index in the part's fine lattice) + offset */
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

/* A part with a warp at its stations: template f, its gradient g, factor s of the metric,
   correction r, index u. */
typedef struct template_samples {
    float *f, *g[3], *s, *r, *u[3];
} template_samples;

/* The warp of a part. */
typedef struct template_warp {
    const float
        *control; /* [nz][ny][nx][4] displacements of the control points, the fourth 0; mm */
    int32_t n[3]; /* fewer than 2^28 control points */
    double origin[3], spacing;
} template_warp;

/* Where a point lies among the control points of a warp. */
typedef struct template_place {
    int32_t first;          /* float of the first of the 4 x 4 x 4 control points */
    float weights[3][2][4]; /* along x, y, z, and their derivatives */
} template_place;

/* A voxel index at which a warp is inverted exactly. */
typedef struct template_station {
    double y[3];       /* carried point */
    double inverse[9]; /* (I + dU/dy)^-1 at y */
} template_station;

/* Up to four lines of n stations each, one after the other: y + U(y) = first + i step for the
   station i of a line. Lengths in mm. */
typedef struct template_stations {
    size_t n, n_lines;
    double first[3][4], step[3][4]; /* of each line */
    double frame[9];                /* inverse of the part's matrix m */
    double origin[3], spacing;      /* of the nodes of the part's fine lattice, mm */
    size_t line, plane;             /* stations in a line, in a plane */
    /* Input and output: y - (y + U(y)) of the first station of the line before, then of the last
       line. */
    double shift[3];
    /* Output, by lines: y as an index, [4], after the lines before it; metric, [8]; the stations,
       unless NULL. */
    float *points, *metric;
    template_station *station;
} template_stations;

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
    /* f[n] = distance and g[3][n] = gradient of the template at the indices u[3][n] in the
       part's fine lattice, interpolated in `l`; indices outside the lattice are clamped. */
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
    /* Is base + slope . (x, y, z) larger than value[z][y][x] for all x, y, z = 0 .. 3? */
    bool (*is_above)(float base, const float slope[3], const float *value);
    /* value[64] = the lesser of value and other[64]; where other is NAN, value. */
    void (*take_lesser)(const float *other, float *value);
    /* out[i] = first + i step for i = 0 .. n - 1, rounded once to a float; writes up to
       SDM_TEMPLATE_LANES - 1 floats beyond. */
    void (*line)(size_t n, double first, double step, float *out);
    /* out[i stride .. i stride + 3] = f[i] and the three sums by[a] . g[i], i = 0 .. n - 1. */
    void (*tangents)(size_t n, const float *f, const float *const *g, const float (*by)[3],
                     size_t stride, float *out);
    /* value[4][4][4] = a function in a block of 4 x 4 x 4 voxels, cubic interpolation (Hermite)
       from its value and slopes by blocks at the eight corners, the voxels (0, 0, 0) .. (4, 4, 4):
       corner[x][4], and the same `line` floats further along y and `plane` floats along z. Returns
       the smallest of |value[64]| if none of them is NAN. */
    float (*block)(const float *corner, size_t line, size_t plane, float *value);
    /* to[c][i] = from[i stride + c] for c = 0 .. 3 and i = 0 .. n - 1. */
    void (*separate)(size_t n, const float *from, size_t stride, float *const *to);
    /* out[n][4] = the distance f s + r at the stations first .. first + n - 1, and its gradient by
       blocks, with central differences of u, s and r between stations; stride[3]: stations between
       neighbours along x, y, z; spacing: of u, mm. Reads up to SDM_TEMPLATE_LANES - 1 stations
       beyond. */
    void (*corners)(const template_samples *p, size_t first, size_t n, const size_t stride[3],
                    float spacing, float *out);
    /* *place = where the point y[3] lies in a warp. Beyond the lattice the displacement is that of
       the nearest point of the lattice. */
    void (*find_place)(const template_warp *w, const double y[3], template_place *place);
    /* sum[4][4] = the displacement (x, y, z, 0) of a warp at a place, and its derivatives by x, y
       and z. */
    void (*displace)(const template_warp *w, const template_place *place, float (*sum)[4]);
    /* Inverts a warp at lines of stations by Newton's method. Stops when the next step would change
       y by about the square of the last step. Where the warp folds (determinant near 0) it is
       treated as the identity.
       invert_line: one line. The starts make the second differences along y and z together vanish:
       they do not depend on the stations before on the line.
       invert_in_turn: the start of a station is the station before on the line, moved to first
       order; that of the first one is y of the first one of the line before, moved. */
    void (*invert_line)(const template_warp *w, template_stations *s);
    void (*invert_in_turn)(const template_warp *w, template_stations *s);
    /* Transposes of kernels: add to the adjoints of what a kernel reads those that follow from the
       adjoints of what it writes.
       expand_back: c[9][64] of `expand`, to points[4][4][4][4] and metric[2][2][2][8]; line, plane:
       stations from one station to the next along y and z.
       block_back: value[64] of `block`, to its corners.
       correct_back: value[n], at the indices u[3][n], of `correct`, to the map of c,
       map[nz][ny][nx]. displace_back: sum[4][4] of `displace`, to the control points. */
    void (*expand_back)(const template_expansion *e, const float *const *c, size_t line,
                        size_t plane, float *points, float *metric);
    void (*block_back)(const float *value, size_t line, size_t plane, float *corner);
    void (*correct_back)(const template_correction *c, size_t n, const float *const *u,
                         const float *value, float *map);
    void (*displace_back)(const template_warp *w, const template_place *place,
                          const float (*sum)[4], float *control);
} template_table;

extern const template_table sdm_template_generic;
#if defined(__x86_64__)
extern const template_table sdm_template_avx2, sdm_template_avx512;
#endif
