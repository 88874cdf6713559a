/* Finds angles in degrees that mesh() gives to cos() or sin(), also those that it has converted
 * from rad. */
#pragma once

#include "shape_family.h"

/* *swings = how often the vertices turn back while parameter k goes over its range, the others as
 * in p[n_params], if they do so about twice for every 6.28 of the parameter, as cos() and sin() do;
 * else 0. 0 for parameters in mm or sd, for ranges of less than two turns in rad, and if meshes
 * cannot be made or change their vertices. SDM_E_NOMEM. [any thread] */
sdm_status sdm_survey_swings(const shape_family *f, const double *p, size_t k, size_t *swings,
                             sdm_error *err);

/* Change of a parameter in rad after which cos() and sin() of it in degrees come back: 2 pi over
 * 180 / pi. */
#define SDM_SURVEY_SPIN 0.10966227112321508

/* *found: a quarter of the vertices that move, *vertex among them, come back whenever parameter k,
 * which is in rad, goes on by 2 pi / 57.296, the others as in p[n_params]. So it is where mesh()
 * gives 180 / pi times the parameter to cos() or sin(); no whole number of teeth, turns or joints
 * has this period. false for ranges of less than 0.165 rad, and if meshes cannot be made or change
 * their vertices. SDM_E_NOMEM. [any thread] */
sdm_status sdm_survey_spins(const shape_family *f, const double *p, size_t k, bool *found,
                            size_t *vertex, sdm_error *err);

/* *degrees = by how many degrees parameter k, which is in degrees, turns a quarter of the turning
 * surface per unit, *vertex among it, the others as in p[n_params], if mesh() is likely to give it
 * to cos() or sin() as it is (57.3, half or twice as much), or to convert it twice (0.01745, half
 * or twice as much). Else 0; also if meshes cannot be made or change their vertices. SDM_E_NOMEM.
 * [any thread] */
sdm_status sdm_survey_turns(const shape_family *f, const double *p, size_t k, double *degrees,
                            size_t *vertex, sdm_error *err);
