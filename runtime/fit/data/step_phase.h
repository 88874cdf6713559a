/* How far the steps of labels average out over a piece of the surface.

   Labels show a surface to a voxel: its place is off by a step of 1 / sqrt(12) voxel (rms). Where
   the places s of its samples, in voxels, lie anywhere within a voxel, these errors cancel; where
   all lie at the same part of a voxel, the whole piece is off. The length of the mean of exp(2 pi i
   s) tells: 0 for the former, 1 for the latter. */
#pragma once

#include <math.h>

/* sd of a place that is known to a whole voxel: 1 / sqrt(12) */
#define FIT_STEP_SD 0.28867513459481287

/* Sums over the samples: of their weights, and of weight times cos and sin of 2 pi s. */
typedef struct fit_step_phase {
    double all, turn[2];
} fit_step_phase;

static inline void fit_step_phase_add(fit_step_phase *f, double weight, double place)
{
    const double angle = 6.283185307179586 * place;
    f->all += weight;
    f->turn[0] += weight * cos(angle);
    f->turn[1] += weight * sin(angle);
}
