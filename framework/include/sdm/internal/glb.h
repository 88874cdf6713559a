/* Writes a mesh as binary glTF 2.0 (.glb), with morph targets. */
#pragma once

#include <stddef.h>

#include "sdm/internal/text.h"
#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A morph target: a vertex moves by weight * delta. */
typedef struct sdm_glb_target {
    const char *name;
    const double *delta; /* [n_vert][3], mm */
    double weight;       /* at which the file shows the mesh */
} sdm_glb_target;

/* Writes keys and values of `extras` of the mesh, an object that is open. */
typedef void (*sdm_glb_extras)(const void *user, sdm_json *j);

/* Writes the mesh (mm, LPS; at least one triangle) and targets[n], which the reader of the file
   adds to it. Coordinates are floats in mm, LPS; the node of the mesh scales them to metres and
   turns them upright, as glTF asks: its x is x, its y is z, its z is -y. The names of the targets
   are in `targetNames` of the extras. SDM_E_UNSUPPORTED: the file would have more than 4 GB;
   SDM_E_IO, SDM_E_NOMEM; the file is complete or absent. [any thread] */
sdm_status sdm_glb_write(const char *path, const sdm_mesh *mesh, const sdm_glb_target *targets,
                         size_t n, sdm_glb_extras extras, const void *user, sdm_error *err);

#ifdef __cplusplus
}
#endif
