/* Reads points from text tables, NumPy arrays and mesh files. */
#include "points_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "report/files.h"
#include "sdm/image.h"
#include "sdm/internal/file.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/text.h"
#include "sdm/meshfile.h"

#define MAX_BYTES ((uint64_t)4 << 30)

/* The end of messages about a line with other separators, as spreadsheets of some countries write
 * it: 0,5;1;2 for 0.5,1,2. */
#define SEPARATORS "; commas separate the values, and a decimal number has a point: 0.5,1,2"

/* The columns of a table. */
typedef struct columns {
    size_t n, place[3]; /* number; places of x, y and z */
} columns;

/* Cuts the next cell off *line and trims it; NULL after the last one. */
static char *next_cell(char **line)
{
    if (!*line) return NULL;
    char *cell = *line, *comma = strchr(cell, ',');
    *line = comma ? comma + 1 : NULL;
    if (comma) *comma = '\0';
    cell += strspn(cell, " \t\r");
    size_t length = strlen(cell);
    while (length > 0 && strchr(" \t\r", cell[length - 1])) cell[--length] = '\0';
    return cell;
}

/* Finds the columns x, y and z among the names of a header, which may hold others. */
static sdm_status read_names(const char *path, size_t number, char *line, columns *c,
                             sdm_error *err)
{
    const char *first[3] = {"", "", ""};
    int found[3] = {0, 0, 0};
    size_t n = 0;
    for (char *cell; (cell = next_cell(&line)); n++) {
        const char *at = strlen(cell) == 1 ? strchr("xXyYzZ", *cell) : NULL;
        if (n < 3) first[n] = cell;
        if (!at) continue;
        const int axis = (int)(at - "xXyYzZ") / 2;
        found[axis]++;
        c->place[axis] = n;
    }
    c->n = n;
    if (found[0] == 1 && found[1] == 1 && found[2] == 1) return SDM_OK;
    return sdm_fail(err, SDM_E_FORMAT,
                    "%s:%zu: the header (%.30s%s%.30s%s%.30s%s) must name one column each x, y and "
                    "z, in mm; without a header a line is x,y,z%s",
                    path, number, first[0], n > 1 ? "," : "", first[1], n > 2 ? "," : "", first[2],
                    n > 3 ? ",..." : "", strchr(first[0], ';') ? SEPARATORS : "");
}

/* Whether none of the cells of the line is a number. */
static bool is_header(const char *line)
{
    for (const char *cell = line; cell; cell = strchr(cell, ',')) {
        char text[64], *end = text;
        double value;
        cell += *cell == ',';
        snprintf(text, sizeof text, "%.*s", (int)strcspn(cell, ","), cell);
        if (sdm_parse_real(next_cell(&end), &value)) return false;
    }
    return true;
}

/* Reads the coordinates of one line, which is changed. */
static sdm_status read_line(const char *path, size_t number, char *line, const columns *c,
                            double x[3], sdm_error *err)
{
    size_t n = 0;
    const char *wrong = NULL;
    for (char *cell; (cell = next_cell(&line)); n++)
        for (size_t a = 0; a < 3; a++)
            if (n == c->place[a] && !sdm_parse_real(cell, &x[a]) && !wrong) wrong = cell;
    if (wrong)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s:%zu: '%.100s' is not a finite number; a line is %s%s", path, number,
                        wrong, c->n == 3 ? "x,y,z" : "as the header says",
                        strchr(wrong, ';') ? SEPARATORS : "");
    if (n != c->n && c->n == 3)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: %zu values, a line needs three: x,y,z (mm)%s",
                        path, number, n, n == 6 ? SEPARATORS : "");
    if (n != c->n)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: %zu values, the header names %zu columns", path,
                        number, n, c->n);
    return SDM_OK;
}

static sdm_status read_csv(const char *path, double **x, size_t **places, size_t *n, sdm_error *err)
{
    char *text = NULL;
    size_t size, lines, number = 0;
    sdm_status s = sdm_file_read_text(path, MAX_BYTES, &text, &size, &lines, err);
    if (s) return s;
    s = SDM_ALLOC(x, 3 * lines, "points", err);
    if (!s && places) s = SDM_ALLOC(places, lines, "lines of points", err);
    // spreadsheets begin the file with a byte order mark
    char *at = size >= 3 && !memcmp(text, "\xef\xbb\xbf", 3) ? text + 3 : text;
    bool header = true;
    columns order = {3, {0, 1, 2}};
    while (!s && *at) {
        char *line = at;
        const size_t length = strcspn(line, "\n");
        at += length + (line[length] == '\n');
        line[length] = '\0';
        number++;
        line += strspn(line, " \t\r");
        if (!*line || *line == '#') continue;
        if (header && is_header(line))
            s = read_names(path, number, line, &order, err);
        else {
            if (places) (*places)[*n] = number;
            s = read_line(path, number, line, &order, *x + 3 * *n, err);
            *n += !s;
        }
        header = false;
    }
    sdm_free(text);
    return s;
}

static sdm_status read_npy(const char *path, double **x, size_t *n, sdm_error *err)
{
    size_t shape[4];
    int n_dim;
    const sdm_status s = sdm_npy_read(path, x, shape, &n_dim, err);
    if (s) return s;
    if (n_dim != 2 || shape[1] != 3)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: array with %d dimensions, the second of %zu; need [n][3]", path, n_dim,
                        shape[1]);
    *n = shape[0];
    return SDM_OK;
}

static sdm_status read_vertices(const char *path, double **x, size_t *n, sdm_error *err)
{
    sdm_mesh m = {0};
    sdm_status s = sdm_mesh_read(path, &m, err);
    if (!s) s = SDM_ALLOC(x, 3 * m.n_vert, "points", err);
    if (!s) {
        memcpy(*x, m.vert, 3 * m.n_vert * sizeof **x);
        *n = m.n_vert;
    }
    sdm_mesh_dispose(&m);
    return s;
}

sdm_status cli_read_points(const char *path, double **x, size_t **lines, size_t *n, sdm_error *err)
{
    sdm_status s;
    *x = NULL;
    if (lines) *lines = NULL;
    *n = 0;
    if (cli_ends_with(path, ".csv"))
        s = read_csv(path, x, lines, n, err);
    else if (cli_ends_with(path, ".npy"))
        s = read_npy(path, x, n, err);
    else if (cli_ends_with_any(path, CLI_MESH_ENDINGS))
        s = read_vertices(path, x, n, err);
    else
        return sdm_fail(
            err, SDM_E_ARG,
            "points '%s': the name must end in .csv (x,y,z), .npy ([n][3]) or " CLI_MESH_ENDINGS
            " (vertices)",
            path);
    if (!s && *n == 0) s = sdm_fail(err, SDM_E_FORMAT, "%s: no points", path);
    if (!s) return SDM_OK;
    sdm_free(*x);
    *x = NULL;
    if (lines) {
        sdm_free(*lines);
        *lines = NULL;
    }
    return s;
}
