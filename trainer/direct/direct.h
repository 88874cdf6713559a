/* Networks that learn by gradients on the maps themselves, as a kind of network of the trainer:
   sdmnn, deepsdf and imnet. */
#ifndef SDM_TRAINER_DIRECT_H
#define SDM_TRAINER_DIRECT_H

#include "state/kind.h"

extern const train_kind trainer_kind_direct;

#endif
