/* Patches of a map of a template network: the scratch memory of one map and the evaluation of one
   part in a patch. Words as in template_internal.h. */
#pragma once

#include "template_internal.h"

/* Voxels of a block along each axis, and all together. */
enum { SDM_TEMPLATE_BLOCK = 4, SDM_TEMPLATE_BLOCK_VOXELS = 64 };

/* A patch: the voxels that are evaluated together, x fastest, then y, then z. Without a warp a
   patch is a block of 4 x 4 x 4 voxels (smaller at the end of the grid), in which parts that cannot
   be the nearest are left out; with a warp it is a line of the grid. */
typedef struct template_patch {
    size_t at[3], n[3]; /* first voxel, number of voxels along x, y, z */
    size_t count;       /* n[0] n[1] n[2] */
    size_t block;       /* number of the block */
} template_patch;

/* Arrays with an element for each voxel of a patch. */
typedef struct template_row {
    float *u[3];      /* indices */
    float *metric[6]; /* xx, yy, zz, yz, xz, xy */
    float *f, *g[3];  /* template and its gradient */
    float *far_f, *far_g[3];
    float *value; /* the part's distance */
} template_row;

/* A part without a warp: its index at a voxel is an affine function of the voxel's index. */
typedef struct affine_part {
    double from[3], by[3][3]; /* index at voxel (0, 0, 0); by[a]: change along axis a of the grid */
    bool rigid;
    double slope; /* bound on how fast the distance changes, mm per mm */
} affine_part;

/* Scratch memory of one map. */
typedef struct template_work {
    const sdm_model *model;
    const template_network *k;
    const sdm_grid *grid;
    double *g, *dg;  /* [N], [P][N] (derivatives wanted only) */
    float *phi;      /* polynomials */
    part_pose *pose; /* [n_parts] */
    warp_scratch warp[SDM_TEMPLATE_MAX_PARTS];
    bool by_lines;    /* patches are lines: a part has a warp */
    size_t blocks[3]; /* number of blocks along each axis */
    /* [blocks][n_parts][4] distance of each part at the centre of the block, and its gradient by
       the indices of the grid; not with lines. */
    float *centre;
    /* [n_parts][corners][4] the same at the first voxel of each block and of those that would
       follow the last ones, with the gradient by blocks; not with lines. */
    float *corner;
    float *value;      /* values of a patch */
    affine_part *part; /* [n_parts]; not with lines */
    float *offset[3];  /* voxel indices of a whole block, relative to its first voxel */
    float *correction; /* [its voxels] the correction, NULL if there is none */
    template_correction correction_at; /* the lattice of the correction with its first map */
    void *correction_scratch;
    template_row row;
} template_work;

/* Takes the next `bytes` of memory (NULL: only counts), 64-byte aligned, and advances *at. */
void *sdm_template_take(void *memory, size_t *at, size_t bytes);

/* Bytes of scratch memory for one map; sets the pointers of *w into memory (NULL: none). slopes:
   derivatives by the parameters are wanted. correction_maps: maps of the correction to hold,
   correction_scratch: bytes of its own scratch memory. */
size_t sdm_template_carve(const sdm_model *m, bool slopes, size_t correction_maps,
                          size_t correction_scratch, void *memory, template_work *w);

/* Prepares the map at the parameters p[P]: numbers, frames, warps, centres of the
   blocks. The correction is
   left to the caller. slopes: as in sdm_template_carve(). */
void sdm_template_begin(template_work *w, const double *p, bool slopes);

/* Combines the stations of part c for the plane z of voxels, then for the line y of this plane.
   points[stations][4], metric[stations][8]: those of the warp or of a derivative of it. */
void sdm_template_plane(const template_network *k, const float *points, const float *metric,
                        size_t z, float *plane);
void sdm_template_line(const template_network *k, const float *plane, size_t y, float *line);

/* The patches one after another: sets *p to the first patch if p->count is 0, else to the next one.
   false: there is none. Prepares the stations of all warps for the plane of the patch. */
bool sdm_template_next(template_work *w, template_patch *p);

/* Evaluates part c in a patch: fills u, metric, f, g and value of w->row. */
void sdm_template_run(template_work *w, size_t c, const template_patch *p);

/* True if distances are carried along unchanged: part c only rotates and moves. The metric is then
   not filled. */
bool sdm_template_is_rigid(const template_network *k, size_t c);

/* Distance and gradient of the template of part c at row.u[n], in row.f and row.g: from the lattice
   `near`, and from `far` for points outside of it. */
void sdm_template_lookup(const template_work *w, size_t c, size_t n);

/* Where a patch of a part without a warp lies: wholly within the lattice `near`, wholly beyond it,
   or neither. */
typedef enum template_place { TEMPLATE_WITHIN, TEMPLATE_BEYOND, TEMPLATE_ACROSS } template_place;
template_place sdm_template_place(const template_work *w, size_t c, const template_patch *p);

/* template_blocks.c. Prepares the blocks of a map: centres and corners. */
void sdm_template_blocks(template_work *w);

/* value[count] = the map in a patch: the minimum over the parts; nearest[count] = the part that has
   it, unless NULL. Parts that cannot be the nearest in a block are left out. */
void sdm_template_values(template_work *w, const template_patch *p, float *value, uint8_t *nearest);

/* Index of the first voxel of line (y, z) of the patch in a map. */
static inline size_t sdm_template_line_at(const template_work *w, const template_patch *p, size_t y,
                                          size_t z)
{
    return ((p->at[2] + z) * (size_t)w->grid->n[1] + p->at[1] + y) * (size_t)w->grid->n[0] +
           p->at[0];
}

/* Elements of the arrays of a template_row. */
size_t sdm_template_row_floats(const sdm_grid *grid);
