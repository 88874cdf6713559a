/* Point networks in the trainer: backward pass and losses against central differences, and the
 * model file against the trainer's forward pass.
 * Tests: activation.c loss.c point_build.c point_draw.c point_mlp.c point_open.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "direct/point_draw.h"
#include "direct/point_mlp.h"
#include "numerics/loss.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"

enum { P = 2, U = P + 3, BATCH = 70 };

static sdm_point_arch arch_of(int activation, bool tanh_output)
{
    return (sdm_point_arch){.n_params = P,
                            .depth = 3,
                            .width = {11, 9, 7},
                            .skip = 1u << 1 | 1u << 2,
                            .activation = activation,
                            .tanh_output = tanh_output,
                            .centre = {1, 2, 3},
                            .radius = 0.8,
                            .scale = 2.5};
}

static void random_fill(float *x, size_t n, uint64_t stream, double size)
{
    for (size_t i = 0; i < n; i++) x[i] = (float)(size * sdm_rng_normal(5, stream, i));
}

// A loss that is linear in the values, so that only the network is nonlinear.
static double loss(const sdm_point_arch *a, const float *w, const float *u, const float *slope,
                   float *workspace)
{
    float value[BATCH];
    double sum = 0;
    const point_pass p = {a, w, BATCH, u, workspace, NULL, 1};
    assert_int_equal(trainer_point_forward(&p, value, NULL), 0);
    for (int i = 0; i < BATCH; i++) sum += (double)slope[i] * value[i];
    return sum;
}

static void gradient_matches_differences(void **state)
{
    (void)state;
    // SiLU and tanh only: the derivative of ReLU jumps at its kinks.
    for (int mode = 0; mode < 4; mode++) {
        const sdm_point_arch a = arch_of(mode / 2, mode & 1);
        const size_t n = sdm_point_count(&a);
        assert_int_equal(n, 11 * (U + 1) + 9 * (11 + U + 1) + 7 * (9 + U + 1) + 7 + 1);
        float *w, *gradient, *workspace, u[BATCH * U], value[BATCH], slope[BATCH];
        assert_int_equal(SDM_ALLOC(&w, n, "w", NULL), 0);
        assert_int_equal(SDM_ALLOC(&gradient, n, "g", NULL), 0);
        assert_int_equal(SDM_ALLOC(&workspace, trainer_point_workspace(&a, BATCH), "ws", NULL), 0);
        trainer_point_init(&a, 3, w);
        random_fill(u, BATCH * U, 1, 1);
        random_fill(slope, BATCH, 2, 0.1);
        point_pass p = {&a, w, BATCH, u, workspace, NULL, 1};
        assert_int_equal(trainer_point_forward(&p, value, NULL), 0);
        assert_int_equal(trainer_point_backward(&p, slope, gradient, NULL), 0);
        double size = 0;
        for (size_t i = 0; i < n; i++) size = fmax(size, fabs((double)gradient[i]));
        for (size_t i = 0; i < n; i++) {
            const float keep = w[i], h = 4e-3f;
            w[i] = keep + h;
            const double up = loss(&a, w, u, slope, workspace);
            w[i] = keep - h;
            const double down = loss(&a, w, u, slope, workspace);
            w[i] = keep;
            assert_true(fabs((up - down) / (2 * (double)h) - (double)gradient[i]) < 2e-3 * size);
        }
        // A second call adds to the gradient; any number of threads gives the same bits.
        float *twice;
        assert_int_equal(SDM_ALLOC(&twice, 2 * n, "g", NULL), 0);
        for (int threads = 2; threads <= 3; threads++) {
            memset(twice, 0, 2 * n * sizeof *twice);
            p.n_threads = threads;
            assert_int_equal(trainer_point_forward(&p, value, NULL), 0);
            assert_int_equal(trainer_point_backward(&p, slope, twice, NULL), 0);
            assert_memory_equal(twice, gradient, n * sizeof *twice);
        }
        p.n_threads = 1;
        assert_int_equal(trainer_point_forward(&p, value, NULL), 0);
        assert_int_equal(trainer_point_backward(&p, slope, twice, NULL), 0);
        for (size_t i = 0; i < n; i++)
            assert_true(fabs((double)twice[i] - 2 * (double)gradient[i]) < 1e-5 * size);
        sdm_free(twice);
        sdm_free(w);
        sdm_free(gradient);
        sdm_free(workspace);
    }
}

// Each loss by its formula.
static double loss_of(const sdm_config *c, double predicted, double target)
{
    const double weight = fabs(target) < c->train.near_mm ? 1 + c->train.near_weight : 1,
                 e = predicted - target;
    const double most = c->train.clamp_mm, t = fmax(-most, fmin(most, target));
    // Within the clamp nothing changes. Where the target is at the clamp, a prediction beyond it
    // costs nothing.
    const double p = fabs(t) < most ? predicted
                     : t > 0        ? fmin(most, predicted)
                                    : fmax(-most, predicted);
    switch (c->train.loss) {
    case SDM_LOSS_L1:
        return weight * fabs(e);
    case SDM_LOSS_HUBER:
        return weight * (fabs(e) < 0.01 ? 0.5 * e * e / 0.01 : fabs(e) - 0.005);
    case SDM_LOSS_CLAMPED_L1:
        return weight * fabs(p - t);
    case SDM_LOSS_MSE:
        break;
    }
    return weight * e * e;
}

static void loss_slopes_match_differences(void **state)
{
    (void)state;
    static sdm_config c;
    c.train.near_weight = 3, c.train.near_mm = 0.2, c.train.clamp_mm = 0.3;
    for (int kind = 0; kind < 4; kind++) {
        c.train.loss = (sdm_loss)kind;
        double square = 0, squares = 0;
        for (uint64_t i = 0; i < 2000; i++) {
            const float target = (float)(0.5 * sdm_rng_normal(1, 7, i));
            const float predicted =
                target + (float)((i % 10 ? 0.02 : 0.5) * sdm_rng_normal(1, 8, i));
            const double h = 1e-7, slope = (loss_of(&c, (double)predicted + h, (double)target) -
                                            loss_of(&c, (double)predicted - h, (double)target)) /
                                           (2 * h);
            assert_true(fabs(slope - (double)trainer_loss_slope(&c, predicted, target, &square)) <
                        1e-4 * (1 + fabs(slope)));
            const double weight = fabsf(target) < 0.2f ? 4 : 1;
            assert_true(fabs(slope / weight - (double)trainer_loss_slope_drawn(
                                                  &c, predicted, target, &squares)) < 1e-4);
        }
        // sum of 200 squares with mean 0.5^2
        assert_true(square > 40 && square < 60 && square == squares);
    }
}

static void loss_slopes_of_a_row_match_those_of_its_voxels(void **state)
{
    (void)state;
    enum { N = 21 };
    static sdm_config c;
    float predicted[N], target[N], slope[N];
    for (uint64_t i = 0; i < N; i++) {
        predicted[i] = (float)sdm_rng_normal(1, 9, i);
        target[i] = (float)sdm_rng_normal(1, 10, i);
    }
    c.train.near_mm = 0.5, c.train.clamp_mm = 0.3;
    for (int kind = 0; kind < 8; kind++) {
        c.train.loss = (sdm_loss)(kind % 4), c.train.near_weight = kind / 4;
        for (size_t n = 0; n <= N; n++) {
            double square = 0;
            memcpy(slope, target, sizeof slope);
            const double sum = trainer_loss_slopes(&c, n, predicted, slope, slope);
            for (size_t i = 0; i < n; i++)
                assert_true(slope[i] == trainer_loss_slope(&c, predicted[i], target[i], &square));
            assert_true(fabs(sum - square) <= 1e-12 * square);
            for (size_t i = n; i < N; i++) assert_true(slope[i] == target[i]);
        }
    }
}

static double eikonal_of(const sdm_config *c, const double f[4])
{
    double square = 0;
    for (int i = 0; i < 3; i++) square += pow((f[1 + i] - f[0]) / c->grid.spacing[i], 2);
    return c->train.eikonal * pow(sqrt(square) - 1, 2);
}

static void eikonal_slopes_match_differences(void **state)
{
    (void)state;
    static sdm_config c;
    c.train.eikonal = 0.7;
    c.grid = sdm_grid_centred((const int64_t[]){4, 3, 5}, 0.5, (const double[]){0, 0, 0});
    c.grid.spacing[1] = 0.25;
    for (uint64_t trial = 0; trial < 20; trial++) {
        float f[4], slope[4] = {1, 1, 1, 1};
        random_fill(f, 4, 20 + trial, 0.4);
        double g[4] = {(double)f[0], (double)f[1], (double)f[2], (double)f[3]};
        assert_true(fabs(trainer_loss_eikonal(&c, f, 0.5f, slope) - eikonal_of(&c, g)) < 1e-6);
        for (int i = 0; i < 4; i++) {
            const double h = 1e-6, keep = g[i];
            g[i] = keep + h;
            const double up = eikonal_of(&c, g);
            g[i] = keep - h;
            const double down = eikonal_of(&c, g);
            g[i] = keep;
            assert_true(fabs(1 + 0.5 * (up - down) / (2 * h) - (double)slope[i]) <
                        1e-4 * (1 + fabs((double)slope[i])));
        }
    }
    // A slope of 1 has no eikonal loss; a constant map has the loss 0.7 but no gradient, for lack
    // of a direction.
    const float exact[4] = {0, 0.5f, 0, 0}, flat[4] = {1, 1, 1, 1};
    float none[4] = {0};
    assert_true(trainer_loss_eikonal(&c, exact, 1, none) == 0 &&
                fabs(trainer_loss_eikonal(&c, flat, 1, none) - 0.7) < 1e-12);
    for (int i = 0; i < 4; i++) assert_true(none[i] == 0);
}

// Mean over a map of the loss and the eikonal loss.
static double map_loss(const sdm_config *c, const float *f, const float *target)
{
    const size_t nx = 4, ny = 3, nz = 5;
    double sum = 0, bend = 0;
    for (size_t v = 0; v < nx * ny * nz; v++) sum += loss_of(c, (double)f[v], (double)target[v]);
    for (size_t z = 0; z + 1 < nz; z++)
        for (size_t y = 0; y + 1 < ny; y++)
            for (size_t x = 0; x + 1 < nx; x++) {
                const size_t v = (z * ny + y) * nx + x;
                bend += eikonal_of(c, (const double[4]){(double)f[v], (double)f[v + 1],
                                                        (double)f[v + nx], (double)f[v + nx * ny]});
            }
    return sum / 60 + bend / (3 * 2 * 4);
}

static void map_gradient_matches_differences(void **state)
{
    (void)state;
    static sdm_config c;
    c.grid = sdm_grid_centred((const int64_t[]){4, 3, 5}, 0.5, (const double[]){0, 0, 0});
    c.train.near_mm = 0.4, c.train.near_weight = 2;
    for (int with = 0; with < 2; with++) {
        c.train.eikonal = 0.3 * with;
        float f[60], target[60], slope[60];
        random_fill(f, 60, 31, 1), random_fill(target, 60, 32, 1);
        double square = 0;
        for (int v = 0; v < 60; v++)
            square += ((double)f[v] - (double)target[v]) * ((double)f[v] - (double)target[v]);
        assert_true(fabs(trainer_loss_map(&c, f, target, slope) / square - 1) < 1e-6);
        for (int v = 0; v < 60; v++) {
            const float keep = f[v], h = 1.0f / 1024;
            f[v] = keep + h;
            const double up = map_loss(&c, f, target);
            f[v] = keep - h;
            const double down = map_loss(&c, f, target);
            f[v] = keep;
            assert_true(fabs((up - down) / (2 * (double)h) - (double)slope[v]) < 1e-3);
        }
    }
}

// Voxels near the surface are drawn more often by the configured weight; each index lies in the
// map.
static void draws_have_the_right_shares(void **state)
{
    (void)state;
    enum { VOXELS = 60, DRAWN = 20000 };
    static sdm_config c;
    int16_t maps[2 * VOXELS];
    float scale[2] = {0.5f, 0.001f};
    dataset d = {.n_voxels = VOXELS, .maps = maps, .scale = scale};
    // a tenth of the voxels is near
    for (int v = 0; v < 2 * VOXELS; v++)
        maps[v] = (int16_t)(v % VOXELS < 6 ? (v & 1 ? -1 : 1) : 1000);
    c.train.near_mm = 0.6;
    c.seed = 9;
    for (int weight = 0; weight < 10; weight += 9) {
        size_t count[VOXELS] = {0}, near = 0;
        c.train.near_weight = weight;
        for (uint64_t i = 0; i < DRAWN; i++) count[trainer_point_draw(&c, &d, 0, i)]++;
        for (int v = 0; v < VOXELS; v++) {
            const double wanted =
                (double)DRAWN * (v < 6 ? 1 + weight : 1) / (6 * (1 + weight) + VOXELS - 6);
            assert_true(fabs((double)count[v] - wanted) < 6 * sqrt(wanted));
            near += v < 6 ? count[v] : 0;
        }
        assert_true(near > 0);
    }
    // A map in which no voxel is near.
    c.train.near_mm = 1e-6;
    for (uint64_t i = 0; i < 100; i++) assert_true(trainer_point_draw(&c, &d, 1, i) < VOXELS);

    const sdm_grid g = {.n = {3, 4, 5}};
    for (size_t v = 0; v < VOXELS; v++) {
        const size_t w = trainer_point_with_neighbours(&g, v), x = v % 3, y = v / 3 % 4, z = v / 12;
        assert_int_equal(w, (z < 3 ? z : 3) * 12 + (y < 2 ? y : 2) * 3 + (x < 1 ? x : 1));
    }
}

static void file_equals_the_trained_network(void **state)
{
    (void)state;
    sdm_model_param params[P] = {{.name = "a", .unit = "mm", .min = -1, .max = 1},
                                 {.name = "b", .unit = "mm", .min = 2, .max = 5, .def = 3}};
    sdm_model_info info = {
        .n_params = P,
        .params = params,
        .shape = "toy",
        .grid = sdm_grid_centred((const int64_t[]){5, 4, 3}, 0.3, (const double[]){1, 2, 3}),
        .config = ""};
    for (int activation = 0; activation < 4; activation++) {
        sdm_point_spec spec = {
            .info = &info, .kind = "imnet", .arch = arch_of(activation, activation & 1)};
        const size_t n = sdm_point_count(&spec.arch);
        float *w, *workspace, u[60 * U], value[60], map[60];
        assert_int_equal(SDM_ALLOC(&w, n, "w", NULL), 0);
        assert_int_equal(SDM_ALLOC(&workspace, trainer_point_workspace(&spec.arch, 60), "ws", NULL),
                         0);
        trainer_point_init(&spec.arch, 3, w);
        // makes biases nonzero too
        for (size_t i = 0; i < n; i++) w[i] += (float)(0.1 * sdm_rng_normal(2, 9, i));
        spec.weights = w;
        uint8_t *bytes;
        size_t size;
        sdm_model *m;
        void *scratch;
        assert_int_equal(sdm_point_build(&spec, &bytes, &size, NULL), 0);
        assert_int_equal(sdm_model_open_memory("toy", bytes, size, &m, NULL), 0);
        assert_int_equal(sdm_alloc(&scratch, sdm_model_scratch_bytes(m, 1), 1, "scratch", NULL), 0);
        const double p[P] = {0.4, 2.5};
        for (size_t v = 0; v < 60; v++) {
            const double index[3] = {(double)(v % 5), (double)(v / 5 % 4), (double)(v / 20)};
            u[v * U] = 0.4f, u[v * U + 1] = (float)(2 * 0.5 / 3 - 1);
            for (int i = 0; i < 3; i++)
                u[v * U + 2 + (size_t)i] =
                    (float)((info.grid.origin[i] + 0.3 * index[i] - spec.arch.centre[i]) /
                            spec.arch.radius);
        }
        sdm_model_forward(m, p, 1, map, scratch);
        const point_pass pass = {&spec.arch, w, 60, u, workspace, NULL, 1};
        assert_int_equal(trainer_point_forward(&pass, value, NULL), 0);
        for (int v = 0; v < 60; v++) assert_true(fabsf(map[v] - value[v]) < 1e-5f * 2.5f);
        sdm_model_free(m);
        sdm_free(scratch);
        sdm_free(bytes);
        sdm_free(workspace);
        sdm_free(w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gradient_matches_differences),
        cmocka_unit_test(loss_slopes_match_differences),
        cmocka_unit_test(loss_slopes_of_a_row_match_those_of_its_voxels),
        cmocka_unit_test(eikonal_slopes_match_differences),
        cmocka_unit_test(map_gradient_matches_differences),
        cmocka_unit_test(draws_have_the_right_shares),
        cmocka_unit_test(file_equals_the_trained_network)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
