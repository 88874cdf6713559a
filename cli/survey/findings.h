/* A survey of shapes whose findings are told. */
#pragma once

#include "sdm/internal/config.h"
#include "sdm/internal/shape_survey.h"
#include "sdm/internal/text.h"

/* The survey of a shape, and with what it was made. */
typedef struct cli_survey {
    const sdm_instance *shape;
    const sdm_grid *grid;     /* NULL: none */
    const sdm_config *config; /* whose grid it is; NULL: none */
    /* nothing is told of shapes that all overlap themselves or all have parts apart: they mostly do
     * so on purpose */
    bool brief;
    sdm_shape_survey found;
} cli_survey;

/* Called with a line. weight: SDM_E_MESH: the meshes are broken; SDM_E_QUALITY: a training or
 * derivatives would suffer; SDM_OK: good to know. */
typedef void cli_tell(void *user, sdm_status weight, const char *line);

/* The weight of the findings of sdm_survey_mend_first(). */
sdm_status cli_survey_cause(const cli_survey *s);

/* The spacing, mm, with which the line about the thinnest part says that the grid shows it; NaN: no
 * such line is told. */
double cli_survey_thin_spacing(const cli_survey *s);

/* Appends "flat faces lie exactly on planes of voxel centres along x and z, ..." to `text`. */
void cli_describe_hits(const sdm_face_hits *h, sdm_text *text);
