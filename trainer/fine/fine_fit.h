/* The training of the fine level (sdm/internal/fine.h), after that of the network. */
#pragma once

#include "state/trainer.h"

/* Trains the fine level of the model in the run's folder, if network.fine asks for one, and adds it
   to the file if it gains on shapes that it has not seen. A message tells the errors between the
   voxels. SDM_E_CANCELLED. */
sdm_status trainer_fine_add(trainer *t, sdm_error *err);
