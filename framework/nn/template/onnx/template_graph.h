/* The graph of a template network, for the files template_onnx*.c. The map is computed in a loop
   over the layers of blocks along z, each of 4 planes; planes are padded to whole blocks.

   Dimensions of values: N maps; V points; X, Y padded voxels along x and y; bx, by, bz blocks;
   cx = bx + 1 ... corners of blocks; sx = bx + 3 ... stations. Indices are in units of the lattice
   `near`. */
#pragma once

#include "template/template_work.h"

/* The values of a part that are computed before the loop. */
typedef struct part_graph {
    bool warped;
    bool rigid;           /* distances are carried along unchanged */
    sdm_onnx_value nodes; /* [M][4], those of `near` and then those of `far` */
    sdm_onnx_value frame; /* [N][3][3] the inverse of the frame's matrix */
    sdm_onnx_value place; /* [N][3][1] the point of the template, mm, at the world's origin */
    sdm_onnx_value index; /* [N][3][4] times (i, j, k, 1): the index at the voxel (i, j, k) */
    /* Parts with a warp. */
    sdm_onnx_value points, metric; /* at the stations, [N][3][sz][sy sx] and [N][6][sz][sy sx] */
    sdm_onnx_value corners;        /* distance and slopes by blocks, [N][4][cz][cy cx] */
    sdm_onnx_value known;          /* 1 in the lattice `far`, else 0, [N][1][cz][cy cx] */
} part_graph;

/* What a layer of the loop reads: rows of matrices, from one slice. */
typedef struct layer_graph {
    sdm_onnx_value first;   /* [1] its first plane */
    sdm_onnx_value corners; /* [2][cz] selects its corners */
    sdm_onnx_value cubic;   /* [4][sz] cubic B-splines through the stations */
    sdm_onnx_value linear;  /* [4][sz] */
} layer_graph;

typedef struct template_graph {
    sdm_onnx *g;
    const sdm_model *model;
    const template_network *k;
    size_t blocks[3];
    sdm_onnx_value correction; /* [N][its voxels]; 0: none */
    part_graph part[SDM_TEMPLATE_MAX_PARTS];
    layer_graph layer;
    sdm_onnx_value voxels; /* [4][V] (i, j, k, 1) of the voxels of the first layer (not of warps) */
    sdm_onnx_value edges;  /* [4][2 cy cx] of the corners of its blocks (rigid parts only) */
    sdm_onnx_value middles; /* [4][by bx] of their middles (the same) */
} template_graph;

/* Voxels of a layer, V; the corners of its blocks at one end along z. */
static inline size_t template_graph_voxels(const template_graph *t)
{
    return SDM_TEMPLATE_STEP * SDM_TEMPLATE_STEP * SDM_TEMPLATE_STEP * t->blocks[0] * t->blocks[1];
}

/* template_onnx_lookup.c. */

/* f[N][1][V], gradient[N][3][V] = template of part c at the indices u[N][3][V]. */
void sdm_template_onnx_lookup(const template_graph *t, size_t c, size_t points, sdm_onnx_value u,
                              sdm_onnx_value *f, sdm_onnx_value *gradient);

/* [N][1][V]: 1 where the indices u[N][3][V] lie in the lattice `far` of part c, else 0. */
sdm_onnx_value sdm_template_onnx_known(const template_graph *t, size_t c, sdm_onnx_value u);

/* [N][1][V] = the correction at the indices u[N][3][V] of the first part. */
sdm_onnx_value sdm_template_onnx_correction(const template_graph *t, size_t points,
                                            sdm_onnx_value u);

/* metric[N][6][V] (xx, yy, zz, yz, xz, xy) of b[N][...][3][3], V matrices in order: b b^T. */
sdm_onnx_value sdm_template_onnx_metric(sdm_onnx *g, size_t points, sdm_onnx_value b);

/* [N][1][V] = the factor that makes the template a distance, from gradient[N][3][V] and
   metric[N][6][V or 1]. */
sdm_onnx_value sdm_template_onnx_factor(sdm_onnx *g, sdm_onnx_value gradient,
                                        sdm_onnx_value metric);

/* m[...][9] = inverse of the matrices m[...][9]; the identity where the determinant is at most
   `least`. */
sdm_onnx_value sdm_template_onnx_inverse(sdm_onnx *g, sdm_onnx_value m, double least);

/* template_onnx_warp.c. Sets points, metric, corners and known of part c; numbers[N][K]. */
void sdm_template_onnx_warp(template_graph *t, size_t c, sdm_onnx_value numbers);

/* template_onnx_blocks.c, in the loop. */

/* The slices of the loop: the tensor [bz][n], and the values of a layer from a slice [n]. */
sdm_onnx_value sdm_template_onnx_layers(const template_graph *t, size_t *n);
void sdm_template_onnx_layer(template_graph *t, sdm_onnx_value slice);

/* [N][4][Y][X] = the distance to part c in a layer. */
sdm_onnx_value sdm_template_onnx_part(const template_graph *t, size_t c);
