/* Tests whether a shape keeps the contract of sdm/shape.h. */
#include "sdm/internal/conformance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "sdm/internal/shape_survey.h"
#include "sdm/internal/text.h"
#include "sdm/internal/units.h"
#include "sdm/memory.h"
#include "shape_internal.h"

enum { REPEATED = 8, AT_ONCE = 4 };

typedef struct tests {
    const sdm_instance *instance;
    const sdm_conformance_opts *opts;
    sdm_shape_survey found;
    sdm_conformance *out;
} tests;

/* ---- results ---- */

static sdm_test_result *result(tests *t, int test, sdm_test_outcome outcome, double figure,
                               const char *format, ...) SDM_PRINTF(5, 6);

static sdm_test_result *result(tests *t, int test, sdm_test_outcome outcome, double figure,
                               const char *format, ...)
{
    sdm_test_result *r = &t->out->test[test];
    va_list arguments;
    r->outcome = outcome;
    r->figure = figure;
    va_start(arguments, format);
    vsnprintf(r->text, sizeof r->text, format, arguments);
    va_end(arguments);
    return r;
}

static void at_params(sdm_test_result *r, const double *p, size_t n)
{
    memcpy(r->p, p, n * sizeof *p);
    r->has_params = true;
}

static void at_shape(tests *t, sdm_test_result *r, size_t shape)
{
    at_params(r, t->found.p + shape * t->found.n_params, t->found.n_params);
}

/* The message of the shape, without its name and parameters, which are in the result already. */
static const char *reason(const char *text)
{
    const char *end = strncmp(text, "shape '", 7) ? NULL : strstr(text, ": ");
    return end ? end + 2 : text;
}

/* ---- tests of the survey ---- */

static void tell_meshes(tests *t)
{
    const sdm_shape_survey *f = &t->found;
    if (!f->failed.shapes && f->unused.shapes) {
        at_shape(t,
                 result(t, SDM_TEST_MESHES, SDM_TEST_DOUBTFUL, f->unused.amount,
                        "vertices belong to no triangle in %zu of %zu shapes, up to %g: is an "
                        "offset of vertex indices wrong?",
                        f->unused.shapes, f->n, f->unused.amount),
                 f->unused.worst);
        return;
    }
    if (!f->failed.shapes) {
        result(t, SDM_TEST_MESHES, SDM_TEST_PASSED, (double)f->n,
               "%zu meshes, the first with %zu vertices and %zu triangles", f->n, f->n_vert,
               f->n_tri);
        return;
    }
    sdm_mesh mesh = {0};
    sdm_error err = {0};
    sdm_instance_mesh(t->instance, f->p + f->failed.worst * f->n_params, &mesh, &err);
    sdm_mesh_dispose(&mesh);
    at_shape(t,
             result(t, SDM_TEST_MESHES, SDM_TEST_FAILED, (double)f->failed.shapes,
                    "%zu of %zu meshes cannot be made: %s", f->failed.shapes, f->n,
                    err.text[0] ? reason(err.text) : "at the second call this one can"),
             f->failed.worst);
}

/* A test that counts shapes with a fault. */
static void tell_count(tests *t, int test, const sdm_survey_count *c, const char *fault,
                       const char *good)
{
    if (t->found.failed.shapes == t->found.n)
        result(t, test, SDM_TEST_SKIPPED, 0, "there is no mesh");
    else if (c->shapes)
        at_shape(t,
                 result(t, test, SDM_TEST_FAILED, c->amount, "%s in %zu of %zu shapes, up to %g",
                        fault, c->shapes, t->found.n, c->amount),
                 c->worst);
    else
        result(t, test, SDM_TEST_PASSED, 0, "%s", good);
}

static void tell_triangles(tests *t)
{
    const sdm_shape_survey *f = &t->found;
    if (f->failed.shapes == f->n)
        result(t, SDM_TEST_TRIANGLES, SDM_TEST_SKIPPED, 0, "there is no mesh");
    else if (f->resized.shapes)
        at_shape(t,
                 result(t, SDM_TEST_TRIANGLES, SDM_TEST_FAILED, f->resized.amount,
                        "other numbers of vertices or triangles in %zu of %zu shapes: %g vertices",
                        f->resized.shapes, f->n, f->resized.amount),
                 f->resized.worst);
    else if (f->rewired.shapes)
        at_shape(t,
                 result(t, SDM_TEST_TRIANGLES, SDM_TEST_FAILED, (double)f->rewired.shapes,
                        "the triangles have other vertices in %zu of %zu shapes", f->rewired.shapes,
                        f->n),
                 f->rewired.worst);
    else
        result(t, SDM_TEST_TRIANGLES, SDM_TEST_PASSED, 0, "the same in all shapes");
}

/* The first parameter with a value beside which the mesh depends on the calls before; n_params:
 * there is none. */
static size_t find_state(const sdm_shape_survey *f)
{
    size_t k = 0;
    while (k < f->n_params && !(f->jump && f->jump[k].kind == SDM_BREAK_STATE)) k++;
    return k;
}

static void tell_continuous(tests *t)
{
    const sdm_shape_survey *f = &t->found;
    const sdm_survey_jump *worst = NULL;
    size_t param = 0;
    for (size_t k = 0; k < f->n_params && f->jump; k++)
        if (f->jump[k].kind == SDM_BREAK_JUMP && (!worst || f->jump[k].mm > worst->mm)) {
            worst = &f->jump[k];
            param = k;
        }
    if (!f->jump) {
        result(t, SDM_TEST_CONTINUOUS, SDM_TEST_SKIPPED, 0, "there is no mesh");
    } else if (find_state(f) < f->n_params || (worst && f->repeat.unlike)) {
        result(t, SDM_TEST_CONTINUOUS, SDM_TEST_SKIPPED, 0, "meshes depend on the calls before");
    } else if (f->resized.shapes && !worst) {
        result(t, SDM_TEST_CONTINUOUS, SDM_TEST_SKIPPED, 0,
               "meshes with other numbers of vertices cannot be compared");
    } else if (worst) {
        sdm_test_result *r = result(t, SDM_TEST_CONTINUOUS, SDM_TEST_FAILED, worst->mm,
                                    "vertex %zu jumps by %.3g mm along %s", worst->vertex,
                                    worst->mm, t->instance->params[param].name);
        at_shape(t, r, worst->shape);
        r->p[param] = worst->value;
    } else {
        result(t, SDM_TEST_CONTINUOUS, SDM_TEST_PASSED, 0, "no jump along any parameter");
    }
}

static bool jumps_along(const sdm_shape_survey *f, size_t k)
{
    return f->jump && f->jump[k].kind != SDM_BREAK_NONE;
}

/* The size and the motion by the parameters. */
static void tell_units(tests *t)
{
    const sdm_shape_survey *f = &t->found;
    const sdm_survey_scale *c = &f->scale;
    const sdm_param *params = t->instance->params;
    if (f->failed.shapes == f->n) {
        result(t, SDM_TEST_UNITS, SDM_TEST_SKIPPED, 0, "there is no mesh");
        return;
    }
    sdm_text text = {0};
    if (c->odd_size || c->odd_speed) {
        sdm_text_add(&text, "the shape is %.3g mm in size", c->size);
        if (c->odd_speed)
            sdm_text_add(&text, ", 1 mm of the parameter '%s' moves its vertices by %.2g mm",
                         params[c->param].name, c->speed);
        if (c->odd_speed)
            sdm_survey_ask_unit(f, t->instance, c->param, &text);
        else if (c->unit)
            sdm_text_add(&text, ": are the vertices in %s? Multiply them by %g", c->unit,
                         c->unit_mm);
    }
    for (size_t k = 0; k < f->n_params; k++)
        if (sdm_survey_is_other_length(&params[k]))
            sdm_text_add(&text, "%sthe parameter '%s' has the unit %s: sdmgen counts in mm",
                         text.data ? "; " : "", params[k].name, params[k].unit);
        else if (f->speed[k] == 0)
            sdm_text_add(&text, "%sthe parameter '%s' moves no vertex: does mesh() use it?",
                         text.data ? "; " : "", params[k].name);
        else if (sdm_survey_is_faint(f, t->instance, k))
            sdm_text_add(&text,
                         "%s'%s' moves a shape of %.3g mm by %.2g mm per rad: does mesh() convert "
                         "it from degrees?",
                         text.data ? "; " : "", params[k].name, c->size, f->speed[k]);
        else if (sdm_survey_is_narrow(f, t->instance, k) && !sdm_survey_stretches(f))
            sdm_text_add(
                &text, "%s'%s' ranges from %g to %g mm in a shape of %.3g mm: are these m?",
                text.data ? "; " : "", params[k].name, params[k].min, params[k].max, c->size);
        else if (sdm_survey_is_slow(f, t->instance, k) && !c->odd_speed && !jumps_along(f, k)) {
            if (text.data) sdm_text_add(&text, "; ");
            sdm_survey_add_slow(f, t->instance, k, &text);
        }
    const bool tiny = f->tiny.shapes && !sdm_survey_stretches(f);
    if (tiny)
        sdm_text_add(&text,
                     "%sa part is %.0f times smaller than another one in %zu of %zu shapes: are "
                     "the vertices of one of them in another unit than mm, or is it a leftover "
                     "speck?",
                     text.data ? "; " : "", f->tiny.amount, f->tiny.shapes, f->n);
    sdm_test_result *r =
        result(t, SDM_TEST_UNITS, text.data ? SDM_TEST_DOUBTFUL : SDM_TEST_PASSED, c->size, "%s",
               text.data ? text.data : "the size fits to mm, every parameter moves vertices");
    if (tiny) at_shape(t, r, f->tiny.worst);
    sdm_text_dispose(&text);
}

static void tell_velocity(tests *t)
{
    const sdm_shape_survey *f = &t->found;
    if (!f->has_velocity)
        result(t, SDM_TEST_VELOCITY, SDM_TEST_SKIPPED, 0,
               t->instance->shape->velocity ? "there is no mesh" : "there is no callback");
    else if (f->velocity_error > SDM_SURVEY_VELOCITY_LIMIT)
        at_shape(
            t,
            result(t, SDM_TEST_VELOCITY, SDM_TEST_FAILED, f->velocity_error,
                   isfinite(f->velocity_error)
                       ? "off by %.2g of the largest velocity by %s, at vertex %zu"
                       : "fails (%g), or the number of vertices changes nearby; %s, vertex %zu",
                   f->velocity_error, t->instance->params[f->velocity_param].name,
                   f->velocity_vertex),
            f->velocity_shape);
    else
        result(t, SDM_TEST_VELOCITY, SDM_TEST_PASSED, f->velocity_error,
               "differs from differences of meshes by %.2g at most (relative)", f->velocity_error);
}

static sdm_status test_meshes(tests *t, sdm_error *err)
{
    const sdm_survey_opts opts = {.samples = t->opts->samples,
                                  .seed = t->opts->seed,
                                  .n_threads = t->opts->n_threads,
                                  .cancelled = t->opts->cancelled,
                                  .user = t->opts->user,
                                  .process = t->opts->process};
    sdm_shape_survey *f = &t->found;
    const sdm_status s = sdm_shape_survey_make(t->instance, &opts, f, err);
    if (s) return s;
    if (f->cancelled) return sdm_fail(err, SDM_E_CANCELLED, "the tests were cancelled");
    t->out->n_corners = f->n_corners;
    t->out->n_samples = f->n_samples;
    tell_meshes(t);
    tell_count(t, SDM_TEST_CLOSED, &f->open, "open or badly oriented edges",
               "every edge has as many triangles one way as the other");
    // the engine turns parts that meet no others: maps are right, but the contract is broken
    const bool turned = f->turned.shapes > 0;
    tell_count(t, SDM_TEST_ORIENTED, turned && !f->inside_out.shapes ? &f->turned : &f->inside_out,
               "parts are inside out", "no part is inside out");
    tell_triangles(t);
    tell_units(t);
    tell_continuous(t);
    tell_velocity(t);
    return SDM_OK;
}

/* ---- repeated calls ---- */

/* What the survey has found: a parameter after whose change the mesh is another one. */
static void tell_beside(tests *t)
{
    const sdm_repeat *r = &t->found.repeat;
    at_shape(t,
             result(t, SDM_TEST_REPEATS, SDM_TEST_FAILED, (double)r->unlike,
                    SDM_REPEAT_BESIDE_TEXT "; %s", t->instance->params[r->param].name,
                    sdm_repeat_advice(r->cause)),
             r->first);
}

/* What the survey has found on lines through the ranges. false: nothing. */
static bool tell_state(tests *t)
{
    const sdm_shape_survey *f = &t->found;
    const size_t k = find_state(f);
    if (k == f->n_params) return false;
    sdm_test_result *r = result(t, SDM_TEST_REPEATS, SDM_TEST_FAILED, 1,
                                "meshes beside this value of %s have other bits when they are made "
                                "again in another order: %s",
                                t->instance->params[k].name, sdm_repeat_advice(SDM_REPEAT_BESIDE));
    at_shape(t, r, f->jump[k].shape);
    r->p[k] = f->jump[k].value;
    return true;
}

/* The mesh of the first shape after that of another instance. A call that ends the worker is told
 * by test_options(). */
static sdm_status test_other_option(tests *t, sdm_error *err)
{
    const sdm_shape_survey *f = &t->found;
    const size_t size = f->n_params * sizeof *f->p;
    double p[2 * SHAPE_PARAMS_MAX];
    sdm_repeat r;
    if (t->out->test[SDM_TEST_REPEATS].outcome != SDM_TEST_PASSED || f->n < 2) return SDM_OK;
    memcpy(p, f->p, size);
    memcpy(p + f->n_params, f->p + (f->n - 1) * f->n_params, size);
    const sdm_status s = sdm_shape_repeat_options(t->instance, p, &r, err);
    if (s) return s == SDM_E_PLUGIN ? SDM_OK : s;
    if (r.unlike)
        at_shape(t,
                 result(t, SDM_TEST_REPEATS, SDM_TEST_FAILED, (double)r.unlike,
                        "mesh() depends on an earlier call: after a call with another value of the "
                        "option '%s' it gives another mesh; %s",
                        t->instance->shape->options[r.param].name, sdm_repeat_advice(r.cause)),
                 r.first);
    return SDM_OK;
}

/* Repeats the meshes of the survey; too few can be made: the test is skipped. */
static sdm_status test_repeated(tests *t, int test, int n_threads, sdm_error *err)
{
    const sdm_shape_survey *f = &t->found;
    const size_t most = f->ms_mesh > 60 ? 1 : REPEATED, n = f->n < most ? f->n : most;
    if (f->failed.shapes) {
        result(t, test, SDM_TEST_SKIPPED, 0, "meshes cannot be made");
        return SDM_OK;
    }
    if (n_threads == 1 && f->repeat.cause == SDM_REPEAT_BESIDE) {
        tell_beside(t);
        return SDM_OK;
    }
    sdm_repeat r;
    const sdm_status s = n_threads > 1 ? sdm_shape_repeat_at_once(t->instance, f->p, n, n_threads,
                                                                  SHAPE_REPEAT_SECONDS, &r, err)
                                       : sdm_shape_repeat(t->instance, f->p, n, &r, err);
    if (s && s != SDM_E_PLUGIN) return s;
    const char *how = n_threads > 1 ? "made by several threads at once" : "made again";
    if (s)
        result(t, test, SDM_TEST_FAILED, NAN, "%s", err ? reason(err->text) : "a call fails");
    else if (r.unlike)
        at_shape(t,
                 result(t, test, SDM_TEST_FAILED, (double)r.unlike,
                        "%zu of %zu meshes have other bits when they are %s: %s", r.unlike, n, how,
                        sdm_repeat_advice(r.cause)),
                 r.first);
    else if (n_threads == 1 && f->repeat.unlike)
        result(t, test, SDM_TEST_FAILED, (double)f->repeat.unlike,
               "%zu meshes have other bits in another process: %s", f->repeat.unlike,
               sdm_repeat_advice(SDM_REPEAT_PROCESS));
    else if (n_threads > 1 || !tell_state(t))
        result(t, test, SDM_TEST_PASSED, 0, "the same bits, %s", how);
    return SDM_OK;
}

/* ---- parameters outside the ranges ---- */

/* Number `k` of the parameter vectors outside: every parameter NaN, infinite, and far beyond either
 * end of its range. false: there are no more. */
static bool outside_params(const sdm_instance *s, size_t k, double *p)
{
    enum { WAYS = 4 };
    const size_t i = k / WAYS;
    if (i >= s->n_params) return false;
    for (size_t j = 0; j < s->n_params; j++) p[j] = s->params[j].def;
    const double min = s->params[i].min, max = s->params[i].max, width = max - min;
    const double values[WAYS] = {NAN, INFINITY, min - 2 * width, max + 2 * width};
    p[i] = values[k % WAYS];
    return true;
}

/* The program refuses such parameters before it calls, but other programs may not: a callback may
 * fail or make any mesh, but neither crash nor hang. */
static void test_outside(tests *t)
{
    const sdm_instance *s = t->instance;
    if (!sdm_is_isolated(s)) {
        result(t, SDM_TEST_OUTSIDE, SDM_TEST_SKIPPED, 0,
               "no plug-in: such calls could end the program");
        return;
    }
    double p[SHAPE_PARAMS_MAX];
    sdm_mesh mesh = {0};
    size_t calls = 0, refused = 0;
    for (; outside_params(s, calls, p); calls++) {
        sdm_error err = {0};
        const size_t ends = sdm_isolated_ends(s);
        refused += sdm_instance_mesh_anywhere(s, p, &mesh, &err) != SDM_OK;
        if (sdm_isolated_ends(s) == ends) continue;
        at_params(
            result(t, SDM_TEST_OUTSIDE, SDM_TEST_DOUBTFUL, (double)calls, "%s", reason(err.text)),
            p, s->n_params);
        break;
    }
    sdm_mesh_dispose(&mesh);
    if (!t->out->test[SDM_TEST_OUTSIDE].has_params)
        result(t, SDM_TEST_OUTSIDE, SDM_TEST_PASSED, (double)refused,
               "NaN, infinite and far values: %zu calls returned, %zu of them with an error", calls,
               refused);
}

/* ---- options ---- */

/* Sets value[100] = number `k` of the values of option o that are tried; false: there are no
 * more. */
static bool option_try(const sdm_option *o, size_t k, char value[100])
{
    if (o->type == SDM_OPTION_FILE) return false;
    if (o->type != SDM_OPTION_CHOICE) {
        char number[32];
        snprintf(value, 100, "%s", sdm_format_real(k ? o->max : o->min, number));
        return k < 2;
    }
    const char *word = o->choices;
    for (; word && k > 0; k--) {
        word = strchr(word, '|');
        if (word) word++;
    }
    if (word) snprintf(value, 100, "%.*s", (int)strcspn(word, "|"), word);
    return word;
}

/* Makes the default mesh with option `index` = value and the other options as they are. */
static sdm_status try_option(const tests *t, size_t index, const char *value, size_t *ends,
                             sdm_error *err)
{
    const sdm_shape *shape = t->instance->shape;
    const sdm_option_value *now = t->instance->options;
    sdm_named_text options[SHAPE_OPTIONS_MAX];
    char number[SHAPE_OPTIONS_MAX][32];
    size_t n = 0;
    for (size_t i = 0; i < shape->n_options; i++) {
        const bool is_text = shape->options[i].type == SDM_OPTION_FILE ||
                             shape->options[i].type == SDM_OPTION_CHOICE;
        const char *text = i == index ? value
                           : is_text  ? now[i].text
                                      : sdm_format_real(now[i].number, number[i]);
        if (text[0]) options[n++] = (sdm_named_text){shape->options[i].name, text};
    }
    sdm_instance *s = NULL;
    sdm_mesh mesh = {0};
    double p[SHAPE_PARAMS_MAX];
    sdm_status status = sdm_instance_create(shape, options, n, NULL, &s, err);
    if (status) return status;
    for (size_t i = 0; i < s->n_params; i++) p[i] = s->params[i].def;
    status = sdm_instance_mesh(s, p, &mesh, err);
    *ends += sdm_is_isolated(s) ? sdm_isolated_ends(s) : 0;
    sdm_mesh_dispose(&mesh);
    sdm_instance_free(s);
    return status;
}

/* An error with a reason is doubtful, because options may exclude each other. */
static void test_options(tests *t)
{
    size_t tried = 0, failed = 0;
    for (size_t i = 0; i < t->instance->shape->n_options; i++) {
        const sdm_option *o = &t->instance->shape->options[i];
        char value[100];
        for (size_t k = 0; option_try(o, k, value); k++) {
            sdm_error err = {0};
            size_t ends = 0;
            tried++;
            if (!try_option(t, i, value, &ends, &err)) continue;
            const sdm_test_outcome outcome = ends ? SDM_TEST_FAILED : SDM_TEST_DOUBTFUL;
            if (t->out->test[SDM_TEST_OPTIONS].outcome < outcome || !failed)
                result(t, SDM_TEST_OPTIONS, outcome, (double)failed, "with %s=%s: %s", o->name,
                       value, reason(err.text));
            failed++;
        }
    }
    if (!tried)
        result(t, SDM_TEST_OPTIONS, SDM_TEST_SKIPPED, 0, "there are none with a range or choices");
    else if (!failed)
        result(t, SDM_TEST_OPTIONS, SDM_TEST_PASSED, 0,
               "a mesh at the ends of every range and with every choice, %zu in all", tried);
    t->out->test[SDM_TEST_OPTIONS].figure = (double)failed;
}

/* ---- all ---- */

sdm_status sdm_conformance_make(const sdm_instance *shape, const sdm_conformance_opts *opts,
                                sdm_conformance *out, sdm_error *err)
{
    static const char *const names[SDM_N_TESTS] = {
        [SDM_TEST_MESHES] = "meshes",     [SDM_TEST_CLOSED] = "closed",
        [SDM_TEST_ORIENTED] = "oriented", [SDM_TEST_TRIANGLES] = "triangles",
        [SDM_TEST_UNITS] = "units",       [SDM_TEST_CONTINUOUS] = "continuous",
        [SDM_TEST_VELOCITY] = "velocity", [SDM_TEST_REPEATS] = "repeats",
        [SDM_TEST_THREADS] = "threads",   [SDM_TEST_OUTSIDE] = "outside",
        [SDM_TEST_OPTIONS] = "options"};
    memset(out, 0, sizeof *out);
    for (int i = 0; i < SDM_N_TESTS; i++) out->test[i].name = names[i];
    tests t = {.instance = shape, .opts = opts, .out = out};
    sdm_status s = test_meshes(&t, err);
    if (!s) s = test_repeated(&t, SDM_TEST_REPEATS, 1, err);
    if (!s) s = test_repeated(&t, SDM_TEST_THREADS, AT_ONCE, err);
    // the last one: what it leaves in a cache is no fault of threads
    if (!s) s = test_other_option(&t, err);
    if (!s) test_outside(&t);
    if (!s) test_options(&t);
    sdm_shape_survey_dispose(&t.found);
    return s;
}

sdm_status sdm_conformance_verdict(const sdm_conformance *c)
{
    sdm_status worst = SDM_OK;
    for (int i = 0; i < SDM_N_TESTS; i++) {
        if (c->test[i].outcome != SDM_TEST_FAILED) continue;
        if (i == SDM_TEST_MESHES || i == SDM_TEST_CLOSED) return SDM_E_MESH;
        worst = SDM_E_QUALITY;
    }
    return worst;
}
