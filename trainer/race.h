/* The choice of the kind of network (network.kind: auto) by short trials on the shape's own maps.
 */
#pragma once

#include "state/kind.h"

/* *out = *t->config with a kind of network, and with the defaults of this kind for all keys that
   have the defaults of `auto`. Each kind that the shape allows is trained on the same few hundred
   exact maps (bases and least squares, no steps) and measured on held-out shapes; the result is
   sent to the message callback and appended to t->metrics. The design of the chosen kind and its
   maps are handed on in t->design and t->tried. The choice depends on
   configuration, shape and seed only. t: config, shape, folder, hooks and n_threads are set.
   SDM_E_CANCELLED and the errors of a training. */
sdm_status trainer_race(trainer *t, sdm_config *out, sdm_error *err);
