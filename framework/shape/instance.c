/* Instances: a shape with fixed option values. Checks arguments before and results after every
 * callback of the plug-in. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sdm/internal/distribution.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "shape_internal.h"

static sdm_status instance_call_create(sdm_instance *s, sdm_error *err)
{
    if (!s->shape->create) return SDM_OK;
    host_call call;
    sdm_host_call_begin(&call, NULL, true);
    call.shape = s->shape;
    sdm_callback_begin(s, "create", NULL);
    const int failed = s->shape->create(&call.host, s->options, &s->self);
    sdm_callback_end();
    sdm_status status = SDM_OK;
    if (failed) {
        s->self = NULL;
        sdm_host_call_failed(&call, "create", failed, SDM_E_PLUGIN, err);
        status = sdm_fail_in(err, call.err.status == SDM_E_NOMEM ? SDM_E_NOMEM : SDM_E_PLUGIN,
                             "shape '%s'", s->shape->name);
    }
    sdm_host_call_end(&call);
    return status;
}

static sdm_status instance_call_describe(sdm_instance *s, sdm_error *err)
{
    s->params = s->shape->params;
    s->n_params = s->shape->n_params;
    if (!s->shape->describe) return SDM_OK;
    const sdm_param *params = NULL;
    uint32_t n = 0;
    sdm_callback_begin(s, "describe", NULL);
    s->shape->describe(s->self, &params, &n);
    sdm_callback_end();
    char who[96];
    snprintf(who, sizeof who, "shape '%s', describe()", s->shape->name);
    const sdm_status status = n ? sdm_shape_check_params(who, params, n, err)
                                : sdm_fail(err, SDM_E_PLUGIN, "%s: no parameters", who);
    s->params = params;
    s->n_params = n;
    return status;
}

static sdm_status instance_call_distributions(sdm_instance *s, sdm_error *err)
{
    sdm_status status =
        SDM_ALLOC(&s->distributions, s->n_params, "distributions of the parameters", err);
    if (status || !s->shape->distributions) return status; // zero is uniform
    sdm_callback_begin(s, "distributions", NULL);
    s->shape->distributions(s->self, s->distributions);
    sdm_callback_end();
    for (size_t i = 0; i < s->n_params; i++) {
        const sdm_param *p = &s->params[i];
        if (sdm_distribution_check(&s->distributions[i], p->min, p->max, err))
            return sdm_fail_in(err, SDM_E_PLUGIN, "shape '%s', distributions(): parameter '%s'",
                               s->shape->name, p->name);
        if (s->distributions[i].kind == SDM_DISTRIBUTION_UNIFORM)
            s->distributions[i] = (sdm_distribution){SDM_DISTRIBUTION_UNIFORM, 0, 0};
    }
    return SDM_OK;
}

sdm_status sdm_instance_create(const sdm_shape *shape, const sdm_named_text *options,
                               size_t n_options, const char *base_dir, sdm_instance **out,
                               sdm_error *err)
{
    if (!out) return sdm_fail(err, SDM_E_ARG, "the address of the instance must not be NULL");
    *out = NULL;
    if (!shape)
        return sdm_fail(err, SDM_E_ARG,
                        "sdm_instance_create: the shape is NULL, as sdm_registry_find() gives it "
                        "for an unknown name; sdm_registry_at() lists the shapes there are");
    if (n_options && !options)
        return sdm_fail(err, SDM_E_ARG, "sdm_instance_create: the %zu options are NULL", n_options);
    sdm_option_value *values = NULL;
    char *text = NULL;
    sdm_status status = SDM_ALLOC(&values, shape->n_options, "option values", err);
    if (!status)
        status = sdm_shape_parse_options(shape, options, n_options, base_dir, values, &text, err);
    if (!status) return sdm_instance_start(shape, values, text, out, err);
    sdm_free(values);
    return status;
}

sdm_status sdm_instance_start(const sdm_shape *shape, sdm_option_value *options, char *text,
                              sdm_instance **out, sdm_error *err)
{
    sdm_instance *s = NULL;
    sdm_status status = SDM_ALLOC(&s, 1, "instance", err);
    if (status) {
        sdm_free(options);
        sdm_free(text);
        return status;
    }
    *s = (sdm_instance){.shape = shape, .options = options, .text = text};
    status = instance_call_create(s, err);
    if (!status) status = instance_call_describe(s, err);
    if (!status) status = instance_call_distributions(s, err);
    if (status)
        sdm_instance_free(s);
    else
        *out = s;
    return status;
}

void sdm_instance_free(sdm_instance *s)
{
    if (!s) return;
    if (s->self && s->shape->destroy) {
        sdm_callback_begin(s, "destroy", NULL);
        s->shape->destroy(s->self);
        sdm_callback_end();
    }
    sdm_free(s->distributions);
    sdm_free(s->text);
    sdm_free(s->options);
    sdm_free(s);
}

const sdm_shape *sdm_instance_shape(const sdm_instance *s) { return s->shape; }

const sdm_param *sdm_instance_params(const sdm_instance *s, size_t *n)
{
    if (n) *n = s->n_params;
    return s->params;
}

const sdm_distribution *sdm_instance_distributions(const sdm_instance *s)
{
    return s->distributions;
}

const sdm_option_value *sdm_instance_options(const sdm_instance *s) { return s->options; }

int sdm_instance_param_index(const sdm_instance *s, const char *name)
{
    for (size_t i = 0; name && i < s->n_params; i++)
        if (strcmp(s->params[i].name, name) == 0) return (int)i;
    return -1;
}

sdm_status sdm_instance_check(const sdm_instance *s, const double *p, sdm_error *err)
{
    if (!s || !p) return sdm_fail(err, SDM_E_ARG, "an instance and its parameters are needed");
    for (size_t i = 0; i < s->n_params; i++) {
        const sdm_param *q = &s->params[i];
        if (p[i] >= q->min && p[i] <= q->max) continue; // a comparison with NaN is false
        sdm_fail_range(q->name, p[i], q->min, q->max, q->unit, err);
        return sdm_fail_in(err, SDM_E_RANGE, "shape '%s'", s->shape->name);
    }
    return SDM_OK;
}

sdm_status sdm_instance_fail_at(const sdm_instance *s, const double *p, sdm_status status,
                                sdm_error *err)
{
    char where[480];
    size_t n = (size_t)snprintf(where, sizeof where, "shape '%s' at", s->shape->name);
    for (size_t i = 0; i < s->n_params; i++) {
        char value[32], word[112];
        const int length =
            snprintf(word, sizeof word, " %s=%s", s->params[i].name, sdm_format_real(p[i], value));
        if (n + (size_t)length + 5 > sizeof where) {
            memcpy(where + n, " ...", 5);
            break;
        }
        memcpy(where + n, word, (size_t)length + 1);
        n += (size_t)length;
    }
    return sdm_fail_in(err, status, "%s", where);
}

sdm_status sdm_mesh_out_check(const sdm_mesh_out *out, const sdm_mesh_out *given, sdm_error *err)
{
    return out->vert && out->vert == given->vert && out->tri == given->tri &&
                   out->n_vert == given->n_vert && out->n_tri == given->n_tri
               ? SDM_OK
               : sdm_fail(err, SDM_E_PLUGIN,
                          "mesh() must fill what reserve() gave, and leave sizes and pointers as "
                          "they are");
}

/* The plug-in must have filled the arrays of host->reserve(), and nothing behind them, with at
   least one triangle, valid indices and finite coordinates. */
static sdm_status mesh_check(const sdm_mesh *m, const sdm_mesh_out *out, sdm_error *err)
{
    const sdm_mesh_out given = {
        .vert = m->vert, .tri = m->tri, .n_vert = m->n_vert, .n_tri = m->n_tri};
    sdm_status s = sdm_mesh_out_check(out, &given, err);
    if (!s) s = sdm_host_check_behind(m, err);
    if (s) return s;
    if (m->n_tri == 0) return sdm_fail(err, SDM_E_PLUGIN, "the mesh has no triangle");
    for (size_t i = 0; i < 3 * m->n_tri; i++)
        if (m->tri[i] == UINT32_MAX) // host->reserve() fills the array with it
            return sdm_fail(err, SDM_E_PLUGIN,
                            "triangle %zu of %zu was reserved, but never written", i / 3, m->n_tri);
        else if (m->tri[i] >= m->n_vert)
            return sdm_fail(err, SDM_E_PLUGIN,
                            "triangle %zu has vertex %lu, but there are %zu vertices", i / 3,
                            (unsigned long)m->tri[i], m->n_vert);
    for (size_t i = 0; i < 3 * m->n_vert; i++)
        if (!isfinite(m->vert[i]))
            return sdm_fail(err, SDM_E_PLUGIN,
                            "vertex %zu has a coordinate that is not finite, or was never written",
                            i / 3);
    return SDM_OK;
}

sdm_status sdm_instance_mesh(const sdm_instance *s, const double *p, sdm_mesh *out, sdm_error *err)
{
    const sdm_status status = sdm_instance_check(s, p, err);
    if (status) return status;
    if (!out) return sdm_fail(err, SDM_E_ARG, "the address of the mesh must not be NULL");
    return sdm_instance_mesh_anywhere(s, p, out, err);
}

/* Calls mesh(); fill < 0: fills nothing but the arrays of reserve(). */
static sdm_status call_mesh(const sdm_instance *s, const double *p, int fill, sdm_mesh *out,
                            sdm_error *err)
{
    out->n_vert = out->n_tri = 0;
    sdm_mesh_out filled = {0};
    host_call call;
    sdm_host_call_begin(&call, out, false);
    if (fill >= 0) {
        call.fill = fill;
        call.fill_stack = true;
        sdm_fill_stack(fill);
    }
    sdm_callback_begin(s, "mesh", p);
    const int failed = s->shape->mesh(s->self, &call.host, s->options, p, &filled);
    sdm_callback_end();
    const sdm_status status = failed
                                  ? sdm_host_call_failed(&call, "mesh", failed, SDM_E_PLUGIN, err)
                                  : mesh_check(out, &filled, err);
    sdm_host_call_end(&call);
    if (status) out->n_vert = out->n_tri = 0;
    return status;
}

/* Index of the first value behind the parameters without which the mesh at p[n_params +
 * SHAPE_PARAMS_BEHIND] fails; n_params + SHAPE_PARAMS_BEHIND: it fails for another reason. */
static size_t find_read_behind(const sdm_instance *s, double *p)
{
    static const double tried[] = {0.5, 8}; // one of them may lie outside of the missing range
    const size_t end = s->n_params + SHAPE_PARAMS_BEHIND;
    sdm_mesh mesh = {0};
    size_t index = end;
    for (size_t i = 0; i < sizeof tried / sizeof *tried && index == end; i++) {
        for (size_t k = s->n_params; k < end; k++) p[k] = tried[i];
        if (call_mesh(s, p, -1, &mesh, NULL)) continue;
        for (index = s->n_params; index < end; index++) {
            p[index] = NAN;
            if (call_mesh(s, p, -1, &mesh, NULL)) break;
            p[index] = tried[i];
        }
    }
    sdm_mesh_dispose(&mesh);
    return index;
}

sdm_status sdm_instance_mesh_anywhere(const sdm_instance *s, const double *p, sdm_mesh *out,
                                      sdm_error *err)
{
    double room[SHAPE_PARAMS_MAX + SHAPE_PARAMS_BEHIND];
    const size_t n = s->n_params;
    memcpy(room, p, n * sizeof *room);
    for (size_t k = n; k < n + SHAPE_PARAMS_BEHIND; k++) room[k] = NAN;
    sdm_status status = call_mesh(s, room, -1, out, err);
    if (!status) return SDM_OK;
    // the process of an isolated shape has looked for the reason
    const size_t index = status == SDM_E_PLUGIN && !sdm_is_isolated(s) && n
                             ? find_read_behind(s, room)
                             : n + SHAPE_PARAMS_BEHIND;
    if (index < n + SHAPE_PARAMS_BEHIND)
        status = sdm_fail(err, SDM_E_PLUGIN,
                          "mesh() reads p[%zu], but the last parameter is p[%zu], '%s': its row is "
                          "missing in the table, or .n_params is too small",
                          index, n - 1, s->params[n - 1].name);
    return sdm_instance_fail_at(s, p, status, err);
}

sdm_status sdm_instance_mesh_filled(const sdm_instance *s, const double *p, int fill, sdm_mesh *out,
                                    sdm_error *err)
{
    const sdm_status status = call_mesh(s, p, fill, out, err);
    return status ? sdm_instance_fail_at(s, p, status, err) : SDM_OK;
}

sdm_status sdm_instance_distance(const sdm_instance *s, const double *p, const double x[3],
                                 double *distance, sdm_error *err)
{
    sdm_status status = sdm_instance_check(s, p, err);
    if (status) return status;
    if (!x || !distance)
        return sdm_fail(err, SDM_E_ARG,
                        "the addresses of the point and the distance must not be NULL");
    if (!s->shape->distance)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "shape '%s' has no closed-form distance",
                        s->shape->name);
    if (!isfinite(x[0]) || !isfinite(x[1]) || !isfinite(x[2]))
        return sdm_fail(err, SDM_E_ARG, "the point is not finite");
    host_call call;
    sdm_host_call_begin(&call, NULL, false);
    double d = NAN;
    sdm_callback_begin(s, "distance", p);
    const int failed = s->shape->distance(s->self, &call.host, s->options, p, x, &d);
    sdm_callback_end();
    // a shape may have a closed form only for some values of its options
    if (failed)
        status = sdm_host_call_failed(&call, "distance", failed, SDM_E_UNSUPPORTED, err);
    else if (!isfinite(d))
        status = sdm_fail(err, SDM_E_PLUGIN, "distance() gives a number that is not finite");
    sdm_host_call_end(&call);
    if (status) return sdm_instance_fail_at(s, p, status, err);
    *distance = d;
    return SDM_OK;
}
