/* How far the errors of a network's map move the unknowns of a fit. */
#pragma once

#include "fit/solver/problem.h"

/* Whether the error of the network can be measured: the maps are those of a network, and the source
 * knows the shape. */
bool sdm_fit_can_measure_network(const fit_problem *p);

/* Sets change[N], N = p->information.n_unknowns, to the change of the unknowns, to first order, if
 * the fit used exact maps (or exact distances at points) in place of the maps of the network: one
 * step of Newton's method with exact maps and their derivatives. Evaluates the problem with exact
 * maps, and then again with those of the network. The same bits for any number of threads.
 * SDM_E_NOMEM, SDM_E_CANCELLED, SDM_E_QUALITY: the information is singular, or an error of the
 * shape. */
sdm_status sdm_fit_network_bias(fit_problem *p, double *change, sdm_error *err);
