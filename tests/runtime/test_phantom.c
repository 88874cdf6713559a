/* Phantoms: volumes, edges, labels and air cells against closed forms.
 * Tests: phantom.c phantom_field.c phantom_shares.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/phantom_tools.h"

static void test_volume_of_an_ellipsoid(void **state)
{
    (void)state;
    const double p[3] = {4, 3, 2};
    const sdm_pose pose = {.rotation = {0.5, -1.1, 0.3}, .translation = {0.31, -0.17, 0.05}};
    const sdm_grid g = oblique(34, 52, 24);
    sdm_mesh mesh = {0};
    sdm_audit audit;
    assert_int_equal(sdm_instance_mesh(ellipsoid, p, &mesh, NULL), SDM_OK);
    assert_int_equal(sdm_mesh_audit(&mesh, &audit, NULL), SDM_OK);
    sdm_mesh_dispose(&mesh);
    for (int blurred = 0; blurred < 2; blurred++) {
        sdm_phantom_opts o = plain();
        for (int a = 0; a < 3 && blurred; a++) o.blur[a] = 0.1 * (a + 1);
        float *v = make(ellipsoid, p, &pose, &o, &g, NULL);
        double sum = 0;
        for (size_t i = 0; i < sdm_grid_count(&g); i++) {
            assert_true(v[i] >= -1e-6f && v[i] <= 1 + 1e-6f);
            sum += (double)v[i];
        }
        const double volume = sum * g.spacing[0] * g.spacing[1] * g.spacing[2],
                     closed = 4 * PI / 3 * 4 * 3 * 2;
        // The mesh lies inside of the ellipsoid. Computing shares from the distance adds an error
        // of w^2 / 12 times the integral of the mean curvature.
        const double w = 0.2 / 3, bound = 1.2 * w * w / 12 * 4 * PI * 3;
        if (!(fabs(volume - audit.volume) < bound))
            fail_msg("volume %g, mesh %g", volume, audit.volume);
        assert_true(volume < closed && volume > 0.998 * closed);
        free(v);
    }
}

static double density(double z) { return exp(-0.5 * z * z) / sqrt(2 * PI); }

/* A step at 0 (1 below, 0 above), blurred by a Gaussian and by the box of a voxel of edge h: the
 * mean of 1 - Phi over the voxel. */
static double edge_profile(double x, double h, double sigma)
{
    double part[2];
    for (int i = 0; i < 2; i++) {
        const double z = x + (i - 0.5) * h;
        part[i] = sigma > 0 ? z * 0.5 * erfc(-z / sigma / sqrt(2)) + sigma * density(z / sigma)
                  : z > 0   ? z
                            : 0;
    }
    return 1 - (part[1] - part[0]) / h;
}

/* Largest difference from the closed form along an axis of the grid: for a face perpendicular to
 * the axis, or for a rotated face with isotropic blur. */
static double profile_error(int axis, double sigma, double turn, double offset, int supersampling)
{
    sdm_phantom_opts o = plain();
    o.supersampling = supersampling;
    const double centre[3] = {0, 0, 0}, h[3] = {0.25, 0.2, 0.3};
    sdm_grid g = sdm_grid_centred((const int64_t[3]){3, 3, 3}, 0.2, centre);
    for (int a = 0; a < 3; a++) {
        g.n[a] = a == axis ? 41 : 3;
        g.spacing[a] = turn > 0 || sigma == 0 ? 0.2 : h[a];
        g.origin[a] = -g.spacing[a] * (double)(g.n[a] / 2);
        // any value: the profile varies along one axis only
        o.blur[a] = turn > 0 || a == axis ? sigma : 0.08;
    }
    // Rotate the x axis of the block to +axis, then by `turn`; shift it by `offset` along the
    // normal.
    sdm_pose face = {.rotation = {0}}, bend = face;
    if (axis == 1) face.rotation[2] = PI / 2;
    if (axis == 2) face.rotation[1] = -PI / 2;
    bend.rotation[(axis + 1) % 3] = turn;
    sdm_pose pose = sdm_pose_compose(&bend, &face);
    double normal[3], worst = 0;
    sdm_pose_apply(&pose, (const double[3]){1, 0, 0}, normal);
    for (int a = 0; a < 3; a++) pose.translation[a] = offset * normal[a];
    float *v = make(block, NULL, &pose, &o, &g, NULL);
    for (size_t i = 0; i < sdm_grid_count(&g); i++) {
        const size_t nx = (size_t)g.n[0], ny = (size_t)g.n[1];
        const double index[3] = {(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)};
        double x[3];
        sdm_grid_world(&g, index, x);
        const double along = x[0] * normal[0] + x[1] * normal[1] + x[2] * normal[2] - offset;
        worst = fmax(worst, fabs((double)v[i] - edge_profile(along, g.spacing[axis], sigma)));
    }
    free(v);
    return worst;
}

static void test_edge_profiles(void **state)
{
    (void)state;
    // The error is at most d^2 / 8 times the height of the point spread over h, for sub-voxels of
    // edge d; sub-voxels that are not cubes add to it.
    static const struct {
        double sigma, bound;
    } blurs[] = {{0, 1e-5},     {0.01, 0.03}, {0.05, 0.02}, {0.1, 0.01},
                 {0.15, 0.006}, {0.3, 0.004}, {0.7, 0.004}};
    for (int axis = 0; axis < 3; axis++)
        for (size_t i = 0; i < sizeof blurs / sizeof *blurs; i++)
            for (int offset = 0; offset < 3; offset++) {
                const double e = profile_error(axis, blurs[i].sigma, 0, 0.061 * offset, 3);
                if (!(e < blurs[i].bound))
                    fail_msg("axis %d, blur %g, offset %d: off by %g", axis, blurs[i].sigma, offset,
                             e);
            }
    for (int axis = 0; axis < 3; axis++) {
        // The error is proportional to the square of the sub-voxel's edge.
        double e = profile_error(axis, 0.15, 0, 0.061, 12);
        if (!(e < 0.006 / 14)) fail_msg("12 sub-voxels, axis %d: off by %g", axis, e);
        // A rotated face cuts the voxel's box in another direction than the closed form assumes.
        e = profile_error(axis, 0.3, 0.5, 0.05, 3);
        if (!(e < 0.006)) fail_msg("turned face, axis %d: off by %g", axis, e);
    }
}

static void test_variance_of_narrow_blur(void **state)
{
    (void)state;
    // A blur narrower than a sub-voxel is too small to see in a profile; compare the variance, to
    // which the voxel's box adds.
    const double h = 0.2, sigma = 0.02, centre[3] = {0, 0, 0};
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){9, 1, 1}, h, centre);
    sdm_phantom_opts o = plain();
    o.blur[0] = sigma;
    enum { STEPS = 40 };
    double variance = -h * h / 12;
    for (int i = 0; i < STEPS; i++) {
        const double offset = h * (i + 0.5) / STEPS - h / 2;
        const sdm_pose pose = {.translation = {offset, 0, 0}};
        float *v = make(block, NULL, &pose, &o, &g, NULL);
        for (int k = 0; k < 9; k++) {
            const double x = h * (k - 4) - offset;
            variance += 2 * x * ((double)v[k] - (x < 0)) * h / STEPS;
        }
        free(v);
    }
    close_to("variance of the point spread", variance, sigma * sigma, 0.1 * sigma * sigma);
}

/* x: position in the frame of the shape, by the vector form of Rodrigues' formula. */
static void to_shape(const sdm_pose *pose, const double world[3], double x[3])
{
    const double *r = pose->rotation, angle = -sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    double k[3], d[3], dot = 0;
    for (int i = 0; i < 3; i++) {
        k[i] = -r[i] / angle;
        d[i] = world[i] - pose->translation[i];
        dot += k[i] * d[i];
    }
    const double c = cos(angle), s = sin(angle);
    const double cross[3] = {k[1] * d[2] - k[2] * d[1], k[2] * d[0] - k[0] * d[2],
                             k[0] * d[1] - k[1] * d[0]};
    for (int i = 0; i < 3; i++) x[i] = d[i] * c + cross[i] * s + k[i] * dot * (1 - c);
}

static void test_label_is_the_inside(void **state)
{
    (void)state;
    const double p[3] = {4, 3, 1.5};
    const sdm_pose pose = {.rotation = {0.5, -1.1, 0.9}, .translation = {0.61, -0.37, 0.45}};
    const sdm_grid g = oblique(30, 46, 22);
    const size_t n = sdm_grid_count(&g), nx = (size_t)g.n[0], ny = (size_t)g.n[1];
    uint8_t *label = calloc(n, 1), *alone = calloc(n, 1);
    if (!label || !alone) abort();
    sdm_error err;
    float *v = make(ellipsoid, p, &pose, NULL, &g, label);
    size_t inside = 0, near = 0;
    for (size_t i = 0; i < n; i++) {
        const double index[3] = {(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)};
        double world[3], x[3], d = 0;
        sdm_grid_world(&g, index, world);
        to_shape(&pose, world, x);
        assert_int_equal(sdm_instance_distance(ellipsoid, p, x, &d, &err), SDM_OK);
        assert_true(label[i] <= 1);
        inside += label[i];
        if (fabs(d) < 1e-3) { // so close that mesh and ellipsoid may differ
            near++;
            continue;
        }
        if (label[i] != (d < 0))
            fail_msg("voxel %zu at distance %g has the label %d", i, d, label[i]);
    }
    assert_true(inside > n / 20 && near < n / 100);
    assert_int_equal(sdm_phantom_make(ellipsoid, p, &pose, NULL, &g, NULL, alone, &err), SDM_OK);
    assert_memory_equal(alone, label, n);
    free(v);
    free(alone);
    free(label);
}

static void test_part_of_the_grid(void **state)
{
    (void)state;
    // A phantom on a part of the grid equals that part of the phantom on the whole grid, although
    // what lies outside is blurred into it.
    sdm_phantom_opts o = plain();
    for (int a = 0; a < 3; a++) o.blur[a] = 0.4;
    o.air_share = 0.7;
    o.air_mm = 0.9;
    o.air_clear_mm = 0.5;
    o.air = (sdm_tissue){-2, 0};
    const sdm_pose pose = {.rotation = {0.2, 0.1, 0.4}};
    const sdm_grid whole = oblique(30, 44, 20);
    sdm_grid part = whole;
    const int64_t first[3] = {12, 9, 8};
    const double corner[3] = {12, 9, 8};
    sdm_grid_world(&whole, corner, part.origin);
    for (int a = 0; a < 3; a++) part.n[a] = whole.n[a] - first[a] - a;
    float *large = make(ellipsoid, NULL, &pose, &o, &whole, NULL),
          *small = make(ellipsoid, NULL, &pose, &o, &part, NULL);
    size_t i = 0;
    for (int64_t z = 0; z < part.n[2]; z++)
        for (int64_t y = 0; y < part.n[1]; y++)
            for (int64_t x = 0; x < part.n[0]; x++, i++) {
                const size_t at =
                    (size_t)(((z + first[2]) * whole.n[1] + y + first[1]) * whole.n[0] + x +
                             first[0]);
                close_to("voxel of the part", (double)small[i], (double)large[at], 1e-5);
            }
    free(small);
    free(large);
}

static void test_share_of_air(void **state)
{
    (void)state;
    // Outside and inside have the value 0, air has 1: the image is the share of air.
    sdm_phantom_opts o = plain();
    o.inside.mean = 0;
    o.air = (sdm_tissue){1, 0};
    o.air_share = 0.5;
    o.air_mm = 1;
    o.air_clear_mm = 2;
    const double centre[3] = {10, 0, 0};
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){120, 80, 80}, 0.2, centre);
    float *v = make(block, NULL, NULL, &o, &g, NULL);
    double sum = 0, count = 0;
    for (size_t i = 0; i < sdm_grid_count(&g); i++) {
        const double x = g.origin[0] + 0.2 * (double)(i % 120); // distance to the block
        if (x < 1.89) assert_true(v[i] == 0);
        assert_true(v[i] >= 0 && v[i] <= 1);
        if (x < 2.5) continue;
        sum += (double)v[i];
        count++;
    }
    /* The probabilities that a point lies in the ball of a neighbouring cell are independent and
     * sum to q = share * pi / 6: it is air with a probability between 1 - exp(-q) and q. */
    const double q = 0.5 * PI / 6;
    if (!(sum / count > 1 - exp(-q) - 0.012 && sum / count < q + 0.012))
        fail_msg("share of air %g", sum / count);
    free(v);

    // The balls do not move with the grid or with the pose of the shape, but change with the seed.
    o.air_clear_mm = 0;
    sdm_grid other = sdm_grid_centred((const int64_t[3]){20, 20, 20}, 0.2, centre);
    const sdm_pose away = {.translation = {-100, 0, 0}};
    float *a = make(block, NULL, NULL, &o, &other, NULL),
          *b = make(block, NULL, &away, &o, &other, NULL);
    o.seed++;
    float *c = make(block, NULL, NULL, &o, &other, NULL);
    assert_memory_equal(a, b, 8000 * sizeof *a);
    assert_memory_not_equal(a, c, 8000 * sizeof *a);
    free(c);
    free(b);
    free(a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_volume_of_an_ellipsoid),  cmocka_unit_test(test_edge_profiles),
        cmocka_unit_test(test_variance_of_narrow_blur), cmocka_unit_test(test_label_is_the_inside),
        cmocka_unit_test(test_part_of_the_grid),        cmocka_unit_test(test_share_of_air),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
