/* The inside of sdm_exact_slopes. */
#pragma once

#include "sdm/internal/exact_slopes.h"
#include "vertex_gradient.h"

struct sdm_exact_slopes {
    sdm_sheets sheets;
    const sdm_mesh *surface; /* the mesh to which distances are measured */
    sdm_frame *frames;       /* those of the sheets */
    const double *velocity;  /* [n][sheets.mesh->n_vert][3] */
    size_t n;
};
