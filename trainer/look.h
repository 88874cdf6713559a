/* The look at a shape before the trials of network.kind: auto, which tells how long they take. */
#pragma once

#include "state/kind.h"

typedef struct trial_look {
    bool bends;     /* as far as its first meshes tell, the template needs a warp or a correction */
    double per_map; /* s an exact map, on all threads of all ranks */
    double trials;  /* s, about, of the trials of both kinds */
    dataset maps;   /* the maps made so far; trials and trainings of kind `pod` take them over */
} trial_look;

/* Makes the first meshes and the first exact maps, and fills *out. config: of a trial of kind
   `pod`; the other arguments as trainer_race(). The caller owns out->maps also after an error. */
sdm_status trainer_look(const trainer *t, sdm_config *config, trial_look *out, sdm_error *err);
