/* Reads and writes the key shape.distribution: a word for all parameters, or a mapping from
 * parameters to distributions. */
#include <stdio.h>
#include <string.h>

#include "special.h"

#define MEAN_MAX 1e9
#define DEVIATION_MIN 1e-9

/* the words, in the order of sdm_distribution_choice */
static const sdm_field WORDS = {.type = SDM_FIELD_CHOICE, .choices = "shape|uniform|normal"};

static bool read_word(sdm_reader *r, const sdm_tree_node *node, const char *path,
                      sdm_config_distribution *out)
{
    int word = 0;
    if (!sdm_read_choice(r, &WORDS, node, path, &word)) return false;
    out->choice = (sdm_distribution_choice)word;
    return true;
}

/* Reads {mean: x, deviation: y}. */
static bool read_figures(sdm_reader *r, const sdm_tree_node *node, const char *path,
                         sdm_config_distribution *out)
{
    static const char *const KEYS[2] = {"mean", "deviation"};
    const double least[2] = {-MEAN_MAX, DEVIATION_MIN};
    double *const values[2] = {&out->mean, &out->deviation};
    bool given[2] = {false, false}, fits = true;
    for (const sdm_tree_node *child = node->first; child; child = child->next) {
        char name[2 * SDM_KEY_PATH_MAX], quoted[SDM_QUOTE_MAX];
        size_t k = 0;
        while (k < 2 && strcmp(child->key, KEYS[k]) != 0) k++;
        if (k == 2) {
            const char *near = sdm_nearest_name(child->key, KEYS, 2);
            sdm_mistakes_add(r->mistakes, child->key_mark, "%s: unknown key '%s'; %s%s%s", path,
                             sdm_quote(child->key, quoted), near ? "did you mean '" : "use mean",
                             near ? near : " and deviation", near ? "'?" : "");
            fits = false;
            continue;
        }
        snprintf(name, sizeof name, "%s.%s", path, KEYS[k]);
        fits &= sdm_read_real(r, child, name, least[k], MEAN_MAX, values[k]);
        given[k] = true;
    }
    for (size_t k = 0; k < 2 && fits; k++) {
        if (given[k]) continue;
        sdm_mistakes_add(r->mistakes, node->mark,
                         "%s: missing key '%s'; e.g. {mean: 0, deviation: 1}", path, KEYS[k]);
        fits = false;
    }
    out->choice = SDM_DISTRIBUTION_FIGURES;
    return fits;
}

/* Adds the distribution of one parameter, or replaces the one of the same name. */
static bool read_parameter(sdm_reader *r, const sdm_tree_node *node, const char *path)
{
    sdm_config *c = r->config;
    sdm_config_distribution one = {.mark = node->key_mark};
    char name[SDM_KEY_PATH_MAX];
    if (!sdm_read_name(r, node, path, one.name)) return false;
    snprintf(name, sizeof name, "%s.%s", path, one.name);
    if (node->kind == SDM_TREE_LIST)
        return sdm_refuse_type(r, node, name, "uniform, normal, shape or {mean: x, deviation: y}");
    if (!(node->kind == SDM_TREE_MAP ? read_figures : read_word)(r, node, name, &one)) return false;
    size_t at = 0;
    while (at < c->shape.n_distributions && strcmp(c->shape.distributions[at].name, one.name) != 0)
        at++;
    if (at == SDM_MAX_PARAMS) {
        sdm_mistakes_add(r->mistakes, node->key_mark, "%s: more than %d parameters", path,
                         SDM_MAX_PARAMS);
        return false;
    }
    c->shape.distributions[at] = one;
    if (at == c->shape.n_distributions) c->shape.n_distributions++;
    return true;
}

bool sdm_read_key_distribution(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                               const char *path)
{
    sdm_config *c = r->config;
    bool fits = true;
    (void)f;
    if (sdm_tree_is_empty(node) && node->mark.override == 0) return true;
    if (node->kind == SDM_TREE_LIST)
        return sdm_refuse_type(r, node, path, "a name, or parameters with distributions");
    if (node->kind == SDM_TREE_SCALAR) {
        c->shape.distribution.mark = node->mark;
        c->shape.n_distributions = 0;
        return read_word(r, node, path, &c->shape.distribution);
    }
    if (c->shape.distribution.choice != SDM_DISTRIBUTION_OF_SHAPE) {
        char word[SDM_NAME_MAX];
        sdm_choice_name(WORDS.choices, (int)c->shape.distribution.choice, word);
        sdm_mistakes_add(r->mistakes, node->key_mark,
                         "%s: '%s' is set for all parameters; give %s=shape before single ones",
                         path, word, path);
        return false;
    }
    for (const sdm_tree_node *child = node->first; child; child = child->next)
        fits &= read_parameter(r, child, path);
    return fits;
}

static void dump_one(const sdm_config_distribution *d, sdm_text *out)
{
    char word[SDM_NAME_MAX], mean[32], deviation[32];
    if (d->choice == SDM_DISTRIBUTION_FIGURES) {
        sdm_text_add(out, "{mean: %s, deviation: %s}", sdm_format_plain(d->mean, mean),
                     sdm_format_plain(d->deviation, deviation));
        return;
    }
    sdm_choice_name(WORDS.choices, (int)d->choice, word);
    sdm_text_add(out, "%s", word);
}

void sdm_dump_key_distribution(const sdm_config *c, sdm_text *out)
{
    if (c->shape.n_distributions == 0) {
        dump_one(&c->shape.distribution, out);
        return;
    }
    sdm_text_add(out, "{");
    for (size_t i = 0; i < c->shape.n_distributions; i++) {
        sdm_text_add(out, "%s\n    %s: ", i ? "," : "", c->shape.distributions[i].name);
        dump_one(&c->shape.distributions[i], out);
    }
    sdm_text_add(out, "}");
}
