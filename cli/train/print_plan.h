/* Prints the plan of a training: `sdmgen train --plan`. */
#pragma once

#include "args/options.h"
#include "sdm/internal/train_plan.h"

/* Measures the speed of this machine and prints time, memory and bytes of the training on the nodes
 * of --nodes and --cores, as text or JSON. Errors of sdm_train_measure(). */
sdm_status cli_plan_training(const cli_args *args, const sdm_config *config,
                             const sdm_instance *shape, sdm_error *err);
