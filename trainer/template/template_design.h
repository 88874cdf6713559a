/* The design of a template network (sdm/internal/template.h): a family of meshes, and what the
   network has computed from it so far. */
#pragma once

#include "family.h"
#include "sdm/internal/template.h"

typedef struct template_design {
    family family;
    const sdm_grid *grid; /* grid of the maps */
    size_t n_parts;
    sdm_template_part parts[SDM_TEMPLATE_MAX_PARTS]; /* arrays owned */
    uint32_t *vertices;                              /* vertices of part 0, then of part 1, ... */
    size_t first[SDM_TEMPLATE_MAX_PARTS + 1]; /* part c: vertices[first[c] .. first[c + 1] - 1] */
    size_t n_numbers, n_terms, degree;        /* N, F */
    double *functions;                        /* [N][F] */
    double motion_error_mm; /* error of frames and amplitudes on meshes left out, mm */
    double warp_error_mm;   /* root mean square error of warps at the vertices, mm; 0: no warp */
    sdm_model *model;       /* the network without a correction */
} template_design;
