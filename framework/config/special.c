/* Reads and writes the values of a configuration that are not a single number or name: grid,
 * ranges, options and the counts of the static grid. */
#include "special.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define GRID_SIZE_MAX 1048576
#define SPACING_MIN 1e-6
#define SPACING_MAX 1e6
#define PLACE_MAX 1e9
#define STATIC_MAX 1000
// data.static: auto: points along a parameter, and points of the grid, at most; more of them where
// these would leave two along a parameter, which show its ends alone
#define STATIC_AUTO_MOST 5
#define STATIC_AUTO_ALL 256
#define STATIC_AUTO_ALL_OF_FEW 750
// with a budget of time, which the maps of the grid must leave for training and for random maps
#define STATIC_AUTO_A_MINUTE 300
#define STATIC_AUTO_A_MINUTE_OF_FEW 150

/* Reads [x, y, z] within min .. max and reports the mistakes in all three numbers. */
static bool read_three(sdm_reader *r, const sdm_tree_node *node, const char *path, double min,
                       double max, double out[3])
{
    static const char *const AXIS[3] = {"x", "y", "z"};
    double v[3] = {0, 0, 0};
    bool fits = true;
    if (node->kind != SDM_TREE_LIST || node->n_children != 3)
        return sdm_refuse_type(r, node, path, "three numbers [x, y, z]");
    const sdm_tree_node *child = node->first;
    for (int i = 0; i < 3; i++, child = child->next) {
        char name[SDM_KEY_PATH_MAX];
        snprintf(name, sizeof name, "%s.%s", path, AXIS[i]);
        fits &= sdm_read_real(r, child, name, min, max, &v[i]);
    }
    if (fits) memcpy(out, v, sizeof v);
    return fits;
}

bool sdm_read_key_size(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                       const char *path)
{
    static const char *const AXIS[3] = {"x", "y", "z"};
    int64_t n[3] = {0, 0, 0};
    bool fits = true;
    (void)f;
    if (node->kind != SDM_TREE_LIST || node->n_children != 3)
        return sdm_refuse_type(r, node, path, "three integers [x, y, z]");
    const sdm_tree_node *child = node->first;
    for (int i = 0; i < 3; i++, child = child->next) {
        char name[SDM_KEY_PATH_MAX];
        snprintf(name, sizeof name, "%s.%s", path, AXIS[i]);
        fits &= sdm_read_int(r, child, name, 1, GRID_SIZE_MAX, &n[i]);
    }
    if (fits) memcpy(r->config->grid.n, n, sizeof n);
    return fits;
}

bool sdm_read_key_spacing(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                          const char *path)
{
    double *spacing = r->config->grid.spacing;
    (void)f;
    if (node->kind == SDM_TREE_LIST)
        return read_three(r, node, path, SPACING_MIN, SPACING_MAX, spacing);
    if (node->kind != SDM_TREE_SCALAR)
        return sdm_refuse_type(r, node, path, "a number or [x, y, z]");
    double v = 0;
    if (!sdm_read_real(r, node, path, SPACING_MIN, SPACING_MAX, &v)) return false;
    for (int i = 0; i < 3; i++) spacing[i] = v;
    return true;
}

bool sdm_read_key_origin(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                         const char *path)
{
    (void)f;
    return read_three(r, node, path, -PLACE_MAX, PLACE_MAX, r->config->grid.origin);
}

bool sdm_read_key_centre(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                         const char *path)
{
    (void)f;
    return read_three(r, node, path, -PLACE_MAX, PLACE_MAX, r->centre);
}

bool sdm_read_name(sdm_reader *r, const sdm_tree_node *node, const char *path,
                   char out[SDM_NAME_MAX])
{
    static const char ALLOWED[] = "abcdefghijklmnopqrstuvwxyz0123456789_";
    char quoted[SDM_QUOTE_MAX];
    size_t length = strlen(node->key);
    if (!(node->key[0] >= 'a' && node->key[0] <= 'z') || strspn(node->key, ALLOWED) != length) {
        sdm_mistakes_add(r->mistakes, node->key_mark,
                         "%s: '%s' is no name; use a-z, 0-9 and _, first a letter", path,
                         sdm_quote(node->key, quoted));
        return false;
    }
    if (length >= SDM_NAME_MAX) {
        sdm_mistakes_add(r->mistakes, node->key_mark,
                         "%s: a name of %zu bytes, at most %d are allowed", path, length,
                         SDM_NAME_MAX - 1);
        return false;
    }
    memcpy(out, node->key, length + 1);
    return true;
}

/* Adds one option, or replaces the one of the same name. */
static bool read_option(sdm_reader *r, const sdm_tree_node *node, const char *path)
{
    sdm_config_option option = {.mark = node->key_mark};
    char name[SDM_KEY_PATH_MAX];
    size_t at = 0;
    if (!sdm_read_name(r, node, path, option.name)) return false;
    snprintf(name, sizeof name, "%s.%s", path, option.name);
    if (!sdm_read_text(r, node, name, sizeof option.value - 1, option.value)) return false;
    sdm_config *c = r->config;
    while (at < c->shape.n_options && strcmp(c->shape.options[at].name, option.name) != 0) at++;
    if (at == SDM_MAX_OPTIONS) {
        sdm_mistakes_add(r->mistakes, node->key_mark, "%s: more than %d options", path,
                         SDM_MAX_OPTIONS);
        return false;
    }
    c->shape.options[at] = option;
    if (at == c->shape.n_options) c->shape.n_options++;
    return true;
}

/* Adds one range, or replaces the one of the same name. */
static bool read_range(sdm_reader *r, const sdm_tree_node *node, const char *path)
{
    sdm_config_range range = {.mark = node->key_mark};
    char name[SDM_KEY_PATH_MAX], a[32], b[32];
    size_t at = 0;
    if (!sdm_read_name(r, node, path, range.name)) return false;
    snprintf(name, sizeof name, "%s.%s", path, range.name);
    if (node->kind != SDM_TREE_LIST || node->n_children != 2)
        return sdm_refuse_type(r, node, name, "two numbers [min, max]");
    if (!sdm_read_real(r, node->first, name, -PLACE_MAX, PLACE_MAX, &range.min)) return false;
    if (!sdm_read_real(r, node->last, name, -PLACE_MAX, PLACE_MAX, &range.max)) return false;
    if (!(range.min < range.max)) {
        sdm_mistakes_add(r->mistakes, node->mark,
                         "%s: [%s, %s] is empty; the first number is the smaller one", name,
                         sdm_format_plain(range.min, a), sdm_format_plain(range.max, b));
        return false;
    }
    sdm_config *c = r->config;
    while (at < c->shape.n_ranges && strcmp(c->shape.ranges[at].name, range.name) != 0) at++;
    if (at == SDM_MAX_PARAMS) {
        sdm_mistakes_add(r->mistakes, node->key_mark, "%s: more than %d parameters", path,
                         SDM_MAX_PARAMS);
        return false;
    }
    c->shape.ranges[at] = range;
    if (at == c->shape.n_ranges) c->shape.n_ranges++;
    return true;
}

bool sdm_read_key_options(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                          const char *path)
{
    bool fits = true;
    (void)f;
    if (sdm_tree_is_empty(node) && node->mark.override == 0) return true;
    if (node->kind != SDM_TREE_MAP) return sdm_refuse_type(r, node, path, "names with values");
    for (const sdm_tree_node *child = node->first; child; child = child->next)
        fits &= read_option(r, child, path);
    return fits;
}

bool sdm_read_key_ranges(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                         const char *path)
{
    bool fits = true;
    (void)f;
    if (sdm_tree_is_empty(node) && node->mark.override == 0) return true;
    if (node->kind != SDM_TREE_MAP) return sdm_refuse_type(r, node, path, "names with [min, max]");
    for (const sdm_tree_node *child = node->first; child; child = child->next)
        fits &= read_range(r, child, path);
    return fits;
}

/* `auto`, one number for all parameters, a list with one number per parameter, or 0 for no static
 * grid. */
bool sdm_read_key_static(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                         const char *path)
{
    int64_t counts[SDM_MAX_PARAMS] = {0};
    size_t n = 0;
    bool fits = true;
    (void)f;
    if (node->kind == SDM_TREE_SCALAR && !strcmp(node->text, "auto")) {
        counts[0] = SDM_STATIC_AUTO, n = 1;
    } else if (node->kind == SDM_TREE_SCALAR) {
        if (node->text[strspn(node->text, "+-0123456789")])
            return sdm_refuse_type(r, node, path, "auto, an integer or a list of 1 to 64");
        if (!sdm_read_int(r, node, path, 0, STATIC_MAX, &counts[0])) return false;
        n = counts[0] > 0;
    } else {
        if (node->kind != SDM_TREE_LIST || node->n_children < 1 ||
            node->n_children > SDM_MAX_PARAMS)
            return sdm_refuse_type(r, node, path, "auto, an integer or a list of 1 to 64");
        for (const sdm_tree_node *child = node->first; child; child = child->next)
            fits &= sdm_read_int(r, child, path, 1, STATIC_MAX, &counts[n++]);
    }
    if (!fits) return false;
    memcpy(r->config->data.static_counts, counts, sizeof counts);
    r->config->data.n_static_counts = n;
    return true;
}

/* The largest number of points along each parameter up to `most` with at most `limit` in all. */
static int64_t count_within(double limit, size_t n_params, int64_t most)
{
    for (int64_t count = most; count > 1; count--) {
        double all = 1;
        for (size_t k = 0; k < n_params && all <= limit; k++) all *= (double)count;
        if (all <= limit) return count;
    }
    return 0;
}

/* With three points along as many parameters as `limit` allows, from the first one on, and two
 * along the others: those along parameter i. */
static int64_t count_mixed(double limit, size_t n_params, size_t i)
{
    double all = pow(2, (double)n_params);
    size_t three = 0;
    while (three < n_params && all * 1.5 <= limit) all *= 1.5, three++;
    return i < three ? 3 : 2;
}

int64_t sdm_config_static_count(const sdm_config *c, size_t n_params, size_t i)
{
    if (!c->data.n_static_counts) return 0;
    const int64_t count = c->data.static_counts[c->data.n_static_counts == 1 ? 0 : i];
    if (count != SDM_STATIC_AUTO) return count;
    const double minutes = c->train.minutes > 0 ? c->train.minutes : INFINITY,
                 all = fmin(STATIC_AUTO_ALL, STATIC_AUTO_A_MINUTE * minutes),
                 of_few = fmin(STATIC_AUTO_ALL_OF_FEW, STATIC_AUTO_A_MINUTE_OF_FEW * minutes);
    const int64_t usual = count_within(all, n_params, STATIC_AUTO_MOST);
    if (usual > 2) return usual;
    const bool three = pow(3, (double)n_params) <= STATIC_AUTO_ALL_OF_FEW;
    const int64_t two = count_within(fmax(all, of_few), n_params, 2);
    return two && three ? count_mixed(of_few, n_params, i) : two;
}

void sdm_config_set_static(sdm_config *c, size_t n_params)
{
    if (c->data.n_static_counts != 1 || c->data.static_counts[0] != SDM_STATIC_AUTO) return;
    int64_t counts[SDM_MAX_PARAMS] = {0};
    bool same = true;
    for (size_t i = 0; i < n_params; i++) {
        counts[i] = sdm_config_static_count(c, n_params, i);
        same = same && counts[i] == counts[0];
    }
    memcpy(c->data.static_counts, counts, sizeof counts);
    c->data.n_static_counts = !counts[0] ? 0 : same ? 1 : n_params;
}

static void dump_three(const double v[3], sdm_text *out)
{
    char a[32], b[32], c[32];
    sdm_text_add(out, "[%s, %s, %s]", sdm_format_plain(v[0], a), sdm_format_plain(v[1], b),
                 sdm_format_plain(v[2], c));
}

void sdm_dump_key_size(const sdm_config *c, sdm_text *out)
{
    sdm_text_add(out, "[%lld, %lld, %lld]", (long long)c->grid.n[0], (long long)c->grid.n[1],
                 (long long)c->grid.n[2]);
}

void sdm_dump_key_spacing(const sdm_config *c, sdm_text *out) { dump_three(c->grid.spacing, out); }

void sdm_dump_key_origin(const sdm_config *c, sdm_text *out) { dump_three(c->grid.origin, out); }

void sdm_dump_key_options(const sdm_config *c, sdm_text *out)
{
    sdm_text_add(out, "{");
    for (size_t i = 0; i < c->shape.n_options; i++) {
        sdm_text_add(out, "%s\n    %s: ", i ? "," : "", c->shape.options[i].name);
        sdm_dump_text(c->shape.options[i].value, out);
    }
    sdm_text_add(out, "}");
}

void sdm_dump_key_ranges(const sdm_config *c, sdm_text *out)
{
    char a[32], b[32];
    sdm_text_add(out, "{");
    for (size_t i = 0; i < c->shape.n_ranges; i++) {
        const sdm_config_range *one = &c->shape.ranges[i];
        sdm_text_add(out, "%s\n    %s: [%s, %s]", i ? "," : "", one->name,
                     sdm_format_plain(one->min, a), sdm_format_plain(one->max, b));
    }
    sdm_text_add(out, "}");
}

void sdm_dump_key_static(const sdm_config *c, sdm_text *out)
{
    const size_t n = c->data.n_static_counts;
    if (n == 1 && c->data.static_counts[0] == SDM_STATIC_AUTO) {
        sdm_text_add(out, "auto");
        return;
    }
    if (n < 2) {
        sdm_text_add(out, "%lld", n ? (long long)c->data.static_counts[0] : 0LL);
        return;
    }
    for (size_t i = 0; i < n; i++)
        sdm_text_add(out, "%s%lld", i ? ", " : "[", (long long)c->data.static_counts[i]);
    sdm_text_add(out, "]");
}
