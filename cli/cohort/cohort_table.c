/* Reads and checks the table of a cohort: its columns and the ids of the cases. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "cohort.h"
#include "report/output.h"
#include "sdm/memory.h"
#include "slicer/slicer.h"

/* Options of `fit` that concern the whole run; a table must not load code (--plugin). */
static bool is_of_the_run(const char *name)
{
    return slicer_has_word("cases part claim json quiet progress plugin threads help max-memory",
                           name);
}

/* ---- columns ---- */

/* The names that the header may hold. Returns their number. */
static size_t list_columns(const char *names[128])
{
    size_t n = 0;
    names[n++] = "id";
    names[n++] = "image";
    names[n++] = "model";
    for (size_t i = 0; i < cli_n_options && n < 128; i++)
        if (cli_option_fits(&cli_options[i], CLI_FIT) && !is_of_the_run(cli_options[i].name))
            names[n++] = cli_options[i].name;
    return n;
}

static sdm_status fail_column(const cli_cohort *c, const char *name, sdm_error *err)
{
    const char *names[128];
    const size_t n = list_columns(names);
    const char *near = is_of_the_run(name) ? NULL : sdm_nearest_name(name, names, n);
    return sdm_fail(err, SDM_E_FORMAT, "%s:%d: column '%.100s': %s%s%s", c->csv, c->cells.line[0],
                    name,
                    is_of_the_run(name) ? "this option is not one of a single case: give it on the "
                                          "command line"
                    : near              ? "unknown; did you mean '"
                           : "unknown; need id, image (an image, labels, a mesh or points), model, "
                             "or an option of `sdmgen fit` without its dashes",
                    near ? near : "", near ? "'?" : "");
}

static sdm_status read_column(cli_cohort *c, size_t k, sdm_error *err)
{
    const char *name = c->cells.cell[k];
    cli_column *column = &c->columns[k];
    column->kind = !strcmp(name, "id")      ? CLI_COLUMN_ID
                   : !strcmp(name, "image") ? CLI_COLUMN_IMAGE
                   : !strcmp(name, "model") ? CLI_COLUMN_MODEL
                                            : CLI_COLUMN_OPTION;
    if (column->kind == CLI_COLUMN_OPTION) {
        column->option = cli_find_option(CLI_FIT, name, strlen(name));
        if (!column->option || is_of_the_run(name)) return fail_column(c, name, err);
    }
    for (size_t i = 0; i < k; i++)
        if (!strcmp(c->cells.cell[i], name))
            return sdm_fail(err, SDM_E_FORMAT, "%s:%d: column '%s' appears twice", c->csv,
                            c->cells.line[0], name);
    return SDM_OK;
}

/* Index of the column of this kind; n_columns: there is none. */
static size_t find_column(const cli_cohort *c, cli_column_kind kind)
{
    size_t k = 0;
    while (k < c->cells.n_columns && c->columns[k].kind != kind) k++;
    return k;
}

static sdm_status read_columns(cli_cohort *c, sdm_error *err)
{
    sdm_status s = SDM_ALLOC(&c->columns, c->cells.n_columns, "columns", err);
    for (size_t k = 0; k < c->cells.n_columns && !s; k++) s = read_column(c, k, err);
    const bool id = !s && find_column(c, CLI_COLUMN_ID) < c->cells.n_columns,
               image = !s && find_column(c, CLI_COLUMN_IMAGE) < c->cells.n_columns;
    if (!s && !(id && image))
        s = sdm_fail(err, SDM_E_FORMAT, "%s:%d: no column '%s': the header needs id and image",
                     c->csv, c->cells.line[0], id ? "image" : "id");
    return s;
}

/* ---- ids ---- */

sdm_status cli_check_id(const char *id, sdm_error *err)
{
    static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                                  "._-";
    const size_t length = strlen(id);
    if (!length) return sdm_fail(err, SDM_E_FORMAT, "the id is empty");
    if (length > CLI_CASE_ID_MAX || id[strspn(id, letters)] || *id == '.' || *id == '-' ||
        id[length - 1] == '.')
        return sdm_fail(err, SDM_E_FORMAT,
                        "id '%.120s': it names a folder: need at most %d letters a-z A-Z, digits "
                        "and . _ -, not . or - at its begin, not . at its end",
                        id, CLI_CASE_ID_MAX);
    if (!strcasecmp(id, CLI_COHORT_LIST) || !strcasecmp(id, CLI_COHORT_FAILED))
        return sdm_fail(err, SDM_E_FORMAT, "id '%s': a file of the cohort has this name", id);
    return SDM_OK;
}

const char *cli_cohort_id(const cli_cohort *c, size_t i)
{
    return c->cells.cell[(i + 1) * c->cells.n_columns + find_column(c, CLI_COLUMN_ID)];
}

typedef struct named_row {
    const char *id;
    size_t row;
} named_row;

static int by_id(const void *a, const void *b)
{
    const named_row *x = a, *y = b;
    const int order = strcasecmp(x->id, y->id);
    return order ? order : (x->row > y->row) - (x->row < y->row);
}

/* Ids must differ also in file systems that take small and large letters for the same. */
static sdm_status check_ids(const cli_cohort *c, sdm_error *err)
{
    named_row *rows = NULL;
    sdm_status s = SDM_ALLOC(&rows, c->cells.n_rows, "ids", err);
    for (size_t i = 0; i < c->cells.n_rows && !s; i++) {
        rows[i] = (named_row){cli_cohort_id(c, i), i};
        s = cli_check_id(rows[i].id, err);
        if (s) s = sdm_fail_in(err, s, "%s:%d", c->csv, c->cells.line[i + 1]);
    }
    if (!s) qsort(rows, c->cells.n_rows, sizeof *rows, by_id);
    for (size_t i = 1; i < c->cells.n_rows && !s; i++)
        if (!strcasecmp(rows[i].id, rows[i - 1].id))
            s = sdm_fail(err, SDM_E_FORMAT,
                         "%s:%d: id '%s' is that of line %d, too%s: each case needs its own",
                         c->csv, c->cells.line[rows[i].row + 1], rows[i].id,
                         c->cells.line[rows[i - 1].row + 1],
                         strcmp(rows[i].id, rows[i - 1].id) ? " (but for large letters)" : "");
    sdm_free(rows);
    return s;
}

/* ---- the whole ---- */

static sdm_status read_folder(cli_cohort *c, sdm_error *err)
{
    const cli_list *outputs = &c->args->outputs;
    const char *out = outputs->n ? outputs->items[0] : NULL;
    if (!out)
        return sdm_fail(err, SDM_E_ARG, "fit: --cases needs a folder for the results: -o DIR");
    if (out[strlen(out) - 1] != '/' && !cli_check_type(out, false, NULL))
        return sdm_fail(err, SDM_E_ARG,
                        "fit: -o %s: with --cases the first -o is the folder of the results, the "
                        "others are file names in the folder of each case",
                        out);
    size_t length = strlen(out);
    while (length > 1 && out[length - 1] == '/') length--;
    if (length >= sizeof c->out - CLI_CASE_ID_MAX)
        return sdm_fail(err, SDM_E_ARG, "-o '%.100s...': the name is too long", out);
    memcpy(c->out, out, length);
    c->out[length] = '\0';
    const char *slash = strrchr(c->csv, '/');
    length = slash ? (size_t)(slash - c->csv) + 1 : 0;
    if (length >= sizeof c->base)
        return sdm_fail(err, SDM_E_ARG, "--cases '%.100s...': the name is too long", c->csv);
    memcpy(c->base, c->csv, length);
    return SDM_OK;
}

sdm_status cli_cohort_read(const cli_args *args, cli_cohort *out, sdm_error *err)
{
    *out = (cli_cohort){.args = args, .csv = args->cohort.cases};
    if (args->files.n > 1)
        return sdm_fail(err, SDM_E_ARG,
                        "fit: with --cases the images stand in the table: unexpected argument '%s'",
                        args->files.items[1]);
    sdm_status s = read_folder(out, err);
    if (!s) s = cli_cells_read(out->csv, &out->cells, err);
    if (!s) s = read_columns(out, err);
    return s ? s : check_ids(out, err);
}

void cli_cohort_dispose(cli_cohort *c)
{
    sdm_free(c->columns);
    cli_cells_dispose(&c->cells);
}

void cli_case_path(const char *folder, const char *id, const char *name,
                   char path[CLI_CASE_PATH_MAX])
{
    snprintf(path, CLI_CASE_PATH_MAX, "%s/%s%s%s", folder, id, name ? "/" : "", name ? name : "");
}
