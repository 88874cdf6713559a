/* Reads level sets in a child process: OpenVDB writes past its memory, or asks for all there is,
 * when a file is damaged in the wrong place. */
#pragma once

#include "sdm/status.h"

/* sdm_vdb_verify() in a child process with limits, for a program without other threads: 512 MB and
 * 2 s of processor time for a small file, more for a large one (32 bytes and 1 us for each of its
 * bytes). *text = new description of the file, freed with sdm_free(). Errors of sdm_vdb_verify();
 * SDM_E_IO: not a regular file, or no process; SDM_E_FORMAT: the child crashed or reached a limit.
 */
sdm_status cli_vdb_verify(const char *path, char **text, sdm_error *err);
