/* The open end that a shape with given options states by its callback open_end, checked. */
#pragma once

#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Does the shape state an open end? */
bool sdm_instance_has_open_end(const sdm_instance *s);

/* *out = the open end at p[n_params], with a normal of length 1. SDM_E_ARG: there is none;
   SDM_E_PLUGIN: numbers that are not finite, a normal of length 0, a radius that is not positive.
   [any thread] */
sdm_status sdm_instance_open_end(const sdm_instance *s, const double *p, sdm_open_end *out,
                                 sdm_error *err);

#ifdef __cplusplus
}
#endif
