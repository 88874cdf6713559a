/* The fits of one row of an experiment. */
#pragma once

#include "experiment_command.h"

/* The fit of a method to one phantom. found and sd are NaN unless it is to be trusted (converged).
 */
typedef struct cli_experiment_fit {
    bool converged;
    bool at_bound[SDM_MAX_PARAMS]; /* the estimate is at an end of its range */
    double truth[SDM_MAX_PARAMS], found[SDM_MAX_PARAMS], sd[SDM_MAX_PARAMS];
    double seconds, dice;
    size_t maps_network, maps_exact; /* number of maps that each source made */
    char reason[300];                /* why it is not to be trusted; "" if it is */
} cli_experiment_fit;

struct cli_experiment_fits {
    size_t n, n_params;
    char name[SDM_MAX_PARAMS][SDM_NAME_MAX], unit[SDM_MAX_PARAMS][16];
    cli_experiment_fit *fit; /* [n] */
};
