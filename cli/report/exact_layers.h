/* Arrays that `sdmgen exact` writes beside the distances (layers): --closest, --normal,
 * --triangle, and the derivatives by the parameters, --jacobian. */
#pragma once

#include "args/options.h"
#include "sdm/exact.h"
#include "sdm/registry.h"

/* Zero-initialise; cli_layers_dispose() frees. */
typedef struct cli_layers {
    sdm_exact_layers arrays;
    double *velocity; /* [n_params][n_vert][3] derivative of the vertices by the parameters */
    size_t n_params;
    float *jacobian; /* [n_params][nz][ny][nx] derivative of the distance, mm per unit */
} cli_layers;

/* True when the command line has one of the four options. */
bool cli_layers_wanted(const cli_args *args);

/* Bytes of the requested layers for each voxel; after cli_layers_velocity(). */
double cli_layers_bytes(const cli_layers *l, const cli_args *args);

/* Before any work: checks the types and paths of these files and of the other outputs, and the
 * options that they require. SDM_E_ARG, SDM_E_IO. */
sdm_status cli_layers_check(const cli_args *args, sdm_error *err);

/* If derivatives are wanted: fills l->velocity for the mesh of the shape at params[n_params]; the
 * mesh has n_vert vertices. */
sdm_status cli_layers_velocity(cli_layers *l, bool wanted, const sdm_instance *shape,
                               const double *params, size_t n_vert, sdm_error *err);

/* Computes the distances into values[nz][ny][nx] and the requested layers. Triangle indices refer
 * to the mesh that the engine was created from, also where the engine uses the union of this mesh
 * with itself. */
sdm_status cli_layers_map(cli_layers *l, const cli_args *args, const sdm_exact *engine,
                          const sdm_grid *grid, float *values, sdm_error *err);

/* Writes the requested layers to their files. SDM_E_IO. */
sdm_status cli_layers_write(const cli_layers *l, const cli_args *args, const sdm_grid *grid,
                            sdm_error *err);
void cli_layers_dispose(cli_layers *l);
