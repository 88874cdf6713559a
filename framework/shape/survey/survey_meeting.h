/* Parts that meet on the surface in some shapes of a family and not in others. */
#pragma once

#include "sdm/internal/part_audit.h"
#include "sdm/internal/shape_survey.h"

/* Which parts of one shape meet, of the first SDM_PART_MEETS. */
typedef struct survey_contacts {
    size_t n; /* parts; 0: not known, or this shape has other triangles than the first one */
    /* bit k of part i: it meets part k outside of further parts; along curves that further parts
       cover in pieces; inside of further parts only; it lies apart from it. None: one of them lies
       in the box of the other and may be inside it. */
    uint32_t meets[SDM_PART_MEETS], partly[SDM_PART_MEETS], covered[SDM_PART_MEETS],
        apart[SDM_PART_MEETS];
} survey_contacts;

void sdm_survey_contacts(const sdm_part_audit *a, survey_contacts *out);

/* Sets *out from the contacts of n shapes with the parameters p[n][n_params]. */
sdm_status sdm_survey_find_meeting(const survey_contacts *contacts, size_t n, const double *p,
                                   size_t n_params, sdm_survey_meeting *out, sdm_error *err);
