/* Cells of Markdown and CSV tables, appended to a text, and writing the finished table to
 * a file. */
#pragma once

#include "sdm/internal/text.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Appends `text` as Markdown: a backslash is inserted before each of | * _ ` < \ [. */
void sdm_markdown_text(sdm_text *t, const char *text);

/* Appends the cell of a number with its closing bar, " 1.23 |": three significant digits; " - |"
 * for NaN and infinities. sdm_markdown_plain() avoids exponents from 1e-3 to 1e6 and writes
 * integers and values from 100 on without decimals: " 1235 |". */
void sdm_markdown_real(sdm_text *t, double v);
void sdm_markdown_plain(sdm_text *t, double v);

/* Appends the line below the head of a table: n_left columns aligned left, then n_right columns
 * aligned right. */
void sdm_markdown_rule(sdm_text *t, size_t n_left, size_t n_right);

/* Appends `text` as a CSV cell in double quotes; double quotes in the text are doubled. */
void sdm_csv_text(sdm_text *t, const char *text);

/* Appends a comma and the number v, with the fewest digits that read back to the same value; for
 * NaN and infinities only the comma. */
void sdm_csv_real(sdm_text *t, double v);

/* Writes the text to the file `path`, atomically as in sdm/internal/file.h. SDM_E_NOMEM: t->failed
 * is set, or an allocation fails here; SDM_E_IO. */
sdm_status sdm_text_write(const sdm_text *t, const char *path, sdm_error *err);

#ifdef __cplusplus
}
#endif
