/* What the readers of folders have in common. */
#pragma once

#include "args/options.h"
#include "sdm/internal/ssm.h"

/* *out = the paths of the files of a folder whose names have one of the endings (separated by
 * spaces), in the order of the bytes of their names; files that begin with a dot are left out. Free
 * it with cli_folder_free(). SDM_E_IO, SDM_E_ARG: a path is too long; SDM_E_NOMEM. */
sdm_status cli_folder_list(const char *folder, const char *endings, cli_list *out, sdm_error *err);
void cli_folder_free(cli_list *list);

/* Makes the model of n shapes vert[n][out->n_vert][3], which are moved, with the triangles that
 * *out has: sdm_ssm_align(), sdm_ssm_components(). Errors as those. */
sdm_status cli_ssm_build(size_t n, double *vert, bool scale, sdm_ssm *out, sdm_error *err);
