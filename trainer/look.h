/* The look at a shape before the trials of network.kind: auto, which tells how long they take. */
#pragma once

#include "state/kind.h"

/* Part of a budget of time for the trials: one that takes more is left out, as its first maps tell,
   and no more maps are made for a trial once the part is used. */
#define TRAINER_TRIALS_SHARE 0.2

typedef struct trial_look {
    bool bends; /* as far as its first meshes tell, the template needs a warp or a correction */
    bool lacks_time; /* both trials take more than their part of train.minutes */
    bool divides;    /* it bends, lacks_time, and the template can be several parts, which need no
                        correction */
    double per_map;  /* time of an exact map on all threads of all ranks, s */
    double trials;   /* estimated time of the trials of both kinds, s */
    dataset maps;    /* the maps made so far; trials and trainings of kind `pod` take them over */
} trial_look;

/* Makes the first meshes and the first exact maps, and fills *out. config: of a trial of kind
   `pod`; the other arguments as trainer_race(). The caller owns out->maps also after an error. */
sdm_status trainer_look(const trainer *t, sdm_config *config, trial_look *out, sdm_error *err);
