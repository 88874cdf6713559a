/* The parameters of the small networks of the tests. */
#ifndef TEST_TOY_PARAMS_H
#define TEST_TOY_PARAMS_H

#include <stdio.h>

#include "sdm/model.h"

/* Fills params[n]: p0, p1 ... in mm, the i-th between -1 - i and 2 + i. */
static inline void toy_params_fill(sdm_model_param *params, int n)
{
    for (int i = 0; i < n; i++) {
        snprintf(params[i].name, sizeof params[i].name, "p%d", i);
        snprintf(params[i].unit, sizeof params[i].unit, "mm");
        params[i].min = -1.0 - i, params[i].max = 2.0 + i, params[i].def = 0.5;
    }
}

#endif
