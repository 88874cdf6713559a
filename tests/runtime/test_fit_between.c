/* A table: a large plate on one thin leg. Where the plate lies between the voxels of the maps must
 * not decide how long the leg is, and the error by voxels at its edges is part of the deviation.
 * Tests: between.c map_bias.c map_fields.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "oracle/fit_tools.h"
#include "oracle/give_mesh.h"
#include "sdm/internal/rng.h"

static const sdm_param table_params[1] = {{"height", "mm", 30, 70, 50, "of the upper side"}};

// the leg ends at z = 0
static int table_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                      const double *p, sdm_mesh_out *out)
{
    sdm_mesh plate = {0}, leg = {0};
    (void)self, (void)options;
    mesh_box(&plate, (const double[3]){-30, -24, p[0] - 6}, (const double[3]){30, 24, p[0]});
    mesh_box(&leg, (const double[3]){-3, -3, 0}, (const double[3]){3, 3, p[0] - 3});
    mesh_append(&plate, &leg);
    sdm_mesh_dispose(&leg);
    return give_mesh(host, out, &plate);
}

static const sdm_shape table = {.abi = SDM_SHAPE_ABI,
                                .size = sizeof(sdm_shape),
                                .name = "table",
                                .summary = "a plate on a leg",
                                .params = table_params,
                                .n_params = 1,
                                .mesh = table_mesh};

// whether x (world) lies in the table of this height
static bool is_inside(const double to_world[9], const sdm_pose *pose, double height,
                      const double x[3])
{
    double y[3] = {0};
    for (size_t d = 0; d < 3; d++)
        for (size_t k = 0; k < 3; k++) y[d] += to_world[3 * k + d] * (x[k] - pose->translation[k]);
    const bool plate = fabs(y[0]) < 30 && fabs(y[1]) < 24 && y[2] > height - 6 && y[2] < height,
               leg = fabs(y[0]) < 3 && fabs(y[1]) < 3 && y[2] > 0 && y[2] < height;
    return plate || leg;
}

static void test_the_place_of_the_grid_does_not_count(void **state)
{
    (void)state;
    sdm_instance *shape = NULL;
    assert_int_equal(sdm_instance_create(&table, NULL, 0, NULL, &shape, NULL), SDM_OK);
    const sdm_grid g = sdm_grid_centred((int64_t[3]){44, 38, 50}, 1.7, (double[3]){0, 0, 24});
    const sdm_fit_source source = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){48, 40, 53}, 1.7, (double[3]){0, 0, 35})};
    float *v = calloc(sdm_grid_count(&g), sizeof *v);
    assert_non_null(v);
    for (int c = 0; c < 3; c++) {
        const double height = 41 + 3.7 * c;
        const sdm_pose pose = {{0.06, -0.05, 0.08}, {0.3, -0.4, 0.2 + 0.5 * c}};
        double to_world[9];
        sdm_pose_matrix(&pose, to_world);
        for (size_t n = 0; n < sdm_grid_count(&g); n++) {
            double x[3];
            sdm_grid_world(
                &g, (const double[3]){(double)(n % 44), (double)(n / 44 % 38), (double)(n / 1672)},
                x);
            v[n] = is_inside(to_world, &pose, height, x);
        }
        const sdm_fit_target t = {.kind = SDM_FIT_LABEL, .grid = g, .values = v};
        sdm_fit_opts o = sdm_fit_defaults_for(1.7);
        o.start_pose = pose;
        o.start_params = &(double){52};
        o.start_pose.translation[2] += height - 52;
        sdm_fit_result r;
        sdm_error err = {0};
        const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
        printf("height %.2f +- %.2f, true %.2f: %s\n", r.params[0], r.sd[0], height,
               s ? err.text : "accepted");
        assert_true(!s && fabs(r.params[0] - height) < 3 * r.sd[0] && r.sd[0] < 0.8);
        sdm_fit_dispose(&r);
    }
    free(v);
    sdm_instance_free(shape);
}

// share of voxel n of the grid that lies in the table, by 4 x 4 x 4 points
static double share_of(const sdm_grid *g, size_t n, const double to_world[9], const sdm_pose *pose,
                       double height)
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
    const double first[3] = {(double)(n % nx), (double)(n / nx % ny), (double)(n / (nx * ny))};
    int inside = 0;
    for (int k = 0; k < 64; k++) {
        double x[3];
        const int step[3] = {k % 4, k / 4 % 4, k / 16};
        sdm_grid_world(g,
                       (const double[3]){first[0] + (step[0] - 1.5) / 4,
                                         first[1] + (step[1] - 1.5) / 4,
                                         first[2] + (step[2] - 1.5) / 4},
                       x);
        inside += is_inside(to_world, pose, height, x);
    }
    return inside / 64.0;
}

// An image with little noise: the error of maps whose voxels are a fifth of the plate is larger
// than the noise.
static void test_errors_at_edges_are_part_of_the_deviation(void **state)
{
    (void)state;
    sdm_instance *shape = NULL;
    assert_int_equal(sdm_instance_create(&table, NULL, 0, NULL, &shape, NULL), SDM_OK);
    const sdm_grid g = sdm_grid_centred((int64_t[3]){44, 38, 44}, 2, (double[3]){0, 0, 24});
    const sdm_fit_source source = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){58, 48, 54}, 1.2, (double[3]){0, 0, 25})};
    float *v = calloc(sdm_grid_count(&g), sizeof *v);
    int accepted = 0;
    assert_non_null(v);
    for (uint64_t c = 0; c < 3; c++) {
        const double height = 41 + 3.7 * (double)c;
        const sdm_pose pose = {{0.06, -0.05, 0.08}, {0.3, -0.4, 0.2 + 0.5 * (double)c}};
        double to_world[9];
        sdm_pose_matrix(&pose, to_world);
        for (size_t n = 0; n < sdm_grid_count(&g); n++)
            v[n] = (float)(-1000 + 2500 * share_of(&g, n, to_world, &pose, height) +
                           30 * sdm_rng_normal(c, 0, n));
        const sdm_fit_target t = {.kind = SDM_FIT_IMAGE, .grid = g, .values = v};
        sdm_fit_opts o = sdm_fit_defaults_for(2);
        o.start_pose = pose;
        o.start_params = &(double){height + 1};
        o.appearance.n_outside = 1;
        o.appearance.inside[0].mean = 1500, o.appearance.inside[0].sd = 30;
        o.appearance.outside[0].mean = -1000, o.appearance.outside[0].sd = 30;
        sdm_fit_result r;
        sdm_error err = {0};
        const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
        printf("height %.3f +- %.3f, true %.2f: %s\n", r.params[0], r.sd[0], height,
               s ? err.text : "accepted");
        assert_true(s == SDM_OK || s == SDM_E_QUALITY);
        accepted += !s;
        if (!s) assert_true(fabs(r.params[0] - height) < 3 * r.sd[0]);
        sdm_fit_dispose(&r);
    }
    assert_true(accepted > 0);
    free(v);
    sdm_instance_free(shape);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_place_of_the_grid_does_not_count),
        cmocka_unit_test(test_errors_at_edges_are_part_of_the_deviation),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
