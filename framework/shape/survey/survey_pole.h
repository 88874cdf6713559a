/* Finds angles in degrees that mesh() gives to tan(), or by whose cos() or sin() it divides. */
#pragma once

#include "shape_family.h"

/* pole[2] = the first two values of parameter k near which a vertex moves beyond all bounds, the
 * other parameters as in p[n_params], and *n = how many such values its range holds at this
 * distance, if it is one, two or more quarter turns in rad, as for tan(); else *n = 0. 0 for
 * parameters in mm or sd, and if meshes cannot be made or change their vertices. SDM_E_NOMEM.
 * [any thread] */
sdm_status sdm_survey_poles(const shape_family *f, const double *p, size_t k, double pole[2],
                            size_t *n, sdm_error *err);
