/* Tables, parameters and options as bytes, for the way between the program and a worker. */
#include <string.h>

#include "isolated_protocol.h"
#include "sdm/internal/heap.h"

/* ---- writing ---- */

static void put(isolated_bytes *b, const void *data, size_t size)
{
    if (b->failed || !size) return;
    if (b->size + size > b->capacity) {
        const size_t capacity = 2 * b->capacity + size;
        b->failed = sdm_grow((void **)&b->data, b->capacity, capacity, 1, "bytes", NULL);
        if (b->failed) return;
        b->capacity = capacity;
    }
    memcpy(b->data + b->size, data, size);
    b->size += size;
}

void sdm_bytes_put_count(isolated_bytes *b, size_t n)
{
    const uint32_t count = (uint32_t)n;
    put(b, &count, sizeof count);
}

void sdm_bytes_put_reals(isolated_bytes *b, const double *x, size_t n) { put(b, x, n * sizeof *x); }

static void put_real(isolated_bytes *b, double x) { put(b, &x, sizeof x); }

/* A NULL is told from an empty text. */
static void put_text(isolated_bytes *b, const char *text)
{
    sdm_bytes_put_count(b, text != NULL);
    if (text) put(b, text, strlen(text) + 1);
}

void sdm_bytes_put_params(isolated_bytes *b, const sdm_param *params, size_t n)
{
    sdm_bytes_put_count(b, n);
    for (size_t i = 0; i < n; i++) {
        const sdm_param *p = &params[i];
        put_text(b, p->name);
        put_text(b, p->unit);
        put_text(b, p->help);
        put_real(b, p->min);
        put_real(b, p->max);
        put_real(b, p->def);
    }
}

void sdm_bytes_put_distributions(isolated_bytes *b, const sdm_distribution *d, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        sdm_bytes_put_count(b, (size_t)d[i].kind);
        put_real(b, d[i].mean);
        put_real(b, d[i].deviation);
    }
}

void sdm_bytes_put_options(isolated_bytes *b, const sdm_option_value *options, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        put_real(b, options[i].number);
        put_text(b, options[i].text);
    }
}

void sdm_bytes_put_shape(isolated_bytes *b, const sdm_shape *s)
{
    put_text(b, s->name);
    put_text(b, s->summary);
    put_text(b, s->mirror);
    sdm_bytes_put_count(b, s->describe != NULL);
    sdm_bytes_put_count(b, s->velocity != NULL);
    sdm_bytes_put_count(b, s->distance != NULL);
    sdm_bytes_put_count(b, s->distributions != NULL);
    sdm_bytes_put_count(b, s->open_end != NULL);
    sdm_bytes_put_params(b, s->params, s->n_params);
    sdm_bytes_put_count(b, s->n_options);
    for (size_t i = 0; i < s->n_options; i++) {
        const sdm_option *o = &s->options[i];
        put_text(b, o->name);
        sdm_bytes_put_count(b, (size_t)o->type);
        put_text(b, o->unit);
        put_text(b, o->choices);
        put_text(b, o->help);
        put_real(b, o->min);
        put_real(b, o->max);
        put_real(b, o->def);
    }
    sdm_bytes_put_count(b, s->n_measures);
    for (size_t i = 0; i < s->n_measures; i++) {
        put_text(b, s->measures[i].name);
        put_text(b, s->measures[i].unit);
        put_text(b, s->measures[i].help);
        sdm_bytes_put_count(b, s->measures[i].of_depth != 0);
    }
}

/* ---- reading ---- */

static void get(isolated_bytes *b, void *data, size_t size)
{
    b->failed = b->failed || size > b->size - b->at;
    if (b->failed) {
        memset(data, 0, size);
        return;
    }
    memcpy(data, b->data + b->at, size);
    b->at += size;
}

size_t sdm_bytes_get_count(isolated_bytes *b, size_t most)
{
    uint32_t count;
    get(b, &count, sizeof count);
    b->failed = b->failed || count > most;
    return b->failed ? 0 : count;
}

static double get_real(isolated_bytes *b)
{
    double x;
    get(b, &x, sizeof x);
    return x;
}

double *sdm_bytes_get_reals(isolated_bytes *b, size_t *n)
{
    double *x = NULL;
    *n = (b->size - b->at) / sizeof *x;
    b->failed = b->failed || SDM_ALLOC(&x, *n, "numbers", NULL);
    if (!b->failed) get(b, x, *n * sizeof *x);
    return x;
}

static const char *get_text(isolated_bytes *b)
{
    if (!sdm_bytes_get_count(b, 1)) return NULL;
    const char *text = (const char *)b->data + b->at;
    const char *end = memchr(text, '\0', b->size - b->at);
    b->failed = !end;
    if (b->failed) return NULL;
    b->at += (size_t)(end - text) + 1;
    return text;
}

sdm_param *sdm_bytes_get_params(isolated_bytes *b, uint32_t *n)
{
    sdm_param *params = NULL;
    *n = (uint32_t)sdm_bytes_get_count(b, SHAPE_PARAMS_MAX);
    b->failed = b->failed || SDM_ALLOC(&params, *n, "parameters", NULL);
    for (size_t i = 0; !b->failed && i < *n; i++) {
        sdm_param *p = &params[i];
        p->name = get_text(b);
        p->unit = get_text(b);
        p->help = get_text(b);
        p->min = get_real(b);
        p->max = get_real(b);
        p->def = get_real(b);
    }
    return params;
}

sdm_distribution *sdm_bytes_get_distributions(isolated_bytes *b, size_t n)
{
    sdm_distribution *d = NULL;
    b->failed = b->failed || SDM_ALLOC(&d, n, "distributions", NULL);
    for (size_t i = 0; !b->failed && i < n; i++) {
        d[i].kind = (sdm_distribution_kind)sdm_bytes_get_count(b, SDM_DISTRIBUTION_NORMAL);
        d[i].mean = get_real(b);
        d[i].deviation = get_real(b);
    }
    return d;
}

sdm_option_value *sdm_bytes_get_options(isolated_bytes *b, size_t n)
{
    sdm_option_value *options = NULL;
    b->failed = b->failed || SDM_ALLOC(&options, n, "option values", NULL);
    for (size_t i = 0; !b->failed && i < n; i++) {
        options[i].number = get_real(b);
        options[i].text = get_text(b);
    }
    return options;
}

static sdm_option *get_options(isolated_bytes *b, uint32_t *n)
{
    sdm_option *options = NULL;
    *n = (uint32_t)sdm_bytes_get_count(b, SHAPE_OPTIONS_MAX);
    b->failed = b->failed || SDM_ALLOC(&options, *n, "options", NULL);
    for (size_t i = 0; !b->failed && i < *n; i++) {
        sdm_option *o = &options[i];
        o->name = get_text(b);
        o->type = (sdm_option_type)sdm_bytes_get_count(b, SDM_OPTION_FILE);
        o->unit = get_text(b);
        o->choices = get_text(b);
        o->help = get_text(b);
        o->min = get_real(b);
        o->max = get_real(b);
        o->def = get_real(b);
    }
    return options;
}

static sdm_measure *get_measures(isolated_bytes *b, uint32_t *n)
{
    sdm_measure *measures = NULL;
    *n = (uint32_t)sdm_bytes_get_count(b, SHAPE_MEASURES_MAX);
    b->failed = b->failed || SDM_ALLOC(&measures, *n, "measures", NULL);
    for (size_t i = 0; !b->failed && i < *n; i++) {
        measures[i].name = get_text(b);
        measures[i].unit = get_text(b);
        measures[i].help = get_text(b);
        measures[i].of_depth = (int)sdm_bytes_get_count(b, 1);
    }
    return measures;
}

sdm_shape sdm_bytes_get_shape(isolated_bytes *b, const sdm_shape *callbacks)
{
    sdm_shape s = *callbacks;
    s.name = get_text(b);
    s.summary = get_text(b);
    s.mirror = get_text(b);
    if (!sdm_bytes_get_count(b, 1)) s.describe = NULL;
    if (!sdm_bytes_get_count(b, 1)) s.velocity = NULL;
    if (!sdm_bytes_get_count(b, 1)) s.distance = NULL;
    if (!sdm_bytes_get_count(b, 1)) s.distributions = NULL;
    if (!sdm_bytes_get_count(b, 1)) s.open_end = NULL;
    s.params = sdm_bytes_get_params(b, &s.n_params);
    s.options = get_options(b, &s.n_options);
    s.measures = get_measures(b, &s.n_measures);
    if (!s.n_measures) s.measure = NULL;
    return s;
}
