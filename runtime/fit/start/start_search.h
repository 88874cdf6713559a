/* The beginning of a fit: which turn of the start pose to go on from. */
#ifndef FIT_SEARCH_H
#define FIT_SEARCH_H

#include "fit/solver/newton.h"

/* From problem->state with a wide point spread: pose alone from every turn, the best goes on with
   all unknowns. *turn: the one chosen; problem->prior takes its rotation. The region is a ball
   about the shape, which holds every turn. */
sdm_status sdm_fit_search(fit_problem *p, size_t *turn, sdm_error *err);

#endif
