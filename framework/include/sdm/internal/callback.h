/* The callback of a shape that a thread is in: whoever ends the process there can name it. */
#pragma once

#include "sdm/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sdm_callback {
    const char *shape;       /* name of the shape */
    const char *function;    /* name of the callback: "mesh", "create", ... */
    const sdm_param *params; /* [n] */
    const double *values;    /* [n] */
    size_t n;                /* 0: the callback gets no parameters */
} sdm_callback;

/* The callback that the calling thread is in; NULL: none. Valid until the callback returns; may be
 * called in a signal handler. */
const sdm_callback *sdm_callback_running(void);

/* What it means that a signal ended a callback, "the plug-in divided an integer by zero"; may be
 * called in a signal handler. */
const char *sdm_callback_crash_reason(int signal_number);

#ifdef __cplusplus
}
#endif
