/* Reads the values of a YAML tree into a struct by field tables, and reports unknown keys and
 * values that do not fit. */
#include "fields.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define CHOICES_MAX 16

/* Reads one value. Defaults are read by this function, too, so the tables cannot have a default
 * that would be refused in a file. */
static bool read_field(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                       const char *path);

const char *sdm_format_plain(double v, char buf[32])
{
    if (!(fabs(v) < 1e9) || v != nearbyint(v)) return sdm_format_real(v, buf);
    snprintf(buf, 32, "%.0f", v);
    return buf;
}

void sdm_dump_text(const char *text, sdm_text *out)
{
    sdm_text_add(out, "\"");
    for (const char *p = text; *p;) {
        size_t plain = strcspn(p, "\"\\");
        sdm_text_add(out, "%.*s", (int)plain, p);
        p += plain;
        if (*p) sdm_text_add(out, "\\%c", *p++);
    }
    sdm_text_add(out, "\"");
}

/* The content of a node for messages: "a list of 3", "a mapping", "nothing", "the text 'x'" or
 * "'x'". Returns buf. */
static const char *describe_node(const sdm_tree_node *node, char buf[SDM_QUOTE_MAX + 16])
{
    char quoted[SDM_QUOTE_MAX];
    if (node->kind == SDM_TREE_LIST)
        snprintf(buf, SDM_QUOTE_MAX + 16, "a list of %zu", node->n_children);
    else if (node->kind == SDM_TREE_MAP)
        snprintf(buf, SDM_QUOTE_MAX + 16, "a mapping");
    else if (sdm_tree_is_empty(node))
        snprintf(buf, SDM_QUOTE_MAX + 16, "nothing");
    else
        snprintf(buf, SDM_QUOTE_MAX + 16, "%s'%s'", node->quoted ? "the text " : "",
                 sdm_quote(node->text, quoted));
    return buf;
}

bool sdm_refuse_type(sdm_reader *r, const sdm_tree_node *node, const char *path, const char *wanted)
{
    char buf[SDM_QUOTE_MAX + 16];
    sdm_mistakes_add(r->mistakes, node->mark, "%s: needs %s, got %s", path, wanted,
                     describe_node(node, buf));
    return false;
}

static bool refuse_number(sdm_reader *r, const sdm_tree_node *node, const char *path)
{
    char buf[SDM_QUOTE_MAX + 16], comma[64] = "";
    if (node->kind == SDM_TREE_SCALAR) sdm_comma_hint(node->text, comma);
    sdm_mistakes_add(r->mistakes, node->mark, "%s: needs a finite number, got %s%s", path,
                     describe_node(node, buf), comma);
    return false;
}

bool sdm_read_real(sdm_reader *r, const sdm_tree_node *node, const char *path, double min,
                   double max, double *out)
{
    char a[32], b[32], quoted[SDM_QUOTE_MAX];
    double v;
    if (node->kind != SDM_TREE_SCALAR || node->quoted || !sdm_parse_real(node->text, &v))
        return refuse_number(r, node, path);
    if (!(v >= min && v <= max)) {
        sdm_mistakes_add(r->mistakes, node->mark, "%s: %s is out of range (%s .. %s)", path,
                         sdm_quote(node->text, quoted), sdm_format_plain(min, a),
                         sdm_format_plain(max, b));
        return false;
    }
    *out = v;
    return true;
}

/* True if the text has the syntax of an integer, even of one too large for 64 bits: such a number
 * is out of range, not of the wrong type. */
static bool is_integer(const char *text)
{
    size_t sign = *text == '-' || *text == '+';
    return text[sign] != 0 && strspn(text + sign, "0123456789") == strlen(text + sign);
}

bool sdm_read_int(sdm_reader *r, const sdm_tree_node *node, const char *path, int64_t min,
                  int64_t max, int64_t *out)
{
    char quoted[SDM_QUOTE_MAX];
    int64_t v;
    if (node->kind != SDM_TREE_SCALAR || node->quoted || !is_integer(node->text))
        return sdm_refuse_type(r, node, path, "an integer");
    if (!sdm_parse_int(node->text, &v) || v < min || v > max) {
        sdm_mistakes_add(r->mistakes, node->mark, "%s: %s is out of range (%lld .. %lld)", path,
                         sdm_quote(node->text, quoted), (long long)min, (long long)max);
        return false;
    }
    *out = v;
    return true;
}

static bool read_uint64(sdm_reader *r, const sdm_tree_node *node, const char *path, uint64_t *out)
{
    char quoted[SDM_QUOTE_MAX];
    if (node->kind != SDM_TREE_SCALAR || node->quoted || !is_integer(node->text))
        return sdm_refuse_type(r, node, path, "an integer");
    uint64_t v = 0;
    bool fits = node->text[0] != '-';
    for (const char *p = node->text + (node->text[0] == '+'); fits && *p; p++) {
        uint64_t digit = (uint64_t)(*p - '0');
        fits = v <= (UINT64_MAX - digit) / 10;
        v = v * 10 + digit;
    }
    if (!fits) {
        sdm_mistakes_add(r->mistakes, node->mark, "%s: %s is out of range (0 .. %llu)", path,
                         sdm_quote(node->text, quoted), (unsigned long long)UINT64_MAX);
        return false;
    }
    *out = v;
    return true;
}

bool sdm_read_text(sdm_reader *r, const sdm_tree_node *node, const char *path, size_t max,
                   char *out)
{
    if (node->kind != SDM_TREE_SCALAR || node->text[0] == 0)
        return sdm_refuse_type(r, node, path, "a text");
    size_t length = strlen(node->text);
    if (length > max) {
        sdm_mistakes_add(r->mistakes, node->mark,
                         "%s: a text of %zu bytes, at most %zu are allowed", path, length, max);
        return false;
    }
    if (sdm_tree_printable(node->text, length) < length) {
        sdm_mistakes_add(r->mistakes, node->mark,
                         "%s: a line break, tab or control character in a text", path);
        return false;
    }
    memcpy(out, node->text, length + 1);
    return true;
}

bool sdm_choice_name(const char *choices, int index, char buf[SDM_NAME_MAX])
{
    const char *p = choices;
    for (; index > 0 && p; index--) {
        p = strchr(p, '|');
        if (p) p++;
    }
    if (!p) return false;
    size_t length = strcspn(p, "|");
    assert(length < SDM_NAME_MAX);
    memcpy(buf, p, length);
    buf[length] = 0;
    return true;
}

/* "a|b|c" -> "a, b, c", cut at `size`. */
static void join_choices(const char *choices, char *buf, size_t size)
{
    char name[SDM_NAME_MAX];
    size_t used = 0;
    buf[0] = 0;
    for (int i = 0; used < size && sdm_choice_name(choices, i, name); i++)
        used += (size_t)snprintf(buf + used, size - used, "%s%s", i ? ", " : "", name);
}

const char *sdm_field_range(const sdm_field *f, char *buf, size_t size)
{
    char a[32], b[32];
    if (f->shown_range)
        snprintf(buf, size, "%s", f->shown_range);
    else if (f->type == SDM_FIELD_CHOICE)
        join_choices(f->choices, buf, size);
    else if (f->type == SDM_FIELD_UINT64)
        snprintf(buf, size, "0 .. %llu", (unsigned long long)UINT64_MAX);
    else if (f->type == SDM_FIELD_TEXT)
        snprintf(buf, size, "1 .. %.0f bytes", f->max);
    else if (f->type == SDM_FIELD_REAL)
        snprintf(buf, size, "%s .. %s", sdm_format_plain(f->min, a), sdm_format_plain(f->max, b));
    else
        snprintf(buf, size, "%lld .. %lld", (long long)f->min, (long long)f->max);
    return buf;
}

bool sdm_read_choice(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node, const char *path,
                     int *out)
{
    char names[CHOICES_MAX][SDM_NAME_MAX], allowed[SDM_KEY_PATH_MAX], quoted[SDM_QUOTE_MAX];
    const char *list[CHOICES_MAX];
    size_t n = 0;
    if (node->kind != SDM_TREE_SCALAR || node->text[0] == 0)
        return sdm_refuse_type(r, node, path, "one of its names");
    for (; n < CHOICES_MAX && sdm_choice_name(f->choices, (int)n, names[n]); n++) {
        list[n] = names[n];
        if (strcmp(node->text, names[n]) != 0) continue;
        *out = (int)n;
        return true;
    }
    const char *near = sdm_nearest_name(node->text, list, n);
    sdm_mistakes_add(
        r->mistakes, node->mark,
        near ? "%s: '%s' is not one of %s; did you mean '%s'?" : "%s: '%s' is not one of %s", path,
        sdm_quote(node->text, quoted), sdm_field_range(f, allowed, sizeof allowed), near);
    return false;
}

static bool read_field(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                       const char *path)
{
    char *at = (char *)r->target + f->offset;
    int64_t wide = 0;
    switch (f->type) {
    case SDM_FIELD_INT:
        if (!sdm_read_int(r, node, path, (int64_t)f->min, (int64_t)f->max, &wide)) return false;
        *(int *)at = (int)wide;
        return true;
    case SDM_FIELD_INT64:
        return sdm_read_int(r, node, path, (int64_t)f->min, (int64_t)f->max, (int64_t *)at);
    case SDM_FIELD_UINT64:
        return read_uint64(r, node, path, (uint64_t *)at);
    case SDM_FIELD_REAL:
        return sdm_read_real(r, node, path, f->min, f->max, (double *)at);
    case SDM_FIELD_CHOICE:
        return sdm_read_choice(r, f, node, path, (int *)at);
    case SDM_FIELD_TEXT:
        return sdm_read_text(r, node, path, (size_t)f->max, at);
    case SDM_FIELD_SPECIAL:
        return f->read(r, f, node, path);
    }
    return false;
}

void sdm_field_set_default(sdm_reader *r, const sdm_field *f, const char *def)
{
    const sdm_tree_node node = {.kind = SDM_TREE_SCALAR, .text = def};
    bool fits = read_field(r, f, &node, f->key);
    assert(fits);
    (void)fits;
}

void sdm_fields_set_defaults(sdm_reader *r)
{
    for (size_t s = 0; s < r->n_sections; s++) {
        assert(s < SDM_SECTIONS_MAX && r->sections[s].n_fields <= SDM_SECTION_FIELDS_MAX);
        for (size_t k = 0; k < r->sections[s].n_fields; k++) {
            const sdm_field *f = &r->sections[s].fields[k];
            if (f->def || f->kind_defs)
                sdm_field_set_default(r, f, f->kind_defs ? f->kind_defs[0] : f->def);
        }
    }
}

sdm_given *sdm_fields_given(sdm_reader *r, const char *section, const char *key)
{
    for (size_t s = 0; s < r->n_sections; s++) {
        if (strcmp(r->sections[s].name, section) != 0) continue;
        for (size_t k = 0; k < r->sections[s].n_fields; k++)
            if (strcmp(r->sections[s].fields[k].key, key) == 0) return &r->given[s][k];
    }
    assert(0 && "a key of the tables");
    return &r->given[0][0];
}

/* Names of the keys of a section, of the top level with those of the sections. Returns their
 * number.
 */
static size_t key_names(const sdm_reader *r, const sdm_section *section,
                        const char *names[SDM_SECTION_FIELDS_MAX + SDM_SECTIONS_MAX])
{
    size_t n = 0;
    for (size_t k = 0; k < section->n_fields; k++) names[n++] = section->fields[k].key;
    for (size_t s = 0; s < r->n_sections && !*section->name; s++)
        if (*r->sections[s].name) names[n++] = r->sections[s].name;
    return n;
}

/* The key to suggest for an unknown one: the most similar key of the same section (with `full` its
 * dotted path), else the path of the same key in another section. NULL: none. */
static const char *suggest(const sdm_reader *r, const sdm_section *section, const char *key,
                           bool full, char buf[SDM_KEY_PATH_MAX])
{
    const char *names[SDM_SECTION_FIELDS_MAX + SDM_SECTIONS_MAX];
    const char *near = sdm_nearest_name(key, names, key_names(r, section, names));
    if (near) {
        bool prefix = full && *section->name;
        snprintf(buf, SDM_KEY_PATH_MAX, "%s%s%s", prefix ? section->name : "", prefix ? "." : "",
                 near);
        return buf;
    }
    for (size_t s = 0; s < r->n_sections; s++) {
        const sdm_section *other = &r->sections[s];
        for (size_t k = 0; k < other->n_fields; k++) {
            if (strcmp(other->fields[k].key, key) != 0) continue;
            snprintf(buf, SDM_KEY_PATH_MAX, "%s%s%s", other->name, *other->name ? "." : "", key);
            return buf;
        }
    }
    return NULL;
}

/* Notes in r->unknown that the section has an unknown key. If the user probably meant the name of a
 * section (gird for grid), that section has one, too: its keys are not missing. */
static void note_unknown(sdm_reader *r, const sdm_section *section, const char *meant)
{
    for (size_t s = 0; s < r->n_sections; s++)
        if (&r->sections[s] == section || (meant && !strcmp(r->sections[s].name, meant)))
            r->unknown[s] = true;
}

/* Records an unknown key as a mistake, with a suggestion if suggest() finds one, else with the keys
 * that are known. */
static void refuse_key(sdm_reader *r, const sdm_section *section, const sdm_tree_node *node)
{
    const char *names[SDM_SECTION_FIELDS_MAX + SDM_SECTIONS_MAX];
    char quoted[SDM_QUOTE_MAX], buf[SDM_KEY_PATH_MAX], list[256];
    const char *dot = *section->name ? "." : "", *key = sdm_quote(node->key, quoted);
    const char *near = suggest(r, section, node->key, node->key_mark.override > 0, buf);
    if (near)
        sdm_mistakes_add(r->mistakes, node->key_mark, "unknown key '%s%s%s'; did you mean '%s'?",
                         section->name, dot, key, near);
    else
        sdm_mistakes_add(r->mistakes, node->key_mark, "unknown key '%s%s%s'; the keys are %s",
                         section->name, dot, key,
                         sdm_list_names(names, key_names(r, section, names), list, sizeof list));
    note_unknown(r, section, near);
}

bool sdm_fields_unknown(const sdm_reader *r, const char *section)
{
    size_t s = 0;
    while (strcmp(r->sections[s].name, section) != 0) s++;
    return r->unknown[s];
}

static void read_key(sdm_reader *r, size_t s, const sdm_tree_node *node)
{
    const sdm_section *section = &r->sections[s];
    for (size_t k = 0; k < section->n_fields; k++) {
        const sdm_field *f = &section->fields[k];
        if (strcmp(f->key, node->key) != 0) continue;
        char path[SDM_KEY_PATH_MAX];
        snprintf(path, sizeof path, "%s%s%s", section->name, *section->name ? "." : "", f->key);
        r->given[s][k].mark = node->key_mark;
        r->given[s][k].refused = !read_field(r, f, node, path);
        return;
    }
    refuse_key(r, section, node);
}

static void read_section(sdm_reader *r, size_t s, const sdm_tree_node *node)
{
    if (!sdm_mark_is_set(r->section_mark[s])) r->section_mark[s] = node->key_mark;
    // in a file a section may be empty: all its keys are commented out
    if (sdm_tree_is_empty(node) && node->mark.override == 0) return;
    const sdm_section *section = &r->sections[s];
    if (section->word && node->kind == SDM_TREE_SCALAR && !strcmp(node->text, section->word)) {
        section->take_word(r, node->mark);
        return;
    }
    if (node->kind != SDM_TREE_MAP) {
        char wanted[64];
        snprintf(wanted, sizeof wanted, "%s%skeys with values", section->word ? section->word : "",
                 section->word ? " or " : "");
        sdm_refuse_type(r, node, section->name, wanted);
        return;
    }
    for (const sdm_tree_node *child = node->first; child; child = child->next)
        read_key(r, s, child);
}

void sdm_fields_read(sdm_reader *r, const sdm_tree_node *root)
{
    size_t top = 0; // the section of the keys at top level
    while (*r->sections[top].name) top++;
    if (!root || sdm_tree_is_empty(root)) return;
    if (root->kind != SDM_TREE_MAP) {
        sdm_refuse_type(r, root, "the configuration", "keys with values");
        return;
    }
    for (const sdm_tree_node *child = root->first; child; child = child->next) {
        size_t s = 0;
        while (s < r->n_sections && strcmp(r->sections[s].name, child->key) != 0) s++;
        if (s < r->n_sections && s != top)
            read_section(r, s, child);
        else
            read_key(r, top, child);
    }
}
