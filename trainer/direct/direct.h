/* The "direct" kind of network: sdmnn, deepsdf and imnet, which learn by gradients on the maps
 * themselves. */
#ifndef SDM_TRAINER_DIRECT_H
#define SDM_TRAINER_DIRECT_H

#include "state/kind.h"

extern const train_kind trainer_kind_direct;

#endif
