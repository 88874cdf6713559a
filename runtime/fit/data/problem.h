/* What the files of this folder share: the unknowns and where they stand. */
#ifndef FIT_PROBLEM_H
#define FIT_PROBLEM_H

#include "sdm/fit.h"

enum {
    FIT_PARAMS_MAX = 64,
    FIT_TISSUES_MAX = 2 * SDM_FIT_LAWS,
    FIT_FIELDS_MAX =
        FIT_PARAMS_MAX + 2, // the field, its derivatives by the parameters and by the blur
    FIT_COLUMNS_MAX =
        FIT_PARAMS_MAX + 7, // unknowns that move the field: parameters, rotation, translation, blur
    FIT_UNKNOWNS_MAX = FIT_COLUMNS_MAX + FIT_TISSUES_MAX // and the means of the tissues
};

/* What is sought. */
typedef struct fit_state {
    double params[FIT_PARAMS_MAX];
    double rotation[9], translation[3]; // world = R x + t
    double blur, l_ref, point_sd;       // mm
    sdm_fit_appearance look;
} fit_state;

/* Place of the unknowns in vectors: parameters, then these. */
static inline size_t fit_at_rotation(size_t n_params) { return n_params; }
static inline size_t fit_at_translation(size_t n_params) { return n_params + 3; }
static inline size_t fit_at_blur(size_t n_params) { return n_params + 6; }
static inline size_t fit_columns(size_t n_params) { return n_params + 7; }

#endif
