/* Common functions for tests of the built-in shapes (included): instances, meshes, random
 * parameters, and velocities against differences. Include cmocka.h first. */
#pragma once

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "oracle/shape_registry.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"
#include "sdm/mesh.h"

// An instance of a shape; options are written as "name=value name=value".
static sdm_instance *shape_make(const char *shape, const char *options)
{
    static char text[512];
    sdm_named_text given[16];
    size_t n = 0;
    snprintf(text, sizeof text, "%s", options);
    for (char *word = strtok(text, " "); word; word = strtok(NULL, " ")) {
        char *value = strchr(word, '=');
        *value = '\0';
        given[n++] = (sdm_named_text){word, value + 1};
    }
    sdm_error err = {0};
    sdm_instance *s = NULL;
    const sdm_status status =
        sdm_instance_create(sdm_registry_find(registry, shape, NULL), given, n, NULL, &s, &err);
    if (status) fail_msg("%s: %s", shape, err.text);
    return s;
}

static void mesh_at(const sdm_instance *s, const double *p, sdm_mesh *m)
{
    sdm_error err = {0};
    if (sdm_instance_mesh(s, p, m, &err)) fail_msg("%s", err.text);
}

static inline double distance_at(const sdm_instance *s, const double *p, const double x[3])
{
    sdm_error err = {0};
    double d = 0;
    if (sdm_instance_distance(s, p, x, &d, &err)) fail_msg("%s", err.text);
    return d;
}

// The next random number in [lo, hi].
static double random_in(double lo, double hi)
{
    static uint64_t index;
    return lo + (hi - lo) * sdm_rng_uniform(5, 1, index++);
}

static void random_params(const sdm_instance *s, double *p)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(s, &n);
    for (size_t i = 0; i < n; i++) p[i] = random_in(params[i].min, params[i].max);
}

// The velocity callback of the shape against the registry's finite differences, which are used when
// the callback is missing.
static inline void velocity_check(const char *shape, const char *options, int rounds, double bound)
{
    sdm_instance *s = shape_make(shape, options);
    sdm_shape without = *sdm_instance_shape(s);
    without.velocity = NULL;
    assert_non_null(sdm_instance_shape(s)->velocity);

    sdm_registry *other = NULL;
    assert_int_equal(sdm_registry_create(&other, NULL), SDM_OK);
    assert_int_equal(sdm_registry_add(other, &without, "test", NULL), SDM_OK);
    sdm_registry *held = registry;
    registry = other;
    sdm_instance *plain = shape_make(shape, options);
    registry = held;

    sdm_mesh m = {0};
    size_t n;
    const sdm_param *params = sdm_instance_params(s, &n);
    for (int round = 0; round < rounds; round++) {
        double p[16];
        random_params(s, p);
        for (size_t i = 0; i < n && round < 2; i++) p[i] = round ? params[i].max : params[i].min;
        mesh_at(s, p, &m);
        double *a = NULL, *b = NULL;
        assert_int_equal(SDM_ALLOC(&a, 3 * m.n_vert * n, "a", NULL), SDM_OK);
        assert_int_equal(SDM_ALLOC(&b, 3 * m.n_vert * n, "b", NULL), SDM_OK);
        assert_int_equal(sdm_instance_velocity(s, p, m.n_vert, a, NULL), SDM_OK);
        assert_int_equal(sdm_instance_velocity(plain, p, m.n_vert, b, NULL), SDM_OK);
        double worst = 0, largest = 0;
        for (size_t i = 0; i < 3 * m.n_vert * n; i++)
            worst = fmax(worst, fabs(a[i] - b[i])), largest = fmax(largest, fabs(a[i]));
        if (!(worst < bound)) fail_msg("%s %s: velocities differ by %g", shape, options, worst);
        assert_true(largest > 0.4);
        sdm_error err = {0};
        assert_int_equal(sdm_instance_velocity(s, p, m.n_vert + 1, a, &err), SDM_E_PLUGIN);
        sdm_free(a);
        sdm_free(b);
    }
    sdm_mesh_dispose(&m);
    sdm_instance_free(plain);
    sdm_instance_free(s);
    sdm_registry_free(other);
}
