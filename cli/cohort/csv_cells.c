/* Reads CSV files whose cells are texts. */
#include "csv_cells.h"

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "sdm/internal/file.h"
#include "sdm/memory.h"

enum { MAX_BYTES = 64 << 20 };

/* Removes spaces, tabs and carriage returns from both ends of word[length], and ends it there. */
static char *trim_spaces(char *word, size_t length)
{
    while (length > 0 && strchr(" \t\r", word[length - 1])) length--;
    word[length] = '\0';
    return word + strspn(word, " \t\r");
}

/* Takes the cell at *at out of its line, which ends at `end`; *at = the next one, NULL after the
 * last. NULL: a quote has no end, or text follows it. */
static char *take_cell(char **at, char *end)
{
    char *cell = *at + strspn(*at, " \t");
    if (*cell != '"') {
        char *comma = memchr(*at, ',', (size_t)(end - *at));
        cell = trim_spaces(*at, (size_t)((comma ? comma : end) - *at));
        *at = comma ? comma + 1 : NULL;
        return cell;
    }
    char *to = cell;
    const char *from = cell + 1;
    for (; from < end && (*from != '"' || from[1] == '"'); from++) {
        from += *from == '"';
        *to++ = *from;
    }
    if (from >= end) return NULL;
    from += 1 + strspn(from + 1, " \t\r");
    const bool last = from >= end;
    if (!last && *from != ',') return NULL;
    *at = last ? NULL : (char *)from + 1;
    *to = '\0';
    return cell;
}

/* Splits a line into cells and appends the row. The first row sets the number of columns. */
static sdm_status add_row(cli_cells *t, size_t *rows, const char *path, int number, char *line,
                          char *end, sdm_error *err)
{
    const char **cell = t->cell + *rows * t->n_columns;
    size_t n = 0;
    for (char *at = line; at; n++) {
        if (*rows > 0 && n == t->n_columns)
            return sdm_fail(err, SDM_E_FORMAT,
                            "%s:%d: more cells than the %zu of the header: a cell with commas "
                            "needs double quotes, \"1,2,3\"",
                            path, number, t->n_columns);
        cell[n] = take_cell(&at, end);
        if (!cell[n])
            return sdm_fail(err, SDM_E_FORMAT,
                            "%s:%d: the cell number %zu begins with a double quote and must end "
                            "with one in the same line",
                            path, number, n + 1);
    }
    if (*rows == 0) t->n_columns = n;
    if (n != t->n_columns)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%d: %zu cells, the header has %zu", path, number, n,
                        t->n_columns);
    t->line[(*rows)++] = number;
    return SDM_OK;
}

static sdm_status split(cli_cells *t, const char *path, sdm_error *err)
{
    size_t rows = 0;
    int number = 1;
    sdm_status s = SDM_OK;
    // spreadsheets begin the file with a byte order mark
    for (char *at = t->text + (strncmp(t->text, "\xef\xbb\xbf", 3) ? 0 : 3); *at && !s; number++) {
        char *line = at + strspn(at, " \t\r"), *end = at + strcspn(at, "\n");
        at = end + (*end == '\n');
        *end = '\0';
        if (line < end && *line != '#') s = add_row(t, &rows, path, number, line, end, err);
    }
    if (!s && rows == 0)
        s = sdm_fail(err, SDM_E_FORMAT, "%s: no header line with the names of the columns", path);
    if (!s && rows == 1) s = sdm_fail(err, SDM_E_FORMAT, "%s: no row after the header", path);
    t->n_rows = s ? 0 : rows - 1;
    return s;
}

sdm_status cli_cells_read(const char *path, cli_cells *out, sdm_error *err)
{
    size_t size = 0, lines = 0, n = 1;
    *out = (cli_cells){0};
    sdm_status s = sdm_file_read_text(path, MAX_BYTES, &out->text, &size, &lines, err);
    for (size_t i = 0; !s && i < size; i++) n += out->text[i] == ',';
    if (!s) s = SDM_ALLOC(&out->cell, n + lines, "table", err);
    if (!s) s = SDM_ALLOC(&out->line, lines, "table", err);
    if (!s) s = split(out, path, err);
    if (s) cli_cells_dispose(out);
    return s;
}

void cli_cells_dispose(cli_cells *cells)
{
    sdm_free(cells->line);
    sdm_free((void *)cells->cell);
    sdm_free(cells->text);
    *cells = (cli_cells){0};
}
