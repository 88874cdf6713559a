/* A phantom: a CT-like test image of a shape, made by `sdmgen phantom`. */
#pragma once

#include "inputs/setup.h"
#include "sdm/phantom.h"

/* All settings of a test image. Zero-initialise all members but args; cli_shape_dispose(&p.shape)
 * frees. */
typedef struct cli_phantom {
    const cli_args *args;
    cli_shape shape; /* with the parameters used for the image */
    sdm_pose pose;   /* pose of the shape in the world */
    sdm_grid grid;   /* grid of the image */
    sdm_phantom_opts opts;
    bool thin; /* a warning has named a part that is too thin for the voxels */
    bool cut;  /* the shape extends beyond the box of the voxel centres */
} cli_phantom;

/* Opens the shape and derives its parameters, the pose, the grid and the options of the image from
 * p->args. SDM_E_ARG, SDM_E_RANGE. */
sdm_status cli_phantom_setup(cli_phantom *p, sdm_error *err);

/* Number of points of --surface FILE.csv without --surface-points. */
#define CLI_SURFACE_POINTS 2000

/* Writes the surface to the file that --surface names, if the option is given: the mesh in its
 * pose, or points on it. Errors of sdm_instance_mesh(), sdm_fit_surface_points() and of writing. */
sdm_status cli_phantom_surface(const cli_phantom *p, sdm_error *err);

/* Prints in one line on stdout what the image or, without one, the labels show, and the files that
 * were written with it: unless quiet, with --json, or without an image and labels. inside: as
 * below. */
void cli_phantom_summary(const cli_phantom *p, size_t inside);

/* Adds the truth as one JSON object; inside: the number of voxels with label 1. */
void cli_phantom_truth(const cli_phantom *p, size_t inside, sdm_json *json);
