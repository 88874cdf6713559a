/* The `pod` network (sdm/internal/pod.h) as a kind of network of the trainer. */
#ifndef SDM_TRAINER_POD_KIND_H
#define SDM_TRAINER_POD_KIND_H

#include "state/kind.h"

extern const train_kind trainer_kind_pod;

#endif
