/* Conversion of option values from text. */
#include <stdio.h>
#include <string.h>

#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "shape_internal.h"

static sdm_status option_fail_unknown(const sdm_shape *shape, const char *name, sdm_error *err)
{
    const char *names[SHAPE_OPTIONS_MAX];
    for (uint32_t i = 0; i < shape->n_options; i++) names[i] = shape->options[i].name;
    const char *near = sdm_nearest_name(name, names, shape->n_options);
    if (near)
        return sdm_fail(err, SDM_E_CONFIG, "shape '%s' has no option '%s'; did you mean '%s'?",
                        shape->name, name, near);
    if (!shape->n_options)
        return sdm_fail(err, SDM_E_CONFIG, "shape '%s' has no option '%s': it has no options",
                        shape->name, name);
    char list[200];
    return sdm_fail(err, SDM_E_CONFIG, "shape '%s' has no option '%s'; its options are %s",
                    shape->name, name, sdm_list_names(names, shape->n_options, list, sizeof list));
}

/* The text given for option `name`, or NULL. */
static const char *given_find(const sdm_named_text *given, size_t n, const char *name)
{
    for (size_t i = 0; i < n; i++)
        if (strcmp(given[i].name, name) == 0) return given[i].value;
    return NULL;
}

static sdm_status given_check(const sdm_shape *shape, const sdm_named_text *given, size_t n,
                              sdm_error *err)
{
    for (size_t i = 0; i < n; i++) {
        if (!given[i].name || !given[i].value)
            return sdm_fail(err, SDM_E_ARG, "shape '%s': option %zu without a name or a value",
                            shape->name, i + 1);
        bool known = false;
        for (uint32_t k = 0; k < shape->n_options; k++)
            known = known || strcmp(shape->options[k].name, given[i].name) == 0;
        if (!known) return option_fail_unknown(shape, given[i].name, err);
        for (size_t j = 0; j < i; j++)
            if (strcmp(given[j].name, given[i].name) == 0)
                return sdm_fail(err, SDM_E_CONFIG, "shape '%s': option '%s' is given twice",
                                shape->name, given[i].name);
    }
    return SDM_OK;
}

static sdm_status number_parse(const sdm_shape *shape, const sdm_option *o, const char *given,
                               sdm_option_value *out, sdm_error *err)
{
    double v = 0;
    int64_t whole = 0;
    const bool integer = o->type == SDM_OPTION_INT;
    const bool good = integer ? sdm_parse_int(given, &whole) : sdm_parse_real(given, &v);
    char comma[64];
    if (!good)
        return sdm_fail(err, SDM_E_CONFIG, "shape '%s': option '%s' is '%s', need %s%s",
                        shape->name, o->name, given, integer ? "an integer" : "a number",
                        integer ? "" : sdm_comma_hint(given, comma));
    if (integer) v = (double)whole;
    if (!(v >= o->min && v <= o->max)) {
        char min[32], max[32];
        return sdm_fail(err, SDM_E_CONFIG, "shape '%s': option '%s' is %s%s%s, need %s .. %s",
                        shape->name, o->name, given, o->unit[0] ? " " : "", o->unit,
                        sdm_format_real(o->min, min), sdm_format_real(o->max, max));
    }
    out->number = v;
    return SDM_OK;
}

/* Finds the choice `given`; NULL selects the first choice. `words` is a writable copy of
   o->choices; it is split at '|' in place, and out->text points into it. */
static sdm_status choice_parse(const sdm_shape *shape, const sdm_option *o, const char *given,
                               char *words, sdm_option_value *out, sdm_error *err)
{
    const char *names[SHAPE_OPTIONS_MAX];
    size_t n = 0;
    for (char *word = words; word && n < SHAPE_OPTIONS_MAX;) {
        names[n++] = word;
        word = strchr(word, '|');
        if (word) *word++ = '\0';
    }
    for (size_t i = 0; i < n; i++)
        if (!given || strcmp(names[i], given) == 0) {
            *out = (sdm_option_value){(double)i, names[i]};
            return SDM_OK;
        }
    const char *near = sdm_nearest_name(given, names, n);
    if (near)
        return sdm_fail(err, SDM_E_CONFIG, "shape '%s': option '%s' is '%s'; did you mean '%s'?",
                        shape->name, o->name, given, near);
    return sdm_fail(err, SDM_E_CONFIG, "shape '%s': option '%s' is '%s', need one of %s",
                    shape->name, o->name, given, o->choices);
}

static bool path_needs_folder(const sdm_option *o, const char *given, const char *base_dir)
{
    return o->type == SDM_OPTION_FILE && given && given[0] && given[0] != '/' && base_dir &&
           base_dir[0];
}

/* Bytes that the value of option o needs in the text block. */
static size_t option_text_size(const sdm_option *o, const char *given, const char *base_dir)
{
    if (o->type == SDM_OPTION_CHOICE) return strlen(o->choices) + 1;
    if (o->type != SDM_OPTION_FILE || !given) return 1;
    return strlen(given) + 1 + (path_needs_folder(o, given, base_dir) ? strlen(base_dir) + 1 : 0);
}

sdm_status sdm_shape_parse_options(const sdm_shape *shape, const sdm_named_text *given,
                                   size_t n_given, const char *base_dir, sdm_option_value *values,
                                   char **text, sdm_error *err)
{
    *text = NULL;
    sdm_status s = given_check(shape, given, n_given, err);
    if (s) return s;
    // one block for all texts
    size_t size = 0;
    for (uint32_t i = 0; i < shape->n_options; i++)
        size += option_text_size(&shape->options[i],
                                 given_find(given, n_given, shape->options[i].name), base_dir);
    s = SDM_ALLOC(text, size, "option texts", err);
    if (s) return s;

    // parse the values; options that are not given have their defaults
    char *at = *text;
    for (uint32_t i = 0; i < shape->n_options && !s; i++) {
        const sdm_option *o = &shape->options[i];
        const char *value = given_find(given, n_given, o->name);
        const size_t room = option_text_size(o, value, base_dir);
        values[i] = (sdm_option_value){o->def, at};
        if (o->type == SDM_OPTION_CHOICE) {
            memcpy(at, o->choices, room);
            s = choice_parse(shape, o, value, at, &values[i], err);
        } else if (o->type == SDM_OPTION_FILE) {
            values[i].number = 0;
            const bool folder = path_needs_folder(o, value, base_dir);
            snprintf(at, room, "%s%s%s", folder ? base_dir : "", folder ? "/" : "",
                     value ? value : "");
        } else if (value) {
            s = number_parse(shape, o, value, &values[i], err);
        }
        at += room;
    }
    if (s) {
        sdm_free(*text);
        *text = NULL;
    }
    return s;
}

sdm_status sdm_shape_check_option(const sdm_shape *shape, const char *name, const char *value,
                                  sdm_error *err)
{
    sdm_option_value values[SHAPE_OPTIONS_MAX];
    char *text = NULL;
    const sdm_named_text given = {name, value};
    const sdm_status s = sdm_shape_parse_options(shape, &given, 1, NULL, values, &text, err);
    sdm_free(text);
    return s;
}
