/* Reads points from text tables, NumPy arrays and mesh files. */
#include "points_file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "report/files.h"
#include "sdm/image.h"
#include "sdm/internal/file.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/text.h"
#include "sdm/meshfile.h"

#define MAX_BYTES ((uint64_t)4 << 30)

/* The columns of x, y and z. */
typedef struct columns {
    size_t axis[3]; /* axis of each column */
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

/* Takes the order of the columns from the names x, y and z of a header, in any case; other names
 * leave x, y, z. */
static void read_names(char *const cell[3], columns *c)
{
    bool found[3] = {false, false, false};
    size_t axis[3] = {0, 1, 2};
    for (size_t k = 0; k < 3; k++) {
        const char *at = strlen(cell[k]) == 1 ? strchr("xXyYzZ", *cell[k]) : NULL;
        if (!at) return;
        axis[k] = (size_t)(at - "xXyYzZ") / 2;
        found[axis[k]] = true;
    }
    if (found[0] && found[1] && found[2]) memcpy(c->axis, axis, sizeof axis);
}

/* Reads the three numbers of one line, which is changed. header: a line without any number is
 * accepted; *is_point is then false. */
static sdm_status read_line(const char *path, size_t number, char *line, bool header, columns *c,
                            double x[3], bool *is_point, sdm_error *err)
{
    size_t n = 0, n_numbers = 0;
    char *cells[3] = {NULL, NULL, NULL};
    const char *wrong = NULL;
    for (char *cell; (cell = next_cell(&line)); n++) {
        double value;
        const bool good = sdm_parse_real(cell, &value);
        n_numbers += good;
        if (!good && !wrong) wrong = cell;
        if (n >= 3) continue;
        cells[n] = cell;
        if (good) x[c->axis[n]] = value;
    }
    *is_point = n == 3 && n_numbers == 3;
    if (*is_point) return SDM_OK;
    if (header && n_numbers == 0) {
        if (n == 3) read_names(cells, c);
        return SDM_OK;
    }
    if (wrong)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s:%zu: '%.100s' is not a finite number; a line is x,y,z", path, number,
                        wrong);
    return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: %zu values, a line needs three: x,y,z (mm)", path,
                    number, n);
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
    columns order = {{0, 1, 2}};
    while (!s && *at) {
        char *line = at;
        const size_t length = strcspn(line, "\n");
        at += length + (line[length] == '\n');
        line[length] = '\0';
        number++;
        line += strspn(line, " \t\r");
        if (!*line || *line == '#') continue;
        bool is_point;
        s = read_line(path, number, line, header, &order, *x + 3 * *n, &is_point, err);
        if (is_point && places) (*places)[*n] = number;
        *n += is_point;
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
