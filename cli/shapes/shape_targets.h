/* A shape as binary glTF with a morph target for each of its parameters. */
#pragma once

#include "inputs/setup.h"

/* At most so many parameters become morph targets; others keep the values of the shape. */
enum { CLI_MAX_TARGETS = 8 };

/* Writes the mesh of the shape at its values (-p, else the defaults) as .glb. If all vertices are
   linear functions of the first eight parameters, which several meshes show, each of these becomes
   a morph target: with the weight w its parameter is default + w * (at - default), where `at` is
   one standard deviation above the default if the distribution is normal, else the farther end of
   the range. Otherwise the file has the mesh alone, and a notice says so. SDM_E_RANGE,
   SDM_E_PLUGIN, SDM_E_UNSUPPORTED, SDM_E_IO, SDM_E_NOMEM. */
sdm_status cli_write_glb(const char *path, const cli_shape *shape, sdm_error *err);
