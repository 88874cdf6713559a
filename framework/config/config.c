/* Reads a training configuration: first the file, then the overrides; then applies the rules that
 * involve several keys. */
#include "sdm/internal/config.h"

#include <stdio.h>
#include <string.h>

#include "config_parse.h"
#include "kinds.h"
#include "schema.h"
#include "sdm/memory.h"
#include "yaml_tree.h"

void sdm_bare_name(const char *file, const char *none, char out[256])
{
    const char *slash = strrchr(file, '/'), *base = slash ? slash + 1 : file,
               *dot = strrchr(base, '.');
    const int length = dot && dot != base ? (int)(dot - base) : 200;
    snprintf(out, 256, "%.*s", length < 200 ? length : 200, *base ? base : none);
    for (size_t n = strlen(out), bad; (bad = sdm_tree_printable(out, n)) < n;) out[bad] = '_';
}

sdm_status sdm_config_override(sdm_reader *r, const char *text, sdm_mark mark, sdm_error *err)
{
    const char *equals = strchr(text, '=');
    size_t names = 1;
    if (!equals || equals == text) {
        sdm_mistakes_add(r->mistakes, mark, "not of the form key=value");
        return SDM_OK;
    }
    const size_t length = (size_t)(equals - text);
    for (size_t i = 0; i < length; i++) names += text[i] == '.';
    if (length >= SDM_TREE_PATH_BYTES || names > SDM_TREE_PATH_NAMES) {
        sdm_mistakes_add(r->mistakes, mark, "unknown key");
        return SDM_OK;
    }
    sdm_tree tree = {0};
    sdm_status s = sdm_tree_parse(&tree, equals + 1, strlen(equals + 1), mark, r->mistakes, err);
    if (!s) s = sdm_tree_wrap(&tree, text, length, mark, err);
    if (!s) {
        sdm_fields_read(r, tree.root);
        if (r->config) sdm_config_settle_override(r, mark.override);
    }
    sdm_tree_dispose(&tree);
    return s == SDM_E_CONFIG ? SDM_OK : s;
}

/* Returns true if the tree is an experiment, and records this as one mistake, instead of one
 * mistake for each key that a training configuration does not have. */
static bool refuse_experiment(sdm_mistakes *mistakes, const sdm_tree_node *root)
{
    for (const sdm_tree_node *n = root ? root->first : NULL; n; n = n->next) {
        if (!n->key || strcmp(n->key, "methods") != 0) continue;
        sdm_mistakes_add(mistakes, n->key_mark,
                         "methods: this is an experiment, for sdmgen experiment, not a training");
        return true;
    }
    return false;
}

/* Reads the file and the overrides. Mistakes in the YAML syntax of the file end the reading,
 * because every key after them would be reported as missing. */
static sdm_status read_all(sdm_reader *r, const char *text, size_t size,
                           const char *const *overrides, const sdm_mark *places, size_t n_overrides,
                           sdm_error *err)
{
    sdm_tree tree = {0};
    sdm_mark top = {.line = 1, .column = 1};
    sdm_status s = sdm_tree_parse(&tree, text, size, (sdm_mark){0}, r->mistakes, err);
    const bool other = !s && refuse_experiment(r->mistakes, tree.root);
    if (!s && !other) sdm_fields_read(r, tree.root);
    r->file_kind = (int)r->config->network.kind;
    const bool is_keyed =
        !tree.root || tree.root->kind == SDM_TREE_MAP || sdm_tree_is_empty(tree.root);
    sdm_tree_dispose(&tree);
    if (s == SDM_E_CONFIG || (!s && (!is_keyed || other)))
        return sdm_mistakes_report(r->mistakes, err);

    for (size_t i = 0; i < n_overrides && !s; i++) {
        sdm_mark mark = {.source = overrides[i]};
        if (places && places[i].line > 0) mark = places[i];
        mark.override = (int)i + 1;
        s = sdm_config_override(r, overrides[i], mark, err);
    }
    if (s) return s;
    sdm_config_finish(r, top);
    return sdm_mistakes_report(r->mistakes, err);
}

sdm_status sdm_config_parse_placed(const char *name, const char *text, size_t size,
                                   const char *const *overrides, const sdm_mark *places,
                                   size_t n_overrides, sdm_config *out, sdm_error *err)
{
    char bare[256];
    if (!name || !out || (!text && size) || (!overrides && n_overrides) || n_overrides > 10000)
        return sdm_fail(
            err, SDM_E_ARG,
            "a configuration needs a name, a text, a place for the result and at most 10000 "
            "overrides");
    for (size_t i = 0; i < n_overrides; i++)
        if (!overrides[i]) return sdm_fail(err, SDM_E_ARG, "override %zu is NULL", i + 1);
    if (strlen(name) >= sizeof out->file)
        return sdm_fail(err, SDM_E_ARG, "a file name of %zu bytes, at most %zu are allowed",
                        strlen(name), sizeof out->file - 1);

    memset(out, 0, sizeof *out);
    snprintf(out->file, sizeof out->file, "%s", name);
    sdm_bare_name(name, "config", bare);
    snprintf(out->output.folder, sizeof out->output.folder, "runs/%s", bare);
    sdm_mistakes mistakes = {.file = name};
    sdm_reader r = {.target = out, .config = out, .mistakes = &mistakes};
    r.sections = sdm_config_sections(&r.n_sections);
    sdm_fields_set_defaults(&r);
    sdm_status s = read_all(&r, text ? text : "", size, overrides, places, n_overrides, err);
    if (s && s != SDM_E_CONFIG) memset(out, 0, sizeof *out);
    return s;
}

sdm_status sdm_config_parse(const char *name, const char *text, size_t size,
                            const char *const *overrides, size_t n_overrides, sdm_config *out,
                            sdm_error *err)
{
    return sdm_config_parse_placed(name, text, size, overrides, NULL, n_overrides, out, err);
}

sdm_status sdm_config_read(const char *path, const char *const *overrides, size_t n_overrides,
                           sdm_config *out, sdm_error *err)
{
    uint8_t *data = NULL;
    size_t size = 0;
    if (!path || !out)
        return sdm_fail(err, SDM_E_ARG, "a configuration needs a path and a place for the result");
    sdm_status s = sdm_tree_read(path, &data, &size, err);
    if (s) return s;
    s = sdm_config_parse(path, (const char *)data, size, overrides, n_overrides, out, err);
    sdm_free(data);
    return s;
}

/* Size, in bytes, of the value of a field that holds a number or a choice. */
static size_t value_bytes(const sdm_field *f)
{
    static const size_t bytes[] = {[SDM_FIELD_INT] = sizeof(int),
                                   [SDM_FIELD_INT64] = sizeof(int64_t),
                                   [SDM_FIELD_UINT64] = sizeof(uint64_t),
                                   [SDM_FIELD_REAL] = sizeof(double),
                                   [SDM_FIELD_CHOICE] = sizeof(int)};
    return bytes[f->type];
}

/* A reader that sets the fields of *plain, a copy of a configuration, to their defaults. */
static sdm_reader defaults_reader(sdm_config *plain, sdm_mistakes *mistakes)
{
    sdm_reader r = {.target = plain, .config = plain, .mistakes = mistakes};
    r.sections = sdm_config_sections(&r.n_sections);
    return r;
}

/* Returns whether c has, in a field that holds a number or a choice, the default value for this
 * kind of network. plain: a reader of defaults_reader(), into whose configuration the default is
 * written. */
static bool has_default(const sdm_config *c, sdm_reader *plain, const sdm_field *f, int kind)
{
    sdm_field_set_default(plain, f, f->kind_defs ? f->kind_defs[kind] : f->def);
    return !memcmp((const char *)c + f->offset, (const char *)plain->config + f->offset,
                   value_bytes(f));
}

/* Gives a key the default of `kind` if it has that of `auto`. plain: reads defaults. */
static void choose_default(sdm_config *c, sdm_reader *plain, const sdm_field *f, int kind)
{
    if (!has_default(c, plain, f, SDM_NETWORK_AUTO)) return;
    sdm_field_set_default(plain, f, f->kind_defs[kind]);
    memcpy((char *)c + f->offset, (const char *)plain->config + f->offset, value_bytes(f));
}

void sdm_config_choose_kind(sdm_config *c, sdm_network_kind kind)
{
    sdm_config plain = *c;
    sdm_mistakes mistakes = {.file = ""};
    sdm_reader r = defaults_reader(&plain, &mistakes);
    for (size_t s = 0; s < r.n_sections; s++)
        for (size_t k = 0; k < r.sections[s].n_fields; k++)
            if (r.sections[s].fields[k].kind_defs)
                choose_default(c, &r, &r.sections[s].fields[k], (int)kind);
    c->network.kind = kind;
    if (kind != SDM_NETWORK_POD) c->data.sampling = SDM_SAMPLING_UNIFORM;
}

void sdm_config_changed_keys(const sdm_config *c, const char *section, const char *but,
                             sdm_text *out)
{
    sdm_config plain = *c;
    sdm_mistakes mistakes = {.file = ""};
    sdm_reader r = defaults_reader(&plain, &mistakes);
    for (size_t s = 0; s < r.n_sections; s++)
        for (size_t k = 0; k < r.sections[s].n_fields; k++) {
            const sdm_field *f = &r.sections[s].fields[k];
            char word[SDM_KEY_PATH_MAX];
            snprintf(word, sizeof word, " %s ", f->key);
            if (strcmp(r.sections[s].name, section) || strstr(but, word) ||
                f->type == SDM_FIELD_SPECIAL || f->type == SDM_FIELD_TEXT ||
                !sdm_kind_has(f, (int)c->network.kind) ||
                has_default(c, &r, f, (int)c->network.kind))
                continue;
            sdm_text_add(out, "%s%s.%s", out->size ? ", " : "", section, f->key);
        }
}

void sdm_config_strip(sdm_config *c)
{
    c->threads = c->data.workers = 0;
    c->file[0] = c->output.folder[0] = c->dropped[0] = '\0';
}

const char *sdm_config_where(const sdm_config *c, sdm_mark mark, char *buf)
{
    return sdm_mark_print(mark, c->file, buf, 1200);
}
