/* Derivatives of a template map by the parameters: functions between the files template_*slope*.c.
   Words as in template_work.h. */
#pragma once

#include "template_work.h"

/* At a point with the index u[3] and the metric G the distance is f s + r: the template f with the
   gradient g, the factor s of the metric, the correction r; with their derivatives. */
typedef struct point_slope {
    float u[3], f, g[3], factor;
    float df[3], dg[3][3], by_u[3], dr[3]; /* of f, g, s, r by u; dg[a]: by u[a] */
    float by_metric[6];                    /* of s by xx, yy, zz, yz, xz, xy */
} point_slope;

/* template_point_slope.c */
void sdm_template_point_slope(const template_work *w, size_t c, const float u[3],
                              const float metric[6], point_slope *out);

/* A direction in which the stations of a part with a warp move. */
typedef struct station_motion {
    const float *points,
        *metric;                /* derivatives of the indices [stations][4], metric [stations][8] */
    template_correction change; /* derivative of the correction; map NULL: none */
} station_motion;

/* template_corner_slopes.c. at[stations] = the slopes at the stations of part c, which has a warp,
   after sdm_template_begin(). */
void sdm_template_station_slopes(const template_work *w, size_t c, point_slope *at);

/* corner[corners][4] = the derivative of the corners of the blocks for part c, which has a warp.
   sample[stations][8]: memory for the derivatives of the samples. */
void sdm_template_corner_slopes(const template_work *w, size_t c, const point_slope *at,
                                const station_motion *m, float *sample, float *corner);
