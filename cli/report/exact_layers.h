/* Layers and derivatives of an exact map: --closest, --normal, --triangle, --jacobian. */
#ifndef CLI_EXACT_LAYERS_H
#define CLI_EXACT_LAYERS_H

#include "args/options.h"
#include "sdm/exact.h"
#include "sdm/registry.h"

typedef struct cli_layers {
    sdm_exact_layers arrays;
    double *velocity; /* [n_params][n_vert][3] */
    size_t n_params;
    float *jacobian; /* [n_params][nz][ny][nx] */
} cli_layers;

/* Is any asked for? */
bool cli_layers_wanted(const cli_args *args);

/* Before any work: types and places of these files and of the other outputs, and what they need.
 * SDM_E_ARG, SDM_E_IO. */
sdm_status cli_layers_check(const cli_args *args, sdm_error *err);

/* Keeps the motion of the mesh's vertices, when --jacobian is given. */
sdm_status cli_layers_velocity(cli_layers *l, const cli_args *args, const sdm_instance *shape,
                               const double *params, size_t n_vert, sdm_error *err);

/* The map into values[nz][ny][nx], with the layers that are asked for. Triangles are those of the
 * given mesh. */
sdm_status cli_layers_map(cli_layers *l, const cli_args *args, const sdm_exact *engine,
                          const sdm_grid *grid, float *values, sdm_error *err);

sdm_status cli_layers_write(const cli_layers *l, const cli_args *args, const sdm_grid *grid,
                            sdm_error *err);
void cli_layers_dispose(cli_layers *l);

#endif
