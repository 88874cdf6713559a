/* A child process that draws a picture: cairo 1.16 crashes where some of its allocations fail, and
 * its scan converter then jumps to an address that it has never set. What that does ends with the
 * child. */
#pragma once

#include <stdbool.h>

#include "sdm/status.h"

/* The part of a process in the drawing of a picture. */
typedef enum sdm_drawer_part {
    SDM_DRAWS_ITSELF, /* there is no child: none is wanted, or there is no process for it */
    SDM_DRAWS_AS_CHILD,
    SDM_HAS_CHILD_DRAWN
} sdm_drawer_part;

/* Starts the child if sdm_picture_in_child() wants one. The parent returns when the child has
 * ended, with the child's error, or SDM_E_NOMEM if the child crashed; *part tells where the call
 * returns. `path` is for messages. */
sdm_status sdm_drawer_start(const char *path, sdm_drawer_part *part, sdm_error *err);

/* Ends the child: its parent's call of sdm_drawer_start() returns s and, if s is an error, *err. */
_Noreturn void sdm_drawer_end(sdm_status s, const sdm_error *err);
