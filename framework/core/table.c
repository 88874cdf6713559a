/* Markdown and CSV cells. */
#include "sdm/internal/table.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/file.h"

void sdm_markdown_text(sdm_text *t, const char *text)
{
    for (; *text; text++) sdm_text_add(t, strchr("|*_`<\\[", *text) ? "\\%c" : "%c", *text);
}

void sdm_markdown_real(sdm_text *t, double v)
{
    sdm_text_add(t, isfinite(v) ? " %.3g |" : " - |", v);
}

void sdm_markdown_plain(sdm_text *t, double v)
{
    if (isfinite(v) && v != 0 && (fabs(v) < 1e-3 || fabs(v) >= 1e6))
        sdm_text_add(t, " %.2e |", v);
    else if (isfinite(v) && (fabs(v) >= 100 || v == floor(v)))
        sdm_text_add(t, " %.0f |", v);
    else
        sdm_markdown_real(t, v);
}

void sdm_markdown_rule(sdm_text *t, size_t n_left, size_t n_right)
{
    sdm_text_add(t, "|");
    for (size_t i = 0; i < n_left + n_right; i++) sdm_text_add(t, i < n_left ? "---|" : "---:|");
    sdm_text_add(t, "\n");
}

void sdm_csv_text(sdm_text *t, const char *text)
{
    sdm_text_add(t, "\"");
    for (; *text; text++) sdm_text_add(t, *text == '"' ? "\"\"" : "%c", *text);
    sdm_text_add(t, "\"");
}

void sdm_csv_real(sdm_text *t, double v)
{
    char number[32];
    sdm_text_add(t, ",%s", isfinite(v) ? sdm_format_real(v, number) : "");
}

sdm_status sdm_text_write(const sdm_text *t, const char *path, sdm_error *err)
{
    if (t->failed) return sdm_fail(err, SDM_E_NOMEM, "%s: out of memory", path);
    sdm_outfile *file = NULL;
    sdm_status s = sdm_outfile_open(path, &file, err);
    if (!s) s = sdm_outfile_write(file, t->data, t->size, err);
    if (!s) return sdm_outfile_commit(&file, err);
    sdm_outfile_discard(&file);
    return s;
}
