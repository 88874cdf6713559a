/* Misfit: where the data contradict the fitted shape, measured against the noise.

   Where the shape is right, residuals are noise. Where it is wrong, the residuals of a whole
   neighbourhood have one sign. The samples are therefore grouped into units: the samples in a cube
   whose edge is half of the largest radius of the shape, separately on both sides of the surface.
   The mean residual of a unit is compared with its standard deviation, which follows from the size
   and the correlation of the noise, and from the error of the maps, which is the same for a whole
   unit. */
#pragma once

#include "residuals.h"

/* The neighbourhood that contradicts the shape most. */
typedef struct fit_worst_place {
    double world[3]; /* middle of its samples, mm */
    double chi_square;
    bool more;   /* true: the data hold more of the inside's material there than the shape */
    double same; /* share of the contradiction (sum of the squared deviations of the units beyond
                    three of them) that has this sign */
} fit_worst_place;

typedef struct fit_misfit {
    /* outside of the surface [0] and inside [1]; points count as inside */
    /* number of units; of points that are no strays (points alone) */
    size_t n_units[2], n_points;
    /* points: too few of them have companions in their unit, or too few units, to tell their
       scatter from errors of the shape */
    bool few;
    /* mean over the units of (mean residual)^2 / variance, where errors of the maps add to the
       variance. 1: the residuals are noise and these errors */
    double chi_square[2];
    /* the unit of the largest deviation; chi_square 0: none deviates by three */
    fit_worst_place worst[2];
    /* chi_square of both sides together, with the variance of the noise alone */
    double noise_chi_square;
    /* points at their feet, else 0: the same, if they share no more of their errors than nearest
       neighbours do. (The chi_square takes the points of a unit to share all of them, as those of a
       segmentation may.) */
    double scatter_chi_square;
    /* largest chi_square that noise alone exceeds once in a thousand fits, with the uncertainty of
       the noise itself; the units count as correlated with their neighbours as the noise is */
    double limit[2];
    /* Volume that the data contradict over the volume of the shape: inside the surface without the
       material of the inside (empty), and outside of it with this material (missing). Only units
       count whose mean exceeds three standard deviations; labels also miss what lies beyond the
       samples. Points: the volumes between the surface
       of the shape and that of the points, inside and outside of the shape */
    double empty, missing;
    /* labels: number of voxels inside that are too far from the shape to be samples */
    double beyond;
} fit_misfit;

/* Measures the misfit from the residuals; points: sets their sd first. */
sdm_status sdm_fit_misfit(const fit_problem *p, fit_residuals *r, fit_misfit *out, sdm_error *err);
