/* The `template` network (sdm/internal/template.h) as a kind of network of the trainer. */
#pragma once

#include "state/kind.h"

extern const train_kind trainer_kind_template;
