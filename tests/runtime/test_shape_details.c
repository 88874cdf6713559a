/* What voxels a shape needs: the largest ball in it, its thinnest part and its details, measured at
 * its surface; and the check `map voxels` of fits, whose limit neither the errors of a network nor
 * the voxels of the maps change.
 * Tests: shape_details.c suffice.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "ball_model.h"
#include "fit/data/shape_details.h"
#include "oracle/fit_tools.h"

static sdm_instance *shape_of(const char *name, const sdm_named_text *options, size_t n)
{
    sdm_instance *out = NULL;
    sdm_error err = {0};
    if (sdm_instance_create(sdm_registry_find(registry, name, NULL), options, n, NULL, &out, &err))
        fail_msg("%s", err.text);
    return out;
}

static sdm_grid cubes(double edge, double half)
{
    const int64_t n = (int64_t)ceil(2 * half / edge);
    return sdm_grid_centred((int64_t[3]){n, n, n}, edge, (double[3]){0, 0, 0});
}

// ---- a box whose wall may be nearly nothing

enum { SIZE, WALL };
static const sdm_param plate_params[] = {{"size", "mm", 2, 30, 12, ""},
                                         {"wall", "mm", 0.0005, 2, 1, ""}};

static int plate_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                      const double *p, sdm_mesh_out *out)
{
    static const uint32_t tri[] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                   2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    (void)self, (void)options;
    const int failed = host->reserve(host, out, 8, 12);
    if (failed) return failed;
    for (int i = 0; i < 8; i++) {
        out->vert[3 * i] = (i & 1 ? 0.5 : -0.5) * p[SIZE];
        out->vert[3 * i + 1] = (i & 2 ? 0.5 : -0.5) * p[SIZE];
        out->vert[3 * i + 2] = (i & 4 ? 0.5 : -0.5) * p[WALL];
    }
    memcpy(out->tri, tri, sizeof tri);
    return 0;
}

static const sdm_shape plate = {.abi = SDM_SHAPE_ABI,
                                .size = sizeof(sdm_shape),
                                .name = "plate",
                                .summary = "a plate",
                                .params = plate_params,
                                .n_params = 2,
                                .mesh = plate_mesh};

static fit_details details_of(const sdm_instance *shape, const double *p, double most)
{
    const sdm_fit_source source = {.shape = shape};
    const fit_maps maps = {.source = &source, .grid = cubes(1, 4)};
    fit_details d;
    sdm_error err = {0};
    if (sdm_fit_shape_details(&maps, p, most, &d, &err)) fail_msg("%s", err.text);
    return d;
}

static void near(double x, double expected, double share)
{
    if (!(fabs(x - expected) <= share * expected)) fail_msg("%g, not %g", x, expected);
}

// Round shapes whose largest ball is known; they have no details.
static void test_the_largest_ball(void **state)
{
    (void)state;
    const sdm_named_text fine = {"edge", "0.1"};
    sdm_instance *round = shape_of("ellipsoid", &fine, 1), *ring = shape_of("torus", &fine, 1);
    const fit_details egg = details_of(round, (double[]){3, 2, 1.5}, 1),
                      tube = details_of(ring, (double[]){3, 0.6}, 1);
    near(egg.radius, 1.5, 0.01);
    near(tube.radius, 0.6, 0.01);
    near(tube.thinnest, 1.2, 0.05);
    assert_true(isinf(egg.edge) && isinf(tube.edge));
    sdm_instance_free(round), sdm_instance_free(ring);
}

// Share of the voxels at the surface with a short gradient, over exact maps on 64 grids.
static double share_in_maps(const sdm_instance *shape, const double *p, double edge)
{
    double bent = 0, all = 0;
    for (int place = 0; place < 64; place++) {
        sdm_grid g = cubes(edge, 4);
        for (int a = 0; a < 3; a++) g.origin[a] += (0.125 + 0.25 * (place >> 2 * a & 3)) * edge;
        const int64_t step[3] = {1, g.n[0], g.n[0] * g.n[1]};
        float *v = malloc(sdm_grid_count(&g) * sizeof *v);
        assert_non_null(v);
        assert_int_equal(sdm_exact_shape_map(shape, p, NULL, &g, v, NULL, NULL), SDM_OK);
        for (int64_t i = step[2]; i < step[2] * (g.n[2] - 1); i++) {
            double square = 0;
            if (fabs((double)v[i]) > 0.5 * edge) continue;
            for (int a = 0; a < 3; a++)
                square += pow((double)(v[i + step[a]] - v[i - step[a]]) / (2 * edge), 2);
            all++, bent += square < 0.64;
        }
        free(v);
    }
    return bent / all;
}

// The edge that shows the details of a plate is the one at which a tenth of the voxels at the
// surface bends, as a mean over many maps: in a single one the share changes with its place.
static void test_details_against_maps(void **state)
{
    (void)state;
    const double p[] = {4, 2};
    sdm_instance *shape = NULL;
    assert_int_equal(sdm_instance_create(&plate, NULL, 0, NULL, &shape, NULL), SDM_OK);
    const fit_details d = details_of(shape, p, 1);
    assert_true(d.edge < 0.5);
    const double at = share_in_maps(shape, p, d.edge), beyond = share_in_maps(shape, p, 2 * d.edge);
    if (!(at > 0.07 && at < 0.13 && beyond > 0.15))
        fail_msg("edge %g: share %g, of twice the edge %g", d.edge, at, beyond);
    sdm_instance_free(shape);
}

// A network whose distances are too short everywhere, by a third where it shows a ball of 1.35 mm.
static double too_flat(const double x[3])
{
    return 1 + 6 * (sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) - 1.25);
}

// Labels of a ball of 1.35 mm.
static float *labels_of_ball(const sdm_grid *g)
{
    float *v = malloc(sdm_grid_count(g) * sizeof *v);
    assert_non_null(v);
    for (size_t i = 0; i < sdm_grid_count(g); i++) {
        const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
        double x[3];
        sdm_grid_world(
            g, (const double[]){(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)}, x);
        v[i] = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] < 1.35 * 1.35;
    }
    return v;
}

// Returns the finding on the voxels of a fit of one parameter of two.
static sdm_fit_finding voxels_of_fit(const sdm_fit_source *source, const sdm_grid *g,
                                     const float *labels, const double *start, size_t open,
                                     double *advised)
{
    const sdm_fit_target target = {.kind = SDM_FIT_LABEL, .grid = *g, .values = labels};
    const bool keep[2] = {open != 0, open != 1};
    sdm_fit_opts o = sdm_fit_defaults_for(1);
    o.kept = keep, o.keep_pose = true, o.start_params = start;
    sdm_fit_result r;
    sdm_error err = {0};
    const sdm_status s = sdm_fit(source, &target, &o, &r, &err);
    if (s && s != SDM_E_QUALITY) fail_msg("%s", err.text);
    size_t i = 0;
    while (r.verdict.findings[i].kind != SDM_FIT_CHECK_VOXELS) i++;
    const sdm_fit_finding out = r.verdict.findings[i];
    *advised = r.advised_voxel_mm;
    sdm_fit_dispose(&r);
    return out;
}

static void test_a_network_does_not_move_the_limit(void **state)
{
    (void)state;
    const sdm_grid grid = cubes(0.25, 17 * 0.125), g = cubes(0.5, 3);
    sdm_instance *ball = NULL;
    assert_int_equal(sdm_instance_create(&ball_shape, NULL, 0, NULL, &ball, NULL), SDM_OK);
    sdm_model *model = ball_model("bulge", &grid, too_flat);
    float *v = labels_of_ball(&g);
    double advised;
    const sdm_fit_finding exact = voxels_of_fit(&(sdm_fit_source){.shape = ball, .grid = grid}, &g,
                                                v, NULL, 0, &advised),
                          network = voxels_of_fit(&(sdm_fit_source){.shape = ball, .model = model},
                                                  &g, v, NULL, 0, &advised);
    assert_int_equal(exact.grade, SDM_FIT_PASSED);
    assert_int_equal(network.grade, SDM_FIT_PASSED);
    near(exact.limit, 1.35 / 2, 0.05);
    near(network.limit, exact.limit, 0.1); // its radius is another one
    free(v);
    sdm_model_free(model);
    sdm_instance_free(ball);
}

/* Voxels that a wall of nearly no thickness needs are no advice: the finding names the wall. */
static void test_a_wall_of_nothing_is_named(void **state)
{
    (void)state;
    // a plane of voxel centres lies in the wall
    const sdm_grid g = cubes(0.5, 7.75);
    sdm_instance *shape = NULL;
    assert_int_equal(sdm_instance_create(&plate, NULL, 0, NULL, &shape, NULL), SDM_OK);
    const double thin[2] = {12, 0.0006};
    assert_int_equal(sdm_fit_thinning_param(shape, thin, 0.0006), WALL);
    assert_int_equal(sdm_fit_thinning_param(shape, (const double[]){2, 2}, 2), 2);
    float *v = calloc(sdm_grid_count(&g), sizeof *v);
    assert_non_null(v);
    for (int64_t i = 3; i < 28; i++)
        for (int64_t j = 3; j < 28; j++) v[(15 * 31 + j) * 31 + i] = 1;
    double advised;
    const sdm_fit_finding x =
        voxels_of_fit(&(sdm_fit_source){.shape = shape, .grid = g}, &g, v, thin, SIZE, &advised);
    assert_true(x.grade != SDM_FIT_PASSED && isnan(advised));
    if (!strstr(x.text, "the thinnest part of the fitted shape is 0.0006 mm thick: 'wall' is at "
                        "0.0006 mm") ||
        strstr(x.text, "exact maps with voxels"))
        fail_msg("%s", x.text);
    // a thicker wall: an advice, which is the stated share of the limit
    const double thick[2] = {12, 0.6};
    const sdm_fit_finding y =
        voxels_of_fit(&(sdm_fit_source){.shape = shape, .grid = g}, &g, v, thick, SIZE, &advised);
    assert_int_equal(y.grade, SDM_FIT_DOUBTFUL);
    near(advised, 0.8 * y.limit, 1e-9);
    assert_non_null(strstr(y.text, "(sdm_fit_source.grid), 0.8 times the limit, show it"));
    free(v);
    sdm_instance_free(shape);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_largest_ball),
        cmocka_unit_test(test_details_against_maps),
        cmocka_unit_test(test_a_network_does_not_move_the_limit),
        cmocka_unit_test(test_a_wall_of_nothing_is_named),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
