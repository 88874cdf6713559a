/* The runtime with a model known in closed form: a ball of radius p[0] + 0.1 p[1], which its
 * network represents exactly.
 * Tests: check_results.c generate.c jacobian.c model_mesh.c model_shape.c shape_sums.c */
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "runtime/ball_model.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/shape_sums.h"

enum { N = 17, VOXELS = N * N * N };

static sdm_model *model_of(const char *second_name)
{
    const sdm_grid grid =
        sdm_grid_centred((const int64_t[]){N, N, N}, 0.25, (const double[]){0, 0, 0});
    return ball_model(second_name, &grid, NULL);
}

typedef struct scene {
    sdm_model *model;
    sdm_registry *registry;
    sdm_instance *shape;
} scene;

static int open_scene(void **state)
{
    static scene s;
    sdm_error err;
    s.model = model_of("bulge");
    if (sdm_registry_create(&s.registry, &err) ||
        sdm_registry_add(s.registry, &ball_shape, "test", &err) ||
        sdm_runtime_instance(s.model, s.registry, &s.shape, &err)) {
        fprintf(stderr, "%s\n", err.text);
        return -1;
    }
    *state = &s;
    return 0;
}

static int close_scene(void **state)
{
    scene *s = *state;
    sdm_instance_free(s->shape);
    sdm_registry_free(s->registry);
    sdm_model_free(s->model);
    return 0;
}

// Largest difference from |x| - r.
static double ball_error(const float *values, double r)
{
    const sdm_grid g =
        sdm_grid_centred((const int64_t[]){N, N, N}, 0.25, (const double[]){0, 0, 0});
    double worst = 0;
    for (int i = 0; i < VOXELS; i++) {
        double x[3];
        sdm_grid_world(&g, (const double[]){i % N, i / N % N, i / N / N}, x);
        worst = fmax(worst,
                     fabs(sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) - r - (double)values[i]));
    }
    return worst;
}

static void test_network_map(void **state)
{
    const scene *s = *state;
    static float values[VOXELS];
    sdm_result result;
    sdm_error err;
    const double p[] = {1.37, -0.6};
    assert_int_equal(sdm_generate(s->model, p, NULL, values, &result, &err), SDM_OK);
    assert_true(ball_error(values, ball_radius(p)) < 1e-5);
    assert_int_equal(result.source, SDM_SOURCE_NETWORK);
    assert_false(result.clamped);
    assert_true(result.error_mm == 0.0125);
    assert_int_equal(sdm_generate(s->model, p, NULL, values, NULL, NULL), SDM_OK);
}

static void test_policies_out_of_range(void **state)
{
    const scene *s = *state;
    static float values[VOXELS];
    sdm_result result;
    sdm_error err;
    const double p[] = {1.7, 0.5}, edge[] = {1.5, 0.5}, wild[] = {2.1, 0.5};
    assert_int_equal(sdm_generate(s->model, p, NULL, values, &result, &err), SDM_E_RANGE);
    assert_non_null(strstr(err.text, "parameter 'radius' = 1.7 mm, allowed 1 .. 1.5 mm"));
    const sdm_generate_opts clamp = {.policy = SDM_RANGE_CLAMP},
                            exact = {.policy = SDM_RANGE_EXACT, .exact_shape = s->shape};
    assert_int_equal(sdm_generate(s->model, p, &clamp, values, &result, &err), SDM_OK);
    assert_true(result.clamped && result.source == SDM_SOURCE_NETWORK);
    assert_true(ball_error(values, ball_radius(edge)) < 1e-5);
    // The exact engine measures the mesh, whose flat facets lie within r (1 - cos(pi / 48)) of the
    // sphere.
    assert_int_equal(sdm_generate(s->model, p, &exact, values, &result, &err), SDM_OK);
    assert_true(!result.clamped && result.source == SDM_SOURCE_EXACT && result.error_mm == 0);
    assert_true(ball_error(values, ball_radius(p)) < 0.005);
    assert_int_equal(sdm_generate(s->model, edge, &exact, values, &result, &err), SDM_OK);
    assert_int_equal(result.source, SDM_SOURCE_NETWORK);
    // Outside of the range of the shape itself.
    assert_int_equal(sdm_generate(s->model, wild, &exact, values, &result, &err), SDM_E_RANGE);
    for (int policy = SDM_RANGE_REFUSE; policy <= SDM_RANGE_EXACT; policy++) {
        const sdm_generate_opts o = {.policy = (sdm_range_policy)policy, .exact_shape = s->shape};
        const double bad[] = {NAN, INFINITY, -INFINITY};
        for (int i = 0; i < 3; i++) {
            const double q[] = {1.2, bad[i]};
            assert_int_equal(sdm_generate(s->model, q, &o, values, &result, &err), SDM_E_RANGE);
            assert_non_null(strstr(err.text, "parameter 'bulge' = "));
        }
    }
}

// Outside of the range, by one rounding error or by far: refused, clamped or exact, and reported as
// such.
static void test_just_outside_the_range(void **state)
{
    const scene *s = *state;
    static float values[VOXELS], at_end[VOXELS], exact_map[VOXELS];
    sdm_result result;
    sdm_error err;
    const double ends[] = {1.0, 1.5}, outside[] = {nextafter(1.0, 0), nextafter(1.5, 2)},
                 far[] = {-1e300, 1e300};
    const sdm_generate_opts clamp = {.policy = SDM_RANGE_CLAMP},
                            exact = {.policy = SDM_RANGE_EXACT, .exact_shape = s->shape};
    for (int i = 0; i < 2; i++) {
        const double end[] = {ends[i], 1}, out[] = {outside[i], 1}, away[] = {far[i], 1};
        assert_int_equal(sdm_generate(s->model, end, NULL, at_end, &result, &err), SDM_OK);
        assert_true(!result.clamped && result.source == SDM_SOURCE_NETWORK &&
                    result.reason == SDM_REASON_NONE);
        assert_int_equal(sdm_generate(s->model, out, NULL, values, &result, &err), SDM_E_RANGE);
        assert_int_equal(sdm_generate(s->model, away, NULL, values, &result, &err), SDM_E_RANGE);
        assert_int_equal(sdm_generate(s->model, out, &clamp, values, &result, &err), SDM_OK);
        assert_true(result.clamped && result.source == SDM_SOURCE_NETWORK &&
                    result.reason == SDM_REASON_NONE);
        assert_memory_equal(values, at_end, sizeof values);
        memset(values, 0, sizeof values);
        assert_int_equal(sdm_generate(s->model, away, &clamp, values, &result, &err), SDM_OK);
        assert_true(result.clamped);
        assert_memory_equal(values, at_end, sizeof values);
        assert_int_equal(sdm_generate(s->model, out, &exact, values, &result, &err), SDM_OK);
        assert_true(!result.clamped && result.source == SDM_SOURCE_EXACT &&
                    result.reason == SDM_REASON_RANGE);
        const sdm_grid *g = &sdm_model_get_info(s->model)->grid;
        assert_int_equal(sdm_exact_shape_map(s->shape, out, NULL, g, exact_map, NULL, &err),
                         SDM_OK);
        assert_memory_equal(values, exact_map, sizeof values);
        assert_int_equal(sdm_generate(s->model, away, &exact, values, &result, &err), SDM_E_RANGE);
    }
}

// About the largest distance of the flat quadrilaterals below the unit sphere.
static double sagitta(void) { return 2 - cos(acos(-1) / 2 / RINGS) - cos(acos(-1) / SECTORS); }

// The network gives the ideal ball, the mesh lies inside of it: the network's distance is too
// small.
static void test_error_bound_is_enforced(void **state)
{
    const scene *s = *state;
    static float values[VOXELS], exact_map[VOXELS];
    sdm_result result;
    sdm_error err;
    const double p[] = {1.3, 0.5};
    const double most = ball_radius(p) * sagitta();
    sdm_generate_opts o = {.exact_shape = s->shape, .check = true};
    assert_int_equal(sdm_generate(s->model, p, &o, values, &result, &err), SDM_OK);
    assert_true(result.checked && result.source == SDM_SOURCE_NETWORK &&
                result.check.used == SDM_CHECK_POINTS);
    assert_true(result.check.max_mm < most && result.check.max_mm > 0.5 * most &&
                result.check.bias_mm < 0);
    assert_true(ball_error(values, ball_radius(p)) < 1e-5);

    const sdm_check_stat stats[] = {SDM_CHECK_MAX, SDM_CHECK_Q95, SDM_CHECK_RMSE, SDM_CHECK_MEAN};
    const sdm_check c = result.check;
    const double figures[] = {c.max_mm, c.q95_mm, c.rmse_mm, c.mean_mm};
    assert_int_equal(sdm_exact_shape_map(s->shape, p, NULL, &sdm_model_get_info(s->model)->grid,
                                         exact_map, NULL, &err),
                     SDM_OK);
    for (int i = 0; i < 4; i++) {
        o = (sdm_generate_opts){
            .exact_shape = s->shape, .max_error_mm = 1.001 * figures[i], .max_error_of = stats[i]};
        assert_int_equal(sdm_generate(s->model, p, &o, values, &result, &err), SDM_OK);
        assert_true(result.checked && result.reason == SDM_REASON_NONE);
        // A bound slightly below the error: SDM_E_QUALITY with all results written, or the exact
        // map instead.
        o.max_error_mm = 0.999 * figures[i];
        memset(values, 0, sizeof values);
        result = (sdm_result){0};
        assert_int_equal(sdm_generate(s->model, p, &o, values, &result, &err), SDM_E_QUALITY);
        assert_non_null(strstr(err.text, sdm_check_stat_name(stats[i])));
        assert_true(result.checked && result.source == SDM_SOURCE_NETWORK &&
                    ball_error(values, ball_radius(p)) < 1e-5);
        assert_memory_equal(&result.check, &c, sizeof c);
        o.policy = SDM_RANGE_EXACT;
        assert_int_equal(sdm_generate(s->model, p, &o, values, &result, &err), SDM_OK);
        assert_true(result.checked && result.source == SDM_SOURCE_EXACT &&
                    result.reason == SDM_REASON_ERROR);
        assert_true(result.error_mm == 0 && result.check.max_mm == c.max_mm);
        assert_memory_equal(values, exact_map, sizeof values);
    }
}

// With the surface outside of the grid there is no error figure, which must fail every bound.
static void test_nothing_to_check(void **state)
{
    const scene *s = *state;
    static float values[VOXELS];
    sdm_result result;
    sdm_error err;
    sdm_instance *large = NULL;
    const double p[] = {1.3, 0.5};
    const sdm_named_text scale = {"scale", "10"};
    assert_int_equal(sdm_instance_create(&ball_shape, &scale, 1, NULL, &large, &err), SDM_OK);
    const sdm_generate_opts o = {.exact_shape = large, .max_error_mm = 1e6};
    assert_int_equal(sdm_generate(s->model, p, &o, values, &result, &err), SDM_E_QUALITY);
    assert_true(result.checked && result.check.used == 0 && isnan(result.check.max_mm));
    sdm_instance_free(large);
}

// Maps of radius near 1 meet the bound, larger ones do not: each map is judged by its own error,
// for any number of threads.
static void test_checked_batch(void **state)
{
    const scene *s = *state;
    enum { MAPS = 7 };
    static float values[MAPS * VOXELS], first[MAPS * VOXELS];
    const double p[2 * MAPS] = {1.0, -1, 1.5, 1, 1.02, -1, 1.6, 0, 1.49, 1, 1.01, -1, 1.48, 0.9};
    const sdm_source source[MAPS] = {0, 1, 0, 1, 1, 0, 1};
    const sdm_reason reason[MAPS] = {0, 2, 0, 1, 2, 0, 2};
    sdm_result results[MAPS];
    sdm_error err;
    const double most = 1.25 * sagitta();
    sdm_generate_opts o = {
        .policy = SDM_RANGE_EXACT, .exact_shape = s->shape, .max_error_mm = 0.9 * most};
    for (o.n_threads = 1; o.n_threads <= 3; o.n_threads++) {
        if (sdm_generate_batch(s->model, p, MAPS, &o, values, results, &err))
            fail_msg("%s", err.text);
        if (o.n_threads == 1) memcpy(first, values, sizeof first);
        assert_memory_equal(values, first, sizeof first);
        for (int i = 0; i < MAPS; i++) {
            assert_int_equal(results[i].source, source[i]);
            assert_int_equal(results[i].reason, reason[i]);
            assert_int_equal(results[i].checked, reason[i] != SDM_REASON_RANGE);
        }
        // Without replacement by exact maps the error names the first bad map, whatever the order
        // of threads.
        sdm_generate_opts refuse = o;
        refuse.policy = SDM_RANGE_CLAMP;
        assert_int_equal(sdm_generate_batch(s->model, p, MAPS, &refuse, values, results, &err),
                         SDM_E_QUALITY);
        assert_non_null(strstr(err.text, "map 1 of 7: "));
        for (int i = 0; i < MAPS; i++)
            assert_true(results[i].checked && results[i].source == SDM_SOURCE_NETWORK);
        // A failed check takes precedence over a bad map; the first failed check is named.
        double q[2 * MAPS];
        memcpy(q, p, sizeof q);
        q[2 * 3 + 1] = q[2 * 5 + 1] = UNLUCKY;
        assert_int_equal(sdm_generate_batch(s->model, q, MAPS, &refuse, values, results, &err),
                         SDM_E_PLUGIN);
        assert_non_null(strstr(err.text, "map 3 of 7: "));
        assert_non_null(strstr(err.text, "an unlucky number"));
    }
}

enum { BATCH = 53 };

static void batch_params(double *p)
{
    for (uint64_t i = 0; i < BATCH; i++) {
        p[2 * i] = 1.0 + 0.5 * sdm_rng_uniform(7, 0, i);
        p[2 * i + 1] = -1 + 2 * sdm_rng_uniform(7, 1, i);
    }
}

// The same bits for any number of threads, with network and exact maps mixed, and each map in its
// place.
static void test_batch_has_same_bits_for_threads(void **state)
{
    const scene *s = *state;
    double p[2 * BATCH];
    batch_params(p);
    p[2 * 5] = 1.6, p[2 * 16] = 0.9, p[2 * 52] = 1.55;
    const size_t bytes = (size_t)BATCH * VOXELS * sizeof(float);
    float *first = malloc(bytes), *again = malloc(bytes);
    assert_true(first && again);
    sdm_result results[BATCH];
    sdm_error err;
    for (int threads = 1; threads <= 4; threads++) {
        const sdm_generate_opts o = {
            .policy = SDM_RANGE_EXACT, .exact_shape = s->shape, .n_threads = threads};
        memset(again, 0xff, bytes);
        if (sdm_generate_batch(s->model, p, BATCH, &o, threads == 1 ? first : again, results, &err))
            fail_msg("%s", err.text);
        if (threads > 1) assert_memory_equal(first, again, bytes);
        for (int i = 0; i < BATCH; i++) {
            const bool far = i == 5 || i == 16 || i == 52;
            assert_int_equal(results[i].source, far ? SDM_SOURCE_EXACT : SDM_SOURCE_NETWORK);
            assert_true(ball_error(first + (size_t)i * VOXELS, ball_radius(p + 2 * i)) <
                        (far ? 0.005 : 1e-5));
        }
    }
    // All or nothing: one bad row of parameters is named and no map is written.
    memset(again, 0, bytes);
    p[2 * 40 + 1] = 5;
    assert_int_equal(sdm_generate_batch(s->model, p, BATCH, NULL, again, results, &err),
                     SDM_E_RANGE);
    assert_non_null(strstr(err.text, "map 5 of 53: parameter 'radius' = "));
    assert_non_null(strstr(err.text, "; sdm_generate_opts.policy = SDM_RANGE_CLAMP moves it "));
    assert_non_null(strstr(err.text, ", SDM_RANGE_EXACT computes exact maps "));
    p[2 * 5] = p[2 * 16] = p[2 * 52] = 1.2;
    assert_int_equal(sdm_generate_batch(s->model, p, BATCH, NULL, again, results, &err),
                     SDM_E_RANGE);
    assert_non_null(strstr(err.text, "map 40 of 53: parameter 'bulge' = 5"));
    for (size_t i = 0; i < bytes / sizeof *again; i++) assert_true(again[i] == 0);
    assert_int_equal(sdm_generate_batch(s->model, NULL, 0, NULL, NULL, NULL, &err), SDM_OK);
    free(first);
    free(again);
}

// Each allocation fails once: SDM_E_NOMEM, and no leak (detected by the sanitizer build).
static void test_each_allocation_may_fail(void **state)
{
    const scene *s = *state;
    static float values[VOXELS], jacobian[2 * VOXELS];
    const double p[] = {1.2, 0};
    sdm_error err;
    unsigned long n = 1;
    for (;; n++) {
        sdm_alloc_fail_after(n);
        const sdm_status t = sdm_generate(s->model, p, NULL, values, NULL, &err);
        sdm_alloc_fail_after(0);
        if (!t) break;
        assert_int_equal(t, SDM_E_NOMEM);
    }
    assert_true(n > 1 && n < 20);
    const sdm_generate_opts checked = {.exact_shape = s->shape, .n_threads = 1, .check = true};
    for (n = 1;; n++) {
        sdm_alloc_fail_after(n);
        const sdm_status t = sdm_generate(s->model, p, &checked, values, NULL, &err);
        sdm_alloc_fail_after(0);
        if (!t) break;
        assert_int_equal(t, SDM_E_NOMEM);
    }
    assert_true(n > 10 && n < 1000);
    for (n = 1;; n++) {
        sdm_alloc_fail_after(n);
        const sdm_status t = sdm_generate_jacobian(s->model, p, NULL, values, jacobian, NULL, &err);
        sdm_alloc_fail_after(0);
        if (!t) break;
        assert_int_equal(t, SDM_E_NOMEM);
    }
    assert_true(n > 1 && n < 20);
}

typedef struct caller {
    const sdm_model *model;
    float values[VOXELS];
    sdm_status status;
} caller;

static void *thread_generate(void *data)
{
    caller *c = data;
    double p[2 * BATCH];
    batch_params(p);
    for (int i = 0; i < BATCH && !c->status; i++)
        c->status = sdm_generate(c->model, p + 2 * i, NULL, c->values, NULL, NULL);
    return NULL;
}

static void test_concurrent_callers(void **state)
{
    const scene *s = *state;
    static caller callers[4];
    pthread_t threads[4];
    for (int i = 0; i < 4; i++) {
        callers[i] = (caller){.model = s->model};
        assert_int_equal(pthread_create(&threads[i], NULL, thread_generate, &callers[i]), 0);
    }
    for (int i = 0; i < 4; i++) assert_int_equal(pthread_join(threads[i], NULL), 0);
    for (int i = 0; i < 4; i++) {
        assert_int_equal(callers[i].status, SDM_OK);
        assert_memory_equal(callers[i].values, callers[0].values, sizeof callers[0].values);
    }
}

static void test_jacobian(void **state)
{
    const scene *s = *state;
    static float values[VOXELS], jacobian[2 * VOXELS];
    sdm_result result;
    sdm_error err;
    const double p[] = {1.1, 0.4}, far[] = {1.7, 0.4}, edge[] = {1.5, 0.4};
    assert_int_equal(sdm_generate_jacobian(s->model, p, NULL, values, jacobian, &result, &err),
                     SDM_OK);
    assert_true(ball_error(values, ball_radius(p)) < 1e-5);
    for (int i = 0; i < VOXELS; i++)
        assert_true(fabs((double)jacobian[i] + 1) < 1e-5 &&
                    fabs((double)jacobian[VOXELS + i] + 0.1) < 1e-5);
    assert_int_equal(sdm_generate_jacobian(s->model, far, NULL, values, jacobian, &result, &err),
                     SDM_E_RANGE);
    const sdm_generate_opts clamp = {.policy = SDM_RANGE_CLAMP},
                            exact = {.policy = SDM_RANGE_EXACT, .exact_shape = s->shape};
    assert_int_equal(sdm_generate_jacobian(s->model, far, &clamp, values, jacobian, &result, &err),
                     SDM_OK);
    assert_true(result.clamped && ball_error(values, ball_radius(edge)) < 1e-5);
    // The Jacobian of the exact engine: outside of the range, or when the network misses the error
    // bound. The mesh has flat facets.
    static float again[VOXELS];
    assert_int_equal(sdm_generate_jacobian(s->model, p, &exact, values, jacobian, &result, &err),
                     SDM_OK);
    assert_int_equal(result.source, SDM_SOURCE_NETWORK);
    const sdm_generate_opts strict = {
        .policy = SDM_RANGE_EXACT, .exact_shape = s->shape, .max_error_mm = 1e-6};
    const double *const at[] = {far, p};
    for (int k = 0; k < 2; k++) {
        memset(jacobian, 0, sizeof jacobian);
        assert_int_equal(sdm_generate_jacobian(s->model, at[k], k ? &strict : &exact, values,
                                               jacobian, &result, &err),
                         SDM_OK);
        assert_true(result.source == SDM_SOURCE_EXACT &&
                    result.reason == (k ? SDM_REASON_ERROR : SDM_REASON_RANGE));
        assert_int_equal(sdm_generate(s->model, at[k], k ? &strict : &exact, again, NULL, &err),
                         SDM_OK);
        assert_memory_equal(values, again, sizeof values);
        for (int i = 0; i < VOXELS; i++)
            assert_true(fabs((double)jacobian[i] + 1) < 5e-3 &&
                        fabs((double)jacobian[VOXELS + i] + 0.1) < 5e-4);
    }
    const sdm_generate_opts bound = {.exact_shape = s->shape, .max_error_mm = 1e-6};
    assert_int_equal(sdm_generate_jacobian(s->model, p, &bound, values, jacobian, &result, &err),
                     SDM_E_QUALITY);
    assert_true(result.checked);
}

// Products with the Jacobian, whose entries are -1 and -0.1 in every voxel; outside of the range
// those of the exact engine.
static void test_jacobian_products(void **state)
{
    const scene *s = *state;
    static float values[VOXELS], tangent[VOXELS], adjoint[VOXELS];
    double gradient[2], sum = 0;
    sdm_result result;
    sdm_error err;
    const double p[] = {1.1, 0.4}, far[] = {1.7, 0.4}, direction[] = {0.5, -2};
    const sdm_generate_opts exact = {.policy = SDM_RANGE_EXACT, .exact_shape = s->shape};
    for (int i = 0; i < VOXELS; i++) sum += (double)(adjoint[i] = (float)(i % 7) - 2);
    for (int k = 0; k < 2; k++) {
        const double *at = k ? far : p, loose = k ? 5e-3 : 1e-5;
        const sdm_source source = k ? SDM_SOURCE_EXACT : SDM_SOURCE_NETWORK;
        assert_int_equal(
            sdm_generate_jvp(s->model, at, direction, &exact, values, tangent, &result, &err),
            SDM_OK);
        assert_true(result.source == source &&
                    ball_error(values, ball_radius(at)) < (k ? 2e-2 : 1e-5));
        for (int i = 0; i < VOXELS; i++) assert_true(fabs((double)tangent[i] + 0.3) < loose);
        assert_int_equal(sdm_generate_vjp(s->model, at, adjoint, &exact, gradient, &result, &err),
                         SDM_OK);
        assert_true(result.source == source);
        assert_true(fabs(gradient[0] + sum) < loose * sum &&
                    fabs(gradient[1] + 0.1 * sum) < loose * sum);
    }
    assert_int_equal(
        sdm_generate_jvp(s->model, far, direction, NULL, values, tangent, &result, &err),
        SDM_E_RANGE);
    assert_int_equal(sdm_generate_vjp(s->model, far, adjoint, NULL, gradient, &result, &err),
                     SDM_E_RANGE);
    const sdm_generate_opts bound = {.exact_shape = s->shape, .max_error_mm = 1e-6};
    assert_int_equal(
        sdm_generate_jvp(s->model, p, direction, &bound, values, tangent, &result, &err),
        SDM_E_QUALITY);
    assert_int_equal(sdm_generate_jvp(s->model, p, NULL, NULL, values, tangent, &result, &err),
                     SDM_E_ARG);
    assert_int_equal(sdm_generate_vjp(s->model, p, NULL, NULL, gradient, &result, &err), SDM_E_ARG);
}

static void test_instance_of_model(void **state)
{
    const scene *s = *state;
    sdm_error err;
    sdm_instance *made = (sdm_instance *)state;
    assert_string_equal(sdm_instance_shape(s->shape)->name, "ball");
    assert_true(sdm_instance_options(s->shape)[0].number == 1);
    sdm_registry *empty = NULL;
    assert_int_equal(sdm_registry_create(&empty, &err), SDM_OK);
    assert_int_equal(sdm_runtime_instance(s->model, empty, &made, &err), SDM_E_PLUGIN);
    assert_null(made);
    assert_non_null(strstr(err.text, "'ball'"));
    sdm_registry_free(empty);
    sdm_model *other = model_of("swelling");
    assert_int_equal(sdm_runtime_instance(other, s->registry, &made, &err), SDM_E_PLUGIN);
    assert_non_null(strstr(err.text, "'swelling'"));
    assert_null(made);
    sdm_model_free(other);
}

// The shape must have the mesh of the training, to a relative difference of 1e-6.
static void test_changed_shape_is_refused(void **state)
{
    const scene *s = *state;
    const double p[] = {1.2, 0};
    sdm_error err;
    sdm_shape_figures mesh, probe;
    assert_int_equal(sdm_shape_sums(s->shape, p, &mesh, &err), SDM_OK);
    assert_true(fabs(mesh.area / (16 * atan(1) * 1.44) - 1) < 0.2);
    // of a sphere: its squares, area r^2 / 3, seven times
    assert_true(fabs(mesh.moment / (mesh.area * 1.44 * 7 / 3 / sqrt(mesh.area)) - 1) < 0.01);
    // the first probe, inside the ranges of the model
    const double q[] = {sdm_probe_param(0, 0, 1, 1.5), sdm_probe_param(0, 1, -1, 1)};
    assert_true(q[0] > 1 && q[0] < 1.5 && q[1] > -1 && q[1] < 1);
    assert_int_equal(sdm_shape_sums(s->shape, q, &probe, &err), SDM_OK);
    const double cube = mesh.area * sqrt(mesh.area), cube_at = probe.area * sqrt(probe.area);
    for (int k = 0; k < 8; k++) { // 0, 7: not changed; 7: of an earlier version
        sdm_instance *made = NULL;
        ball_mesh_volume = mesh.volume * (k == 1 ? 1 + 1.5e-6 : 1 + 7e-7);
        ball_mesh_area = mesh.area * (k == 2 ? 1 + 1.5e-6 : 1 - 7e-7);
        ball_probe_volume = probe.volume * (k == 3 ? 1 + 1.5e-6 : 1 - 7e-7);
        ball_probe_area = probe.area * (k == 4 ? 1 + 1.5e-6 : 1 - 7e-7);
        ball_mesh_moment = k == 7 ? NAN : mesh.moment + cube * (k == 5 ? 1.5e-6 : 7e-7);
        ball_probe_moment = k == 7 ? NAN : probe.moment - cube_at * (k == 6 ? 1.5e-6 : 7e-7);
        sdm_model *m = model_of("bulge");
        ball_mesh_volume = ball_mesh_area = ball_probe_volume = ball_probe_area = NAN;
        ball_mesh_moment = ball_probe_moment = NAN;
        const sdm_status status = sdm_runtime_instance(m, s->registry, &made, &err);
        const bool changed = k % 7, moved = k >= 5, at_probe = k == 3 || k == 4 || k == 6;
        assert_int_equal(status, changed ? SDM_E_PLUGIN : SDM_OK);
        if (changed) {
            assert_non_null(strstr(err.text, "shape 'ball' was changed after the training"));
            assert_non_null(strstr(err.text, moved ? "a part of it lies elsewhere;"
                                                   : "(sums over all triangles: overlaps count "
                                                     "twice)"));
            assert_non_null(strstr(err.text, at_probe ? "at other parameters" : "at the default"));
        }
        sdm_instance_free(made);
        sdm_model_free(m);
    }
}

static void test_exact_shape_map(void **state)
{
    const scene *s = *state;
    static float values[VOXELS];
    sdm_exact_report report;
    sdm_error err;
    sdm_grid g = sdm_model_get_info(s->model)->grid;
    const double p[] = {1.0, -1.5}, wrong[] = {5, 0};
    assert_int_equal(sdm_exact_shape_map(s->shape, p, NULL, &g, values, &report, &err), SDM_OK);
    assert_true(ball_error(values, ball_radius(p)) < 0.005);
    assert_int_equal(report.audit.n_tri, 2 * (RINGS - 1) * SECTORS);
    assert_true(report.audit.manifold && !report.turned);
    assert_int_equal(sdm_exact_shape_map(s->shape, wrong, NULL, &g, values, NULL, &err),
                     SDM_E_RANGE);
    g.spacing[1] = 0;
    assert_int_equal(sdm_exact_shape_map(s->shape, p, NULL, &g, values, NULL, &err), SDM_E_ARG);
}

static void test_wrong_arguments_are_refused(void **state)
{
    const scene *s = *state;
    static float values[VOXELS];
    const double p[] = {1.2, 0};
    sdm_error err;
    sdm_instance *made;
    assert_int_equal(sdm_generate(NULL, p, NULL, values, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_generate(s->model, NULL, NULL, values, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_generate(s->model, p, NULL, NULL, NULL, &err), SDM_E_ARG);
    assert_int_equal(
        sdm_generate(s->model, p, &(sdm_generate_opts){.n_threads = -1}, values, NULL, &err),
        SDM_E_ARG);
    assert_int_equal(sdm_generate(s->model, p, &(sdm_generate_opts){.policy = (sdm_range_policy)9},
                                  values, NULL, &err),
                     SDM_E_ARG);
    assert_int_equal(sdm_generate(s->model, p, &(sdm_generate_opts){.policy = SDM_RANGE_EXACT},
                                  values, NULL, &err),
                     SDM_E_ARG);
    const double bounds[] = {-1, NAN, INFINITY};
    for (int i = 0; i < 3; i++) {
        const sdm_generate_opts o = {.exact_shape = s->shape, .max_error_mm = bounds[i]};
        assert_int_equal(sdm_generate(s->model, p, &o, values, NULL, &err), SDM_E_ARG);
    }
    const sdm_generate_opts stat = {
        .exact_shape = s->shape, .max_error_mm = 1, .max_error_of = (sdm_check_stat)4};
    assert_int_equal(sdm_generate(s->model, p, &stat, values, NULL, &err), SDM_E_ARG);
    assert_int_equal(
        sdm_generate(s->model, p, &(sdm_generate_opts){.check = true}, values, NULL, &err),
        SDM_E_ARG);
    assert_non_null(strstr(err.text, "sdm_runtime_instance()"));
    assert_int_equal(sdm_generate_batch(s->model, p, SIZE_MAX / 8, NULL, values, NULL, &err),
                     SDM_E_NOMEM);
    assert_int_equal(sdm_generate_jacobian(s->model, p, NULL, values, NULL, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_runtime_instance(NULL, s->registry, &made, &err), SDM_E_ARG);
    assert_int_equal(sdm_runtime_instance(s->model, s->registry, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_shape_map(NULL, p, NULL, NULL, values, NULL, &err), SDM_E_ARG);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_network_map),
        cmocka_unit_test(test_policies_out_of_range),
        cmocka_unit_test(test_batch_has_same_bits_for_threads),
        cmocka_unit_test(test_jacobian),
        cmocka_unit_test(test_jacobian_products),
        cmocka_unit_test(test_each_allocation_may_fail),
        cmocka_unit_test(test_concurrent_callers),
        cmocka_unit_test(test_instance_of_model),
        cmocka_unit_test(test_changed_shape_is_refused),
        cmocka_unit_test(test_exact_shape_map),
        cmocka_unit_test(test_wrong_arguments_are_refused),
        cmocka_unit_test(test_just_outside_the_range),
        cmocka_unit_test(test_error_bound_is_enforced),
        cmocka_unit_test(test_checked_batch),
        cmocka_unit_test(test_nothing_to_check),
    };
    return cmocka_run_group_tests(tests, open_scene, close_scene);
}
