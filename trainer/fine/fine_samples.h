/* Samples for the fine level (sdm/internal/fine.h): cells at creases of maps of a finished network,
   and what exact maps of half the spacing say there. Each map is made, used and thrown away. */
#pragma once

#include "sdm/internal/fine.h"
#include "state/trainer.h"

typedef struct fine_samples {
    size_t n;
    float *x;    /* [n][SDM_FINE_INPUTS] */
    float *gate; /* [n] */
    float *y;    /* [n][SDM_FINE_OUTPUTS] wanted changes in units of sdm_fine_unit() */
    /* Sums over all new voxels of the maps, and over those within `near_mm` of the surface: squared
       changes that are wanted, mm^2, and their number. */
    double square[2], count[2];
} fine_samples;

/* f: the fine level whose changes are made already; NULL: none. Fills *out with per_shape samples
   of each of n_shapes random shapes, numbers first and up of the stream of these samples; maps
   without creases give samples with a gate of 0. All threads; the bits do not depend on their
   number. Call trainer_fine_samples_dispose() also after an error. SDM_E_CANCELLED, errors of the
   exact engine. */
sdm_status trainer_fine_samples(const trainer *t, const sdm_model *m, const sdm_fine *f,
                                float threshold, size_t first, size_t n_shapes, size_t per_shape,
                                double until, fine_samples *out, sdm_error *err);
void trainer_fine_samples_dispose(fine_samples *s);
