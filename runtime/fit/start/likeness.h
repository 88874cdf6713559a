/* How much every place of an image looks like the inside of a shape, on a coarser grid. */
#pragma once

#include <stdint.h>

#include "sdm/fit.h"

/* The probability of the inside's material, averaged over boxes of voxels of the image. */
typedef struct fit_likeness {
    /* number of boxes along the axes of the image, `pad` of them before the image and as many or
     * more behind it; edges of a box, mm */
    int64_t n[3], pad[3];
    double edge[3];
    /* [n[2]][n[1]][n[0]] 0 .. 255; places beyond the image and NaN have half */
    uint8_t *values;
} fit_likeness;

/* Averages the likeness of a target over boxes of edges near `edge` (mm), of at least one voxel;
   boxes that reach beyond the image are left out. A voxel of an image is of the inside's material
   with the probability by the laws of opts->appearance, the inside and the outside being equally
   likely; that of a label map has its value. At least `margin` (mm) is padded on every side. The
   same bits for any number of threads. SDM_E_NOMEM. */
sdm_status sdm_fit_likeness_make(const sdm_fit_target *target, const sdm_fit_opts *opts,
                                 double edge, double margin, fit_likeness *out, sdm_error *err);
void sdm_fit_likeness_dispose(fit_likeness *l);

/* Index in l of the point u of the image, in mm along its axes from its first voxel, and back. */
void sdm_fit_likeness_index(const fit_likeness *l, const sdm_grid *g, const double u[3],
                            double index[3]);
void sdm_fit_likeness_point(const fit_likeness *l, const sdm_grid *g, const double index[3],
                            double u[3]);
