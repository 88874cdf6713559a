/* Prints the content of an image file as text and as JSON. */
#pragma once

#include "sdm/internal/text.h"
#include "sdm/volume.h"

/* Prints grid, range of values, segments and description as text on stdout. */
void cli_print_volume(const char *path, const sdm_volume *v);

/* Is the file a signed distance map that this program has written? */
bool cli_is_distance_map(const sdm_volume *v);

/* Adds the same figures, and the direction matrix, as members of the open object. */
void cli_json_volume(sdm_json *j, const char *path, const sdm_volume *v);
