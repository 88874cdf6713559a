/* Lists of states from which a fit may start, the one that explains the samples best first. */
#pragma once

#include "fit/data/unknowns.h"

typedef struct fit_start {
    fit_state state;
    double log_likelihood;
    /* iterations that begin at this state do not change its parameters */
    bool keep_params;
    /* the parameter that has another value than in the fit, from 1; 0: none has */
    size_t param;
} fit_start;

/* Inserts a start into list[*n], which is sorted; of more than `most` the worst is left out. */
void sdm_fit_start_insert(fit_start *list, size_t *n, size_t most, const fit_start *one);
