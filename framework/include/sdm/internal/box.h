/* Bounding boxes. */
#pragma once

#include <math.h>

typedef struct sdm_box {
    double min[3], max[3];
} sdm_box;

/* The box of no point. */
static const sdm_box SDM_BOX_EMPTY = {{INFINITY, INFINITY, INFINITY},
                                      {-INFINITY, -INFINITY, -INFINITY}};

/* Extends the box to the point x. */
static inline void sdm_box_add(sdm_box *b, const double x[3])
{
    for (int a = 0; a < 3; a++)
        b->min[a] = fmin(b->min[a], x[a]), b->max[a] = fmax(b->max[a], x[a]);
}
