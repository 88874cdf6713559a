/* Writes distances, gradients, nearest points, triangles and derivatives at points. */
#include "points_table.h"

#include <math.h>
#include <string.h>

#include "report/files.h"
#include "sdm/image.h"
#include "sdm/internal/config.h"
#include "sdm/internal/file.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/npy.h"
#include "sdm/internal/text.h"

enum { DISTANCE, GRADIENT, CLOSEST, TRIANGLE, SLOPES, N_KINDS };

/* Most numbers of a row, without the point. */
enum { ROW_MAX = 8 + SDM_MAX_PARAMS };

static const struct {
    const char *name, *header;
    size_t width; /* 0: one for each parameter */
} kinds[N_KINDS] = {{"distance", "distance", 1},
                    {"gradient", "gradient_x,gradient_y,gradient_z", 3},
                    {"closest", "closest_x,closest_y,closest_z", 3},
                    {"triangle", "triangle", 1},
                    {"slopes", "d_", 0}};

/* Adds the column whose name is the first `length` characters of `word`. */
static sdm_status add_column(cli_points_table *t, const char *word, size_t length, sdm_error *err)
{
    for (int k = 0; k < N_KINDS; k++) {
        if (strlen(kinds[k].name) != length || strncmp(word, kinds[k].name, length)) continue;
        for (int i = 0; i < t->n_columns; i++)
            if (t->column[i] == k)
                return sdm_fail(err, SDM_E_ARG, "--columns: '%s' is given twice", kinds[k].name);
        t->column[t->n_columns++] = k;
        return SDM_OK;
    }
    return sdm_fail(err, SDM_E_ARG,
                    "--columns: unknown column '%.*s', known are distance, gradient and "
                    "slopes, with exact also closest and triangle",
                    (int)(length < 60 ? length : 60), word);
}

static bool has_column(const cli_points_table *t, int kind)
{
    for (int i = 0; i < t->n_columns; i++)
        if (t->column[i] == kind) return true;
    return false;
}

/* Fills the columns of --columns. */
static sdm_status read_columns(const cli_args *args, cli_points_table *t, sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (const char *word = args->columns ? args->columns : "distance"; !s;) {
        const size_t length = strcspn(word, ",");
        s = add_column(t, word, length, err);
        if (!word[length]) break;
        word += length + 1;
    }
    t->wants_slopes = args->jacobian || has_column(t, SLOPES);
    return s;
}

static sdm_status check_outputs(const cli_args *args, sdm_error *err)
{
    for (size_t i = 0; i < args->outputs.n; i++)
        if (!cli_ends_with_any(args->outputs.items[i], ".csv .npy"))
            return sdm_fail(err, SDM_E_ARG,
                            "output '%s': with --points its name must end in .csv or .npy",
                            args->outputs.items[i]);
    if (args->jacobian && !cli_ends_with(args->jacobian, ".npy"))
        return sdm_fail(err, SDM_E_ARG, "--jacobian '%s': its name must end in .npy",
                        args->jacobian);
    return cli_check_files(args, NULL, err);
}

/* An option that does not apply to points. */
typedef struct map_option {
    const char *name;
    bool given;
    const char *remedy; /* the end of the message */
} map_option;

#define USE_COLUMNS "; --columns chooses the values at points"

/* SDM_E_ARG if one of options[n], or an option of the grid, is given. */
static sdm_status refuse_map_options(const char *command, const cli_args *args,
                                     const map_option *options, size_t n, sdm_error *err)
{
    const map_option grid[] = {{"--size", args->size[0] > 0, ""},
                               {"--spacing", args->spacing[0] > 0, ""},
                               {"--origin", !isnan(args->origin[0]), ""},
                               {"--like", args->like && true, ""}};
    const size_t n_grid = sizeof grid / sizeof *grid;
    for (size_t i = 0; i < n_grid + n; i++) {
        const map_option *o = i < n_grid ? &grid[i] : &options[i - n_grid];
        if (o->given)
            return sdm_fail(err, SDM_E_ARG, "%s --points: %s is an option of maps%s", command,
                            o->name, o->remedy);
    }
    return SDM_OK;
}

sdm_status cli_points_check(const cli_args *args, cli_points_table *t, sdm_error *err)
{
    const sdm_status s = read_columns(args, t, err);
    if (s) return s;
    if (args->outputs.n == 0 && !args->jacobian)
        return sdm_fail(err, SDM_E_ARG,
                        "exact --points: an output is needed: -o FILE.csv or .npy, --jacobian");
    t->needs_all = t->wants_slopes;
    if (t->wants_slopes && !args->shape)
        return sdm_fail(err, SDM_E_ARG, "%s needs --shape: a mesh file has no parameters",
                        args->jacobian ? "--jacobian" : "--columns slopes");
    const map_option options[] = {
        {"--method", strcmp(args->method, "exact") != 0, ""},
        {"--certify", args->certify, ""},
        {"--narrow", args->narrow > 0, ""},
        {"--json", args->json, ""},
        {"--closest", args->closest && true, USE_COLUMNS},
        {"--normal", args->normal && true, "; --columns gradient is the normal"},
        {"--triangle", args->triangle && true, USE_COLUMNS}};
    const sdm_status other =
        refuse_map_options("exact", args, options, sizeof options / sizeof *options, err);
    return other ? other : check_outputs(args, err);
}

sdm_status cli_points_check_model(const cli_args *args, cli_points_table *t, sdm_error *err)
{
    const sdm_status s = read_columns(args, t, err);
    if (s) return s;
    if (has_column(t, CLOSEST) || has_column(t, TRIANGLE))
        return sdm_fail(err, SDM_E_ARG,
                        "generate --columns: a network knows distance, gradient and slopes only");
    if (args->outputs.n == 0 && !args->jacobian)
        return sdm_fail(err, SDM_E_ARG,
                        "generate --points: an output is needed: -o FILE.csv or .npy, --jacobian");
    const map_option options[] = {{"--params", args->rows && true, ""},
                                  {"--check", args->check, ""},
                                  {"--max-error", args->max_error > 0, ""},
                                  {"--gradient", args->gradient && true, USE_COLUMNS},
                                  {"--json", args->json, ""},
                                  {"--direction", !isnan(args->direction[0]), ""}};
    const sdm_status other =
        refuse_map_options("generate", args, options, sizeof options / sizeof *options, err);
    return other ? other : check_outputs(args, err);
}

sdm_status cli_points_allocate(cli_points_table *t, const sdm_param *params, size_t n_params,
                               size_t n, sdm_error *err)
{
    const bool all = t->needs_all;
    size_t count;
    t->n = n;
    t->params = params;
    t->n_params = n_params;
    sdm_status s = sdm_mul(n, n_params, &count, err);
    if (!s && (all || has_column(t, DISTANCE))) s = SDM_ALLOC(&t->at.distance, n, "distances", err);
    if (!s && (all || has_column(t, GRADIENT)))
        s = SDM_ALLOC(&t->at.gradient, 3 * n, "gradients", err);
    if (!s && (all || has_column(t, CLOSEST)))
        s = SDM_ALLOC(&t->at.closest, 3 * n, "nearest points", err);
    if (!s && (all || has_column(t, TRIANGLE))) s = SDM_ALLOC(&t->at.triangle, n, "triangles", err);
    if (!s && t->wants_slopes) s = SDM_ALLOC(&t->slopes, count, "derivatives", err);
    return s;
}

void cli_points_dispose(cli_points_table *t)
{
    sdm_free(t->at.distance);
    sdm_free(t->at.gradient);
    sdm_free(t->at.closest);
    sdm_free(t->at.triangle);
    sdm_free(t->slopes);
    *t = (cli_points_table){0};
}

/* row = the answers for point i; returns their number. */
static size_t row_fill(const cli_points_table *t, size_t i, double row[ROW_MAX])
{
    size_t n = 0;
    for (int c = 0; c < t->n_columns; c++) {
        const double *three = t->column[c] == GRADIENT ? t->at.gradient : t->at.closest;
        if (t->column[c] == DISTANCE)
            row[n++] = t->at.distance[i];
        else if (t->column[c] == TRIANGLE)
            row[n++] = t->at.triangle[i] == UINT32_MAX ? NAN : (double)t->at.triangle[i];
        else if (t->column[c] == SLOPES)
            for (size_t k = 0; k < t->n_params; k++) row[n++] = t->slopes[i * t->n_params + k];
        else
            for (size_t a = 0; a < 3; a++) row[n++] = three[3 * i + a];
    }
    return n;
}

/* Writes the headings of column c: of slopes, d_NAME for each parameter. */
static sdm_status write_header(const cli_points_table *t, int c, sdm_outfile *f, sdm_error *err)
{
    const char *header = kinds[t->column[c]].header;
    sdm_status s = SDM_OK;
    if (t->column[c] != SLOPES) return sdm_outfile_printf(f, err, ",%s", header);
    for (size_t k = 0; k < t->n_params && !s; k++)
        s = sdm_outfile_printf(f, err, ",%s%s", header, t->params[k].name);
    return s;
}

static sdm_status write_csv(const char *path, const cli_points_table *t, const double *x,
                            sdm_error *err)
{
    sdm_outfile *f = NULL;
    sdm_status s = sdm_outfile_open(path, &f, err);
    if (!s) s = sdm_outfile_printf(f, err, "x,y,z");
    for (int c = 0; c < t->n_columns && !s; c++) s = write_header(t, c, f, err);
    for (size_t i = 0; i < t->n && !s; i++) {
        double row[3 + ROW_MAX];
        char number[32];
        memcpy(row, x + 3 * i, 3 * sizeof *row);
        const size_t n = 3 + row_fill(t, i, row + 3);
        for (size_t k = 0; k < n && !s; k++)
            s = sdm_outfile_printf(f, err, "%s%s", k ? "," : "\n",
                                   isnan(row[k]) ? "" : sdm_format_real(row[k], number));
    }
    if (!s) s = sdm_outfile_write(f, "\n", 1, err);
    if (!s) return sdm_outfile_commit(&f, err);
    sdm_outfile_discard(&f);
    return s;
}

static sdm_status write_npy(const char *path, const cli_points_table *t, sdm_error *err)
{
    size_t width = 0, count;
    double *values = NULL;
    for (int c = 0; c < t->n_columns; c++)
        width += t->column[c] == SLOPES ? t->n_params : kinds[t->column[c]].width;
    sdm_status s = sdm_mul(t->n, width, &count, err);
    if (!s) s = SDM_ALLOC(&values, count, "table of answers", err);
    for (size_t i = 0; i < t->n && !s; i++) {
        double row[ROW_MAX];
        const size_t n = row_fill(t, i, row);
        memcpy(values + i * width, row, n * sizeof *row);
    }
    if (!s) s = sdm_npy_write_double(path, values, (const size_t[]){t->n, width}, 2, err);
    sdm_free(values);
    return s;
}

/* Writes the file of --jacobian: float32 [n][n_params]. */
static sdm_status write_jacobian(const cli_points_table *t, const char *path, sdm_error *err)
{
    const size_t count = t->n * t->n_params;
    float *slopes = NULL;
    sdm_status s = SDM_ALLOC(&slopes, count, "derivatives", err);
    for (size_t i = 0; i < count && !s; i++) slopes[i] = (float)t->slopes[i];
    if (!s) s = sdm_npy_write(path, slopes, (const size_t[]){t->n, t->n_params}, 2, err);
    sdm_free(slopes);
    return s;
}

sdm_status cli_points_write(const cli_points_table *t, const double *x, const cli_args *args,
                            sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < args->outputs.n && !s; i++) {
        const char *path = args->outputs.items[i];
        s = cli_ends_with(path, ".csv") ? write_csv(path, t, x, err) : write_npy(path, t, err);
    }
    if (!s && args->jacobian) s = write_jacobian(t, args->jacobian, err);
    return s;
}
