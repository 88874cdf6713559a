/* What the parts of `sdmgen phantom` share. */
#ifndef CLI_PHANTOM_H
#define CLI_PHANTOM_H

#include "args/options.h"
#include "sdm/phantom.h"

/* Everything an image was made from. */
typedef struct cli_phantom {
    const cli_args *args;
    const sdm_instance *shape;
    double *params; /* [n_params] */
    size_t n_params;
    sdm_pose pose;
    sdm_grid grid;
    sdm_phantom_opts opts;
    bool cut; /* the shape leaves the box of the voxels' centres */
} cli_phantom;

/* Fills in all but args, shape and params[n_params], which are given room. SDM_E_ARG, SDM_E_RANGE.
 */
sdm_status cli_phantom_setup(cli_phantom *p, sdm_error *err);

/* The truth as one JSON object; inside: voxels of the label that are 1. */
void cli_phantom_truth(const cli_phantom *p, size_t inside, sdm_json *json);

#endif
