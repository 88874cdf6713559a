/* Status codes and error messages.

   A function that can fail returns an sdm_status. Its argument `err` receives the status and
   the message of a failure; err may be NULL. Test the returned status, not *err: a function that
   succeeds may leave the message of an earlier failure in *err.

       sdm_error err = {0};
       if (sdm_model_open("model.sdm", &model, &err)) fprintf(stderr, "%s\n", err.text); */
#ifndef SDM_STATUS_H
#define SDM_STATUS_H

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Result of a function: 0 is success. Values are fixed and never reused. */
typedef enum sdm_status {
    SDM_OK = 0,
    SDM_E_ARG = 1,         /* invalid argument, name or command-line value from the caller */
    SDM_E_NOMEM = 2,       /* out of memory, or over the given memory limit */
    SDM_E_IO = 3,          /* a system call failed: open, read, write, fsync, rename */
    SDM_E_FORMAT = 4,      /* the content of a file is damaged or of another type */
    SDM_E_CONFIG = 5,      /* error in a configuration */
    SDM_E_MESH = 6,        /* the mesh cannot be used */
    SDM_E_PLUGIN = 7,      /* a shape plug-in returned invalid data or cannot be loaded */
    SDM_E_RANGE = 8,       /* shape parameters outside the allowed range */
    SDM_E_UNSUPPORTED = 9, /* valid input, but not supported by this build or shape */
    SDM_E_CANCELLED = 10,  /* cancelled by the caller */
    SDM_E_QUALITY = 11,    /* completed, but the result is below the required quality */
    SDM_E_INTERNAL = 12    /* bug in sdmgen */
} sdm_status;

#define SDM_ERROR_TEXT_MAX 4096

/* The message of a failure. Each thread needs an sdm_error of its own. `text` is one line without a
 * line feed; errors of a configuration have one line for each mistake. */
typedef struct sdm_error {
    sdm_status status;
    char text[SDM_ERROR_TEXT_MAX];
} sdm_error;

/* Stores the status and the formatted text in *err (may be NULL) and returns `status`. Text beyond
 * SDM_ERROR_TEXT_MAX - 1 bytes is cut off. [any thread] */
SDM_API sdm_status sdm_fail(sdm_error *err, sdm_status status, const char *fmt, ...)
    SDM_PRINTF(3, 4);

/* Writes "PREFIX: " before the text of *err, stores `status` in it and returns `status`; err may be
 * NULL. PREFIX is a printf format and names, for example, the file or the shape. [any thread] */
SDM_API sdm_status sdm_fail_in(sdm_error *err, sdm_status status, const char *fmt, ...)
    SDM_PRINTF(3, 4);

/* Short constant name of a status, e.g. "config"; "unknown" for other values, never NULL. [any
 * thread] */
SDM_API const char *sdm_status_name(sdm_status status);

#ifdef __cplusplus
}
#endif
#endif
