/* Finds angles in degrees that mesh() gives to cos() or sin(). */
#pragma once

#include "shape_family.h"

/* *swings = how often the vertices turn back while parameter k goes over its range, the others as
 * in p[n_params], if they do so about twice for every 6.28 of the parameter, as cos() and sin() do;
 * else 0. 0 for parameters in mm or sd, for ranges of less than two turns in rad, and if meshes
 * cannot be made or change their vertices. SDM_E_NOMEM. [any thread] */
sdm_status sdm_survey_swings(const shape_family *f, const double *p, size_t k, size_t *swings,
                             sdm_error *err);
