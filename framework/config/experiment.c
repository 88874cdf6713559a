/* Reads an experiment: the file, the overrides and the base configuration, and checks the training
 * configuration of every row. */
#include "sdm/internal/experiment.h"

#include <stdio.h>
#include <string.h>

#include "config_parse.h"
#include "experiment_schema.h"
#include "overrides.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"
#include "yaml_tree.h"

void sdm_experiment_free(sdm_experiment *e)
{
    if (!e) return;
    sdm_overrides_dispose(&e->common);
    sdm_overrides_dispose(&e->command_line);
    for (size_t i = 0; i < e->n_methods; i++) sdm_overrides_dispose(&e->methods[i].set);
    for (size_t i = 0; i < e->n_variants; i++) sdm_overrides_dispose(&e->variants[i].set);
    sdm_free(e->methods);
    sdm_free(e->variants);
    sdm_free(e->references);
    sdm_free(e->rows);
    sdm_free(e->base_text);
    sdm_free(e);
}

/* ---- one row ---- */

/* Concatenates the lists (NULL: an empty list) to texts[] and places[], with e->file as source of
 * each place; returns the number of texts. */
static size_t gather(const sdm_experiment *e, const sdm_overrides *const lists[], size_t n_lists,
                     const char **texts, sdm_mark *places)
{
    size_t n = 0;
    for (size_t k = 0; k < n_lists; k++)
        for (size_t i = 0; lists[k] && i < lists[k]->n; i++, n++) {
            texts[n] = lists[k]->items[i].text;
            places[n] = lists[k]->items[i].mark;
            places[n].source = e->file;
        }
    return n;
}

sdm_status sdm_experiment_config(const sdm_experiment *e, size_t row, sdm_config *out,
                                 sdm_error *err)
{
    enum { N_LISTS = 5 };
    char kind_text[SDM_NAME_MAX + 32];
    if (!e || !out || row >= e->n_rows)
        return sdm_fail(err, SDM_E_ARG,
                        "an experiment's configuration needs a row and a place for the result");
    const sdm_experiment_method *m = e->rows[e->rows[row].network_row].method;
    const sdm_experiment_variant *v = e->rows[row].variant;
    // An engine is not trained, but a training configuration must have a budget.
    snprintf(kind_text, sizeof kind_text, "%s%s",
             *m->engine ? "train.steps=1" : "network.kind=", m->network);
    sdm_override kind = {kind_text, m->mark};
    // later lists override earlier ones: for an engine the budget of one step comes first, so that
    // a budget of the experiment replaces it
    const sdm_overrides first = {.items = &kind, .n = 1};
    const sdm_overrides *lists[N_LISTS] = {&e->common, &first, &m->set, v ? &v->set : NULL,
                                           &e->command_line};
    if (*m->engine) {
        lists[0] = &first;
        lists[1] = &e->common;
    }
    size_t n = 0;
    for (int k = 0; k < N_LISTS; k++) n += lists[k] ? lists[k]->n : 0;
    const char **texts = NULL;
    sdm_mark *places = NULL;
    sdm_status s = SDM_ALLOC(&texts, n, "overrides", err);
    if (!s) s = SDM_ALLOC(&places, n, "overrides", err);
    if (!s) n = gather(e, lists, N_LISTS, texts, places);
    if (!s)
        s = sdm_config_parse_placed(*e->base ? e->base : e->file, e->base_text, e->base_size, texts,
                                    places, n, out, err);
    sdm_free(places);
    sdm_free((void *)texts);
    return s;
}

/* ---- the whole experiment ---- */

/* Applies one key=value of the command line. Keys of the training configuration are only stored;
 * sdm_experiment_config() applies them to every row. */
static sdm_status apply_override(sdm_experiment *e, sdm_reader *r, const char *text, int number,
                                 sdm_error *err)
{
    const sdm_mark mark = {.override = number, .source = text};
    const size_t length = strcspn(text, "=");
    if (text[length] && sdm_experiment_is_training_key(text, length))
        return sdm_overrides_add(&e->command_line, text, mark, err);
    return sdm_config_override(r, text, mark, err);
}

/* Turns `name`, relative to the folder of the experiment's file, into a path. Returns false if the
 * path is too long. */
static bool place_beside(const sdm_experiment *e, char name[SDM_PATH_TEXT_MAX])
{
    char path[SDM_PATH_TEXT_MAX];
    const char *slash = strrchr(e->file, '/');
    const int folder = slash ? (int)(slash - e->file) + 1 : 0;
    if (snprintf(path, sizeof path, "%.*s%s", folder, e->file, name) >= (int)sizeof path)
        return false;
    strcpy(name, path);
    return true;
}

/* Reads the base configuration, a file in the folder of the experiment's file: e->base becomes the
 * path of the file, e->base_text its content. */
static sdm_status read_base(sdm_experiment *e, sdm_reader *r, sdm_error *err)
{
    const sdm_mark mark = sdm_fields_given(r, "", "base")->mark;
    if (!*e->base || r->mistakes->count > 0) return SDM_OK;
    if (strchr(e->base, '/') || !strcmp(e->base, "..")) {
        sdm_mistakes_add(r->mistakes, mark, "base: '%s' must be the name of a file beside this one",
                         e->base);
        return SDM_OK;
    }
    if (!place_beside(e, e->base)) {
        sdm_mistakes_add(r->mistakes, mark, "base: the path is too long");
        return SDM_OK;
    }
    uint8_t *data = NULL;
    sdm_error why = {0};
    const sdm_status s = sdm_file_read(e->base, SDM_TREE_BYTES_MAX, &data, &e->base_size, &why);
    e->base_text = (char *)data;
    if (s == SDM_E_NOMEM) return sdm_fail(err, s, "%s", why.text);
    if (s) sdm_mistakes_add(r->mistakes, mark, "base: %.300s", why.text);
    return SDM_OK;
}

/* A relative path fit.model from the experiment's file is relative to the folder of that file and
 * is converted here. On the command line it is relative to the working folder, as for other files.
 */
static void place_model(sdm_experiment *e, sdm_reader *r)
{
    const sdm_mark mark = sdm_fields_given(r, "fit", "model")->mark;
    if (!*e->fit.model || *e->fit.model == '/' || mark.override > 0) return;
    if (!place_beside(e, e->fit.model))
        sdm_mistakes_add(r->mistakes, mark, "fit.model: the path is too long");
}

/* Reads the file, the overrides and the base configuration. Mistakes in the YAML syntax of the file
 * end the reading, as in a training configuration. */
static sdm_status read_all(sdm_experiment *e, sdm_reader *r, const char *text, size_t size,
                           const char *const *overrides, size_t n_overrides, sdm_error *err)
{
    sdm_tree tree = {0};
    sdm_status s = sdm_tree_parse(&tree, text, size, (sdm_mark){0}, r->mistakes, err);
    if (!s) sdm_fields_read(r, tree.root);
    const bool is_keyed =
        !tree.root || tree.root->kind == SDM_TREE_MAP || sdm_tree_is_empty(tree.root);
    sdm_tree_dispose(&tree);
    if (s == SDM_E_CONFIG || (!s && !is_keyed)) return sdm_mistakes_report(r->mistakes, err);
    for (size_t i = 0; i < n_overrides && !s; i++)
        s = apply_override(e, r, overrides[i], (int)i + 1, err);
    if (!s) s = read_base(e, r, err);
    if (!s) place_model(e, r);
    if (!s) s = sdm_experiment_finish(e, r, err);
    return s ? s : sdm_mistakes_report(r->mistakes, err);
}

/* Reads the training configuration of every row, to report its mistakes. */
static sdm_status check_rows(const sdm_experiment *e, sdm_error *err)
{
    sdm_config *config = NULL;
    sdm_status s = SDM_ALLOC(&config, 1, "configuration", err);
    for (size_t i = 0; i < e->n_rows && !s; i++) s = sdm_experiment_config(e, i, config, err);
    sdm_free(config);
    return s;
}

sdm_status sdm_experiment_parse(const char *name, const char *text, size_t size,
                                const char *const *overrides, size_t n_overrides,
                                sdm_experiment **out, sdm_error *err)
{
    char bare[256];
    if (!name || !out || (!text && size) || (!overrides && n_overrides) || n_overrides > 10000)
        return sdm_fail(err, SDM_E_ARG,
                        "an experiment needs a name, a text, a place for the result and at most "
                        "10000 overrides");
    *out = NULL;
    for (size_t i = 0; i < n_overrides; i++)
        if (!overrides[i]) return sdm_fail(err, SDM_E_ARG, "override %zu is NULL", i + 1);
    if (strlen(name) >= SDM_PATH_TEXT_MAX)
        return sdm_fail(err, SDM_E_ARG, "a file name of %zu bytes, at most %d are allowed",
                        strlen(name), SDM_PATH_TEXT_MAX - 1);
    sdm_experiment *e = NULL;
    sdm_status s = SDM_ALLOC(&e, 1, "experiment", err);
    if (s) return s;
    snprintf(e->file, sizeof e->file, "%s", name);
    sdm_bare_name(name, "experiment", bare);
    snprintf(e->experiment.title, sizeof e->experiment.title, "%s", bare);
    snprintf(e->experiment.folder, sizeof e->experiment.folder, "runs/%s", bare);
    strcpy(e->experiment.reference, "reference");

    sdm_mistakes mistakes = {.file = name};
    sdm_reader r = {.target = e, .mistakes = &mistakes};
    r.sections = sdm_experiment_sections(&r.n_sections);
    sdm_fields_set_defaults(&r);
    s = read_all(e, &r, text ? text : "", size, overrides, n_overrides, err);
    if (!s) s = check_rows(e, err);
    if (s)
        sdm_experiment_free(e);
    else
        *out = e;
    return s;
}

sdm_status sdm_experiment_read(const char *path, const char *const *overrides, size_t n_overrides,
                               sdm_experiment **out, sdm_error *err)
{
    uint8_t *data = NULL;
    size_t size = 0;
    if (!path || !out)
        return sdm_fail(err, SDM_E_ARG, "an experiment needs a path and a place for the result");
    *out = NULL;
    sdm_status s = sdm_tree_read(path, &data, &size, err);
    if (s) return s;
    s = sdm_experiment_parse(path, (const char *)data, size, overrides, n_overrides, out, err);
    sdm_free(data);
    return s;
}
