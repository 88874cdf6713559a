/* Measurements of a training beside distances: volumes of maps and inside surfaces, derivatives by
 * the parameters. Tests: surface_check.c derivative_check.c
 * volume_check.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../shape/faulty_shape.h"
#include "capsule_training.h"
#include "data/surface_check.h"
#include "sdm/map.h"
#include "sdm/memory.h"
#include "sdm/model.h"
#include "state/derivative_check.h"
#include "state/volume_check.h"

/* A sphere with the given radius on a grid with the given spacing around it, and, unless it is 0,
 * another sphere on the same grid. */
static surface_check check_sphere(double radius, double spacing, double other)
{
    sdm_instance *sphere;
    sdm_error e = {0};
    const sdm_named_text fine[] = {{"edge", "0.1"}};
    if (sdm_instance_create(sdm_registry_find(registry, "ellipsoid", NULL), fine, 1, NULL, &sphere,
                            &e))
        fail_msg("%s", e.text);
    double p[6] = {radius, radius, radius, other, other, other};
    const int64_t n = (int64_t)ceil(2 * radius / spacing) + 6;
    const double first = -0.5 * spacing * (double)(n - 1) + 0.13 * spacing;
    const sdm_grid grid = {.n = {n, n, n},
                           .spacing = {spacing, spacing, spacing},
                           .origin = {first, first, first},
                           .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    const dataset d = {.shape = sphere,
                       .grid = &grid,
                       .n_params = 3,
                       .seed = 5,
                       .n_holdout = other > 0 ? 2 : 1,
                       .holdout_params = p};
    surface_check check[2];
    for (int threads = 1; threads <= 2; threads++)
        if (trainer_surface_check(&d, threads, &check[threads - 1], &e)) fail_msg("%s", e.text);
    assert_memory_equal(&check[0], &check[1], sizeof *check);
    sdm_instance_free(sphere);
    return check[0];
}

// Trilinear interpolation overestimates a distance on average by spacing^2 / 12 times the sum of
// its second derivatives, which is 2 / radius for a sphere.
static void surface_of_a_sphere(void **state)
{
    (void)state;
    const surface_check large = check_sphere(3, 0.5, 0);
    const double mean = 0.5 * 0.5 / (6 * 3);
    assert_true(large.rms_mm > mean && large.rms_mm < 1.3 * mean);
    assert_true(large.thin == 0);
    // a ball of one voxel does not fit into a sphere of 0.8 voxels
    const surface_check small = check_sphere(1, 1.25, 0);
    assert_true(small.thin == 1 && small.rms_mm > 0.1);
    // the margin of the grid is between 2.5 and 3.5 voxels
    assert_true(large.cut == 0 && small.cut == 0);
    assert_true(check_sphere(3, 0.5, 3.2).cut == 0 && check_sphere(2, 0.5, 3.9).cut == 0.5);
}

// Largest relative error of the volumes of the model's maps of capsules, which have a formula.
static double volume_error_of(const char *path)
{
    sdm_model *m;
    if (sdm_model_open(path, &m, NULL)) fail_msg("%s", path);
    const sdm_model_info *info = sdm_model_get_info(m);
    const sdm_model_param *param = info->params;
    float *map = calloc(sdm_grid_count(&info->grid), sizeof *map);
    void *scratch = NULL;
    if (!map || sdm_alloc(&scratch, sdm_model_scratch_bytes(m, 1), 1, "test", NULL)) abort();
    assert_int_equal(info->n_params, 2);
    double largest = 0;
    for (int i = 0; i < 9; i++) {
        // capsules of a radius of three voxels and more that lie within the grid
        const double share[2] = {0.4 + 0.1 * (i % 3), 0.1 + 0.2 * (i / 3)};
        double p[2], volume;
        for (int k = 0; k < 2; k++) p[k] = param[k].min + share[k] * (param[k].max - param[k].min);
        const double length = p[sdm_model_param_index(m, "length")],
                     radius = p[sdm_model_param_index(m, "radius")],
                     exact = acos(-1) * radius * radius * (length + 4 * radius / 3);
        sdm_model_forward(m, p, 1, map, scratch);
        assert_int_equal(sdm_map_volume(&info->grid, map, 1, &volume, NULL), SDM_OK);
        largest = fmax(largest, fabs(volume / exact - 1));
    }
    sdm_free(scratch);
    free(map);
    sdm_model_free(m);
    return largest;
}

// Largest error, over its root mean square, of a derivative of the volume of the model's maps of
// capsules, by differences; the formulas are those of a cylinder and a ball.
static double volume_slope_error_of(const char *path)
{
    enum { SHAPES = 8 };
    sdm_model *m;
    if (sdm_model_open(path, &m, NULL)) fail_msg("%s", path);
    const sdm_model_info *info = sdm_model_get_info(m);
    float *map = calloc(sdm_grid_count(&info->grid), sizeof *map);
    void *scratch = NULL;
    if (!map || sdm_alloc(&scratch, sdm_model_scratch_bytes(m, 1), 1, "test", NULL)) abort();
    const int at[2] = {sdm_model_param_index(m, "length"), sdm_model_param_index(m, "radius")};
    double error[2] = {0}, size[2] = {0};
    for (int i = 0; i < SHAPES * SHAPES; i++) {
        double middle[2];
        for (int k = 0; k < 2; k++) {
            const double share = ((k ? i / SHAPES : i % SHAPES) + 0.5) / SHAPES;
            const sdm_model_param *param = &info->params[at[k]];
            middle[at[k]] = param->min + share * (param->max - param->min);
        }
        const double length = middle[at[0]], radius = middle[at[1]];
        const double exact[2] = {acos(-1) * radius * radius,
                                 2 * acos(-1) * radius * (length + 2 * radius)};
        for (int k = 0; k < 2; k++) {
            const double step = 0.02 * (info->params[at[k]].max - info->params[at[k]].min);
            double p[2] = {middle[0], middle[1]}, volume[2];
            for (int side = 0; side < 2; side++) {
                p[at[k]] = middle[at[k]] + (side ? step : -step);
                sdm_model_forward(m, p, 1, map, scratch);
                assert_int_equal(sdm_map_volume(&info->grid, map, 1, &volume[side], NULL), SDM_OK);
            }
            const double slope = (volume[1] - volume[0]) / (2 * step);
            error[k] += (slope - exact[k]) * (slope - exact[k]), size[k] += exact[k] * exact[k];
        }
    }
    sdm_free(scratch);
    free(map);
    sdm_model_free(m);
    return sqrt(fmax(error[0] / size[0], error[1] / size[1]));
}

// A trained network holds volumes and derivatives, one of linear polynomials does not, and the
// figures say so; the model file keeps them.
static void volumes_and_derivatives(void **state)
{
    (void)state;
    for (int linear = 0; linear < 2; linear++) {
        static const char *const set[] = {"network.depth=0", "network.degree=1", "network.rank=2"};
        const sdm_train_report r = train(set, linear ? 3 : 0);
        const sdm_verdict *v = &r.verdict;
        const double seen = volume_error_of(r.model_path);
        if (linear ? !(v->volume_error > 0.02) || !(v->derivative_error > 0.15)
                   : !(v->volume_error < 0.01) || !(v->derivative_error < 0.1))
            fail_msg("linear %d: volumes %g, derivatives %g", linear, v->volume_error,
                     v->derivative_error);
        assert_true(v->volume_error > 0 && v->volume_error_max >= v->volume_error);
        if (linear ? !(seen > 0.02) : !(seen < 0.03)) fail_msg("linear %d: %g", linear, seen);
        assert_true((v->volume_derivative_error > 0.1) == (linear == 1));
        // one fault has one figure: that of the list
        char figure[128];
        snprintf(figure, sizeof figure, "%s: off by %.0f %%", v->volume_derivative_by,
                 100 * v->volume_derivative_error);
        if (v->volume_derivative_error > 0.2 && !strstr(v->volume_derivatives_bad, figure))
            fail_msg("%s: %s", figure, v->volume_derivatives_bad);
        if (linear) assert_true(v->volume_derivative_error > 0.2);
        // over the derivative itself the error is no smaller, and the maps of other shapes show it
        const double own = volume_slope_error_of(r.model_path);
        if (!(v->volume_own_error >= v->volume_derivative_error &&
              fabs(v->volume_own_error / own - 1) < (linear ? 0.25 : 1)))
            fail_msg("linear %d: %g (%s), %g of other shapes", linear, v->volume_own_error,
                     v->volume_own_by, own);
        // voxels of a sixth of the capsule lose little: the network errs
        if (linear ? !(v->volume_derivative_voxels > 0 && v->volume_derivative_voxels < 0.1)
                   : !isnan(v->volume_derivative_voxels))
            fail_msg("linear %d: voxels %g", linear, v->volume_derivative_voxels);
        assert_true(!strcmp(v->derivative_by, "length") || !strcmp(v->derivative_by, "radius"));
        sdm_model *m;
        assert_int_equal(sdm_model_open(r.model_path, &m, NULL), SDM_OK);
        const sdm_model_quality *q = &sdm_model_get_info(m)->quality;
        assert_true(fabs(q->volume_error / v->volume_error - 1) < 1e-6);
        assert_true(fabs(q->derivative_error / v->derivative_error - 1) < 1e-6);
        assert_true(fabs(q->surface_volume_error / v->surface_volume_error - 1) < 1e-6);
        assert_true(fabs(q->far_error_mm / v->far_largest_mm - 1) < 1e-6);
        // all held-out shapes that the grid does not cut, also beside them
        assert_true(v->derivative_shapes >= 12 && v->derivative_shapes <= 16);
        assert_true(fabs(q->volume_derivative_error / v->volume_derivative_error - 1) < 1e-6);
        sdm_model_free(m);
    }
}

/* A box of half edges p[0], p[1] and p[1]. */
static int box_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, sdm_mesh_out *out)
{
    static const uint32_t TRI[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                     2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    (void)self, (void)options;
    const int failed = host->reserve(host, out, 8, 12);
    for (size_t v = 0; v < 8 && !failed; v++)
        for (size_t k = 0; k < 3; k++) out->vert[3 * v + k] = (v >> k & 1 ? 1 : -1) * p[k > 0];
    if (!failed) memcpy(out->tri, TRI, sizeof TRI);
    return failed;
}

/* The volume of a map of such a box, from the formula of its distance. */
static double box_map_volume(const sdm_grid *g, const double half[3])
{
    const size_t n = sdm_grid_count(g), nx = (size_t)g->n[0], ny = (size_t)g->n[1];
    float *map = calloc(n, sizeof *map);
    double volume;
    if (!map) abort();
    for (size_t v = 0; v < n; v++) {
        const double index[3] = {(double)(v % nx), (double)(v / nx % ny), (double)(v / nx / ny)};
        double x[3], most = -INFINITY, beyond = 0;
        sdm_grid_world(g, index, x);
        for (int k = 0; k < 3; k++) {
            const double d = fabs(x[k]) - half[k];
            most = fmax(most, d), beyond += fmax(0, d) * fmax(0, d);
        }
        map[v] = (float)(most < 0 ? most : sqrt(beyond));
    }
    assert_int_equal(sdm_map_volume(g, map, 1, &volume, NULL), SDM_OK);
    free(map);
    return volume;
}

// Voxels alone err in the derivative of the volume by the difference between maps and solids, which
// both have formulas for boxes.
static void derivative_of_voxels(void **state)
{
    (void)state;
    static const sdm_param PARAMS[] = {{"length", "mm", 1, 3, 2, ""}, {"width", "mm", 1, 2, 1, ""}};
    static const sdm_shape SHAPE = {.abi = SDM_SHAPE_ABI,
                                    .size = sizeof(sdm_shape),
                                    .name = "box",
                                    .summary = "a box",
                                    .params = PARAMS,
                                    .n_params = 2,
                                    .mesh = box_mesh};
    sdm_instance *shape = NULL;
    sdm_error e = {0};
    if (sdm_instance_create(&SHAPE, NULL, 0, NULL, &shape, &e)) fail_msg("%s", e.text);
    double p[2] = {2.05, 1.1};
    for (int coarse = 0; coarse < 2; coarse++) {
        const double h = coarse ? 1.3 : 0.25, step = 0.01;
        const int64_t n = coarse ? 9 : 36;
        const double first = -0.5 * h * (double)(n - 1) + 0.23 * h;
        const sdm_grid grid = {.n = {n, n, n},
                               .spacing = {h, h, h},
                               .origin = {first, first, first},
                               .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
        const trainer t = {.n_threads = 1,
                           .data = {.shape = shape,
                                    .grid = &grid,
                                    .n_params = 2,
                                    .min = {1, 1},
                                    .max = {3, 2},
                                    .n_holdout = 1,
                                    .holdout_params = p}};
        double error;
        if (trainer_derivative_of_voxels(&t, 0, step, 8, &error, &e)) fail_msg("%s", e.text);
        const double longer[3] = {p[0] + step, p[1], p[1]}, shorter[3] = {p[0] - step, p[1], p[1]},
                     map = box_map_volume(&grid, longer) - box_map_volume(&grid, shorter),
                     expected = fabs(map / (16 * step * p[1] * p[1]) - 1);
        if (fabs(error - expected) > 1e-3) fail_msg("%g, not %g", error, expected);
        if (coarse) assert_true(error > 0.05);
    }
    sdm_instance_free(shape);
}

// The parameters whose derivatives are too wrong are listed, the worst first; those that hardly
// change the volume with their own size, and where the sign may be wrong.
static void lists_of_derivatives(void **state)
{
    (void)state;
    static const sdm_param p[] = {{.name = "a"}, {.name = "b"}, {.name = "c"},
                                  {.name = "d"}, {.name = "e"}, {.name = "f"}};
    char text[SDM_VERDICT_LIST];
    trainer_list_derivatives(p, (double[]){0.3, NAN, 0.1, 0.4, 0.3}, 5, text);
    assert_string_equal(text, "d: off by 40 %; by a: off by 30 %; by e: off by 30 %");
    trainer_list_derivatives(p, (double[]){NAN, 0.2}, 2, text);
    assert_string_equal(text, "");
    trainer_list_small(p, (double[]){NAN, 0.2}, 2, text);
    assert_string_equal(text, "");
    trainer_list_small(p, (double[]){0.1, 0.35}, 2, text);
    assert_string_equal(text, "b: off by 35 % of their own size: this parameter hardly changes the "
                              "volume");
    trainer_list_small(p, (double[]){0.3, INFINITY, 1.4, 0.9, 0.8, 0.7}, 6, text);
    assert_string_equal(text,
                        "b: off by over 1000 % of their own size; by c: off by 140 %; by d: off by "
                        "90 %; by e: off by 80 %; ...: these parameters hardly change the volume, "
                        "and the sign may be wrong");
}

// Each parameter of the list has its own cause; one alone needs no name.
static void causes_of_derivatives(void **state)
{
    (void)state;
    static const sdm_param p[] = {{.name = "a"}, {.name = "b"}, {.name = "c"}, {.name = "d"}};
    char text[SDM_VERDICT_LIST];
    trainer_list_causes(p, (double[]){0.3, 0.1, 0.4, 0.5}, (double[]){0.25, 0.9, 0.015, 0.21}, 4,
                        text);
    assert_string_equal(text, "21 % for d, 25 % for a: the voxels cause it; by 1.5 % for c: the "
                              "network errs");
    trainer_list_causes(p, (double[]){0.3, NAN, 0.1}, (double[]){0.15, NAN, NAN}, 3, text);
    assert_string_equal(text, "15 %: the voxels cause a part");
    trainer_list_causes(p, (double[]){0.3}, (double[]){NAN}, 1, text);
    assert_string_equal(text, "");
    // what has no room is left out
    char name[80];
    sdm_param many[32];
    double error[32], voxels[32];
    memset(name, 'x', sizeof name), name[79] = '\0';
    for (int i = 0; i < 32; i++) many[i] = (sdm_param){.name = name}, error[i] = 1, voxels[i] = 1;
    trainer_list_causes(many, error, voxels, 32, text);
    assert_non_null(strstr(text, "xxx: the voxels cause it"));
}

// A parameter that moves vertices inside of another part alone has no error of its derivative, and
// is named; its rounding errors are no figure.
static void still_parameters(void **state)
{
    (void)state;
    static const sdm_param p[] = {{.name = "a"}, {.name = "b"}, {.name = "c"}};
    static const char yaml[] = "shape: {name: faulty, options: {fault: within}}\n"
                               "grid: {size: [20, 20, 20], spacing: 0.5, centre: [0.01, 0, 0]}\n"
                               "network: {width: 8, modes: 8, rank: 2, degree: 2, depth: 1}\n"
                               "data: {static: 0, start: 20, online: 0, holdout: 4}\n"
                               "train: {steps: 10, batch: 8, refine: 0}\n";
    static const sdm_named_text option = {"fault", "within"};
    char text[SDM_VERDICT_LIST];
    trainer_list_still(p, (const bool[]){true, false, true}, 3, text);
    assert_string_equal(text, "a, c");
    trainer_list_still(p, (const bool[]){false, false, false}, 3, text);
    assert_string_equal(text, "");
    const sdm_config c = parse_config(yaml, NULL, 0);
    sdm_instance *shape;
    sdm_train_report r;
    sdm_error e = {0};
    run_files_remove();
    if (sdm_instance_create(&FAULTY, &option, 1, NULL, &shape, &e) ||
        sdm_train(&c, shape, folder, false, NULL, &r, &e))
        fail_msg("%s", e.text);
    assert_string_equal(r.verdict.still_params, "reach");
    assert_string_equal(r.verdict.derivative_by, "size");
    assert_true(r.verdict.derivative_error < 10);
    assert_null(strstr(r.verdict.derivatives_bad, "reach"));
    sdm_instance_free(shape);
}

// A joint that turns hardly changes the volume: the derivative by it is named with its own size,
// also in the model.
static void small_changes_of_the_volume(void **state)
{
    (void)state;
    static const char text[] = "shape: {name: linkage, options: {links: 1}}\n"
                               "grid: {size: [28, 16, 16], spacing: 0.6, centre: [1, 0, 0]}\n"
                               "network: {kind: template, depth: 0}\n"
                               "data: {start: 60, online: 0, holdout: 8, memory_gb: 0.5}\n"
                               "train: {steps: 10, batch: 64, refine: 0}\n";
    static const sdm_named_text option = {"links", "1"};
    static const char begin[] = "q1: off by ";
    const sdm_config c = parse_config(text, NULL, 0);
    sdm_instance *shape;
    sdm_train_report r;
    sdm_model *m;
    sdm_error e = {0};
    run_files_remove();
    if (sdm_instance_create(sdm_registry_find(registry, "linkage", NULL), &option, 1, NULL, &shape,
                            &e) ||
        sdm_train(&c, shape, folder, false, NULL, &r, &e))
        fail_msg("%s", e.text);
    const sdm_verdict *v = &r.verdict;
    if (strncmp(v->volume_derivatives_small, begin, sizeof begin - 1) ||
        !strstr(v->volume_derivatives_small, "and the sign may be wrong"))
        fail_msg("%s", v->volume_derivatives_small);
    assert_string_equal(v->volume_derivatives_bad, "");
    assert_int_equal(sdm_model_open(r.model_path, &m, NULL), SDM_OK);
    assert_non_null(
        strstr(sdm_model_get_info(m)->quality.unfit, "derivatives of the volume by q1: off by "));
    sdm_model_free(m);
    sdm_instance_free(shape);
}

// On coarse voxels a surface encloses too little while its map holds the volume, which the uses
// tell with the spacing that mends it.
static void surfaces_lose_volume(void **state)
{
    (void)state;
    static const char *const set[] = {"grid.spacing=1.2", "grid.size=[12,10,10]"};
    char lines[SDM_MODEL_UNFIT];
    const sdm_train_report r = train(set, 2);
    const sdm_verdict *v = &r.verdict;
    const double spacing = sdm_verdict_spacing(v);
    sdm_verdict_unfit(v, lines);
    if (!(v->surface_volume_error > 0.02) || !(v->surface_volume_error > 2 * v->volume_error) ||
        !strstr(lines, "volumes of surfaces (.stl): off by"))
        fail_msg("maps %g, surfaces %g: %s", v->volume_error, v->surface_volume_error, lines);
    assert_true(v->surface_volume_error_max >= v->surface_volume_error);
    assert_true(spacing < 1.2 && spacing > 0.2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(surface_of_a_sphere),         cmocka_unit_test(volumes_and_derivatives),
        cmocka_unit_test(derivative_of_voxels),        cmocka_unit_test(lists_of_derivatives),
        cmocka_unit_test(causes_of_derivatives),       cmocka_unit_test(still_parameters),
        cmocka_unit_test(small_changes_of_the_volume), cmocka_unit_test(surfaces_lose_volume),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
