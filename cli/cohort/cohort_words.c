/* The command line of the fit of one case, and the hash of all that decides its result. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "cohort.h"
#include "inputs/input_checksum.h"
#include "report/files.h"
#include "sdm/internal/heap.h"
#include "slicer/slicer.h"

/* ---- lists of words ---- */

void cli_words_dispose(cli_words *w)
{
    for (int i = 0; i < w->argc; i++) sdm_free(w->argv[i]);
    sdm_free(w->argv);
    sdm_free((void *)w->inputs.items);
    sdm_free((void *)w->outputs.items);
    sdm_text_dispose(&w->settings);
    *w = (cli_words){0};
}

/* Appends a word of three parts; returns the place of the second one in it, NULL: no memory. */
static const char *add(cli_words *w, const char *begin, const char *folder, const char *name,
                       sdm_error *err)
{
    if (w->argc == w->capacity) {
        const int more = w->capacity ? 2 * w->capacity : 32;
        if (sdm_grow((void **)&w->argv, (size_t)w->capacity, (size_t)more, sizeof *w->argv,
                     "command line", err))
            return NULL;
        w->capacity = more;
    }
    const size_t length = strlen(begin), size = length + strlen(folder) + strlen(name) + 1;
    char *word = NULL;
    if (SDM_ALLOC(&word, size, "command line", err)) return NULL;
    snprintf(word, size, "%s%s%s", begin, folder, name);
    w->argv[w->argc++] = word;
    return word + length;
}

/* Appends an item to a list. */
static sdm_status list(cli_list *l, const char *item, sdm_error *err)
{
    if ((l->n & (l->n - 1)) == 0) { // 0 or a power of two: the list is full
        const size_t more = l->n ? 2 * l->n : 1;
        const sdm_status s =
            sdm_grow((void **)&l->items, l->n, more, sizeof *l->items, "list", err);
        if (s) return s;
    }
    l->items[l->n++] = item;
    return SDM_OK;
}

/* ---- options ---- */

static bool is_input(const cli_option *o)
{
    return slicer_has_word("reference start-points plugin", o->name);
}

static bool is_output(const cli_option *o)
{
    return slicer_has_word("output label-out returnparameterfile", o->name);
}

/* Options that belong to the run. */
static bool is_of_no_case(const cli_option *o)
{
    return slicer_has_word("cases part claim json quiet progress", o->name);
}

/* base/name, or name where it is absolute or `base` is empty. */
static const char *base_for(const char *base, const char *name) { return *name == '/' ? "" : base; }

/* The folder of the value of a shape's option "name=FILE": values that name files start from the
 * folder of the table, too. */
static const char *base_for_value(const char *base, const char *value)
{
    char path[CLI_CASE_PATH_MAX];
    const bool fits = snprintf(path, sizeof path, "%s%s", base, value) < (int)sizeof path;
    return *value != '/' && fits && !access(path, F_OK) ? base : "";
}

/* Appends "--option=value" of case `id`; relative inputs start from `base`. */
static sdm_status add_value(cli_words *w, const char *out, const char *id, const char *base,
                            const cli_option *o, const char *value, sdm_error *err)
{
    char begin[CLI_CASE_PATH_MAX], folder[CLI_CASE_PATH_MAX];
    if (!slicer_has_word("threads max-memory", o->name))
        sdm_text_add(&w->settings, "%s=%s\n", o->name, value);
    snprintf(begin, sizeof begin, "--%s%s", o->name, o->kind == CLI_FLAG ? "" : "=");
    if (o->kind == CLI_FLAG) return add(w, begin, "", "", err) ? SDM_OK : SDM_E_NOMEM;
    if (is_output(o)) {
        cli_case_path(out, id, "", folder);
        const char *path = add(w, begin, folder, value, err);
        return path ? list(&w->outputs, path + strlen(folder), err) : SDM_E_NOMEM;
    }
    const char *equals = strcmp(o->name, "option") ? NULL : strchr(value, '=');
    if (equals) {
        const size_t used = strlen(begin);
        snprintf(begin + used, sizeof begin - used, "%.*s=", (int)(equals - value), value);
        value = equals + 1;
        base = base_for_value(base, value);
    } else {
        base = is_input(o) ? base_for(base, value) : "";
    }
    const char *path = add(w, begin, base, value, err);
    if (!path) return SDM_E_NOMEM;
    return is_input(o) || equals ? list(&w->inputs, path, err) : SDM_OK;
}

/* Index of the cell of case i that replaces an option of the command line; NULL: none does. */
static const char *find_cell(const cli_cohort *c, size_t i, const cli_option *o)
{
    for (size_t k = 0; k < c->cells.n_columns; k++) {
        const char *cell = c->cells.cell[(i + 1) * c->cells.n_columns + k];
        if (c->columns[k].option == o && *cell) return cell;
    }
    return NULL;
}

/* The options of the command line that this case has; the first -o is the folder of the cohort. */
static sdm_status add_given(cli_words *w, const cli_cohort *c, size_t i, sdm_error *err)
{
    sdm_status s = SDM_OK;
    bool folder = true;
    for (size_t k = 0; k < c->args->n_given && !s; k++) {
        const cli_given *g = &c->args->given[k];
        const bool skip = folder && !strcmp(g->option->name, "output");
        if (skip) folder = false;
        if (skip || is_of_no_case(g->option) || find_cell(c, i, g->option)) continue;
        s = add_value(w, c->out, cli_cohort_id(c, i), "", g->option, g->value, err);
    }
    return s;
}

/* Appends the values of a list, which semicolons separate. */
static sdm_status add_list(cli_words *w, const cli_cohort *c, size_t i, const cli_option *o,
                           const char *cell, sdm_error *err)
{
    sdm_status s = SDM_OK;
    while (*cell && !s) {
        char value[SDM_ERROR_TEXT_MAX];
        const size_t length = strcspn(cell, ";");
        if (length >= sizeof value)
            return sdm_fail(err, SDM_E_FORMAT, "column '%s': the value is too long", o->name);
        memcpy(value, cell, length);
        value[length] = '\0';
        s = add_value(w, c->out, cli_cohort_id(c, i), c->base, o, value + strspn(value, " "), err);
        cell += length + (cell[length] == ';');
    }
    return s;
}

static sdm_status add_cell(cli_words *w, const cli_cohort *c, size_t i, const cli_option *o,
                           const char *cell, sdm_error *err)
{
    if (o->kind == CLI_LIST) return add_list(w, c, i, o, cell, err);
    if (o->kind != CLI_FLAG)
        return add_value(w, c->out, cli_cohort_id(c, i), c->base, o, cell, err);
    if (!strcmp(cell, "no")) return SDM_OK;
    if (strcmp(cell, "yes"))
        return sdm_fail(err, SDM_E_FORMAT, "column '%s': '%.100s': need yes or no", o->name, cell);
    return add_value(w, c->out, cli_cohort_id(c, i), "", o, o->name, err);
}

/* Appends a file that the case reads. */
static sdm_status add_input(cli_words *w, const char *what, const char *base, const char *name,
                            sdm_error *err)
{
    sdm_text_add(&w->settings, "%s=%s\n", what, name);
    const char *path = add(w, "", base_for(base, name), name, err);
    return path ? list(&w->inputs, path, err) : SDM_E_NOMEM;
}

/* The model, of the row or of the command line, and the image. */
static sdm_status add_files(cli_words *w, const cli_cohort *c, size_t i, sdm_error *err)
{
    const char *model = NULL, *image = NULL;
    for (size_t k = 0; k < c->cells.n_columns; k++) {
        const char *cell = c->cells.cell[(i + 1) * c->cells.n_columns + k];
        if (c->columns[k].kind == CLI_COLUMN_IMAGE) image = cell;
        if (c->columns[k].kind == CLI_COLUMN_MODEL && *cell) model = cell;
    }
    if (!image || !*image)
        return sdm_fail(err, SDM_E_FORMAT, "id '%s': no image", cli_cohort_id(c, i));
    sdm_status s = add(w, "--", "", "", err) ? SDM_OK : SDM_E_NOMEM;
    if (!s && model)
        s = add_input(w, "model", c->base, model, err);
    else if (!s && c->args->files.n)
        s = add_input(w, "model", "", c->args->files.items[0], err);
    return s ? s : add_input(w, "image", c->base, image, err);
}

sdm_status cli_words_make(const cli_cohort *c, size_t i, cli_words *out, sdm_error *err)
{
    sdm_status s =
        add(out, "sdmgen", "", "", err) && add(out, "fit", "", "", err) ? SDM_OK : SDM_E_NOMEM;
    if (!s) s = add_given(out, c, i, err);
    for (size_t k = 0; k < c->cells.n_columns && !s; k++) {
        const char *cell = c->cells.cell[(i + 1) * c->cells.n_columns + k];
        if (c->columns[k].option && *cell) s = add_cell(out, c, i, c->columns[k].option, cell, err);
    }
    if (!s) s = add_files(out, c, i, err);
    if (!s && out->settings.failed) s = sdm_fail(err, SDM_E_NOMEM, "out of memory for a case");
    return s;
}

/* ---- the key ---- */

static void add_checksum(sdm_text *t, const char *path)
{
    uint64_t crc = 0;
    if (cli_input_checksum(path, &crc, NULL))
        sdm_text_add(t, "no file\n");
    else
        sdm_text_add(t, "%016" PRIx64 "\n", crc);
}

sdm_status cli_words_key(const cli_words *w, char key[SDM_SHA256_TEXT], sdm_error *err)
{
    sdm_text t = {0};
    sdm_text_add(&t, "sdmgen " SDM_VERSION_TEXT "\n%s", w->settings.data);
    for (size_t i = 0; i < w->inputs.n; i++) add_checksum(&t, w->inputs.items[i]);
    const bool failed = t.failed;
    if (!failed) sdm_sha256(t.data, t.size, key);
    sdm_text_dispose(&t);
    return failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory for the key of a case") : SDM_OK;
}
