/* Finds a mesh that depends on the options of the instance that was called before it. */
#include <string.h>

#include "sdm/memory.h"
#include "shape_internal.h"

/* Of a real number, as a share of its range: the size of a mesh hardly changes by it. */
static const double STEP = 1e-3;

/* Two instances of a shape that differ in an option, and the mesh of the last call. */
typedef struct both {
    const sdm_instance *here;
    sdm_instance *there;
    sdm_mesh mesh;
} both;

/* The word of the choices a|b|c behind number `index`, or the first one; *length: its length. */
static const char *next_choice(const char *choices, size_t index, size_t *length)
{
    const char *word = choices;
    for (size_t i = 0; i <= index && word; i++) {
        word = strchr(word, '|');
        if (word) word++;
    }
    if (!word) word = choices;
    *length = strcspn(word, "|");
    return word;
}

/* *value = another value of the option; *text: a new block with its text, NULL if it has none. A
 * file has no other value: *value stays. */
static sdm_status change(const sdm_option *o, sdm_option_value *value, char **text, sdm_error *err)
{
    size_t length;
    if (o->type == SDM_OPTION_INT) value->number += value->number + 1 <= o->max ? 1 : -1;
    if (o->type == SDM_OPTION_REAL) {
        const double step = STEP * (o->max - o->min);
        value->number += value->number + step <= o->max ? step : -step;
    }
    if (o->type != SDM_OPTION_CHOICE) return SDM_OK;
    const char *word = next_choice(o->choices, (size_t)value->number, &length);
    const sdm_status s = SDM_ALLOC(text, length + 1, "the value of an option", err);
    if (s) return s;
    memcpy(*text, word, length);
    value->number = word == o->choices ? 0 : value->number + 1;
    value->text = *text;
    return SDM_OK;
}

/* t->there = an instance with another value of option `index`; NULL: there is no other value, or
 * the shape refuses it. */
static sdm_status open_other(both *t, size_t index, sdm_error *err)
{
    const sdm_shape *shape = t->here->shape;
    const sdm_option *o = &shape->options[index];
    sdm_option_value *options = NULL;
    char *text = NULL;
    t->there = NULL;
    sdm_status s = SDM_ALLOC(&options, shape->n_options, "option values", err);
    if (s) return s;
    memcpy(options, t->here->options, shape->n_options * sizeof *options);
    s = change(o, &options[index], &text, err);
    const double now = options[index].number;
    if (s || now == t->here->options[index].number || (!text && now < o->min)) {
        sdm_free(options);
        sdm_free(text);
        return s;
    }
    s = sdm_instance_start(shape, options, text, &t->there, NULL);
    return s == SDM_E_NOMEM ? sdm_fail(err, s, "no memory for another option") : SDM_OK;
}

/* Checksum of the mesh at p, or at the defaults where the instance does not allow p; 0: it cannot
 * be made. */
static uint64_t make(both *t, const sdm_instance *s, const double *p)
{
    double own[SHAPE_PARAMS_MAX];
    for (size_t k = 0; k < s->n_params; k++) own[k] = s->params[k].def;
    const bool allowed = s->n_params == t->here->n_params && !sdm_instance_check(s, p, NULL);
    return sdm_instance_mesh(s, allowed ? p : own, &t->mesh, NULL) ? 0
                                                                   : sdm_mesh_checksum(&t->mesh);
}

sdm_status sdm_shape_repeat_options(const sdm_instance *s, const double *p, sdm_repeat *out,
                                    sdm_error *err)
{
    *out = (sdm_repeat){0};
    if (sdm_is_isolated(s)) return sdm_isolated_repeat(s, p, 2, 0, out, err);
    const double *other = p + s->n_params;
    both t = {.here = s};
    sdm_status status = SDM_OK;
    for (size_t i = 0; i < s->shape->n_options && !out->unlike; i++) {
        status = open_other(&t, i, err);
        if (status) break;
        if (!t.there) continue;
        // the other shapes in between: a cache of the last mesh does not keep this one
        (void)make(&t, s, other);
        const uint64_t first = make(&t, s, p);
        (void)make(&t, t.there, other);
        (void)make(&t, t.there, p);
        if (make(&t, s, p) != first)
            *out = (sdm_repeat){.unlike = 1, .cause = SDM_REPEAT_OPTION, .param = i};
        sdm_instance_free(t.there);
    }
    sdm_mesh_dispose(&t.mesh);
    return status;
}
