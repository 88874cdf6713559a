/* Common parts of the tests of fits: a small ellipsoid, phantom images of it, options. Include
 * after cmocka.h. */
#ifndef SDM_TEST_FIT_TOOLS_H
#define SDM_TEST_FIT_TOOLS_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/builtin_shapes.h"
#include "sdm/fit.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/rotation.h"
#include "sdm/phantom.h"

static sdm_registry *registry;
static sdm_instance *ellipsoid;

static const double TRUTH[3] = {2.5, 1.8, 1.3};
static const sdm_pose POSE = {{0.3, -0.2, 0.4}, {0.4, -0.3, 0.2}};

static int set_up(void **state)
{
    (void)state;
    return sdm_registry_create(&registry, NULL) || sdm_builtin_shapes_add(registry, NULL) ||
           sdm_instance_create(sdm_registry_find(registry, "ellipsoid", NULL),
                               &(sdm_named_text){"edge", "0.2"}, 1, NULL, &ellipsoid, NULL);
}

static int tear_down(void **state)
{
    (void)state;
    sdm_instance_free(ellipsoid);
    sdm_registry_free(registry);
    return 0;
}

static inline sdm_fit_source exact_source(void)
{
    return (sdm_fit_source){
        .shape = ellipsoid,
        .grid = sdm_grid_centred((int64_t[3]){30, 28, 26}, 0.25, (double[3]){0, 0, 0})};
}

/* An image grid with rotated axes and a different spacing along each axis. */
static inline sdm_grid image_grid(void)
{
    sdm_grid g = sdm_grid_centred((int64_t[3]){36, 30, 26}, 0.25, (double[3]){0, 0, 0});
    const double h[3] = {0.22, 0.25, 0.28}, middle[3] = {17.5, 14.5, 12.5},
                 centre[3] = {0.3, -0.2, 0.1};
    double at[3];
    memcpy(g.spacing, h, sizeof h);
    sdm_pose_matrix(&(sdm_pose){{0.2, 0.1, -0.3}, {0, 0, 0}}, g.dir);
    sdm_grid_world(&g, middle, at);
    for (int k = 0; k < 3; k++) g.origin[k] += centre[k] - at[k];
    return g;
}

/* Phantom image of the ellipsoid (caller frees). noise: factor on the default standard deviations
 * of texture and noise. */
static inline float *phantom(const double *p, const sdm_pose *pose, double noise, uint64_t seed)
{
    sdm_error err = {0};
    const sdm_grid g = image_grid();
    sdm_phantom_opts o = sdm_phantom_defaults();
    for (int k = 0; k < 3; k++) o.blur[k] = 0.2;
    o.inside.sd *= noise, o.outside.sd *= noise, o.noise *= noise;
    o.texture_mm = 0.2;
    o.seed = seed;
    o.supersampling = 6;
    float *values = calloc(sdm_grid_count(&g), sizeof *values);
    if (!values) abort();
    if (sdm_phantom_make(ellipsoid, p, pose, &o, &g, values, NULL, &err)) fail_msg("%s", err.text);
    return values;
}

static inline sdm_fit_target image_of(const float *values)
{
    return (sdm_fit_target){.kind = SDM_FIT_IMAGE, .grid = image_grid(), .values = values};
}

static const double START[3] = {2.2, 2.0, 1.5};

/* Options with start values near the truth. */
static inline sdm_fit_opts near_start(void)
{
    sdm_fit_opts o = sdm_fit_defaults();
    const sdm_pose off = {{0.1, 0.08, -0.1}, {0.2, 0.2, -0.2}};
    o.start_params = START;
    o.start_pose = sdm_pose_compose(&off, &POSE);
    o.appearance.n_outside = 1;
    return o;
}

static inline sdm_fit_result fit(const sdm_fit_target *t, const sdm_fit_opts *o)
{
    const sdm_fit_source source = exact_source();
    sdm_fit_result r;
    sdm_error err = {0};
    if (sdm_fit(&source, t, o, &r, &err)) fail_msg("%s", err.text);
    return r;
}

/* Fits a shape of this table to the labels of its mesh at truth[n_params], on the grid g, which is
 * also that of the maps. */
static inline sdm_status fit_labels_of(const sdm_shape *table, const double *truth,
                                       const sdm_grid *g, const sdm_fit_opts *o, sdm_fit_result *r,
                                       sdm_error *err)
{
    sdm_instance *shape = NULL;
    sdm_mesh mesh = {0};
    sdm_exact *e = NULL;
    float *v = calloc(sdm_grid_count(g), sizeof *v);
    if (!v || sdm_instance_create(table, NULL, 0, NULL, &shape, NULL) ||
        sdm_instance_mesh(shape, truth, &mesh, NULL) || sdm_exact_create(&mesh, NULL, &e, NULL) ||
        sdm_exact_map(e, g, v, NULL))
        abort();
    for (size_t i = 0; i < sdm_grid_count(g); i++) v[i] = v[i] < 0;
    const sdm_fit_source source = {.shape = shape, .grid = *g};
    const sdm_fit_target t = {.kind = SDM_FIT_LABEL, .grid = *g, .values = v};
    *err = (sdm_error){0};
    const sdm_status s = sdm_fit(&source, &t, o, r, err);
    sdm_exact_free(e);
    sdm_mesh_dispose(&mesh);
    sdm_instance_free(shape);
    free(v);
    return s;
}

/* Errors of a fit: e[n_params + 6] in the order of the covariance matrix: parameters, rotation
 * vector (rad, about the axes of the world frame), translation (mm). */
static inline void errors(const sdm_fit_result *r, const double *p, const sdm_pose *pose, double *e)
{
    double a[9], b[9], m[9] = {0};
    sdm_pose_matrix(&r->pose, a);
    sdm_pose_matrix(pose, b);
    for (int i = 0; i < 9; i++)
        for (int k = 0; k < 3; k++) m[i] += a[3 * (i / 3) + k] * b[3 * (i % 3) + k];
    for (size_t k = 0; k < r->n_params; k++) e[k] = r->params[k] - p[k];
    sdm_rotation_vector(m, e + r->n_params);
    for (size_t k = 0; k < 3; k++)
        e[r->n_params + 3 + k] = r->pose.translation[k] - pose->translation[k];
}

#endif
