/* A shape as binary glTF with a morph target for each of its parameters. */
#include "shape_targets.h"

#include <math.h>
#include <string.h>

#include "report/terminal.h"
#include "sdm/internal/glb.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/same_triangles.h"
#include "sdm/memory.h"

/* The largest difference from a linear function, as a fraction of the size of the mesh. */
#define LINEAR 1e-6

/* The mesh at the defaults and, for each parameter with a target, the displacement of its vertices
 * when the parameter goes from its default to at[]. */
typedef struct targets {
    const cli_shape *shape;
    const sdm_distribution *distribution; /* [n_params] */
    double *p, *at;                       /* [n_params] */
    size_t n;                             /* targets */
    sdm_mesh base, other;
    double *delta; /* [n][n_vert][3] */
    double size;   /* largest coordinate, mm */
} targets;

static void targets_dispose(targets *t)
{
    sdm_mesh_dispose(&t->base);
    sdm_mesh_dispose(&t->other);
    sdm_free(t->delta);
    sdm_free(t->p);
    sdm_free(t->at);
}

/* p[] = the values of the shape; parameters with a target have their defaults. */
static void set_defaults(targets *t)
{
    memcpy(t->p, t->shape->values, t->shape->n_params * sizeof *t->p);
    for (size_t i = 0; i < t->n; i++) t->p[i] = t->shape->params[i].def;
}

static void choose_at(targets *t)
{
    for (size_t i = 0; i < t->shape->n_params; i++) {
        const sdm_param *p = &t->shape->params[i];
        const double up = p->max - p->def, down = p->def - p->min;
        t->at[i] = up >= down ? p->max : p->min;
        if (t->distribution[i].kind == SDM_DISTRIBUTION_NORMAL && t->distribution[i].deviation < up)
            t->at[i] = p->def + t->distribution[i].deviation;
    }
}

static double weight_of(const targets *t, size_t i, double value)
{
    const double def = t->shape->params[i].def;
    return (value - def) / (t->at[i] - def);
}

/* *linear = the mesh at p[] has the triangles of t->base, and its vertices are at
 * base + sum of weight * delta. */
static sdm_status check_at(targets *t, bool *linear, sdm_error *err)
{
    const sdm_status s = sdm_instance_mesh(t->shape->instance, t->p, &t->other, err);
    const sdm_mesh *a = &t->base, *b = &t->other;
    if (s) return s;
    *linear = sdm_mesh_same_triangles(a, b);
    for (size_t j = 0; j < 3 * a->n_vert && *linear; j++) {
        double v = a->vert[j];
        for (size_t i = 0; i < t->n; i++)
            v += weight_of(t, i, t->p[i]) * t->delta[i * 3 * a->n_vert + j];
        *linear = fabs(v - b->vert[j]) <= LINEAR * t->size;
    }
    return SDM_OK;
}

/* Computes delta[]; *linear = false if the triangles change. */
static sdm_status measure(targets *t, bool *linear, sdm_error *err)
{
    const size_t n = 3 * t->base.n_vert;
    for (size_t i = 0; i < t->n; i++) {
        set_defaults(t);
        t->p[i] = t->at[i];
        const sdm_status s = sdm_instance_mesh(t->shape->instance, t->p, &t->other, err);
        if (s) return s;
        *linear = *linear && t->other.n_vert == t->base.n_vert;
        for (size_t j = 0; j < n && *linear; j++)
            t->delta[i * n + j] = t->other.vert[j] - t->base.vert[j];
    }
    return SDM_OK;
}

/* *linear = the vertices are linear functions of the parameters: compared at both ends of every
 * parameter and at eight random places. */
static sdm_status check_linear(targets *t, bool *linear, sdm_error *err)
{
    sdm_status s = measure(t, linear, err);
    for (size_t i = 0; i < 2 * t->n && !s && *linear; i++) {
        set_defaults(t);
        const sdm_param *q = &t->shape->params[i / 2];
        t->p[i / 2] = i % 2 ? q->max : q->min;
        s = check_at(t, linear, err);
    }
    for (size_t i = 0; i < 8 && !s && *linear; i++) {
        for (size_t k = 0; k < t->n; k++) {
            const sdm_param *q = &t->shape->params[k];
            t->p[k] = q->min + sdm_rng_uniform(1, 0, i * t->n + k) * (q->max - q->min);
        }
        s = check_at(t, linear, err);
    }
    return s;
}

static sdm_status prepare(targets *t, bool *linear, sdm_error *err)
{
    const cli_shape *shape = t->shape;
    sdm_status s = sdm_instance_check(shape->instance, shape->values, err);
    t->distribution = sdm_instance_distributions(shape->instance);
    t->n = shape->n_params < CLI_MAX_TARGETS ? shape->n_params : CLI_MAX_TARGETS;
    if (!s) s = SDM_ALLOC(&t->p, shape->n_params, "parameters", err);
    if (!s) s = SDM_ALLOC(&t->at, shape->n_params, "parameters", err);
    if (s) return s;
    choose_at(t);
    set_defaults(t);
    s = sdm_instance_mesh(shape->instance, t->p, &t->base, err);
    if (!s) s = SDM_ALLOC(&t->delta, t->n * 3 * t->base.n_vert, "morph targets", err);
    if (s) return s;
    for (size_t j = 0; j < 3 * t->base.n_vert; j++) t->size = fmax(t->size, fabs(t->base.vert[j]));
    return check_linear(t, linear, err);
}

/* What the file says about shape, units and parameters. */
static void describe(const void *user, sdm_json *j)
{
    const targets *t = user;
    const cli_shape *shape = t->shape;
    sdm_json_text(j, "shape", sdm_instance_shape(shape->instance)->name);
    sdm_json_text(j, "unit", "mm");
    sdm_json_text(j, "frame", "LPS");
    sdm_json_open(j, "parameters", '[');
    for (size_t i = 0; i < shape->n_params; i++) {
        const sdm_param *p = &shape->params[i];
        sdm_json_open(j, NULL, '{');
        sdm_json_text(j, "name", p->name);
        sdm_json_text(j, "unit", p->unit);
        sdm_json_real(j, "value", shape->values[i]);
        if (i < t->n) {
            sdm_json_real(j, "default", p->def);
            sdm_json_real(j, "at", t->at[i]);
            sdm_json_real(j, "weight_min", weight_of(t, i, p->min));
            sdm_json_real(j, "weight_max", weight_of(t, i, p->max));
        }
        sdm_json_close(j, '}');
    }
    sdm_json_close(j, ']');
}

static sdm_status write_file(const char *path, const targets *t, sdm_error *err)
{
    sdm_glb_target list[CLI_MAX_TARGETS];
    for (size_t i = 0; i < t->n; i++)
        list[i] = (sdm_glb_target){.name = t->shape->params[i].name,
                                   .delta = t->delta + i * 3 * t->base.n_vert,
                                   .weight = weight_of(t, i, t->shape->values[i])};
    return sdm_glb_write(path, &t->base, list, t->n, describe, t, err);
}

sdm_status cli_write_glb(const char *path, const cli_shape *shape, sdm_error *err)
{
    targets t = {.shape = shape};
    bool linear = true;
    sdm_status s = prepare(&t, &linear, err);
    if (!s && linear && t.n < shape->n_params)
        cli_notice("%s: morph targets for the first %zu of %zu parameters", path, t.n,
                   shape->n_params);
    if (!s && !linear) {
        cli_notice("%s: the vertices are no linear functions of the parameters: the mesh alone, "
                   "without morph targets",
                   path);
        t.n = 0;
        s = sdm_instance_mesh(shape->instance, shape->values, &t.base, err);
    }
    if (!s) s = write_file(path, &t, err);
    targets_dispose(&t);
    return s;
}
