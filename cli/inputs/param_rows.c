/* Reads CSV tables of numbers: a header line of names, then one line of numbers for each row. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/internal/file.h"
#include "sdm/internal/heap.h"
#include "setup.h"

enum { MAX_COLUMNS = 256, MAX_BYTES = 64 << 20 };

typedef struct csv_table {
    const char *path;
    char *at;                   /* the text that is not read yet */
    int line;                   /* number of the current line, from 1 */
    size_t column[MAX_COLUMNS]; /* index of the parameter in each column */
    size_t n_columns;
} csv_table;

/* Removes spaces, tabs and carriage returns from both ends. */
static char *trim_spaces(char *word)
{
    word += strspn(word, " \t\r");
    size_t length = strlen(word);
    while (length > 0 && strchr(" \t\r", word[length - 1])) word[--length] = '\0';
    return word;
}

/* The next line that is neither empty nor a comment (#), trimmed; NULL at the end. */
static char *next_line(csv_table *t)
{
    while (*t->at) {
        char *line = t->at;
        const size_t length = strcspn(line, "\n");
        t->at += length + (line[length] == '\n');
        line[length] = '\0';
        t->line++;
        line = trim_spaces(line);
        if (*line && *line != '#') return line;
    }
    return NULL;
}

/* Removes the next cell from *line and returns it trimmed; NULL after the last one. */
static char *next_cell(char **line)
{
    if (!*line) return NULL;
    char *cell = *line, *comma = strchr(cell, ',');
    *line = comma ? comma + 1 : NULL;
    if (comma) *comma = '\0';
    return trim_spaces(cell);
}

static sdm_status read_header(csv_table *t, const sdm_param *params, size_t n, sdm_error *err)
{
    char *line = next_line(t);
    if (!line)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: no header line: the first line must name the columns, such as '%s'",
                        t->path, params[0].name);
    for (char *cell; (cell = next_cell(&line));) {
        // find the parameter of the column
        const char *names[MAX_COLUMNS];
        size_t index = n;
        for (size_t i = 0; i < n && i < MAX_COLUMNS; i++) {
            names[i] = params[i].name;
            if (!strcmp(cell, params[i].name)) index = i;
        }
        if (index == n) {
            const char *near = sdm_nearest_name(cell, names, n < MAX_COLUMNS ? n : MAX_COLUMNS);
            return sdm_fail(err, SDM_E_FORMAT, "%s:%d: unknown column '%.100s'%s%s%s", t->path,
                            t->line, cell, near ? "; did you mean '" : "; the first is '",
                            near ? near : params[0].name, near ? "'?" : "'");
        }
        for (size_t i = 0; i < t->n_columns; i++)
            if (t->column[i] == index)
                return sdm_fail(err, SDM_E_FORMAT, "%s:%d: column '%s' appears twice", t->path,
                                t->line, cell);
        // the columns are distinct, so n_columns <= n <= MAX_COLUMNS
        t->column[t->n_columns++] = index;
    }
    return SDM_OK;
}

static sdm_status read_row(csv_table *t, char *line, double *row, sdm_error *err)
{
    size_t column = 0;
    for (char *cell; (cell = next_cell(&line)); column++) {
        if (column >= t->n_columns)
            return sdm_fail(err, SDM_E_FORMAT, "%s:%d: more values than the %zu of the header",
                            t->path, t->line, t->n_columns);
        double *value = &row[t->column[column]];
        if (sdm_parse_real(cell, value)) continue;
        // NaN and infinities pass here: the range check that follows names the parameter
        char *end = NULL;
        *value = strtod(cell, &end);
        if (end == cell || *end || isfinite(*value))
            return sdm_fail(err, SDM_E_FORMAT, "%s:%d: '%.100s' is not a number", t->path, t->line,
                            cell);
    }
    if (column < t->n_columns)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%d: %zu values, the header has %zu", t->path,
                        t->line, column, t->n_columns);
    return SDM_OK;
}

static size_t count_lines(const char *text)
{
    size_t n = 1;
    for (; *text; text++) n += *text == '\n';
    return n;
}

/* Refuses a parameter that both a column and -p give. */
static sdm_status check_columns(const csv_table *t, const sdm_param *params, const cli_list *given,
                                sdm_error *err)
{
    for (size_t i = 0; i < t->n_columns; i++) {
        const char *name = params[t->column[i]].name;
        const size_t length = strlen(name);
        for (size_t k = 0; k < given->n; k++)
            if (!strncmp(given->items[k], name, length) && given->items[k][length] == '=')
                return sdm_fail(err, SDM_E_ARG,
                                "%s: the column '%s' and -p %s both give this parameter: leave one "
                                "of them out",
                                t->path, name, given->items[k]);
    }
    return SDM_OK;
}

sdm_status cli_read_rows(const char *path, const sdm_param *params, size_t n, const double *base,
                         const cli_list *given, double **values, int **lines, size_t *n_rows,
                         sdm_error *err)
{
    if (n > MAX_COLUMNS)
        return sdm_fail(err, SDM_E_ARG, "%zu parameters, a table has at most %d", n, MAX_COLUMNS);
    uint8_t *data = NULL;
    size_t size = 0, total = 0;
    sdm_status s = sdm_file_read(path, MAX_BYTES, &data, &size, err);
    if (s) return s;
    // spreadsheets begin the file with a byte order mark
    const bool marked = size >= 3 && !memcmp(data, "\xef\xbb\xbf", 3);
    csv_table t = {.path = path, .at = (char *)data + (marked ? 3 : 0)};
    if (strlen((char *)data) != size)
        s = sdm_fail(err, SDM_E_FORMAT, "%s: not a text file (a zero byte)", path);
    if (!s) s = sdm_mul(count_lines(t.at), n, &total, err);
    if (!s) s = SDM_ALLOC(values, total, "table of parameters", err);
    if (!s && lines) s = SDM_ALLOC(lines, count_lines(t.at), "table of parameters", err);
    if (!s) s = read_header(&t, params, n, err);
    if (!s) s = check_columns(&t, params, given, err);
    // the rows
    *n_rows = 0;
    for (char *line; !s && (line = next_line(&t)); (*n_rows)++) {
        double *row = *values + *n_rows * n;
        memcpy(row, base, n * sizeof *row);
        if (lines) (*lines)[*n_rows] = t.line;
        s = read_row(&t, line, row, err);
    }
    if (!s && *n_rows == 0) s = sdm_fail(err, SDM_E_FORMAT, "%s: no row after the header", path);
    if (s) {
        sdm_free(*values);
        *values = NULL;
        if (lines) {
            sdm_free(*lines);
            *lines = NULL;
        }
    }
    sdm_free(data);
    return s;
}
