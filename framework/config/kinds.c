/* Keys and defaults by kind of network. */
#include "kinds.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

bool sdm_kind_has(const sdm_field *f, int kind) { return !f->kinds || (f->kinds >> kind & 1); }

static const char *list_kinds(const sdm_field *f, bool defaults, char *buf, size_t size)
{
    char name[SDM_NAME_MAX];
    size_t used = 0;
    buf[0] = 0;
    for (int k = 0; used < size && sdm_choice_name(SDM_KIND_CHOICES, k, name); k++)
        if (sdm_kind_has(f, k))
            used += (size_t)snprintf(buf + used, size - used, "%s%s%s%s", used ? ", " : "", name,
                                     defaults ? " " : "", defaults ? f->kind_defs[k] : "");
    return buf;
}

const char *sdm_kind_names(const sdm_field *f, char *buf, size_t size)
{
    return list_kinds(f, false, buf, size);
}
const char *sdm_kind_defaults(const sdm_field *f, char *buf, size_t size)
{
    return list_kinds(f, true, buf, size);
}

/* Checks the ranges that are narrower for one kind of network than in the field table. */
static void check_limits(sdm_reader *r, sdm_mark place)
{
    const sdm_config *c = r->config;
    const struct {
        sdm_network_kind kind;
        const char *key;
        int value, min, max;
    } limits[] = {{SDM_NETWORK_POD, "block", c->network.block, 2, 16},
                  {SDM_NETWORK_AUTO, "block", c->network.block, 2, 16},
                  {SDM_NETWORK_TEMPLATE, "block", c->network.block, 2, 16},
                  {SDM_NETWORK_SDMNN, "depth", c->network.depth, 1, 6},
                  {SDM_NETWORK_DEEPSDF, "depth", c->network.depth, 1, 16},
                  {SDM_NETWORK_IMNET, "depth", c->network.depth, 1, 16},
                  {SDM_NETWORK_DEEPSDF, "skip", c->network.skip, 0, c->network.depth - 1}};
    char name[SDM_NAME_MAX];
    sdm_choice_name(SDM_KIND_CHOICES, (int)c->network.kind, name);
    for (size_t i = 0; i < sizeof limits / sizeof *limits; i++) {
        const sdm_given *g = sdm_fields_given(r, "network", limits[i].key);
        if (c->network.kind != limits[i].kind || g->refused) continue;
        if (limits[i].value < limits[i].min || limits[i].value > limits[i].max)
            sdm_mistakes_add(r->mistakes, sdm_mark_is_set(g->mark) ? g->mark : place,
                             "network.%s: %d is out of range (%d .. %d) for a network of kind %s",
                             limits[i].key, limits[i].value, limits[i].min, limits[i].max, name);
    }
}

/* Only pod and template may have weights of type i8. */
static bool bytes_refused(int kind)
{
    return kind != SDM_NETWORK_POD && kind != SDM_NETWORK_TEMPLATE && kind != SDM_NETWORK_AUTO;
}

/* Forgets a key of the file that the kind of an override does not have, and notes its name. */
static void drop(sdm_reader *r, const char *section, const char *key, sdm_given *g)
{
    char *list = r->config->dropped;
    const size_t size = sizeof r->config->dropped, used = strlen(list);
    if (sdm_mark_is_set(g->mark))
        snprintf(list + used, size - used, "%s%s.%s", used ? ", " : "", section, key);
    *g = (sdm_given){0};
}

void sdm_kinds_settle(sdm_reader *r, sdm_mark place)
{
    const int kind = (int)r->config->network.kind;
    const bool bytes = bytes_refused(kind) && r->config->network.weights == SDM_WEIGHT_I8;
    char names[200], chosen[SDM_NAME_MAX];
    sdm_choice_name(SDM_KIND_CHOICES, kind, chosen);
    for (size_t s = 0; s < r->n_sections; s++)
        for (size_t k = 0; k < r->sections[s].n_fields; k++) {
            const sdm_field *f = &r->sections[s].fields[k];
            sdm_given *g = &r->given[s][k];
            if (!f->kinds && !f->kind_defs) continue;
            // a key of the file that does not fit the kind set by an override counts as not given
            const bool fits = sdm_kind_has(f, kind) &&
                              !(f->offset == offsetof(sdm_config, network.weights) && bytes);
            if (!fits && kind != r->file_kind && g->mark.override == 0)
                drop(r, r->sections[s].name, f->key, g);
            if (!sdm_kind_has(f, kind) && sdm_mark_is_set(g->mark))
                sdm_mistakes_add(
                    r->mistakes, g->mark, "%s.%s: a network of kind %s has no such key, only %s",
                    r->sections[s].name, f->key, chosen, sdm_kind_names(f, names, sizeof names));
            if (sdm_mark_is_set(g->mark)) continue;
            sdm_field_set_default(r, f, f->kind_defs ? f->kind_defs[kind] : f->def);
        }
    // default of deepsdf: the input enters again at half of the depth (Park et al. 2019)
    if (kind == SDM_NETWORK_DEEPSDF &&
        !sdm_mark_is_set(sdm_fields_given(r, "network", "skip")->mark))
        r->config->network.skip = r->config->network.depth / 2;
    check_limits(r, place);
    const sdm_given *g = sdm_fields_given(r, "network", "weights");
    if (bytes_refused(kind) && r->config->network.weights == SDM_WEIGHT_I8 && !g->refused)
        sdm_mistakes_add(
            r->mistakes, sdm_mark_is_set(g->mark) ? g->mark : place,
            "network.weights: i8 is for a network of kind pod or template; %s has f16 and f32",
            chosen);
}
