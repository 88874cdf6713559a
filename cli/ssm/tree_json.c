/* The JSON form of HDF5 (the HDF Group's hdf5-json): groups and datasets by identifiers, links from
 * the root group on give them names. */
#include <math.h>
#include <string.h>

#include "sdm/internal/file.h"
#include "sdm/internal/json_read.h"
#include "sdm/memory.h"
#include "tree.h"

#define JSON_FILE_MAX (UINT64_C(1) << 30)

typedef struct content {
    uint8_t *bytes;
    sdm_json_document doc;
} content;

/* Copies a string; false when it is none, or too long. */
static bool copy_text(const sdm_json_document *d, size_t i, char out[CLI_TREE_TEXT])
{
    const sdm_json_value *v = &d->values[i];
    if (v->kind == '[' && v->next > i + 1) v = &d->values[i + 1]; // an array of one string
    if (v->kind != '"' || v->size >= CLI_TREE_TEXT) return false;
    memcpy(out, v->at, v->size);
    out[v->size] = '\0';
    return true;
}

/* The object of that collection and identifier, or 0. */
static size_t object_of(const sdm_json_document *d, const char *collection, const char *id)
{
    const size_t all = sdm_json_member(d, 0, collection);
    return all ? sdm_json_member(d, all, id) : 0;
}

/* The object that a hard link of the group names, or 0. */
static size_t follow(const sdm_json_document *d, size_t group, const char *title)
{
    const size_t links = sdm_json_member(d, group, "links");
    char collection[CLI_TREE_TEXT], id[CLI_TREE_TEXT];
    if (!links || d->values[links].kind != '[') return 0;
    for (size_t i = links + 1; i < d->values[links].next; i = d->values[i].next) {
        const size_t name = sdm_json_member(d, i, "title"), to = sdm_json_member(d, i, "id"),
                     in = sdm_json_member(d, i, "collection");
        if (name && to && in && sdm_json_is(d, name, title) && copy_text(d, to, id) &&
            copy_text(d, in, collection))
            return object_of(d, collection, id);
    }
    return 0;
}

/* The object at a path, or 0. */
static size_t find(const cli_tree *t, const char *name)
{
    const sdm_json_document *d = &((const content *)t->self)->doc;
    char part[CLI_TREE_TEXT];
    const size_t root = sdm_json_member(d, 0, "root");
    size_t at = root && copy_text(d, root, part) ? object_of(d, "groups", part) : 0;
    while (at && *name) {
        while (*name == '/') name++;
        const size_t n = strcspn(name, "/");
        if (n >= sizeof part) return 0;
        memcpy(part, name, n);
        part[n] = '\0';
        if (n > 0) at = follow(d, at, part);
        name += n;
    }
    return at;
}

static bool json_has(const cli_tree *t, const char *name) { return find(t, name) != 0; }

/* The sizes of nested arrays of numbers: each row as long as the first. */
static bool shape_of(const sdm_json_document *d, size_t value, size_t shape[2], int *n_dim)
{
    shape[0] = shape[1] = 1;
    *n_dim = 0;
    if (d->values[value].kind != '[') return true;
    size_t n = 0, row = 0, rows = 0;
    for (size_t i = value + 1; i < d->values[value].next; i = d->values[i].next, n++)
        if (d->values[i].kind == '[') {
            size_t m = 0;
            for (size_t k = i + 1; k < d->values[i].next; k = d->values[k].next, m++)
                if (d->values[k].kind != '0') return false;
            if (rows++ > 0 && m != row) return false;
            row = m;
        } else if (d->values[i].kind != '0') {
            return false;
        }
    shape[0] = n;
    if (rows > 0) shape[1] = row;
    *n_dim = rows > 0 ? 2 : 1;
    return rows == 0 || rows == n;
}

static sdm_status json_numbers(const cli_tree *t, const char *name, double **values,
                               size_t shape[2], int *n_dim, sdm_error *err)
{
    const sdm_json_document *d = &((const content *)t->self)->doc;
    const size_t object = find(t, name), value = object ? sdm_json_member(d, object, "value") : 0;
    *values = NULL;
    if (!value) return sdm_fail(err, SDM_E_FORMAT, "%s: no array %s", t->path, name);
    if (!shape_of(d, value, shape, n_dim))
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: %s is no array of finite numbers with one or two dimensions", t->path,
                        name);
    const size_t n = shape[0] * shape[1];
    const sdm_status s = SDM_ALLOC(values, n, "numbers of a shape model", err);
    size_t at = 0;
    for (size_t i = value; i < d->values[value].next && !s && at < n; i++)
        if (sdm_json_number(d, i, *values + at)) at++;
    if (s || at == n) return s;
    sdm_free(*values);
    *values = NULL;
    return sdm_fail(err, SDM_E_FORMAT, "%s: %s has values that are no numbers", t->path, name);
}

static bool json_text(const cli_tree *t, const char *name, const char *attribute,
                      char out[CLI_TREE_TEXT])
{
    const sdm_json_document *d = &((const content *)t->self)->doc;
    const size_t object = find(t, name);
    if (!object) return false;
    if (!attribute) {
        const size_t value = sdm_json_member(d, object, "value");
        return value && copy_text(d, value, out);
    }
    const size_t all = sdm_json_member(d, object, "attributes");
    if (!all || d->values[all].kind != '[') return false;
    for (size_t i = all + 1; i < d->values[all].next; i = d->values[i].next) {
        const size_t key = sdm_json_member(d, i, "name"), value = sdm_json_member(d, i, "value");
        if (key && value && sdm_json_is(d, key, attribute)) return copy_text(d, value, out);
    }
    return false;
}

static bool json_child(const cli_tree *t, const char *group, size_t index, char out[CLI_TREE_TEXT])
{
    const sdm_json_document *d = &((const content *)t->self)->doc;
    const size_t object = find(t, group), links = object ? sdm_json_member(d, object, "links") : 0;
    if (!links || d->values[links].kind != '[') return false;
    size_t i = links + 1;
    while (index-- > 0 && i < d->values[links].next) i = d->values[i].next;
    const size_t title = i < d->values[links].next ? sdm_json_member(d, i, "title") : 0;
    return title && copy_text(d, title, out);
}

static void json_close(cli_tree *t)
{
    content *c = t->self;
    sdm_json_document_dispose(&c->doc);
    sdm_free(c->bytes);
    sdm_free(c);
    *t = (cli_tree){0};
}

sdm_status cli_tree_json(const char *path, cli_tree *tree, sdm_error *err)
{
    content *c = NULL;
    size_t size = 0;
    sdm_status s = SDM_ALLOC(&c, 1, "JSON file", err);
    if (s) return s;
    *tree = (cli_tree){path, c, json_numbers, json_has, json_text, json_child, json_close};
    s = sdm_file_read(path, JSON_FILE_MAX, &c->bytes, &size, err);
    if (!s) s = sdm_json_parse(path, (const char *)c->bytes, size, &c->doc, err);
    if (s) json_close(tree);
    return s;
}
