/* Correlation of patterns in many rotations with every place of a coarse image. */
#pragma once

#include "pattern.h"

/* best[l->n[2]][l->n[1]][l->n[0]] = the largest score of patterns[n] in n_turns rotations over the
   sphere each with the centroid in the middle of the box; below `least`, the value may be 0. 0 in
   the padding, which must be at least as wide as the reach of the patterns and their layers. The
   same bits for any number of threads. SDM_E_NOMEM. */
sdm_status sdm_fit_coarse_scan(const fit_pattern *patterns, size_t n, size_t n_turns,
                               const fit_likeness *l, float least, int n_threads, float *best,
                               sdm_error *err);
