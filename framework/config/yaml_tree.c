/* Builds a tree of nodes with marks from the events of libyaml. No other file includes libyaml. */
#include "yaml_tree.h"

#include <stdio.h>
#include <string.h>
#include <yaml.h>

#include "sdm/internal/file.h"
#include "sdm/memory.h"

/* A list or map whose end has not been read yet. */
typedef struct tree_frame {
    sdm_tree_node *node;
    bool want_key;   /* a map: the next event is a key */
    bool drop_value; /* the key was refused: the next value is dropped */
    const char *key;
    sdm_mark key_mark;
} tree_frame;

typedef struct tree_builder {
    sdm_tree *tree;
    sdm_mistakes *mistakes;
    sdm_error *err;
    sdm_mark override;
    tree_frame stack[SDM_TREE_DEPTH_MAX];
    int depth;
    bool has_document;
} tree_builder;

/* Returns the length of the UTF-8 sequence at s, and sets *code to its code point. Returns 0 if the
 * sequence is invalid, overlong or a surrogate. */
static size_t utf8_next(const unsigned char *s, size_t left, uint32_t *code)
{
    static const uint32_t CODE_MIN[5] = {0, 0, 0x80, 0x800, 0x10000};
    size_t n = s[0] < 0x80 ? 1 : s[0] >> 5 == 6 ? 2 : s[0] >> 4 == 14 ? 3 : s[0] >> 3 == 30 ? 4 : 0;
    if (n == 0 || n > left) return 0;
    uint32_t c = n == 1 ? s[0] : s[0] & (0x7Fu >> n);
    for (size_t i = 1; i < n; i++) {
        if ((s[i] & 0xC0) != 0x80) return 0;
        c = c << 6 | (s[i] & 0x3Fu);
    }
    if (c < CODE_MIN[n] || c > 0x10FFFF || (c >= 0xD800 && c <= 0xDFFF)) return 0;
    *code = c;
    return n;
}

/* True for the characters that YAML defines as printable, except tabs, line breaks and the byte
 * order mark. */
static bool is_printable(uint32_t c)
{
    if (c < 0xA0) return c >= 0x20 && c < 0x7F;
    return c != 0x2028 && c != 0x2029 && c != 0xFEFF && c != 0xFFFE && c != 0xFFFF;
}

size_t sdm_tree_printable(const char *text, size_t size)
{
    size_t at = 0;
    while (at < size) {
        uint32_t code = 0;
        size_t n = utf8_next((const unsigned char *)text + at, size - at, &code);
        if (n == 0 || !is_printable(code)) return at;
        at += n;
    }
    return size;
}

/* Returns the mark of a position; all positions in an override have the mark of the override. */
static sdm_mark mark_at(sdm_mark override, int line, int column)
{
    return override.override > 0 ? override : (sdm_mark){.line = line, .column = column};
}

/* Checks encoding, control characters and tabs before libyaml reads the text: the messages of
 * libyaml for these mistakes do not help, and it accepts byte order marks silently. */
static bool check_characters(const unsigned char *s, size_t size, sdm_mark override,
                             sdm_mistakes *mistakes)
{
    int line = 1, column = 1;
    bool indent = true;
    if (size >= 2 && ((s[0] == 0xFF && s[1] == 0xFE) || (s[0] == 0xFE && s[1] == 0xFF))) {
        sdm_mistakes_add(mistakes, mark_at(override, line, column),
                         "the text is UTF-16; save it as UTF-8");
        return false;
    }
    for (size_t at = 0, n; at < size; at += n) {
        uint32_t c = 0;
        n = utf8_next(s + at, size - at, &c);
        if (n == 0) {
            sdm_mistakes_add(mistakes, mark_at(override, line, column),
                             "byte 0x%02X is not valid UTF-8; save the text as UTF-8",
                             (unsigned)s[at]);
            return false;
        }
        if (c == '\n' || c == '\r') {
            if (c == '\r' && at + 1 < size && s[at + 1] == '\n') n = 2;
            line++;
            column = 1;
            indent = true;
            continue;
        }
        if (c == '\t' && indent) {
            sdm_mistakes_add(mistakes, mark_at(override, line, column),
                             "a tab in the indentation; use spaces");
            return false;
        }
        if (c == 0xFEFF) {
            sdm_mistakes_add(mistakes, mark_at(override, line, column),
                             "a byte order mark; save the text as UTF-8 without it");
            return false;
        }
        if (c != '\t' && !is_printable(c)) {
            sdm_mistakes_add(mistakes, mark_at(override, line, column),
                             "control character U+%04X; remove it", (unsigned)c);
            return false;
        }
        if (c != ' ') indent = false;
        column++;
    }
    return true;
}

static sdm_mark mark_of(const tree_builder *b, yaml_mark_t at)
{
    // the text has at most 2^20 bytes, so line and column fit in an int
    return mark_at(b->override, (int)at.line + 1, (int)at.column + 1);
}

static sdm_status copy_text(sdm_tree *tree, const char *text, size_t size, const char **out,
                            sdm_error *err)
{
    if (size >= tree->pool_size - tree->pool_used)
        return sdm_fail(err, SDM_E_INTERNAL, "YAML texts need more than %zu bytes",
                        tree->pool_size);
    char *copy = tree->pool + tree->pool_used;
    memcpy(copy, text, size);
    copy[size] = 0;
    tree->pool_used += size + 1;
    *out = copy;
    return SDM_OK;
}

static sdm_status add_node(tree_builder *b, sdm_tree_kind kind, sdm_mark mark, sdm_tree_node **out)
{
    sdm_tree *tree = b->tree;
    if (tree->n_nodes == tree->max_nodes) {
        sdm_mistakes_add(b->mistakes, mark, "more than %d values; a configuration is smaller",
                         SDM_TREE_NODES_MAX);
        return SDM_E_CONFIG;
    }
    *out = &tree->nodes[tree->n_nodes++];
    **out = (sdm_tree_node){.kind = kind, .mark = mark};
    return SDM_OK;
}

/* Adds a scalar or a newly opened list or map to the innermost open list or map. */
static void attach(tree_builder *b, sdm_tree_node *node)
{
    if (b->depth == 0) {
        b->tree->root = node;
        return;
    }
    tree_frame *f = &b->stack[b->depth - 1];
    sdm_tree_node *parent = f->node;
    if (parent->kind == SDM_TREE_MAP) {
        // this list or map stands in place of a key: it is dropped together with its value
        if (f->want_key) {
            sdm_mistakes_add(b->mistakes, node->mark, "a key must be a single name");
            f->want_key = false;
            f->drop_value = true;
            return;
        }
        f->want_key = true;
        if (f->drop_value) return;
        node->key = f->key;
        node->key_mark = f->key_mark;
    }
    if (parent->last)
        parent->last->next = node;
    else
        parent->first = node;
    parent->last = node;
    parent->n_children++;
}

static const sdm_tree_node *find_child(const sdm_tree_node *map, const char *key)
{
    const sdm_tree_node *child = map->first;
    while (child && strcmp(child->key, key) != 0) child = child->next;
    return child;
}

/* out = the dotted path of a key in the innermost open map: "network.depth" for `depth`. */
static void full_path(const tree_builder *b, const char *key, char *out, size_t size)
{
    size_t used = 0;
    out[0] = 0;
    for (int i = 1; i < b->depth && used < size; i++) {
        const char *name = b->stack[i].node->key;
        if (name) used += (size_t)snprintf(out + used, size - used, "%s.", name);
    }
    if (used < size) snprintf(out + used, size - used, "%s", key);
}

static sdm_status read_key(tree_builder *b, tree_frame *f, const char *text, size_t size,
                           sdm_mark mark)
{
    sdm_status s = copy_text(b->tree, text, size, &f->key, b->err);
    if (s) return s;
    f->key_mark = mark;
    f->want_key = false;
    const sdm_tree_node *before = find_child(f->node, f->key);
    f->drop_value = before != NULL;
    if (before) {
        char path[SDM_QUOTE_MAX], buf[SDM_QUOTE_MAX];
        full_path(b, f->key, path, sizeof path);
        if (before->key_mark.line > 0)
            sdm_mistakes_add(b->mistakes, mark, "duplicate key '%s' (first at line %d)",
                             sdm_quote(path, buf), before->key_mark.line);
        else
            sdm_mistakes_add(b->mistakes, mark, "duplicate key '%s'", sdm_quote(path, buf));
    }
    return SDM_OK;
}

/* Refuses anchors and tags. */
static void check_extras(tree_builder *b, const yaml_char_t *anchor, const yaml_char_t *tag,
                         sdm_mark mark)
{
    char buf[SDM_QUOTE_MAX];
    if (anchor)
        sdm_mistakes_add(b->mistakes, mark, "anchor '&%s'; anchors are not allowed",
                         sdm_quote((const char *)anchor, buf));
    if (tag)
        sdm_mistakes_add(b->mistakes, mark, "tag '%s'; tags are not allowed",
                         sdm_quote((const char *)tag, buf));
}

static sdm_status read_scalar(tree_builder *b, const yaml_event_t *e)
{
    const char *text = (const char *)e->data.scalar.value;
    size_t size = e->data.scalar.length;
    sdm_mark mark = mark_of(b, e->start_mark);
    check_extras(b, e->data.scalar.anchor, e->data.scalar.tag, mark);
    if (memchr(text, 0, size)) {
        sdm_mistakes_add(b->mistakes, mark, "a NUL character in a text; remove it");
        size = strlen(text);
    }
    tree_frame *f = b->depth ? &b->stack[b->depth - 1] : NULL;
    if (f && f->node->kind == SDM_TREE_MAP && f->want_key) return read_key(b, f, text, size, mark);

    sdm_tree_node *node = NULL;
    sdm_status s = add_node(b, SDM_TREE_SCALAR, mark, &node);
    if (s) return s;
    node->quoted = e->data.scalar.style != YAML_PLAIN_SCALAR_STYLE;
    s = copy_text(b->tree, text, size, &node->text, b->err);
    if (s) return s;
    attach(b, node);
    return SDM_OK;
}

static sdm_status open_collection(tree_builder *b, const yaml_event_t *e)
{
    bool is_map = e->type == YAML_MAPPING_START_EVENT;
    sdm_mark mark = mark_of(b, e->start_mark);
    check_extras(b, is_map ? e->data.mapping_start.anchor : e->data.sequence_start.anchor,
                 is_map ? e->data.mapping_start.tag : e->data.sequence_start.tag, mark);
    if (b->depth == SDM_TREE_DEPTH_MAX) {
        sdm_mistakes_add(b->mistakes, mark, "nesting deeper than %d", SDM_TREE_DEPTH_MAX);
        return SDM_E_CONFIG;
    }
    sdm_tree_node *node = NULL;
    sdm_status s = add_node(b, is_map ? SDM_TREE_MAP : SDM_TREE_LIST, mark, &node);
    if (s) return s;
    attach(b, node);
    b->stack[b->depth++] = (tree_frame){.node = node, .want_key = is_map};
    return SDM_OK;
}

/* Refuses an alias. The value of the alias is unknown, so reading ends here. */
static sdm_status refuse_alias(tree_builder *b, const yaml_event_t *e)
{
    char buf[SDM_QUOTE_MAX];
    sdm_mark mark = mark_of(b, e->start_mark);
    sdm_mistakes_add(b->mistakes, mark, "alias '*%s'; aliases are not allowed",
                     sdm_quote((const char *)e->data.alias.anchor, buf));
    return SDM_E_CONFIG;
}

static sdm_status open_document(tree_builder *b, const yaml_event_t *e)
{
    sdm_mark mark = mark_of(b, e->start_mark);
    if (b->has_document) {
        sdm_mistakes_add(b->mistakes, mark, "a second document; one file holds one configuration");
        return SDM_E_CONFIG;
    }
    b->has_document = true;
    if (e->data.document_start.version_directive ||
        e->data.document_start.tag_directives.start != e->data.document_start.tag_directives.end) {
        sdm_mistakes_add(b->mistakes, mark,
                         "a %%YAML or %%TAG directive; directives are not allowed");
        return SDM_E_CONFIG;
    }
    return SDM_OK;
}

static sdm_status read_event(tree_builder *b, const yaml_event_t *e)
{
    switch (e->type) {
    case YAML_DOCUMENT_START_EVENT:
        return open_document(b, e);
    case YAML_ALIAS_EVENT:
        return refuse_alias(b, e);
    case YAML_SCALAR_EVENT:
        return read_scalar(b, e);
    case YAML_SEQUENCE_START_EVENT:
    case YAML_MAPPING_START_EVENT:
        return open_collection(b, e);
    case YAML_SEQUENCE_END_EVENT:
    case YAML_MAPPING_END_EVENT:
        b->depth--;
        return SDM_OK;
    default:
        return SDM_OK;
    }
}

/* True if character number `index` is a tab; libyaml counts characters, not bytes. */
static bool is_tab(const char *text, size_t size, size_t index)
{
    size_t at = 0;
    for (; at < size; at++) {
        bool starts = ((unsigned char)text[at] & 0xC0) != 0x80;
        if (starts && index-- == 0) break;
    }
    return at < size && text[at] == '\t';
}

static sdm_status report_syntax(const tree_builder *b, const yaml_parser_t *parser,
                                const char *text, size_t size)
{
    if (parser->error == YAML_MEMORY_ERROR)
        return sdm_fail(b->err, SDM_E_NOMEM, "out of memory while reading YAML");
    yaml_mark_t at = parser->problem_mark;
    const char *problem = parser->problem ? parser->problem : "unreadable";
    if (is_tab(text, size, at.index))
        sdm_mistakes_add(b->mistakes, mark_of(b, at), "a tab where YAML wants spaces");
    else if (parser->context)
        sdm_mistakes_add(b->mistakes, mark_of(b, at), "not valid YAML: %s (%s from line %d)",
                         problem, parser->context, (int)parser->context_mark.line + 1);
    else
        sdm_mistakes_add(b->mistakes, mark_of(b, at), "not valid YAML: %s%s", problem,
                         strstr(problem, "mapping values")
                             ? " (is a space missing behind a ':' near here?)"
                             : "");
    return SDM_E_CONFIG;
}

/* Parses event by event, so that a document that is nested too deeply or has too many values is
 * refused early: libyaml reads at most about one line ahead. */
static sdm_status tree_build(tree_builder *b, yaml_parser_t *parser, const char *text, size_t size)
{
    sdm_status s = SDM_OK;
    bool more = true;
    yaml_parser_set_encoding(parser, YAML_UTF8_ENCODING);
    yaml_parser_set_input_string(parser, (const unsigned char *)text, size);
    while (more && !s) {
        yaml_event_t event;
        if (!yaml_parser_parse(parser, &event)) return report_syntax(b, parser, text, size);
        s = read_event(b, &event);
        more = event.type != YAML_STREAM_END_EVENT;
        yaml_event_delete(&event);
    }
    return s;
}

/* Allocates nodes and texts for a document of `size` bytes. */
static sdm_status tree_allocate(sdm_tree *tree, size_t size, sdm_error *err)
{
    // Upper bounds: two nodes for each byte of the document; two bytes of text for each byte (an
    // escape sequence yields at most 1.5), and two terminators for each node, for its text and its
    // key. add_node() and copy_text() check these bounds again. The terms SDM_TREE_PATH_... are for
    // sdm_tree_wrap().
    size_t nodes = 2 * size + 2;
    tree->max_nodes = nodes < SDM_TREE_NODES_MAX ? nodes : SDM_TREE_NODES_MAX;
    tree->pool_size = 2 * size + 2 * tree->max_nodes + SDM_TREE_PATH_BYTES + SDM_TREE_PATH_NAMES;
    sdm_status s =
        SDM_ALLOC(&tree->nodes, tree->max_nodes + SDM_TREE_PATH_NAMES + 1, "YAML nodes", err);
    return s ? s : SDM_ALLOC(&tree->pool, tree->pool_size, "YAML texts", err);
}

sdm_status sdm_tree_read(const char *path, uint8_t **data, size_t *size, sdm_error *err)
{
    sdm_error why = {0};
    const sdm_status s = sdm_file_read(path, SDM_TREE_BYTES_MAX, data, size, &why);
    if (s == SDM_E_IO && strchr(path, '='))
        return sdm_fail(err, s, "%s: the first argument is a configuration file, key=value follows",
                        why.text);
    if (!s && *size > 2 && (*data)[0] == 0x1f && (*data)[1] == 0x8b) {
        sdm_free(*data);
        *data = NULL;
        return sdm_fail(err, SDM_E_CONFIG, "%s:1:1: a file compressed by gzip, no configuration",
                        path);
    }
    if (s != SDM_E_FORMAT) return s ? sdm_fail(err, s, "%s", why.text) : s;
    return sdm_fail(err, SDM_E_CONFIG, "%s:1:1: more than %zu bytes; a configuration is smaller",
                    path, SDM_TREE_BYTES_MAX);
}

sdm_status sdm_tree_parse(sdm_tree *tree, const char *text, size_t size, sdm_mark override,
                          sdm_mistakes *mistakes, sdm_error *err)
{
    const sdm_mark top = mark_at(override, 1, 1);
    *tree = (sdm_tree){0};
    if (size > SDM_TREE_BYTES_MAX) {
        sdm_mistakes_add(mistakes, top, "%zu bytes, more than the allowed %zu", size,
                         SDM_TREE_BYTES_MAX);
        return SDM_E_CONFIG;
    }
    if (!check_characters((const unsigned char *)text, size, override, mistakes))
        return SDM_E_CONFIG;
    sdm_status s = tree_allocate(tree, size, err);
    if (s) return s;

    yaml_parser_t parser;
    if (!yaml_parser_initialize(&parser))
        return sdm_fail(err, SDM_E_NOMEM, "out of memory while reading YAML");
    tree_builder b = {.tree = tree, .mistakes = mistakes, .err = err, .override = override};
    s = tree_build(&b, &parser, text, size);
    yaml_parser_delete(&parser);
    return s;
}

sdm_status sdm_tree_wrap(sdm_tree *tree, const char *path, size_t length, sdm_mark override,
                         sdm_error *err)
{
    const size_t limit = tree->max_nodes + SDM_TREE_PATH_NAMES + 1;
    if (!tree->root) {
        tree->root = &tree->nodes[tree->n_nodes++];
        *tree->root = (sdm_tree_node){.kind = SDM_TREE_SCALAR, .text = "", .mark = override};
    }
    for (size_t end = length + 1; end > 0;) {
        // from the last name to the first: this name is path[start] .. path[end - 2]
        size_t start = end - 1;
        while (start > 0 && path[start - 1] != '.') start--;
        const char *key = NULL;
        sdm_status s = copy_text(tree, path + start, end - 1 - start, &key, err);
        if (s) return s;
        if (tree->n_nodes == limit)
            return sdm_fail(err, SDM_E_INTERNAL, "a key of more than %d names",
                            SDM_TREE_PATH_NAMES);
        sdm_tree_node *map = &tree->nodes[tree->n_nodes++];
        *map = (sdm_tree_node){.kind = SDM_TREE_MAP,
                               .mark = override,
                               .n_children = 1,
                               .first = tree->root,
                               .last = tree->root};
        tree->root->key = key;
        tree->root->key_mark = override;
        tree->root = map;
        end = start;
    }
    return SDM_OK;
}

void sdm_tree_dispose(sdm_tree *tree)
{
    if (!tree) return;
    sdm_free(tree->nodes);
    sdm_free(tree->pool);
    *tree = (sdm_tree){0};
}

bool sdm_tree_is_empty(const sdm_tree_node *node)
{
    return node->kind == SDM_TREE_SCALAR && !node->quoted && node->text[0] == 0;
}
