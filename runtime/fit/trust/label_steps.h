/* What the steps of labels do to a fit.

   A label tells on which side of the surface the centre of a voxel lies, so the surface is known to
   a voxel. Where it runs obliquely through the voxels, or is curved, the steps average out. A flat
   face that is parallel to them is off as a whole, by up to half a voxel; one that rises by less
   than a voxel over its length has the same labels, which hide its tilt. */
#pragma once

#include "neighbours.h"

/* Adds to out[n_unknowns][n_unknowns] the covariance of the score caused by the steps of the labels
   in pieces of the surface that lie between the same two layers of voxels. s: place of the surface
   in voxels. A curved piece is off by 1 / sqrt(12) voxel (rms) times the length of the mean of
   exp(2 pi i s) over its samples. A flat one is off by 1 / sqrt(12) voxel as a whole, and by
   1 / sqrt(24) voxel at its ends for a tilt along each of the other two axes, both times
   min(1, (1 - 12 variance(s)) / (1 - 0.75^2)): by nothing where it runs from one layer to the next.
   v: the neighbours of p. SDM_E_NOMEM. */
sdm_status sdm_fit_label_steps(const fit_problem *p, const fit_neighbours *v, double *out,
                               sdm_error *err);
