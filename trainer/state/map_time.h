/* The time that a finished network takes for a map. */
#pragma once

#include "data/dataset.h"
#include "sdm/model.h"

/* *ms = processor time of one map on one core, the smallest of three maps of the first held-out
   shape. */
sdm_status trainer_map_time(const dataset *d, const sdm_model *m, double *ms, sdm_error *err);
