/* How far the errors of a network's map move the unknowns of a fit. */
#pragma once

#include "fit/solver/problem.h"

/* Whether the error of the network can be measured: the maps are those of a network, and the source
 * knows the shape. */
bool sdm_fit_can_measure_network(const fit_problem *p);

/* Sets change[N], N = p->information.n_unknowns, to the change of the unknowns, to first order, if
 * the fit used exact maps on the same grid in place of those of the network: one step of Newton's
 * method from the score of the exact map. influence[N][N]: inverse of the information. The same
 * bits for any number of threads. SDM_E_NOMEM, SDM_E_CANCELLED, or an error of the shape. */
sdm_status sdm_fit_network_bias(const fit_problem *p, const double *influence, double *change,
                                sdm_error *err);
