/* Warns of points whose coordinates seem to be in m or um: lengths are mm. */
#pragma once

#include <stddef.h>

#include "sdm/internal/box.h"

/* Warns where the points x[n][3] of the file `path` would lie around the box of the shape, and have
 * about its size, if they were in another unit than mm. name: what the box holds, for the message.
 */
void cli_warn_points_unit(const char *path, const double *x, size_t n, const sdm_box *shape,
                          const char *name);
