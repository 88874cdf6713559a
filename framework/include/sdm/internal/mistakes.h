/* The mistakes found in a configuration. The first SDM_MISTAKES_SHOWN by position are kept, the
 * others only counted. */
#pragma once

#include "sdm/internal/config.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_MISTAKES_SHOWN 20
#define SDM_MISTAKE_TEXT_MAX 400
#define SDM_QUOTE_MAX 80

typedef struct sdm_mistake {
    sdm_mark mark;
    char text[SDM_MISTAKE_TEXT_MAX];
} sdm_mistake;

typedef struct sdm_mistakes {
    const char *file; /* file name for marks without a source; owned by the caller */
    size_t count;     /* number of all mistakes, including those that are not kept */
    bool starved;     /* an allocation failed: the list is not complete */
    /* sorted: mistakes in the file by line and column, then mistakes in overrides by number */
    sdm_mistake first[SDM_MISTAKES_SHOWN];
} sdm_mistakes;

/* Records a mistake with a formatted message. */
void sdm_mistakes_add(sdm_mistakes *m, sdm_mark mark, const char *fmt, ...) SDM_PRINTF(3, 4);

/* Records that an allocation failed; it counts as a mistake, so that the reading ends. */
void sdm_mistakes_starve(sdm_mistakes *m);

/* SDM_OK when there are no mistakes; SDM_E_NOMEM after sdm_mistakes_starve(), whatever else was
 * found; else SDM_E_CONFIG with one line per mistake in err->text. */
sdm_status sdm_mistakes_report(const sdm_mistakes *m, sdm_error *err);

/* buf[size] = the position of a mark as text: "file:line:column", "argument 'key=value'", or only
 * the file name. Returns buf. */
const char *sdm_mark_print(sdm_mark mark, const char *file, char *buf, size_t size);

/* buf = `text` for use in a message: control characters become '?', and the text is cut after 60
 * bytes. Returns buf. */
const char *sdm_quote(const char *text, char buf[SDM_QUOTE_MAX]);

#ifdef __cplusplus
}
#endif
