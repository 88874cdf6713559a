/* Rows of a map of a template network: the scratch memory of one map and the evaluation of one part
   in a run of voxels. Words as in template_internal.h. */
#pragma once

#include "template_internal.h"

/* Voxels along the edge of a block in which parts that cannot be the nearest are left out. */
enum { SDM_TEMPLATE_BLOCK = 8 };

/* A row of voxels along x; each array has row_floats() elements. */
typedef struct template_row {
    float *u[3];      /* indices */
    float *metric[6]; /* xx, yy, zz, yz, xz, xy */
    float *f, *g[3];  /* template and its gradient */
    float *far_f, *far_g[3];
    float *value; /* the part's distance */
} template_row;

/* Scratch memory of one map. */
typedef struct template_work {
    const sdm_model *model;
    const template_network *k;
    const sdm_grid *grid;
    double *g, *dg;   /* [N], [P][N] (derivatives wanted only) */
    float *phi;       /* polynomials */
    part_pose *pose;  /* [n_parts] */
    warp_scratch warp[SDM_TEMPLATE_MAX_PARTS];
    uint32_t *active; /* [blocks] bit c: part c may be the nearest somewhere in the block */
    float *correction;         /* [its voxels] the correction, NULL if there is none */
    template_correction correction_at; /* the lattice of the correction with its first map */
    void *correction_scratch;
    template_row row;
} template_work;

/* Bytes of scratch memory for one map; sets the pointers of *w into memory (NULL: none). slopes:
   derivatives by the parameters are wanted. correction_maps: maps of the correction to hold,
   correction_scratch: bytes of its own scratch memory. */
size_t sdm_template_carve(const sdm_model *m, bool slopes, size_t correction_maps,
                          size_t correction_scratch, void *memory, template_work *w);

/* Prepares the map at the parameters p[P]: numbers, frames, warps, active blocks. The correction is
   left to the caller. slopes: as in sdm_template_carve(). */
void sdm_template_begin(template_work *w, const double *p, bool slopes);

/* Combines the stations of part c for the plane z of voxels, then for the line y of this plane.
   points[stations][4], metric[stations][8]: those of the warp or of a derivative of it. */
void sdm_template_plane(const template_network *k, const float *points, const float *metric,
                        size_t z, float *plane);
void sdm_template_line(const template_network *k, const float *plane, size_t y, float *line);

/* Evaluates part c in n voxels from voxel (x, y, z) on: fills u, metric, f, g and value of w->row.
   A part with a warp is evaluated in whole lines (x = 0), after sdm_template_plane(). */
void sdm_template_run(template_work *w, size_t c, size_t x, size_t y, size_t z, size_t n);

/* The number of voxels, from voxel (x, y, z) on, that lie in blocks in which part c is active: 0 if
   the first one does not. */
size_t sdm_template_active(const template_work *w, size_t c, size_t x, size_t y, size_t z);
