/* The product of an adjoint with the Jacobian of a template network, in reverse mode: scratch
   memory of the files template_reverse*.c. The caller gives a number a[v] for each voxel v; the
   adjoint of a quantity x is the derivative of the sum over v of a[v] * map[v] by x. Other words as
   in template_work.h. */
#pragma once

#include "template_derivative.h"

/* Adjoints of a part. */
typedef struct part_adjoint {
    /* Without a warp, of the index as an affine function of the voxel's index, as in part_state,
       and of the metric. */
    double from[3], by[3][3], metric[6];
    /* With a warp, of the stations and of the corners of the blocks. */
    float *points;  /* [stations][4] adjoints of the B-spline coefficients of the carried points */
    float *station; /* [stations][8] adjoints of the metric at the stations */
    float *corner;  /* [corners][4] adjoints of distance and slopes at the corners */
    warp_adjoint warp;
} part_adjoint;

/* Scratch memory of the product. */
typedef struct reverse_work {
    template_work w;
    const float *adjoint; /* [nz][ny][nx] a[v], given by the caller */
    part_adjoint *part;   /* [n_parts] */
    size_t stations, corners;
    float *control;                /* adjoint of the control points of one part */
    point_slope *station;          /* [stations] of one part */
    float *sample;                 /* [stations][8] adjoint of its samples */
    float *correction;             /* adjoint of the correction's map */
    template_slope_rows rows, far; /* of a block, or of a row of stations */
    float *slope[9];               /* [64] derivatives of the value by u and metric */
    float *row[9];                 /* [64] adjoints of u and metric */
    float *given;                  /* [64] adjoint of the map in a block; 0 beyond the grid */
    float *exact, *interpolated;   /* [64] of the distance to a part, and of its interpolation */
    float *value;                  /* [64] the map */
    uint8_t *nearest;              /* [64] part with the smallest value */
    double (*dm)[9], (*db)[3];     /* [n_parts] derivatives by a parameter */
    double *correction_gradient;   /* [P] */
} reverse_work;

/* template_reverse_blocks.c. Adds to the adjoints of the parts and of the correction what follows
   from the adjoint of the map, after sdm_template_begin(). */
void sdm_template_blocks_back(reverse_work *s);
