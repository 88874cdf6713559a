/* Where pictures are drawn. */
#pragma once

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/* true: from now on each picture is drawn in a child process, so that a crash of cairo, which has
 * no memory, is an error. Only for a program whose other threads hold no locks of cairo,
 * fontconfig or FreeType: the child would wait for them. Pictures are drawn by the process itself
 * until this is called, and where no child can be started. */
void sdm_picture_in_child(bool wanted);

#ifdef __cplusplus
}
#endif
