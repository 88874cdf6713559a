/* Deviations of fits to labels of a box whose faces are parallel to the voxels: the labels show
 * each face to a voxel only, however many voxels the face has. Tests: label_steps.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "oracle/fit_tools.h"

enum { EDGES = 3 };
static const sdm_param box_params[EDGES] = {{"width", "mm", 6, 14, 10, "along x"},
                                            {"depth", "mm", 6, 14, 10, "along y"},
                                            {"height", "mm", 6, 14, 10, "along z"}};

static int box_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, sdm_mesh_out *out)
{
    const double half[3] = {0.5 * p[0], 0.5 * p[1], 0.5 * p[2]};
    sdm_mesh m = {0};
    (void)self, (void)options;
    mesh_box(&m, (const double[3]){-half[0], -half[1], -half[2]}, half);
    const int failed = host->reserve(host, out, m.n_vert, m.n_tri);
    if (!failed) memcpy(out->vert, m.vert, 3 * m.n_vert * sizeof *m.vert);
    if (!failed) memcpy(out->tri, m.tri, 3 * m.n_tri * sizeof *m.tri);
    sdm_mesh_dispose(&m);
    return failed;
}

static const sdm_shape box = {.abi = SDM_SHAPE_ABI,
                              .size = sizeof(sdm_shape),
                              .name = "box",
                              .summary = "a box",
                              .params = box_params,
                              .n_params = EDGES,
                              .mesh = box_mesh};

/* Fits random boxes to their labels on a grid with voxels of 1 mm, all turned by the same rotation;
 * returns the mean square of the errors over their deviations; *widest: the largest deviation. */
static double errors_of(const double turn[3], double *widest)
{
    enum { CASES = 4 };
    sdm_instance *shape = NULL;
    double squares = 0;
    *widest = 0;
    if (sdm_instance_create(&box, NULL, 0, NULL, &shape, NULL)) abort();
    const sdm_grid g = sdm_grid_centred((int64_t[3]){26, 26, 26}, 1, (double[3]){0, 0, 0});
    const sdm_fit_source source = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){24, 24, 24}, 0.8, (double[3]){0, 0, 0})};
    for (uint64_t c = 0; c < CASES; c++) {
        double truth[EDGES];
        sdm_pose pose = {.rotation = {turn[0], turn[1], turn[2]}};
        for (size_t k = 0; k < EDGES; k++) {
            truth[k] = 8 + 4 * sdm_rng_uniform(3, k, c);
            pose.translation[k] = sdm_rng_uniform(3, 3 + k, c) - 0.5;
        }
        double to_world[9];
        sdm_pose_matrix(&pose, to_world);
        float *v = calloc(sdm_grid_count(&g), sizeof *v);
        if (!v) abort();
        for (size_t n = 0; n < sdm_grid_count(&g); n++) {
            double x[3], index[3] = {(double)(n % 26), (double)(n / 26 % 26), (double)(n / 676)};
            bool inside = true;
            sdm_grid_world(&g, index, x);
            for (size_t d = 0; d < 3; d++) {
                double y = 0;
                for (size_t k = 0; k < 3; k++)
                    y += to_world[3 * k + d] * (x[k] - pose.translation[k]);
                inside = inside && fabs(y) < 0.5 * truth[d];
            }
            v[n] = inside;
        }
        const sdm_fit_target t = {.kind = SDM_FIT_LABEL, .grid = g, .values = v};
        sdm_fit_opts o = sdm_fit_defaults_for(1);
        sdm_fit_result r;
        sdm_error err = {0};
        o.start_pose = pose;
        o.polish_eps = 1e-4;
        const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
        if (s && s != SDM_E_QUALITY) fail_msg("case %d: %s", (int)c, err.text);
        for (size_t k = 0; k < EDGES; k++) {
            const double error = (r.params[k] - truth[k]) / r.sd[k];
            squares += error * error / (EDGES * CASES);
            *widest = fmax(*widest, r.sd[k]);
            if (!(fabs(error) < 4))
                fail_msg("case %d, %s: %g, %g deviations off", (int)c, box_params[k].name,
                         r.params[k], error);
        }
        sdm_fit_dispose(&r);
        free(v);
    }
    sdm_instance_free(shape);
    return squares;
}

static void test_faces_parallel_to_the_voxels(void **state)
{
    (void)state;
    double widest;
    // the mean of twelve squares of standard normal numbers exceeds 2.8 once in a thousand cases
    assert_true(errors_of((double[3]){0, 0, 0}, &widest) < 2.8);
    // both faces are off by sqrt(1/12) mm (rms)
    assert_true(widest > 0.3 && widest < 0.6);
}

/* Oblique faces: the steps average out, and the deviations stay small. */
static void test_oblique_faces(void **state)
{
    (void)state;
    double widest;
    assert_true(errors_of((double[3]){0.3, 0.25, 0.35}, &widest) < 2.8);
    assert_true(widest < 0.2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_faces_parallel_to_the_voxels),
                                       cmocka_unit_test(test_oblique_faces)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
