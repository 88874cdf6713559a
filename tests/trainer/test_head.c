/* The head of a pod network: least squares with a ridge towards a prior, and its choice where maps
 * are few. Tests: head.c head_choice.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "pod/head.h"
#include "pod/mlp.h"
#include "sdm/internal/rng.h"
#include "train_tools.h"

enum { K = 5, F = 3, W = 4, L = F + W, R = 2, MAPS = 40 };

static float number(uint64_t stream, size_t i) { return (float)sdm_rng_normal(3, stream, i); }

// A state with random modes, polynomials and readout.
static pod_state state_of(trainer *t, float modes[R * K], float poly[R * F], float *weights)
{
    *t = (trainer){.n_threads = 1};
    pod_state pod = {.t = t,
                     .n_modes = R,
                     .modes = modes,
                     .poly = poly,
                     .target_scale = 0.5f,
                     .arch = {.n_params = 1,
                              .n_terms = F,
                              .n_inputs = F - 1,
                              .depth = 1,
                              .width = W,
                              .n_latent = L,
                              .n_coefficients = K}};
    pod.mode_fit.average = weights;
    for (size_t i = 0; i < R * K; i++) modes[i] = number(1, i);
    for (size_t i = 0; i < R * F; i++) poly[i] = number(2, i);
    for (size_t i = 0; i < trainer_mlp_count(&pod.arch) + R * W; i++) weights[i] = number(4, i);
    return pod;
}

// The head of the modes gives the same coefficients as amplitudes of modes, one after the other.
static void head_of_modes(void **state)
{
    (void)state;
    trainer t;
    float modes[R * K], poly[R * F], weights[200], head[K * L];
    const pod_state pod = state_of(&t, modes, poly, weights);
    const float *readout = weights + trainer_mlp_count(&pod.arch);
    assert_true(trainer_mlp_count(&pod.arch) + R * W <= 200);
    assert_int_equal(trainer_head_of_modes(&pod, head, NULL), SDM_OK);
    float z[L];
    for (size_t i = 0; i < L; i++) z[i] = number(5, i);
    for (size_t k = 0; k < K; k++) {
        double direct = 0, by_head = 0;
        for (size_t r = 0; r < R; r++) {
            double amplitude = 0;
            for (size_t i = 0; i < F; i++) amplitude += (double)poly[r * F + i] * z[i];
            for (size_t i = 0; i < W; i++) amplitude += 0.5 * readout[r * W + i] * z[F + i];
            direct += amplitude * modes[r * K + k];
        }
        for (size_t i = 0; i < L; i++) by_head += (double)head[k * L + i] * z[i];
        assert_true(fabs(direct - by_head) < 1e-5);
    }
}

// The gradient of the sum of squares and the ridge, from the maps themselves, vanishes.
static void solution_is_stationary(void **state)
{
    (void)state;
    trainer t;
    float modes[R * K], poly[R * F], weights[200], z[MAPS * L], y[MAPS * K], prior[K * L];
    const pod_state pod = state_of(&t, modes, poly, weights);
    float gram[L * L] = {0}, right[L * K] = {0}, head[K * L];
    for (size_t i = 0; i < MAPS * L; i++) z[i] = number(6, i);
    for (size_t i = 0; i < MAPS * K; i++) y[i] = number(7, i);
    for (size_t i = 0; i < K * L; i++) prior[i] = number(8, i);
    for (size_t n = 0; n < MAPS; n++)
        for (size_t i = 0; i < L; i++) {
            for (size_t j = 0; j < L; j++) gram[i * L + j] += z[n * L + i] * z[n * L + j];
            for (size_t k = 0; k < K; k++) right[i * K + k] += z[n * L + i] * y[n * K + k];
        }
    const head_equations e = {.maps = MAPS, .gram = gram, .right = right};
    static const double ridges[] = {1e-6, 0.1, 10};
    for (size_t q = 0; q < 6; q++) {
        const double ridge = ridges[q % 3];
        const float *towards = q < 3 ? NULL : prior;
        assert_int_equal(trainer_head_solve(&pod, &e, ridge, towards, head, NULL), SDM_OK);
        for (size_t k = 0; k < K; k++)
            for (size_t i = 0; i < L; i++) {
                double g = ridge * MAPS *
                           ((double)head[k * L + i] - (towards ? (double)towards[k * L + i] : 0));
                for (size_t n = 0; n < MAPS; n++) {
                    double r = -(double)y[n * K + k];
                    for (size_t j = 0; j < L; j++) r += (double)head[k * L + j] * z[n * L + j];
                    g += r * z[n * L + i];
                }
                assert_true(fabs(g) < 1e-3 * (1 + ridge));
            }
    }
}

// Held-out error in the last line of metrics.jsonl with this phase.
static double error_in(const char *phase)
{
    char line[512], start[64];
    double error = -1;
    FILE *f = fopen(in_folder("metrics.jsonl"), "r");
    assert_non_null(f);
    snprintf(start, sizeof start, "{\"phase\": \"%s\"", phase);
    while (fgets(line, sizeof line, f)) {
        const char *at = strstr(line, "\"heldout_mse_mm2\": ");
        if (at && !strncmp(line, start, strlen(start))) sscanf(at + 19, "%lf", &error);
    }
    fclose(f);
    assert_true(error > 0);
    return error;
}

// 70 maps and 83 latent variables: the head is no worse than the mode fit before it.
static void few_maps_keep_the_fit(void **state)
{
    (void)state;
    static const char text[] = "shape: {name: capsule}\n"
                               "grid: {size: [20, 18, 16], spacing: 0.8}\n"
                               "network: {kind: pod, depth: 3, width: 64, rank: 6, block: 8,\n"
                               "  modes: 32, degree: 4, input_degree: 3}\n"
                               "data: {static: 0, static_share: 0, start: 70, online: 0,\n"
                               "  holdout: 60}\n"
                               "train: {steps: 500, batch: 32, refine: 0, patience: 0}\n";
    sdm_config c;
    sdm_error e = {0};
    sdm_train_report r;
    if (sdm_config_parse("test.yaml", text, sizeof text - 1, NULL, 0, &c, &e))
        fail_msg("%s", e.text);
    if (sdm_train(&c, capsule, folder, false, NULL, &r, &e)) fail_msg("%s", e.text);
    assert_true(error_in("refine") < 1.02 * error_in("fit"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(head_of_modes),
                                       cmocka_unit_test(solution_is_stationary),
                                       cmocka_unit_test(few_maps_keep_the_fit)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
