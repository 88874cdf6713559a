/* The list of mistakes found in a configuration: the first few by position are kept, the rest are
 * counted. */
#ifndef SDM_MISTAKES_H
#define SDM_MISTAKES_H

#include "sdm/internal/config.h"

#define SDM_MISTAKES_SHOWN 20
#define SDM_MISTAKE_TEXT_MAX 400
#define SDM_QUOTE_MAX 80

typedef struct sdm_mistake {
    sdm_mark mark;
    char text[SDM_MISTAKE_TEXT_MAX];
} sdm_mistake;

typedef struct sdm_mistakes {
    const char *file; /* of the marks without a source; the caller's */
    size_t count;
    sdm_mistake first[SDM_MISTAKES_SHOWN]; /* sorted: the file by line and column, then the
                                              overrides by number */
} sdm_mistakes;

void sdm_mistakes_add(sdm_mistakes *m, sdm_mark mark, const char *fmt, ...) SDM_PRINTF(3, 4);

/* SDM_OK when there are none, else SDM_E_CONFIG with one line for each in err->text. */
sdm_status sdm_mistakes_report(const sdm_mistakes *m, sdm_error *err);

/* "file:line:column", "argument 'key=value'", or the file alone. Returns buf. */
const char *sdm_mark_print(sdm_mark mark, const char *file, char *buf, size_t size);

/* `text` made fit for a message: on one line, cut behind 60 bytes. Returns buf. */
const char *sdm_quote(const char *text, char buf[SDM_QUOTE_MAX]);

#endif
