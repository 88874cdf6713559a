/* Reads level sets in a child process (reader_child.h). */
#pragma once

#include "sdm/status.h"

/* sdm_vdb_verify() in a child process. *text = new description of the file, freed with sdm_free().
 * Errors of sdm_vdb_verify() and cli_read_in_child(). */
sdm_status cli_vdb_verify(const char *path, char **text, sdm_error *err);
