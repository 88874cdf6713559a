/* Tissue field: weights of the outside tissues that vary smoothly in space. */
#pragma once

#include "problem.h"

/* Improves the tissue field at the samples, problem->samples.log_weight, by a few steps of
   expectation-maximisation, and updates problem->information. If there is no field yet, it starts
   from the weights that are the same everywhere. Removes the field (n_outside = 0) and leaves the
   information as it is where problem->use_tissue_field or the options switch it off, the appearance
   is kept, the model is not partial volume or fewer than two outside tissues are present. The same
   bits for any number of threads. */
sdm_status sdm_fit_tissue_field_update(fit_problem *p, sdm_error *err);
