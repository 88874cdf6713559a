/* Validation of a plug-in's table before its first use. All mistakes are told at once. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "sdm/internal/mesh_measures.h"
#include "sdm/internal/text.h"
#include "shape_internal.h"

static sdm_status range_check(const char *who, const char *what, const char *name, double min,
                              double max, double def, sdm_error *err)
{
    if (!isfinite(min) || !isfinite(max) || !(min < max))
        return sdm_fail(err, SDM_E_PLUGIN,
                        "%s: %s '%s' has the range %g .. %g, need finite numbers with min < max",
                        who, what, name, min, max);
    if (!(def >= min && def <= max))
        return sdm_fail(err, SDM_E_PLUGIN,
                        "%s: %s '%s' has the default %g outside its range %g .. %g", who, what,
                        name, def, min, max);
    return SDM_OK;
}

/* Adds the outcome s of one more check to those before: the texts of all mistakes, with `who` once.
 */
static sdm_status add_mistake(sdm_status before, sdm_status s, const char *who,
                              const sdm_error *one, sdm_error *err)
{
    if (!s) return before;
    if (!before) return sdm_fail(err, s, "%s", one->text);
    const size_t length = strlen(who), skip = strncmp(one->text, who, length) ? 0 : length + 2;
    const size_t used = err ? strlen(err->text) : 0;
    if (err) snprintf(err->text + used, sizeof err->text - used, "; %.1000s", one->text + skip);
    return before;
}

static sdm_status param_check(const char *who, const sdm_param *params, uint32_t i, sdm_error *err)
{
    const sdm_param *p = &params[i];
    if (!p->name)
        return sdm_fail(err, SDM_E_PLUGIN,
                        "%s: parameter %u has no name: a row of the table that is not set, or "
                        ".n_params is larger than the table (SDM_PARAMS(TABLE) counts the rows)",
                        who, (unsigned)i + 1);
    if (!sdm_is_name(p->name))
        return sdm_fail(err, SDM_E_PLUGIN, "%s: parameter %u has the name '%s': " SDM_NAME_RULE,
                        who, (unsigned)i + 1, p->name);
    for (uint32_t j = 0; j < i; j++)
        if (params[j].name && strcmp(params[j].name, p->name) == 0)
            return sdm_fail(err, SDM_E_PLUGIN, "%s: two parameters are named '%s'", who, p->name);
    if (!p->unit || !p->help)
        return sdm_fail(err, SDM_E_PLUGIN, "%s: parameter '%s' has no %s (\"\" is fine)", who,
                        p->name, p->unit ? "help" : "unit");
    return range_check(who, "parameter", p->name, p->min, p->max, p->def, err);
}

sdm_status sdm_shape_check_params(const char *who, const sdm_param *params, uint32_t n,
                                  sdm_error *err)
{
    if (n > SHAPE_PARAMS_MAX)
        return sdm_fail(err, SDM_E_PLUGIN, "%s: %u parameters, at most %d", who, (unsigned)n,
                        SHAPE_PARAMS_MAX);
    if (n && !params)
        return sdm_fail(err, SDM_E_PLUGIN, "%s: %u parameters, but no table of them", who,
                        (unsigned)n);
    sdm_status s = SDM_OK;
    for (uint32_t i = 0; i < n; i++) {
        sdm_error one = {0};
        s = add_mistake(s, param_check(who, params, i, &one), who, &one, err);
    }
    return s;
}

/* o->choices must be a list of words separated by '|', none of them empty or repeated. */
static sdm_status choices_check(const char *who, const sdm_option *o, sdm_error *err)
{
    const char *all = o->choices;
    if (!all || !all[0])
        return sdm_fail(err, SDM_E_PLUGIN, "%s: option '%s' has no choices", who, o->name);
    size_t count = 0;
    for (const char *word = all;;) {
        const size_t n = strcspn(word, "|");
        bool bad = n == 0 || n > SDM_NAME_LENGTH_MAX || ++count > SHAPE_OPTIONS_MAX;
        for (const char *before = all; before < word && !bad; before += strcspn(before, "|") + 1)
            bad = strcspn(before, "|") == n && memcmp(before, word, n) == 0;
        if (bad)
            return sdm_fail(
                err, SDM_E_PLUGIN,
                "%s: option '%s' has an empty, long or repeated choice, or too many, in '%s'", who,
                o->name, all);
        if (!word[n]) return SDM_OK;
        word += n + 1;
    }
}

static sdm_status values_check(const char *who, const sdm_option *o, sdm_error *err)
{
    switch (o->type) {
    case SDM_OPTION_INT:
        if (!(fabs(o->min) <= 1e15 && fabs(o->max) <= 1e15) || o->def != nearbyint(o->def))
            return sdm_fail(
                err, SDM_E_PLUGIN,
                "%s: option '%s' is an integer, but its range %g .. %g or default %g is none", who,
                o->name, o->min, o->max, o->def);
        return range_check(who, "option", o->name, o->min, o->max, o->def, err);
    case SDM_OPTION_REAL:
        return range_check(who, "option", o->name, o->min, o->max, o->def, err);
    case SDM_OPTION_CHOICE:
        return choices_check(who, o, err);
    case SDM_OPTION_FILE:
        return SDM_OK;
    }
    return sdm_fail(err, SDM_E_PLUGIN, "%s: option '%s' has the unknown type %d", who, o->name,
                    (int)o->type);
}

static sdm_status option_check(const char *who, const sdm_option *options, uint32_t i,
                               sdm_error *err)
{
    const sdm_option *o = &options[i];
    if (!sdm_is_name(o->name))
        return sdm_fail(err, SDM_E_PLUGIN, "%s: option %u has the name '%s': " SDM_NAME_RULE, who,
                        (unsigned)i + 1, o->name ? o->name : "(none)");
    for (uint32_t j = 0; j < i; j++)
        if (options[j].name && strcmp(options[j].name, o->name) == 0)
            return sdm_fail(err, SDM_E_PLUGIN, "%s: two options are named '%s'", who, o->name);
    if (!o->unit || !o->help)
        return sdm_fail(err, SDM_E_PLUGIN, "%s: option '%s' has no %s (\"\" is fine)", who, o->name,
                        o->unit ? "help" : "unit");
    return values_check(who, o, err);
}

static sdm_status options_check(const char *who, const sdm_option *options, uint32_t n,
                                sdm_error *err)
{
    if (n > SHAPE_OPTIONS_MAX)
        return sdm_fail(err, SDM_E_PLUGIN, "%s: %u options, at most %d", who, (unsigned)n,
                        SHAPE_OPTIONS_MAX);
    if (n && !options)
        return sdm_fail(err, SDM_E_PLUGIN, "%s: %u options, but no table of them", who,
                        (unsigned)n);
    sdm_status s = SDM_OK;
    for (uint32_t i = 0; i < n; i++) {
        sdm_error one = {0};
        s = add_mistake(s, option_check(who, options, i, &one), who, &one, err);
    }
    return s;
}

static sdm_status callbacks_check(const char *who, const sdm_shape *t, sdm_error *err)
{
    if (!t->mesh) return sdm_fail(err, SDM_E_PLUGIN, "%s: no callback mesh()", who);
    if (!t->create != !t->destroy)
        return sdm_fail(err, SDM_E_PLUGIN,
                        "%s: callback %s() is missing: create() and destroy() go together", who,
                        t->create ? "destroy" : "create");
    if (t->describe && !t->create)
        return sdm_fail(err, SDM_E_PLUGIN, "%s: describe() needs create()", who);
    return SDM_OK;
}

// the option that mirrors the shape has two choices
static sdm_status mirror_check(const char *who, const sdm_shape *shape, sdm_error *err)
{
    if (!shape->mirror) return SDM_OK;
    for (uint32_t i = 0; i < shape->n_options; i++) {
        const sdm_option *o = &shape->options[i];
        if (strcmp(o->name, shape->mirror) != 0 || o->type != SDM_OPTION_CHOICE) continue;
        const char *bar = strchr(o->choices, '|');
        if (bar && !strchr(bar + 1, '|')) return SDM_OK;
    }
    return sdm_fail(err, SDM_E_PLUGIN, "%s: mirror '%s': need an option of two choices", who,
                    shape->mirror);
}

// whether `name` belongs to one of measures[n]
static bool is_taken(const char *name, const sdm_measure *measures, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        if (strcmp(measures[i].name, name) == 0) return true;
    return false;
}

static sdm_status measures_check(const char *who, const sdm_shape *t, sdm_error *err)
{
    const uint32_t n = t->n_measures;
    if (!t->measure != !n || (n && !t->measures))
        return sdm_fail(err, SDM_E_PLUGIN,
                        "%s: measures, their number and measure() go together: all or none", who);
    if (n > SHAPE_MEASURES_MAX)
        return sdm_fail(err, SDM_E_PLUGIN, "%s: %u measures, at most %d", who, (unsigned)n,
                        SHAPE_MEASURES_MAX);
    for (uint32_t i = 0; i < n; i++) {
        const sdm_measure *m = &t->measures[i];
        if (!sdm_is_name(m->name))
            return sdm_fail(err, SDM_E_PLUGIN, "%s: measure %u has the name '%s': " SDM_NAME_RULE,
                            who, (unsigned)i + 1, m->name ? m->name : "(none)");
        if (is_taken(m->name, t->measures, i))
            return sdm_fail(err, SDM_E_PLUGIN, "%s: two measures are named '%s'", who, m->name);
        if (is_taken(m->name, sdm_mesh_measures, SDM_MESH_MEASURES))
            return sdm_fail(err, SDM_E_PLUGIN, "%s: measure '%s': every shape has it from its mesh",
                            who, m->name);
        if (!m->unit || !m->help)
            return sdm_fail(err, SDM_E_PLUGIN, "%s: measure '%s' has no %s (\"\" is fine)", who,
                            m->name, m->unit ? "help" : "unit");
    }
    return SDM_OK;
}

sdm_status sdm_shape_copy_checked(const sdm_shape *table, const char *origin, sdm_shape *out,
                                  sdm_error *err)
{
    // only abi and size are certain to exist; everything else is read from the copy
    uint32_t lead[2];
    memcpy(lead, table, sizeof lead);
    if (lead[0] != SDM_SHAPE_ABI)
        return sdm_fail(err, SDM_E_PLUGIN,
                        "%s: shape table of plug-in interface %u, this program has interface %u: "
                        "build the plug-in "
                        "with the sdm/shape.h of this program",
                        origin, (unsigned)lead[0], SDM_SHAPE_ABI);
    const size_t need = offsetof(sdm_shape, mesh) + sizeof table->mesh;
    if (lead[1] < need)
        return sdm_fail(
            err, SDM_E_PLUGIN,
            "%s: shape table of %u bytes, need at least %zu: set .size = sizeof(sdm_shape)", origin,
            (unsigned)lead[1], need);
    *out = (sdm_shape){0};
    // do not copy half a pointer if `size` is not a multiple of the pointer size
    const size_t whole = lead[1] / sizeof(void *) * sizeof(void *);
    memcpy(out, (const void *)table, whole < sizeof *out ? whole : sizeof *out);
    out->size = (uint32_t)sizeof *out;

    if (!sdm_is_name(out->name))
        return sdm_fail(err, SDM_E_PLUGIN, "%s: shape of the name '%s': " SDM_NAME_RULE, origin,
                        out->name ? out->name : "(none)");
    char who[1200];
    snprintf(who, sizeof who, "%.1000s: shape '%s'", origin, out->name);
    sdm_error one = {0};
    sdm_status s = out->summary ? SDM_OK : sdm_fail(err, SDM_E_PLUGIN, "%s: no summary", who);
    s = add_mistake(s, callbacks_check(who, out, &one), who, &one, err);
    s = add_mistake(s, sdm_shape_check_params(who, out->params, out->n_params, &one), who, &one,
                    err);
    if (!out->n_params && !out->describe)
        s = add_mistake(s, sdm_fail(&one, SDM_E_PLUGIN, "%s: no parameters", who), who, &one, err);
    const sdm_status options = options_check(who, out->options, out->n_options, &one);
    s = add_mistake(s, options, who, &one, err);
    if (!options) s = add_mistake(s, mirror_check(who, out, &one), who, &one, err);
    return add_mistake(s, measures_check(who, out, &one), who, &one, err);
}
