/* Measures of the cochlea as surgeons and audiologists define them, on the model of cochlea.c. The
 * lateral wall is the curve of the outermost points of the cross-sections, centre + wide * e1, and
 * the modiolar axis is z. docs/measures.md compares the definitions with the published ones. */
#pragma once

#include "cochlea_curve.h"
#include "sdm/shape.h"

enum {
    COCHLEA_DIAMETER_A,
    COCHLEA_DIAMETER_B,
    COCHLEA_HEIGHT,
    COCHLEA_LENGTH_CENTRE,
    COCHLEA_LENGTH_WALL,
    COCHLEA_TURNS,
    COCHLEA_INSERTION_ANGLE,
    COCHLEA_FREQUENCY,
    COCHLEA_MEASURES
};

extern const sdm_measure sdm_cochlea_measures[COCHLEA_MEASURES];

/* A curve along the centreline: out[3] = point at theta = fraction * (apical angle), mm. */
typedef void cochlea_curve(const void *owner, double fraction, double out[3]);

/* All that the measures need of a cochlea. `owner` is given to the functions. */
typedef struct cochlea_path {
    const void *owner;
    double end; /* angle of the apical end, rad */
    cochlea_curve *centre, *wall;
    /* highest point of the section over the plane z = 0, mm, or of its image in this plane with
     * `up` -1. end: -1 or 1: the section has the cap of the basal or apical end; 0: none */
    double (*height)(const void *owner, double fraction, double up, int end);
} cochlea_path;

/* Measure number `index` of a path, end >= COCHLEA_MEASURES_FROM; otherwise as
 * sdm_cochlea_measure(). */
double sdm_cochlea_path_measure(const cochlea_path *path, uint32_t index, double depth);

/* Smallest angle of the apical end, rad, at which the tube has all of these measures: diameter B
 * needs three quarters of a turn. */
#define COCHLEA_MEASURES_FROM 4.8

/* Measure number `index` at the unknowns x[COCHLEA_UNKNOWNS], x[COCHLEA_THETA] >=
 * COCHLEA_MEASURES_FROM. depth: along the lateral wall from the basal end, mm; beyond the apical
 * end it is NaN. Lengths and angles are right to 1e-5 of their value. */
double sdm_cochlea_measure(const cochlea_model *m, const double *x, uint32_t index, double depth);
