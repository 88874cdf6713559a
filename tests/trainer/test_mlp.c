/* Backward pass of the multilayer perceptron against central differences of its forward pass;
 * optimiser, average and learning rate schedule against their formulas; the same bits for any
 * number of threads.
 * Tests: mlp.c optimiser.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "numerics/optimiser.h"
#include "pod/mlp.h"
#include "sdm/internal/checksum.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/team.h"
#include "sdm/memory.h"

enum { BATCH = 5, INPUTS = 7, WIDTH = 9, DEPTH = 3 };

// Loss: weighted sum of the last layer's output, with weights dh.
static double loss(const sdm_pod_arch *a, const float *w, const float *x, const float *dh,
                   float *workspace)
{
    const float *h = trainer_mlp_forward(a, w, BATCH, x, workspace, 1);
    double s = 0;
    for (int i = 0; i < BATCH * WIDTH; i++) s += (double)dh[i] * h[i];
    return s;
}

static void gradient_matches_differences(void **state)
{
    (void)state;
    for (int activation = 0; activation < 2; activation++) {
        const sdm_pod_arch a = {
            .depth = DEPTH, .width = WIDTH, .n_inputs = INPUTS, .activation = activation};
        const size_t n = trainer_mlp_count(&a);
        assert_int_equal(n, WIDTH * (INPUTS + 1) + 2 * WIDTH * (WIDTH + 1));
        float *w, *g, *workspace, x[BATCH * INPUTS], dh[BATCH * WIDTH];
        assert_int_equal(SDM_ALLOC(&w, n, "w", NULL), 0);
        assert_int_equal(SDM_ALLOC(&g, n, "g", NULL), 0);
        assert_int_equal(SDM_ALLOC(&workspace, trainer_mlp_workspace(&a, BATCH), "ws", NULL), 0);
        trainer_mlp_init(&a, 3, w);
        for (size_t i = 0; i < BATCH * INPUTS; i++) x[i] = (float)sdm_rng_normal(1, 1, i);
        for (size_t i = 0; i < BATCH * WIDTH; i++) dh[i] = (float)sdm_rng_normal(1, 2, i);
        trainer_mlp_forward(&a, w, BATCH, x, workspace, 1);
        trainer_mlp_backward(&a, w, BATCH, x, workspace, dh, g, 1);
        double size = 0;
        for (size_t i = 0; i < n; i++) size = fmax(size, fabs((double)g[i]));
        for (size_t i = 0; i < n; i++) {
            const float keep = w[i], h = 4e-3f;
            w[i] = keep + h;
            const double up = loss(&a, w, x, dh, workspace);
            w[i] = keep - h;
            const double down = loss(&a, w, x, dh, workspace);
            w[i] = keep;
            assert_true(fabs((up - down) / (2 * (double)h) - (double)g[i]) < 2e-3 * size);
        }
        sdm_free(w);
        sdm_free(g);
        sdm_free(workspace);
    }
}

// Two steps of Adam with their average on a network wider than the slices of all loops.
static uint64_t train_with(int n_threads)
{
    enum { ROWS = 70, IN = 9, OUT = 200, LAYERS = 3 };
    const sdm_pod_arch a = {.depth = LAYERS, .width = OUT, .n_inputs = IN, .activation = 0};
    static float x[ROWS * IN], dh[ROWS * OUT];
    parameters p;
    sdm_team *team;
    float *g, *workspace;
    assert_int_equal(sdm_team_start(n_threads, &team, NULL), SDM_OK);
    assert_int_equal(trainer_parameters_create(&p, trainer_mlp_count(&a), NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&g, p.n, "g", NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&workspace, trainer_mlp_workspace(&a, ROWS), "ws", NULL), SDM_OK);
    trainer_mlp_init(&a, 3, p.w);
    for (size_t i = 0; i < ROWS * IN; i++) x[i] = (float)sdm_rng_normal(1, 1, i);
    for (int step = 1; step <= 2; step++) {
        const float *h = trainer_mlp_forward(&a, p.w, ROWS, x, workspace, n_threads);
        memcpy(dh, h, sizeof dh); // gradient of the sum of squares
        trainer_mlp_backward(&a, p.w, ROWS, x, workspace, dh, g, n_threads);
        trainer_adam_update_all(&p, g, trainer_adam_begin(0.01, 0.99, step), n_threads);
        trainer_average_follow(&p, 0.9, step, step == 2, n_threads);
    }
    const uint64_t sum =
        sdm_crc64(sdm_crc64(0, p.w, p.n * sizeof *p.w), p.average, p.n * sizeof *p.average);
    assert_memory_not_equal(p.w, p.average, p.n * sizeof *p.w);
    trainer_parameters_dispose(&p);
    sdm_free(workspace);
    sdm_free(g);
    sdm_team_end(team);
    return sum;
}

static void same_bits_for_threads(void **state)
{
    (void)state;
    const uint64_t alone = train_with(1);
    assert_true(train_with(2) == alone);
    assert_true(train_with(3) == alone);
    assert_true(train_with(8) == alone);
}

static void average_moves_every_eighth_step(void **state)
{
    (void)state;
    parameters p;
    assert_int_equal(trainer_parameters_create(&p, 1, NULL), SDM_OK);
    p.w[0] = 1;
    for (int step = 1; step < 8; step++) {
        trainer_average_follow(&p, 0.9, step, false, 1);
        assert_true(p.average[0] == 0);
    }
    trainer_average_follow(&p, 0.9, 8, false, 1); // decay 1 / 11, below 0.9^8
    assert_true(fabs(p.average[0] - 10.0 / 11) < 1e-6);
    p.average[0] = 0;
    trainer_average_follow(&p, 0.9, 8000, false, 1);
    assert_true(fabs(p.average[0] - (1 - pow(0.9, 8))) < 1e-6);
    trainer_average_follow(&p, 0, 8001, true, 1); // a copy
    assert_true(p.average[0] == 1);
    trainer_parameters_dispose(&p);
}

static void adam_takes_the_right_steps(void **state)
{
    (void)state;
    // The first step changes each weight by the learning rate, against the sign of its gradient,
    // whatever the gradient's size.
    parameters p;
    assert_int_equal(trainer_parameters_create(&p, 3, NULL), 0);
    const float g[3] = {1e-3f, -40, 0};
    trainer_adam_update(&p, 0, 3, g, trainer_adam_begin(0.01, 0.999, 1), 2);
    assert_true(fabs((double)p.w[0] + 0.02) < 1e-6 && fabs((double)p.w[1] - 0.02) < 1e-6 &&
                p.w[2] == 0);
    // Minimises a quadratic function.
    for (int t = 2; t < 2000; t++) {
        const float slope[3] = {2 * (p.w[0] - 1), 20 * (p.w[1] + 2), p.w[2]};
        trainer_adam_update(&p, 0, 3, slope, trainer_adam_begin(0.01, 0.999, t), 1);
        trainer_average_update(&p, 0.99, 1);
    }
    assert_true(fabs((double)p.w[0] - 1) < 1e-3 && fabs((double)p.w[1] + 2) < 1e-3);
    assert_true(fabs((double)p.average[0] - 1) < 1e-2);
    trainer_parameters_dispose(&p);

    assert_true(trainer_rate_schedule(0, 0.1) == 0 &&
                fabs(trainer_rate_schedule(0.05, 0.1) - 0.5) < 1e-12 &&
                fabs(trainer_rate_schedule(0.1, 0.1) - 1) < 1e-12);
    assert_true(fabs(trainer_rate_schedule(0.55, 0.1) - 0.5) < 1e-12 &&
                trainer_rate_schedule(1, 0.1) < 1e-12 && trainer_rate_schedule(2, 0) < 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(gradient_matches_differences),
                                       cmocka_unit_test(same_bits_for_threads),
                                       cmocka_unit_test(average_moves_every_eighth_step),
                                       cmocka_unit_test(adam_takes_the_right_steps)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
