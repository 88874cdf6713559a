/* Derivatives of the template network against central differences of its maps, and its correction
 * by a pod network.
 * Tests: template_corner_slopes.c template_slope_rows.c template_slopes.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "sdm/internal/rng.h"
#include "template_toy.h"

static const double ORIGIN[3] = {0, 0, 0};

static void set_numbers(toy *t, size_t first, size_t n, double scale)
{
    for (size_t i = first; i < first + n; i++)
        t->numbers[i] = (number){scale * sdm_rng_normal(3, 1, i),
                                 {scale * sdm_rng_normal(3, 2, i), scale * sdm_rng_normal(3, 3, i)},
                                 {scale * sdm_rng_normal(3, 4, i), 0}};
}

/* 0: a chain of planes; 1: a sphere that becomes an ellipsoid; 2: a bent sphere on a frame that
   turns; 3: the same beside two planes, which it carries. Templates without an error of
   interpolation have derivatives without jumps. */
enum { TOYS = 4 };
// The metric of a warp belongs to a point up to a two-hundredth of the spacing of its lattice away.
static const double TOLERANCE[TOYS] = {1e-3, 1e-3, 2e-3, 2e-3};

static toy make(int which, const sdm_grid *grid)
{
    toy t = toy_new(grid);
    const sdm_lattice near = lattice(ORIGIN, which < 2 ? 4 : 16, 0.5), far = lattice(ORIGIN, 40, 2),
                      warp = lattice(ORIGIN, 40, 4);
    const body planes[3] = {{PLANE, {0, 0, 1}, {0, 0, 1}, 0},
                            {PLANE, {0, 2, 1}, {0, 0.6, 0.8}, 0},
                            {PLANE, {3, 0, 1}, {0.6, 0, -0.8}, 0}},
               ball = {QUADRIC, {0.2, 0.1, -0.3}, {0}, 2};
    if (which == 0) {
        toy_add(&t, &planes[0], -1, SDM_FRAME_RIGID, &near, &far);
        toy_add(&t, &planes[1], 0, SDM_FRAME_RIGID, &near, &far);
        toy_add(&t, &planes[2], 1, SDM_FRAME_AFFINE, &near, &far);
        set_numbers(&t, 0, t.spec.n_numbers, 0.15);
    } else {
        toy_add(&t, &ball, -1, which == 1 ? SDM_FRAME_AFFINE : SDM_FRAME_RIGID, &near, &far);
        set_numbers(&t, 0, t.spec.n_numbers, 0.08);
    }
    if (which >= 2) {
        toy_warp(&t, 0, 0, MODES, &warp);
        for (size_t m = 0; m < MODES; m++)
            t.numbers[6 + m] = (number){0.5, {0.6, -0.4}, {0, m ? 0 : 0.3}};
    }
    if (which == 3) {
        toy_add(&t, &planes[0], -1, SDM_FRAME_RIGID, &near, &far);
        toy_add(&t, &planes[2], 0, SDM_FRAME_NONE, &near, &far);
        set_numbers(&t, t.parts[1].numbers, 6, 0.1);
    }
    return t;
}

typedef struct slopes {
    size_t voxels;
    float *map, *jacobian;
} slopes;

static slopes slopes_of(const sdm_model *m, const double *p)
{
    slopes s = {.voxels = sdm_grid_count(&sdm_model_get_info(m)->grid)};
    void *scratch = NULL;
    const size_t bytes = sdm_model_jacobian_scratch_bytes(m);
    assert_int_equal(SDM_ALLOC(&s.map, s.voxels, "map", NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&s.jacobian, P * s.voxels, "jacobian", NULL), SDM_OK);
    assert_int_equal(sdm_alloc(&scratch, bytes, 1, "scratch", NULL), SDM_OK);
    memset(scratch, 0xa5, bytes);
    memset(s.jacobian, 0xa5, P * s.voxels * sizeof *s.jacobian);
    sdm_model_jacobian(m, p, s.map, s.jacobian, scratch);
    sdm_free(scratch);
    return s;
}

static void slopes_dispose(slopes *s)
{
    sdm_free(s->map);
    sdm_free(s->jacobian);
}

// Number of the part that is the nearest at voxel v.
static size_t nearest(const toy *t, const double *p, size_t v)
{
    double x[3], least = INFINITY;
    size_t best = 0;
    voxel_world(&t->info.grid, v, x);
    for (size_t c = 0; c < t->spec.n_parts; c++) {
        const double d = toy_distance(t, p, c, 0, x);
        if (d < least) least = d, best = c;
    }
    return best;
}

static void check_slopes(const toy *t, const sdm_model *m, double tolerance)
{
    const double step = 0.01;
    for (uint64_t i = 0; i < 2; i++) {
        const double p[P] = {-0.5 + (double)i, 3 + 1.7 * (double)i};
        slopes s = slopes_of(m, p);
        float *map = toy_map(m, p, 1);
        assert_memory_equal(s.map, map, s.voxels * sizeof *map);
        size_t left_out = 0;
        for (int k = 0; k < P; k++) {
            double low[P], high[P];
            memcpy(low, p, sizeof low), memcpy(high, p, sizeof high);
            low[k] -= step, high[k] += step;
            float *before = toy_map(m, low, 1), *after = toy_map(m, high, 1);
            for (size_t v = 0; v < s.voxels; v++) {
                const double truth = ((double)after[v] - (double)before[v]) / (2 * step),
                             found = (double)s.jacobian[(size_t)k * s.voxels + v];
                if (fabs(found - truth) <= tolerance * (1 + fabs(truth))) continue;
                const bool jumps = t->spec.n_parts > 1 && nearest(t, low, v) != nearest(t, high, v);
                left_out += jumps;
                if (!jumps) fail_msg("voxel %zu, parameter %d: %g, not %g", v, k, found, truth);
            }
            sdm_free(before), sdm_free(after);
        }
        assert_true(left_out < s.voxels / 20 + 1);
        sdm_free(map);
        slopes_dispose(&s);
    }
}

static void jacobian_is_the_slope(void **state)
{
    (void)state;
    for (int which = 0; which < TOYS; which++)
        for (int g = 0; g < GRIDS; g++) {
            const sdm_grid grid = toy_grid(g);
            toy t = make(which, &grid);
            sdm_model *m = toy_open(&t);
            check_slopes(&t, m, TOLERANCE[which]);
            sdm_model_free(m);
            toy_dispose(&t);
        }
}

static void products_use_the_jacobian(void **state)
{
    (void)state;
    const double p[P] = {0.7, 4.4}, direction[P] = {0.6, -1.3};
    for (int which = 0; which < TOYS; which++) {
        const sdm_grid grid = toy_grid(1);
        toy t = make(which, &grid);
        sdm_model *m = toy_open(&t);
        slopes s = slopes_of(m, p);
        float *map = NULL, *tangent = NULL, *adjoint = NULL;
        void *scratch = NULL;
        assert_int_equal(SDM_ALLOC(&map, s.voxels, "map", NULL), SDM_OK);
        assert_int_equal(SDM_ALLOC(&tangent, s.voxels, "map", NULL), SDM_OK);
        assert_int_equal(SDM_ALLOC(&adjoint, s.voxels, "map", NULL), SDM_OK);
        assert_int_equal(sdm_alloc(&scratch, sdm_model_jvp_scratch_bytes(m), 1, "scratch", NULL),
                         SDM_OK);
        sdm_model_jvp(m, p, direction, map, tangent, scratch);
        sdm_free(scratch);
        assert_memory_equal(map, s.map, s.voxels * sizeof *map);
        double gradient[P], expected[P] = {0};
        for (size_t v = 0; v < s.voxels; v++) {
            double sum = 0;
            adjoint[v] = (float)sdm_rng_normal(4, 4, v);
            for (size_t k = 0; k < P; k++) {
                const double slope = (double)s.jacobian[k * s.voxels + v];
                sum += direction[k] * slope;
                expected[k] += (double)adjoint[v] * slope;
            }
            assert_true(fabs((double)tangent[v] - sum) < 1e-5 * (1 + fabs(sum)));
        }
        assert_int_equal(sdm_alloc(&scratch, sdm_model_vjp_scratch_bytes(m), 1, "scratch", NULL),
                         SDM_OK);
        sdm_model_vjp(m, p, adjoint, gradient, scratch);
        sdm_free(scratch);
        for (int k = 0; k < P; k++)
            assert_true(fabs(gradient[k] - expected[k]) < 1e-4 * (1 + fabs(expected[k])));
        sdm_free(map), sdm_free(tangent), sdm_free(adjoint);
        slopes_dispose(&s);
        sdm_model_free(m);
        toy_dispose(&t);
    }
}

/* The correction r = y . LINEAR (1 + x_0), a pod network of one block and one mode. */
static const double LINEAR[3] = {0.2, -0.1, 0.3};
enum { NODES = 9 };

static uint8_t *correction_build(const toy *t, size_t *size)
{
    enum { VOXELS = NODES * NODES * NODES };
    sdm_model_info info = t->info;
    info.params = t->params;
    info.grid = sdm_grid_centred((const int64_t[]){NODES, NODES, NODES}, 3, ORIGIN);
    float mean[VOXELS], head[3] = {0};
    uint8_t exponents[3 * P], *bytes = NULL;
    for (size_t v = 0; v < VOXELS; v++) {
        double y[3];
        voxel_world(&info.grid, v, y);
        mean[v] = (float)dot3(LINEAR, y);
    }
    sdm_poly_table(P, 1, exponents);
    for (size_t i = 1; i < 3; i++)
        if (exponents[i * P]) head[i] = (float)(1 / sqrt(3));
    sdm_pod_spec spec = {.info = &info, .type = SDM_POD_F32};
    spec.arch = (sdm_pod_arch){.n_params = P,
                               .degree = 1,
                               .input_degree = 1,
                               .width = 1,
                               .block = NODES,
                               .n_terms = 3,
                               .n_inputs = P,
                               .n_latent = 3,
                               .n_coefficients = 1,
                               .n_voxels = VOXELS,
                               .levels = sdm_pod_count(&info.grid, NODES, 1)};
    sdm_pod_block block[1];
    sdm_pod_blocks(&info.grid, NODES, &spec.arch.levels, block);
    block[0].rank = 1;
    sdm_pod_number(&spec.arch.levels, block);
    spec.blocks = block;
    spec.weights = (sdm_pod_weights){.head = head, .mean = mean, .basis = mean};
    sdm_error e = {0};
    if (sdm_pod_build(&spec, &bytes, size, &e)) fail_msg("%s", e.text);
    return bytes;
}

static void correction_is_added(void **state)
{
    (void)state;
    for (int which = 1; which <= 2; which++) {
        const sdm_grid grid = toy_grid(0);
        toy t = make(which, &grid);
        sdm_model *plain = toy_open(&t);
        size_t size;
        uint8_t *bytes = correction_build(&t, &size);
        t.spec.correction = bytes;
        t.spec.correction_size = size;
        sdm_model *m = toy_open(&t);
        assert_true(sdm_model_get_info(m)->macs > sdm_model_get_info(plain)->macs);
        const double p[P] = {1.2, 3.1};
        float *without = toy_map(plain, p, 1), *with = toy_map(m, p, 1);
        for (size_t v = 0; v < sdm_grid_count(&grid); v++) {
            double x[3], y[3];
            voxel_world(&grid, v, x);
            toy_carry_back(&t, p, 0, x, y);
            toy_unwarp(&t, p, 0, 0, y);
            for (int a = 0; a < 3; a++) y[a] = fmin(fmax(y[a], -12), 12);
            const double scaled = 2 * (p[0] - t.params[0].min) / 3 - 1,
                         truth = dot3(LINEAR, y) * (1 + scaled);
            // three voxels away from the surface warps are interpolated, by the distance
            const bool far = which == 2 && fmaxf(fabsf(with[v]), fabsf(without[v])) > 3 * 0.5f;
            if (!(fabs((double)(with[v] - without[v]) - truth) < (far ? 5e-2 : 2e-3)))
                fail_msg("voxel %zu: %g, not %g", v, (double)(with[v] - without[v]), truth);
        }
        check_slopes(&t, m, TOLERANCE[which]);
        sdm_free(with), sdm_free(without);
        sdm_model_free(m);
        sdm_model_free(plain);
        sdm_free(bytes);
        toy_dispose(&t);
    }
}

static void wrong_correction_is_refused(void **state)
{
    (void)state;
    const sdm_grid grid = toy_grid(1);
    for (int wrong = 0; wrong < 4; wrong++) {
        toy t = make(wrong == 1 ? 0 : 2, &grid);
        size_t size;
        uint8_t *bytes = correction_build(&t, &size), *file;
        t.spec.correction = bytes;
        t.spec.correction_size = size;
        if (wrong == 0) t.params[1].max += 1;           // another range
        if (wrong == 2) t.spec.correction_size -= 1000; // a part of the file
        if (wrong == 3) t.spec.correction_size = 0;     // wrong == 1: several parts
        sdm_error e = {0};
        sdm_model *m;
        size_t file_size;
        assert_int_equal(toy_build(&t, &file, &file_size, &e), SDM_OK);
        assert_int_equal(sdm_model_open_memory("wrong", file, file_size, &m, &e), SDM_E_FORMAT);
        assert_non_null(strstr(e.text, "correction"));
        assert_null(m);
        sdm_free(file);
        sdm_free(bytes);
        toy_dispose(&t);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(jacobian_is_the_slope), cmocka_unit_test(products_use_the_jacobian),
        cmocka_unit_test(correction_is_added), cmocka_unit_test(wrong_correction_is_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
