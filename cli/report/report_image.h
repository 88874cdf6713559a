/* What an image file holds, for people and as JSON. */
#ifndef CLI_REPORT_IMAGE_H
#define CLI_REPORT_IMAGE_H

#include "sdm/internal/text.h"
#include "sdm/volume.h"

/* Several lines on stdout. */
void cli_print_volume(const char *path, const sdm_volume *v);

/* The members of an object. */
void cli_json_volume(sdm_json *j, const char *path, const sdm_volume *v);

#endif
