/* Derivatives of a template map by the parameters: functions between the files template_*slope*.c.
   Words as in template_work.h. */
#pragma once

#include "template_work.h"

/* template_slope_rows.c */

/* Takes memory for rows of points: all rows of *rows, and f, g, df, dg of *far. */
void sdm_template_take_slope_rows(const template_network *k, void *memory, size_t *at,
                                  template_slope_rows *rows, template_slope_rows *far);

/* *rows = the derivatives of part c at the points row.u[n] with row.metric[n]; of rigid parts
   neither the metric is read nor the factor set. *far: memory. */
void sdm_template_slope_rows(const template_work *w, size_t c, size_t n, template_slope_rows *rows,
                             template_slope_rows *far);

/* slope[9][64] = the derivatives of the distance to part c in the voxels of a block by the index u
   and (not of rigid parts) by the metric, as far as it is computed exactly; w->row = part c.
   valued: the distances are wanted, too, in w->row.value. *rows, *far: memory. */
void sdm_template_block_slopes(template_work *w, size_t c, const template_block *b, bool valued,
                               template_slope_rows *rows, template_slope_rows *far,
                               float *const slope[9]);

/* The derivatives at a station: elements of template_slope_rows, and its index u. */
typedef struct point_slope {
    float u[3], f, g[3], factor;
    float df[3], dg[3][3], by_u[3], dr[3], by_metric[6];
} point_slope;

/* A direction in which the stations of a part with a warp move. */
typedef struct station_motion {
    const float *points,
        *metric;                /* derivatives of the indices [stations][4], metric [stations][8] */
    template_correction change; /* derivative of the correction; map NULL: none */
} station_motion;

/* template_corner_slopes.c. at[stations] = the slopes at the stations of part c, which has a warp,
   after sdm_template_begin(). *rows, *far: memory. */
void sdm_template_station_slopes(const template_work *w, size_t c, template_slope_rows *rows,
                                 template_slope_rows *far, point_slope *at);

/* corner[corners][4] = the derivative of the corners of the blocks for part c, which has a warp.
   sample[stations][8]: memory for the derivatives of the samples. */
void sdm_template_corner_slopes(const template_work *w, size_t c, const point_slope *at,
                                const station_motion *m, float *sample, float *corner);

/* Adjoints of the quantities whose derivatives station_motion holds. */
typedef struct station_adjoint {
    float *points, *metric;
    float *change; /* of the correction's map; NULL: none */
} station_adjoint;

/* The transpose of sdm_template_corner_slopes(): adds to *adjoint what follows from the adjoints
   corner[corners][4]. sample[stations][8]: memory for the adjoints of the samples. */
void sdm_template_corner_slopes_back(const template_work *w, size_t c, const point_slope *at,
                                     const float *corner, float *sample,
                                     const station_adjoint *adjoint);
