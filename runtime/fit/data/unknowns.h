/* The unknowns of a fit and their order in vectors and matrices. */
#pragma once

#include "sdm/fit.h"

enum {
    /* shape parameters */
    FIT_PARAMS_MAX = 64,
    /* tissues, inside and outside together */
    FIT_TISSUES_MAX = 2 * SDM_FIT_LAWS,
    /* fields on a map: the field itself, its derivatives by the shape parameters and by the blur */
    FIT_FIELDS_MAX = FIT_PARAMS_MAX + 2,
    /* columns: unknowns that change the field (parameters, rotation, translation, blur) */
    FIT_COLUMNS_MAX = FIT_PARAMS_MAX + 7,
    /* all unknowns of a Newton step: the columns, then the means of the tissues */
    FIT_UNKNOWNS_MAX = FIT_COLUMNS_MAX + FIT_TISSUES_MAX
};

/* Current estimate of everything that a fit can change. */
typedef struct fit_state {
    /* [n_params], in the units of the shape's parameters */
    double params[FIT_PARAMS_MAX];
    /* pose: world = rotation (row-major, 3 x 3) * x + translation (mm), x in the shape's frame */
    double rotation[9], translation[3];
    /* mm: sd of the point spread; scale of the logistic prior; sd of points about the surface */
    double blur, l_ref, point_sd;
    /* points: share of outliers, whose distances are spread evenly over this density, per mm */
    double outliers, outlier_density;
    /* intensity distributions of the tissues */
    sdm_fit_appearance appearance;
} fit_state;

/* Index of the first unknown of each group; the shape parameters start at 0. The number of columns
 * is the index of the first tissue mean. */
static inline size_t fit_at_rotation(size_t n_params) { return n_params; }
static inline size_t fit_at_translation(size_t n_params) { return n_params + 3; }
static inline size_t fit_at_blur(size_t n_params) { return n_params + 6; }
static inline size_t fit_columns(size_t n_params) { return n_params + 7; }
