/* A family of shapes: an instance with ranges and distributions of its parameters, and the
   parameter vectors at which it is looked at. */
#pragma once

#include "shape_internal.h"

typedef struct shape_family {
    const sdm_instance *shape;
    double min[SHAPE_PARAMS_MAX], max[SHAPE_PARAMS_MAX];
    sdm_distribution distribution[SHAPE_PARAMS_MAX];
    uint64_t seed;
    size_t n_corners;
    bool all_corners; /* the corners of the ranges are all of them, not random ones */
} shape_family;

/* range[n_params] and distribution[n_params]; NULL: those of the shape. A distribution with almost
   no probability in its range counts as uniform. SDM_E_RANGE: a range is empty or wider than the
   shape's. */
sdm_status sdm_family_set(shape_family *f, const sdm_instance *shape, const double (*range)[2],
                          const sdm_distribution *distribution, uint64_t seed, sdm_error *err);

/* p[n_params] = random parameter vector number `index`. [any thread] */
void sdm_family_sample(const shape_family *f, uint64_t index, double *p);

/* p[n_params] = corner number `index` of the ranges, below n_corners. In a random corner a normally
   distributed parameter has a random value in place of an end of its range. [any thread] */
void sdm_family_corner(const shape_family *f, uint64_t index, double *p);
