/* Status codes and error text: how every fallible function reports. */
#ifndef SDM_STATUS_H
#define SDM_STATUS_H

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* 0 is success; values are pinned and never reused. */
typedef enum sdm_status {
    SDM_OK = 0,
    SDM_E_ARG = 1,         /* the caller's mistake: a bad argument, name or command-line value */
    SDM_E_NOMEM = 2,       /* out of memory, or over the given memory budget */
    SDM_E_IO = 3,          /* the system refused: open, read, write, fsync, rename */
    SDM_E_FORMAT = 4,      /* the content of a file is damaged or not of its type */
    SDM_E_CONFIG = 5,      /* a mistake in a configuration */
    SDM_E_MESH = 6,        /* a mesh that cannot be used */
    SDM_E_PLUGIN = 7,      /* a shape plug-in misbehaved or cannot be loaded */
    SDM_E_RANGE = 8,       /* shape parameters outside the allowed range */
    SDM_E_UNSUPPORTED = 9, /* valid, but this build cannot do it */
    SDM_E_CANCELLED = 10,  /* stopped on request */
    SDM_E_QUALITY = 11,    /* done, but worse than the demanded quality */
    SDM_E_INTERNAL = 12    /* our own mistake */
} sdm_status;

#define SDM_ERROR_TEXT_MAX 4096

/* Error message, owned by the caller (on its stack): no lock, no stale text. `text` is one line,
   except for a configuration, where every mistake has its own line. */
typedef struct sdm_error {
    sdm_status status;
    char text[SDM_ERROR_TEXT_MAX];
} sdm_error;

/* Stores status and formatted text in *err (which may be NULL) and returns `status`. Text that does
 * not fit is cut. */
SDM_API sdm_status sdm_fail(sdm_error *err, sdm_status status, const char *fmt, ...)
    SDM_PRINTF(3, 4);

/* Puts "prefix: " before the text of *err and returns its status; for callers that know the file or
 * the shape. */
SDM_API sdm_status sdm_fail_in(sdm_error *err, sdm_status status, const char *fmt, ...)
    SDM_PRINTF(3, 4);

/* Short constant name of a status, e.g. "config"; never NULL. */
SDM_API const char *sdm_status_name(sdm_status status);

#ifdef __cplusplus
}
#endif
#endif
