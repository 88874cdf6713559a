/* The description of a model: one "key=value" a line, written and read back in a fixed order. */
#ifndef SDM_MODEL_TEXT_H
#define SDM_MODEL_TEXT_H

#include <stdbool.h>

#include "sdm/internal/text.h"

void sdm_text_add_real(sdm_text *t, const char *key, double v);
void sdm_text_add_reals(sdm_text *t, const char *key, const double *v, size_t n);

/* Reads the lines in their order; after a failure every further read fails too and gives the lowest
   allowed value, so that a row of reads needs one check: sdm_lines_check(). */
typedef struct sdm_lines {
    const char *at, *end;
    char value[1100];
    bool failed;
    char wanted[64]; /* last key asked for */
} sdm_lines;

const char *
sdm_lines_value(sdm_lines *r,
                const char *key); /* the value, until the next read; "" after a failure */
void sdm_lines_reals(sdm_lines *r, const char *key, double *out, size_t n);
double sdm_lines_real(sdm_lines *r, const char *key);
int64_t sdm_lines_int(sdm_lines *r, const char *key, int64_t min, int64_t max);
void sdm_lines_text(sdm_lines *r, const char *key, char *out, size_t size);

/* SDM_E_FORMAT, naming the key, when a read has failed. */
sdm_status sdm_lines_check(const sdm_lines *r, sdm_error *err);

#endif
