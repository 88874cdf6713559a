/* Converts parts of a YAML tree to key=value texts, so that they can be applied like the overrides
 * of the command line. */
#include "overrides.h"

#include <stdio.h>
#include <string.h>

#include "fields.h"
#include "sdm/internal/heap.h"

sdm_status sdm_overrides_add(sdm_overrides *o, const char *text, sdm_mark mark, sdm_error *err)
{
    const size_t size = strlen(text) + 1;
    sdm_status s = SDM_OK;
    if (o->n == o->capacity) {
        const size_t more = o->capacity ? 2 * o->capacity : 8;
        s = sdm_grow((void **)&o->items, o->capacity, more, sizeof *o->items, "key=value texts",
                     err);
        if (!s) o->capacity = more;
    }
    char *copy = NULL;
    if (!s) s = SDM_ALLOC(&copy, size, "key=value text", err);
    if (s) return s;
    memcpy(copy, text, size);
    o->items[o->n++] = (sdm_override){copy, mark};
    return SDM_OK;
}

void sdm_overrides_dispose(sdm_overrides *o)
{
    for (size_t i = 0; i < o->n; i++) sdm_free(o->items[i].text);
    sdm_free(o->items);
    *o = (sdm_overrides){0};
}

/* Appends the value as YAML on one line. Plain scalars that contain characters with a meaning
 * inside brackets are put in quotes. They are not numbers, so the quotes do not change their
 * meaning. */
static void add_value(const sdm_tree_node *node, sdm_text *out)
{
    const bool is_list = node->kind == SDM_TREE_LIST;
    if (node->kind == SDM_TREE_SCALAR) {
        if (node->quoted || strpbrk(node->text, ",[]{}#:&*!|>'\"%@`"))
            sdm_dump_text(node->text, out);
        else
            sdm_text_add(out, "%s", node->text);
        return;
    }
    sdm_text_add(out, is_list ? "[" : "{");
    for (const sdm_tree_node *child = node->first; child; child = child->next) {
        if (child != node->first) sdm_text_add(out, ", ");
        if (!is_list) {
            sdm_dump_text(child->key, out);
            sdm_text_add(out, ": ");
        }
        add_value(child, out);
    }
    sdm_text_add(out, is_list ? "]" : "}");
}

/* True if all texts and keys of the value are printable, so that the value can be written on one
 * line. */
static bool is_printable(const sdm_tree_node *node)
{
    if (node->text && node->text[sdm_tree_printable(node->text, strlen(node->text))]) return false;
    if (node->key && node->key[sdm_tree_printable(node->key, strlen(node->key))]) return false;
    for (const sdm_tree_node *child = node->first; child; child = child->next)
        if (!is_printable(child)) return false;
    return true;
}

static bool add_leaf(sdm_overrides *o, const char *key, const sdm_tree_node *node, sdm_mistakes *m)
{
    sdm_text text = {0};
    const sdm_mark mark = node->key_mark;
    if (!is_printable(node)) {
        sdm_mistakes_add(m, mark, "%s: a line break, tab or control character in a text", key);
        return false;
    }
    sdm_text_add(&text, "%s=", key);
    add_value(node, &text);
    const bool done = !text.failed && !sdm_overrides_add(o, text.data, mark, NULL);
    if (!done) sdm_mistakes_starve(m);
    sdm_text_dispose(&text);
    return done;
}

bool sdm_overrides_add_tree(sdm_overrides *o, const char *prefix, const sdm_tree_node *node,
                            sdm_mistakes *mistakes)
{
    static const char NAME[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.";
    bool fits = true;
    for (const sdm_tree_node *child = node->first; child; child = child->next) {
        char key[SDM_KEY_PATH_MAX], quoted[SDM_QUOTE_MAX];
        const int length =
            snprintf(key, sizeof key, "%s%s%s", prefix, *prefix ? "." : "", child->key);
        if (!*child->key || child->key[strspn(child->key, NAME)] || length >= (int)sizeof key) {
            sdm_mistakes_add(mistakes, child->key_mark,
                             "'%s' is no key of a training configuration",
                             sdm_quote(child->key, quoted));
            fits = false;
        } else if (child->kind == SDM_TREE_MAP && child->first) {
            fits &= sdm_overrides_add_tree(o, key, child, mistakes);
        } else {
            fits &= add_leaf(o, key, child, mistakes);
        }
    }
    return fits;
}
