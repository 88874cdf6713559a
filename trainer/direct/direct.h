/* The "direct" kind of network: sdmnn, deepsdf and imnet, which learn by gradients on the maps
 * themselves. */
#pragma once

#include "state/kind.h"

extern const train_kind trainer_kind_direct;
