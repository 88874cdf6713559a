/* A map of a template network, block by block: its scratch memory, and the evaluation of one part
   in a block. Words as in template_internal.h. */
#pragma once

#include "template_internal.h"

/* A block of 4 x 4 x 4 voxels. All of its voxels are computed, x fastest, then y, then z; those
   beyond the end of the grid are not stored. Its edge is the distance between two stations: the
   corners of the blocks are stations. */
typedef struct template_block {
    size_t at[3];  /* number of the block along each axis */
    size_t n[3];   /* number of its voxels that lie in the grid */
    size_t number; /* (at[2] blocks[1] + at[1]) blocks[0] + at[0] */
} template_block;

enum { SDM_TEMPLATE_BLOCK_VOXELS = 64 };

/* Points of several rows are looked up at once, up to this number. */
enum { SDM_TEMPLATE_ROWS_POINTS = 256 };

/* Arrays with an element for each voxel of a block, or for each point of a row of stations. */
typedef struct template_row {
    float *u[3];      /* indices */
    float *metric[6]; /* xx, yy, zz, yz, xz, xy */
    float *f, *g[3];  /* template and its gradient */
    float *far_f, *far_g[3];
    float *value; /* the part's distance */
} template_row;

/* Stations combined for lines of voxels: of a warp, or of a derivative of it. */
typedef struct warp_lines {
    const float *points, *metric; /* all stations: [stations][4], [stations][8] */
    float *plane;                 /* [4][stations in a plane][12]: four planes of voxels */
    float *line;                  /* [16][stations in a line][12]: the lines of a row of blocks */
    size_t plane_of, line_of;     /* the layer and the row of blocks to which they belong */
} warp_lines;

/* Derivatives of a part with a warp at a station: elements of template_samples. */
enum { SAMPLE_F = 0, SAMPLE_G = 1, SAMPLE_S = 4, SAMPLE_R = 5, SAMPLE_SIZE = 8 };

/* A part in the current map. */
typedef struct part_state {
    bool warped;
    bool rigid; /* the part only rotates and moves: distances are carried along unchanged */
    /* Without a warp the index at a voxel is an affine function of the voxel's index: the index at
       voxel (0, 0, 0), and by[a], its change along axis a of the grid. */
    double from[3], by[3][3];
    double extent[3]; /* without a warp: half of the extent of a block, in indices */
    double slope;     /* without a warp: bound on how fast the distance changes, mm per mm */
} part_state;

/* Scratch memory of one map. */
typedef struct template_work {
    const sdm_model *model;
    const template_network *k;
    const template_table *kernels;
    const sdm_grid *grid;
    double *g, *dg;  /* [N], [P][N] (derivatives wanted only) */
    float *phi;      /* polynomials */
    part_pose *pose; /* [n_parts] */
    warp_scratch warp[SDM_TEMPLATE_MAX_PARTS];
    warp_lines lines[SDM_TEMPLATE_MAX_PARTS];
    part_state *part;    /* [n_parts] */
    double block_radius; /* half of the diagonal of a block, mm */
    size_t blocks[3];    /* number of blocks along each axis */
    size_t n_blocks;
    /* [n_parts][corners][4] the distance to each part at the corners of the blocks, the first
       voxel of each block and of those that would follow the last ones, and its gradient by blocks;
       NAN where it is not known. Not of affine parts. */
    float *corner;
    /* [blocks][n_parts][4] the distance to each part at the centre of the block, and its gradient
       by voxels (not of parts with a warp); networks of several parts only. */
    float *centre;
    float *value;      /* [64] values of a block */
    size_t loaded;     /* the part of which `row` holds u, metric, f and g in the current block */
    float *offset[3];  /* [64] voxel indices of a block, relative to its first voxel */
    float *correction; /* [its voxels] the correction, NULL if there is none */
    template_correction correction_at; /* the lattice of the correction with its first map */
    void *correction_scratch;
    template_row row;
} template_work;

/* Takes the next `bytes` of memory (NULL: only counts), 64-byte aligned, and advances *at. */
void *sdm_template_take(void *memory, size_t *at, size_t bytes);

/* Bytes of a row: of voxels of a block, of stations, or of rows of points a block apart. */
size_t sdm_template_row_bytes(const template_network *k);

/* The same for the arrays plane and line of *l. */
void sdm_template_take_lines(const template_network *k, void *memory, size_t *at, warp_lines *l);

/* Bytes of scratch memory for one map; sets the pointers of *w into memory (NULL: none). slopes:
   derivatives by the parameters are wanted. correction_maps: maps of the correction to hold,
   correction_scratch: bytes of its own scratch memory. */
size_t sdm_template_carve(const sdm_model *m, bool slopes, size_t correction_maps,
                          size_t correction_scratch, void *memory, template_work *w);

/* The first block, and the one after *b: false if *b was the last one. Blocks are evaluated in the
   order of their numbers. */
template_block sdm_template_first_block(const template_work *w);
bool sdm_template_next_block(const template_work *w, template_block *b);

/* c[n_c][64] = the stations' values in the voxels of a block: u and metric (n_c = 9), or u (3). */
void sdm_template_expand(const template_network *k, const template_block *b, warp_lines *l,
                         size_t n_c, float *const *c);

/* Rows of points of the grid, along x and y a block apart. */
typedef struct template_rows {
    double first[3];  /* voxel index of the first point */
    size_t n, n_rows; /* points in a row, rows */
} template_rows;

/* How many rows of n points may be looked up at once, at least 1. */
size_t sdm_template_max_rows(size_t n);

/* u, f and g of w->row = part c, which has no warp, at the points of *rows, one row after the
   other. */
void sdm_template_lookup_rows(const template_work *w, size_t c, const template_rows *rows);

/* out[i stride .. i stride + 3] = distance of w->row.f and its gradient by `step` voxels along the
   axes of the grid, at the point i < n of w->row. */
void sdm_template_tangents(const template_work *w, size_t c, size_t n, float step, size_t stride,
                           float *out);

/* Does the index i of row.u lie within the lattice `near` of part c? How many of row.u[n] do? */
bool sdm_template_is_near(const template_work *w, size_t c, size_t i);
size_t sdm_template_count_near(const template_work *w, size_t c, size_t n);

/* Distance and gradient of the template of part c at row.u[n], in row.f and row.g: from the lattice
   `near`, and from `far` for points outside of it. */
void sdm_template_lookup(const template_work *w, size_t c, size_t n);

/* Does a block of part c, which has no warp, lie wholly within the lattice `near`? */
bool sdm_template_is_within(const template_work *w, size_t c, const template_block *b);

/* u[3][64] = an affine function of the voxel's index in the voxels of a block: from[3] at voxel
   (0, 0, 0), by[a] along axis a. */
void sdm_template_affine(const template_work *w, const double from[3], const double by[3][3],
                         const template_block *b, float *const u[3]);

/* u and metric (not of rigid parts) of w->row = where part c is asked in a block. */
void sdm_template_points(template_work *w, size_t c, const template_block *b);

/* Evaluates part c in a block: fills u, metric (not of rigid parts), f, g and value of w->row. */
void sdm_template_run(template_work *w, size_t c, const template_block *b);

/* Copies the voxels of a block that lie in the grid from value[64] to the map. */
void sdm_template_store(const template_work *w, const template_block *b, const float *value,
                        float *map);

/* True if distances are carried along unchanged: part c only rotates and moves. */
bool sdm_template_is_rigid(const template_network *k, size_t c);

/* template_corners.c. The corners of the blocks for part c. Before the stations of a warp become
   coefficients of B-splines. */
void sdm_template_corners(template_work *w, size_t c);

/* template_far.c. Rigid parts are interpolated in the blocks that do not lie within the lattice
   `near`; parts with a warp in the blocks in which the smallest interpolated distance is at least
   SDM_TEMPLATE_FAR_VOXELS + 1 voxels. From SDM_TEMPLATE_FAR_VOXELS on the share of the
   interpolation grows from 0 to 1, so that maps do not jump as the parameters change. */
#define SDM_TEMPLATE_FAR_VOXELS 3.0f

/* Index in w->corner / 4 of the first corner of a block for part c; of its corner i = 0 .. 7
   relative to the first. */
size_t sdm_template_corner_at(const template_work *w, size_t c, const template_block *b);
size_t sdm_template_corner_step(const template_work *w, size_t i);

/* value[64] = a function in a block, from its values and slopes at the corners of all blocks;
   corner: the first corner of the block. Returns the smallest of |value[64]|. */
float sdm_template_interpolate(const template_work *w, const float *corner, float *value);

/* The share of the interpolated distances to part c in a block: 0 exact, 1 interpolated, between
   them blended. Unless it is 0, value[64] = the interpolated distances. */
float sdm_template_far(const template_work *w, size_t c, const template_block *b, float *value);

/* value[64] = the distances in a block that is blended, from the interpolated and the exact ones;
   value may be `far`. */
void sdm_template_blend(float share, const float *far, const float *exact, float *value);

/* slope[64] = a derivative of these distances, from those of the interpolated distances and of the
   exact ones, which it holds before. */
void sdm_template_blend_slope(const template_work *w, float share, const float *far,
                              const float *exact, const float *far_slope, float *slope);

/* The transpose: far_adjoint[64] = the adjoint of far_slope; adjoint[64], which holds that of the
   derivative, becomes that of `slope` before the blend. */
void sdm_template_blend_slope_back(const template_work *w, float share, const float *far,
                                   const float *exact, float *adjoint, float *far_adjoint);

/* template_blocks.c. The centres of all blocks for part c, and the bounds for the culling. After
   its corners. */
void sdm_template_centres(template_work *w, size_t c);

/* value[64] = the map in a block: the minimum over the parts; nearest[64] = the part that has it,
   unless NULL. Parts that cannot be the nearest in the block are left out. */
void sdm_template_values(template_work *w, const template_block *b, float *value, uint8_t *nearest);

/* template_forward.c. Prepares the map at the parameters p[P]: numbers, frames, warps, corners and
   centres of the blocks. Before the call the caller computes the correction. slopes: as in
   sdm_template_carve(). */
void sdm_template_begin(template_work *w, const double *p, bool slopes);
