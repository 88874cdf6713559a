/* Deviations of fits to labels of a box whose faces are parallel to the voxels, or nearly: the
 * labels show each face to a voxel only, however many voxels the face has; and of a rod along an
 * axis of the voxels, whose wall may err alike on all sides. A bracket along the voxels, whose
 * right fit is accepted. Tests: label_steps.c matching_steps.c misfit.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "fit/trust/matching_steps.h"
#include "oracle/exact_meshes.h"
#include "oracle/fit_tools.h"
#include "oracle/give_mesh.h"

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
    return give_mesh(host, out, &m);
}

static const sdm_shape box = {.abi = SDM_SHAPE_ABI,
                              .size = sizeof(sdm_shape),
                              .name = "box",
                              .summary = "a box",
                              .params = box_params,
                              .n_params = EDGES,
                              .mesh = box_mesh};

/* A trial: boxes of random edges, turned by `turn` and by random angles up to `tilt` (rad), and
 * their labels on voxels of this edge, mm. */
typedef struct label_trial {
    double turn[3], tilt, edge;
    uint64_t cases;
} label_trial;

/* Results of the fits of a trial. */
typedef struct label_errors {
    /* mean square of the errors over their deviations, of the edges and of the rotation */
    double edges, rotation;
    /* largest deviation of an edge, mm */
    double widest;
} label_errors;

// rotation that turns the pose b into the pose a: a small rotation vector, rad
static void rotation_between(const sdm_pose *a, const sdm_pose *b, double by[3])
{
    double to_a[9], to_b[9], d[9] = {0};
    sdm_pose_matrix(a, to_a);
    sdm_pose_matrix(b, to_b);
    for (size_t i = 0; i < 27; i++)
        d[i / 9 * 3 + i / 3 % 3] += to_a[i / 9 * 3 + i % 3] * to_b[i / 3 % 3 * 3 + i % 3];
    by[0] = 0.5 * (d[7] - d[5]);
    by[1] = 0.5 * (d[2] - d[6]);
    by[2] = 0.5 * (d[3] - d[1]);
}

// fits the boxes to their labels, from the rotation `turn`
static label_errors errors_of(const label_trial *trial)
{
    sdm_instance *shape = NULL;
    label_errors found = {0};
    if (sdm_instance_create(&box, NULL, 0, NULL, &shape, NULL)) abort();
    const size_t n_axis = (size_t)(18 / trial->edge) + 8;
    const int64_t size = (int64_t)n_axis, map = (int64_t)(19.2 / trial->edge);
    const sdm_grid g =
        sdm_grid_centred((int64_t[3]){size, size, size}, trial->edge, (double[3]){0, 0, 0});
    const sdm_fit_source source = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){map, map, map}, trial->edge, (double[3]){0, 0, 0})};
    for (uint64_t c = 0; c < trial->cases; c++) {
        double truth[EDGES];
        sdm_pose pose = {.rotation = {0}};
        for (size_t k = 0; k < EDGES; k++) {
            truth[k] = 8 + 4 * sdm_rng_uniform(3, k, c);
            pose.translation[k] = sdm_rng_uniform(3, 3 + k, c) - 0.5;
            pose.rotation[k] =
                trial->turn[k] + trial->tilt * (2 * sdm_rng_uniform(3, 6 + k, c) - 1);
        }
        double to_world[9];
        sdm_pose_matrix(&pose, to_world);
        float *v = calloc(sdm_grid_count(&g), sizeof *v);
        if (!v) abort();
        for (size_t n = 0; n < sdm_grid_count(&g); n++) {
            double x[3], index[3] = {(double)(n % n_axis), (double)(n / n_axis % n_axis),
                                     (double)(n / (n_axis * n_axis))};
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
        memcpy(o.start_pose.rotation, trial->turn, sizeof trial->turn);
        o.polish_eps = 1e-4;
        const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
        if (s && s != SDM_E_QUALITY) fail_msg("case %d: %s", (int)c, err.text);
        double by[3];
        rotation_between(&r.pose, &pose, by);
        for (size_t k = 0; k < EDGES; k++) {
            const double error = (r.params[k] - truth[k]) / r.sd[k],
                         turned = by[k] / r.sd[EDGES + k];
            found.edges += error * error / (EDGES * (double)trial->cases);
            found.rotation += turned * turned / (3 * (double)trial->cases);
            found.widest = fmax(found.widest, r.sd[k]);
            if (!(fabs(error) < 4) || !(fabs(turned) < 4))
                fail_msg("case %d, %s: %g, %g deviations off; rotation by axis %d: %g off", (int)c,
                         box_params[k].name, r.params[k], error, (int)k, turned);
        }
        sdm_fit_dispose(&r);
        free(v);
    }
    sdm_instance_free(shape);
    return found;
}

static void test_faces_parallel_to_the_voxels(void **state)
{
    (void)state;
    const label_errors found = errors_of(&(label_trial){.edge = 1, .cases = 4});
    // the mean of twelve squares of standard normal numbers exceeds 2.8 once in a thousand cases
    assert_true(found.edges < 2.8 && found.rotation < 2.8);
    // both faces are off by sqrt(1/12) mm (rms)
    assert_true(found.widest > 0.3 && found.widest < 0.6);
}

/* Faces that rise by less than a voxel over their length have flat labels: the labels hide the
 * tilt. */
static void test_faces_nearly_parallel(void **state)
{
    (void)state;
    const label_errors found = errors_of(&(label_trial){.tilt = 0.025, .edge = 0.4, .cases = 2});
    assert_true(found.edges < 2.8 && found.rotation < 2.8);
}

/* Oblique faces: the steps average out, and the deviations stay small. */
static void test_oblique_faces(void **state)
{
    (void)state;
    const label_errors found =
        errors_of(&(label_trial){.turn = {0.3, 0.25, 0.35}, .edge = 1, .cases = 4});
    assert_true(found.edges < 2.8 && found.rotation < 2.8);
    assert_true(found.widest < 0.2);
}

static const sdm_param rod_params[] = {{"radius", "mm", 1, 5, 2.5, "radius of the rod"},
                                       {"length", "mm", 5, 20, 10, "length without the caps"}};

/* Fits a rod with this radius, 10 mm long, to its labels with voxels of 1 mm. Its axis lies along
 * z, off the centre of a voxel by `off` (mm) along x and y. Returns the error of the radius in
 * deviations. */
static double rod_error(double radius, double off)
{
    sdm_shape rod = *sdm_registry_find(registry, "capsule", NULL);
    sdm_instance *shape = NULL;
    rod.params = rod_params;
    if (sdm_instance_create(&rod, &(sdm_named_text){"edge", "0.1"}, 1, NULL, &shape, NULL)) abort();
    enum { ACROSS = 13, ALONG = 25 };
    const sdm_grid g =
        sdm_grid_centred((int64_t[3]){ACROSS, ACROSS, ALONG}, 1, (double[3]){0, 0, 0});
    const sdm_fit_source source = {.shape = shape, .grid = g};
    float v[ALONG][ACROSS][ACROSS];
    for (int z = 0; z < ALONG; z++)
        for (int y = 0; y < ACROSS; y++)
            for (int x = 0; x < ACROSS; x++)
                v[z][y][x] = hypot(hypot(x - ACROSS / 2 - off, y - ACROSS / 2 - off),
                                   fmax(fabs((double)(z - ALONG / 2)) - 5, 0)) < radius;
    const sdm_fit_target t = {.kind = SDM_FIT_LABEL, .grid = g, .values = v[0][0]};
    sdm_fit_opts o = sdm_fit_defaults_for(1);
    sdm_fit_result r;
    sdm_error err = {0};
    const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
    if (s && s != SDM_E_QUALITY) fail_msg("%s", err.text);
    const double error = (r.params[0] - radius) / r.sd[0];
    sdm_fit_dispose(&r);
    sdm_instance_free(shape);
    return error;
}

/* The labels of the first two rods have 13 and 21 voxels in each layer, as many as the areas of
 * circles with radii of 2.03 and 2.59 mm. With independent errors of the four sides their radii are
 * 2.4 and 3 deviations off. */
static void test_rod_along_an_axis(void **state)
{
    (void)state;
    assert_true(fabs(rod_error(2.23, 0)) < 2);
    assert_true(fabs(rod_error(2.3, 0)) < 2);
    assert_true(fabs(rod_error(2.4, 0.2)) < 2);
}

// variance of the mean of four pieces with these places, beyond that of independent pieces
static double missing_variance(const double place[4])
{
    const double score = 0.25;
    double work[5], variance = 0;
    fit_matching_step list[4];
    for (int i = 0; i < 4; i++)
        list[i] = (fit_matching_step){.place = place[i], .sd = 2, .weight = 3, .score = &score};
    sdm_fit_matching_steps(list, 4, 1, work, &variance);
    return variance;
}

/* Pieces at the same part of a voxel have one common error; whole voxels between them change
 * nothing. */
static void test_pieces_that_match(void **state)
{
    (void)state;
    assert_float_equal(missing_variance((double[4]){0.4, 0.4, 0.4, 0.4}), 4 - 4. / 4, 1e-12);
    assert_float_equal(missing_variance((double[4]){0.4, 1.4, -0.6, 2.4}), 4 - 4. / 4, 1e-12);
    assert_float_equal(missing_variance((double[4]){0, 0.25, 0.5, 0.75}), 0, 1e-12);
    // two pairs: variance 4 / 2 instead of 4 / 4
    assert_float_equal(missing_variance((double[4]){0, 0, 0.5, 0.5}), 1, 1e-12);
}

// ---- rivals

enum { THICK = 4 };
static const sdm_param bracket_params[EDGES] = {{"length", "mm", 30, 60, 45, "along x"},
                                                {"width", "mm", 20, 40, 30, "along y"},
                                                {"up", "mm", 10, 40, 25, "along z"}};

// the corners of the lying plate, and of the standing one
static void bracket_corners(const double *p, double low[2][3], double high[2][3])
{
    const double x = 0.5 * p[0], y = 0.5 * p[1], z = 0.5 * THICK;
    memcpy(low, (const double[2][3]){{-x, -y, -z}, {-x, -y, -z}}, 6 * sizeof x);
    memcpy(high, (const double[2][3]){{x, y, z}, {THICK - x, y, p[2]}}, 6 * sizeof x);
}

static int bracket_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                        const double *p, sdm_mesh_out *out)
{
    double low[2][3], high[2][3];
    sdm_mesh m = {0}, standing = {0};
    (void)self, (void)options;
    bracket_corners(p, low, high);
    mesh_box(&m, low[0], high[0]);
    mesh_box(&standing, low[1], high[1]);
    mesh_append(&m, &standing);
    sdm_mesh_dispose(&standing);
    return give_mesh(host, out, &m);
}

static const sdm_shape bracket = {.abi = SDM_SHAPE_ABI,
                                  .size = sizeof(sdm_shape),
                                  .name = "bracket",
                                  .summary = "two plates",
                                  .params = bracket_params,
                                  .n_params = EDGES,
                                  .mesh = bracket_mesh};

// All faces lie between the same layers of voxels, which the labels show as one step: another width
// and pose, which the steps favour, are no better fit.
static void test_steps_favour_no_rival(void **state)
{
    (void)state;
    const double truth[EDGES] = {46.3, 29.1, 24.7};
    enum { NX = 39, NY = 27, NZ = 25 };
    static float v[NX * NY * NZ];
    double low[2][3], high[2][3];
    sdm_instance *shape = NULL;
    if (sdm_instance_create(&bracket, NULL, 0, NULL, &shape, NULL)) abort();
    bracket_corners(truth, low, high);
    const sdm_grid g = sdm_grid_centred((int64_t[3]){NX, NY, NZ}, 1.5, (double[3]){0, 0, 11.35});
    for (size_t n = 0; n < NX * NY * NZ; n++) {
        const double index[3] = {(double)(n % NX), (double)(n / NX % NY), (double)(n / (NX * NY))};
        double x[3];
        sdm_grid_world(&g, index, x);
        for (int part = 0; part < 2; part++) {
            bool in = true;
            for (int d = 0; d < 3; d++) in = in && x[d] > low[part][d] && x[d] < high[part][d];
            if (in) v[n] = 1;
        }
    }
    const sdm_fit_source source = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){60, 42, 50}, 1.14, (double[3]){0, 0, 11})};
    const sdm_fit_target t = {.kind = SDM_FIT_LABEL, .grid = g, .values = v};
    const sdm_fit_opts o = sdm_fit_defaults_for(1.5);
    sdm_fit_result r;
    sdm_error err = {0};
    if (sdm_fit(&source, &t, &o, &r, &err)) fail_msg("%s", err.text);
    for (size_t k = 0; k < EDGES; k++) assert_true(fabs(r.params[k] - truth[k]) < 3 * r.sd[k]);
    sdm_fit_dispose(&r);
    sdm_instance_free(shape);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_pieces_that_match),
                                       cmocka_unit_test(test_rod_along_an_axis),
                                       cmocka_unit_test(test_faces_parallel_to_the_voxels),
                                       cmocka_unit_test(test_faces_nearly_parallel),
                                       cmocka_unit_test(test_oblique_faces),
                                       cmocka_unit_test(test_steps_favour_no_rival)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
