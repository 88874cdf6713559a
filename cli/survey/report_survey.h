/* Tells the findings of a survey of shapes (shape_survey.h), one line each. */
#pragma once

#include "findings.h"

/* For cli_survey_tell(): the findings about the grid, which come with those of the last stage; the
 * findings of all stages. */
enum {
    CLI_STAGE_GRID = 8,
    CLI_ALL_STAGES = SDM_SURVEY_MESHES | SDM_SURVEY_PARTS | SDM_SURVEY_REST | CLI_STAGE_GRID
};

/* Calls tell() for every finding of a sum of stages, for each the gravest first. Where
 * sdm_survey_mend_first(), it leaves out what may follow. SDM_E_NOMEM. */
sdm_status cli_survey_tell(const cli_survey *s, unsigned stages, cli_tell *tell, void *user,
                           sdm_error *err);

/* Appends what was left out for want of time, "3 of 145 shapes, ..."; nothing if all was tested. */
void cli_survey_untested(const cli_survey *s, sdm_text *text);

/* A survey of about a second of the shape of a configuration, over its ranges, distributions and
 * grid, told as warnings and notices; some meshes are made in the process, too. Returns the number
 * of warnings about the shape, without those about the grid; *thin_spacing =
 * cli_survey_thin_spacing() (NULL: not wanted). Errors, such as that of an interrupt,
 * are no notices: what follows meets them again. */
size_t cli_notice_survey(const sdm_config *c, const sdm_instance *shape, sdm_repeat_process process,
                         double *thin_spacing);

/* Warns in one line if the meshes of a shape depend on the calls before; makes some dozens of them,
 * and takes a tenth of a second more. Without memory for it nothing is tested. */
void cli_warn_repeats(const sdm_instance *shape);
