/* Messages about a file of another type than the one that is wanted. */
#pragma once

#include "sdm/status.h"

/* What to do with `path`, a file that is no model: the end of a message, "; a mesh: ..." by the
 * ending of its name, by its length 0, or because it is a folder. "": nothing is known about it.
 * buf[256] may hold the text. */
const char *cli_other_file(const char *path, char buf[256]);
