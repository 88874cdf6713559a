/* Level set files of closed-form distances, read back through OpenVDB.
 * Tests: band.c seal.c vdb.cc vdb_creases.cc vdb_file.cc */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "sdm/internal/file.h"
#include "sdm/memory.h"
#include "sdm/vdb.h"

#define FILE_NAME "test_vdb.vdb"

typedef double (*distance)(const double x[3]);

static double sphere(const double x[3])
{
    return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) - 1.3;
}

static double torus(const double x[3])
{
    const double ring = sqrt(x[0] * x[0] + x[1] * x[1]) - 1.5;
    return sqrt(ring * ring + x[2] * x[2]) - 0.55;
}

// Exact distance to a box with sharp edges, rotated so that its edges cross the voxels.
static double tilted_box(const double x[3])
{
    const double c = cos(0.4), s = sin(0.4), half[3] = {1.5, 1.0, 0.8};
    const double y[3] = {c * x[0] - s * x[1], s * x[0] + c * x[1], x[2]};
    double out = 0, in = -INFINITY;
    for (int a = 0; a < 3; a++) {
        const double q = fabs(y[a]) - half[a];
        if (q > 0) out += q * q;
        if (q > in) in = q;
    }
    return in > 0 ? sqrt(out) : in;
}

static double box(const double x[3])
{
    const double half[3] = {1.5, 1.0, 0.8};
    double out = 0, in = -INFINITY;
    for (int a = 0; a < 3; a++) {
        const double q = fabs(x[a]) - half[a];
        if (q > 0) out += q * q;
        if (q > in) in = q;
    }
    return in > 0 ? sqrt(out) : in;
}

static double two_spheres(const double x[3])
{
    const double a[3] = {x[0] - 0.9, x[1] - 0.1, x[2]},
                 b[3] = {x[0] + 0.9, x[1] + 0.1, x[2] - 0.05};
    return fmin(sphere(a), sphere(b));
}

static double half_space(const double x[3]) { return (0.6 * x[0] + 0.8 * x[2]) - 0.123; }
static double all_outside(const double x[3]) { return sphere(x) + 50; }
static double all_inside(const double x[3]) { return sphere(x) - 50; }
static double step_function(const double x[3]) { return sphere(x) < 0 ? -5.0 : 5.0; }
static double shallow(const double x[3]) { return 0.2 * sphere(x); }

// Three different sizes, and an origin that is not a multiple of the spacing.
static sdm_grid test_grid(void)
{
    const int64_t n[3] = {44, 39, 31};
    const double centre[3] = {0.013, -0.021, 0.037};
    return sdm_grid_centred(n, 0.16, centre);
}

static float *map_fill(const sdm_grid *g, distance f)
{
    float *v = malloc(sdm_grid_count(g) * sizeof *v);
    assert_non_null(v);
    size_t at = 0;
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++) {
                const double index[3] = {(double)i, (double)j, (double)k};
                double x[3];
                sdm_grid_world(g, index, x);
                v[at++] = (float)f(x);
            }
    return v;
}

static void assert_ok(sdm_status s, const sdm_error *err)
{
    if (s) fail_msg("%s: %s", sdm_status_name(s), err->text);
}

static sdm_vdb_report write_level_set(const sdm_grid *g, const float *v, const sdm_vdb_opts *o)
{
    sdm_error err;
    sdm_vdb_report r;
    assert_ok(sdm_vdb_write(FILE_NAME, g, v, o, &r, &err), &err);
    return r;
}

static char *file_verify(void)
{
    sdm_error err;
    char *text = NULL;
    assert_ok(sdm_vdb_verify(FILE_NAME, &text, &err), &err);
    assert_non_null(text);
    return text;
}

// Reads the values on the grid enlarged by `pad` voxels on each side.
static float *read_box(const sdm_grid *g, int32_t pad)
{
    const int32_t n[3] = {(int32_t)g->n[0] + 2 * pad, (int32_t)g->n[1] + 2 * pad,
                          (int32_t)g->n[2] + 2 * pad};
    const size_t count = (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
    int32_t *index = malloc(count * 3 * sizeof *index);
    float *v = malloc(count * sizeof *v);
    assert_true(index && v);
    size_t at = 0;
    for (int32_t k = 0; k < n[2]; k++)
        for (int32_t j = 0; j < n[1]; j++)
            for (int32_t i = 0; i < n[0]; i++, at += 3) {
                index[at] = i - pad;
                index[at + 1] = j - pad;
                index[at + 2] = k - pad;
            }
    sdm_error err;
    assert_ok(sdm_vdb_sample(FILE_NAME, index, count, v, &err), &err);
    free(index);
    return v;
}

// A level set holds the map where |d| < band and +-background elsewhere. Returns the number of
// voxels that differ; *largest: the largest difference.
static size_t compare(const sdm_grid *g, const float *v, double band, double *largest)
{
    float *back = read_box(g, 0);
    size_t differ = 0;
    *largest = 0;
    for (size_t i = 0; i < sdm_grid_count(g); i++) {
        const double expected = v[i] <= -band ? -band : v[i] >= band ? band : (double)v[i];
        assert_true((back[i] < 0) == (v[i] < 0));
        const double change = fabs(expected - (double)back[i]);
        if (change > 1e-7) differ++;
        if (change > *largest) *largest = change;
    }
    free(back);
    return differ;
}

// Largest shift of the surface, in voxels along grid lines, between the map v and the file.
static double crossing_shift(const sdm_grid *g, const float *v)
{
    float *back = read_box(g, 0);
    const size_t count = sdm_grid_count(g),
                 step[3] = {1, (size_t)g->n[0], (size_t)(g->n[0] * g->n[1])};
    double worst = 0;
    for (size_t i = 0; i < count; i++)
        for (int a = 0; a < 3; a++) {
            const size_t j = i + step[a];
            // Neighbours across a row's end are both outside, so they hold no crossing.
            if (j >= count || (v[i] < 0) == (v[j] < 0)) continue;
            const double before = (double)v[i] / ((double)v[i] - (double)v[j]);
            worst =
                fmax(worst, fabs(before - (double)back[i] / ((double)back[i] - (double)back[j])));
        }
    free(back);
    return worst;
}

static void check_smooth(distance f)
{
    const sdm_grid g = test_grid();
    float *v = map_fill(&g, f);
    const sdm_vdb_report r = write_level_set(&g, v, NULL);
    assert_false(r.cut);
    assert_int_equal(r.adjusted_voxels, 0);
    int64_t near = 0;
    for (size_t i = 0; i < sdm_grid_count(&g); i++) near += fabs((double)v[i]) < 0.48;
    assert_int_equal(r.active_voxels, near);
    double largest;
    assert_int_equal(compare(&g, v, 0.48, &largest), 0);
    char *text = file_verify(), expected[64];
    assert_non_null(strstr(text, "class         level set"));
    assert_non_null(strstr(text, "voxel size    0.16 0.16 0.16 mm"));
    assert_non_null(strstr(text, "sdm_frame: LPS"));
    snprintf(expected, sizeof expected, "sdm_hash: %016llx", (unsigned long long)r.hash);
    assert_non_null(strstr(text, expected));
    sdm_free(text);
    free(v);
}

static void test_smooth_sphere(void **state)
{
    (void)state;
    check_smooth(sphere);
}

static void test_smooth_torus(void **state)
{
    (void)state;
    check_smooth(torus);
}

// Edges and creases of exact distances: few values change, by a fraction of a voxel, and no sign
// changes.
static void test_creases_change_few_values(void **state)
{
    (void)state;
    const distance shapes[] = {box, tilted_box, two_spheres};
    for (size_t s = 0; s < 3; s++) {
        const sdm_grid g = test_grid();
        float *v = map_fill(&g, shapes[s]);
        const sdm_vdb_report r = write_level_set(&g, v, NULL);
        double largest;
        const size_t differ = compare(&g, v, 0.48, &largest);
        assert_int_equal(r.adjusted_voxels, differ);
        assert_true(differ < (size_t)r.active_voxels / 10);
        assert_true(largest < 0.25 * 0.16);
        assert_true(crossing_shift(&g, v) < 0.4);
        assert_true(fabs(r.adjusted_mm - largest) < 1e-7);
        char *text = file_verify();
        assert_true((strstr(text, "sdm_adjusted_voxels: ") != NULL) == (differ > 0));
        sdm_free(text);
        free(v);
    }
}

// Plates of 0.8 and 0.5 voxels, oblique to all axes, and two plates with a thin gap between them.
static double tilted_plate(const double x[3], double half, double away)
{
    const double c = cos(0.5), s = sin(0.5), size[3] = {1.5, 1.2, half};
    const double y[3] = {c * x[0] + s * x[2], x[1], -s * x[0] + c * x[2] - away};
    double out = 0, in = -INFINITY;
    for (int a = 0; a < 3; a++) {
        const double q = fabs(y[a]) - size[a];
        if (q > 0) out += q * q;
        if (q > in) in = q;
    }
    return in > 0 ? sqrt(out) : in;
}

static double thin_plate(const double x[3]) { return tilted_plate(x, 0.4 * 0.16, 0.011); }
static double thinner_plate(const double x[3]) { return tilted_plate(x, 0.25 * 0.16, 0.011); }
static double thin_gap(const double x[3])
{
    return fmin(tilted_plate(x, 0.4, 0.4 + 0.4 * 0.16), tilted_plate(x, 0.4, -0.4 - 0.4 * 0.16));
}

// Parts thinner than a voxel stay: no voxel changes sides.
static void test_thin_parts_stay(void **state)
{
    (void)state;
    const distance shapes[] = {thin_plate, thinner_plate, thin_gap};
    for (size_t s = 0; s < 3; s++) {
        const sdm_grid g = test_grid();
        float *v = map_fill(&g, shapes[s]);
        assert_true(write_level_set(&g, v, NULL).adjusted_voxels > 0);
        double largest;
        (void)compare(&g, v, 0.48, &largest); // compares signs, too
        assert_true(largest < 0.5 * 0.16);
        sdm_free(file_verify());
        free(v);
    }
}

static void test_metadata_and_options(void **state)
{
    (void)state;
    const sdm_grid g = test_grid();
    float *v = map_fill(&g, torus);
    const sdm_named_value data[] = {
        {"version", "0.1"}, {"params", "R = 1.5 mm, \xc2\xb5"}, {"empty", ""}};
    const sdm_vdb_opts o = {.band_voxels = 5, .metadata = data, .n_metadata = 3};
    const sdm_vdb_report r = write_level_set(&g, v, &o);
    double largest;
    assert_int_equal(compare(&g, v, 0.8, &largest), 0);
    char *text = file_verify();
    assert_non_null(strstr(text, "version: 0.1\n"));
    assert_non_null(strstr(text, "params: R = 1.5 mm, \xc2\xb5\n"));
    sdm_free(text);
    // The hash depends on the values only: the same values give the same hash, one changed value
    // another.
    const sdm_vdb_opts bare = {.band_voxels = 5};
    assert_true(write_level_set(&g, v, &bare).hash == r.hash);
    size_t near = 0;
    while (!(fabs((double)v[near]) < 0.3)) near++;
    v[near] = nextafterf(v[near], 1.0f);
    assert_true(write_level_set(&g, v, &bare).hash != r.hash);
    free(v);
}

static void test_half_precision(void **state)
{
    (void)state;
    const sdm_grid g = test_grid();
    float *v = map_fill(&g, tilted_box);
    const sdm_vdb_opts o = {.half = true};
    const sdm_vdb_report r = write_level_set(&g, v, &o);
    float *back = read_box(&g, 0);
    size_t far = 0;
    for (size_t i = 0; i < sdm_grid_count(&g); i++) {
        assert_true((back[i] < 0) == (v[i] < 0));
        // Half precision has 11 significant bits; the background is rounded up to the next half.
        if (fabs((double)v[i]) < 0.47 &&
            fabs((double)(back[i] - v[i])) > fabs((double)v[i]) / 2048 + 1e-7)
            far++;
    }
    assert_true(far <= (size_t)r.adjusted_voxels);
    char *text = file_verify();
    assert_non_null(strstr(text, "16-bit floats"));
    sdm_free(text);
    free(back);
    free(v);
}

static void test_dense_map(void **state)
{
    (void)state;
    sdm_grid g = test_grid();
    g.spacing[1] = 0.21; // a dense map may have anisotropic voxels
    float *v = map_fill(&g, half_space);
    const sdm_vdb_opts o = {.dense = true};
    const sdm_vdb_report r = write_level_set(&g, v, &o);
    assert_true(r.cut);
    assert_int_equal(r.active_voxels, sdm_grid_count(&g));
    float *back = read_box(&g, 0);
    assert_memory_equal(back, v, sdm_grid_count(&g) * sizeof *v);
    free(back);
    char *text = file_verify();
    assert_non_null(strstr(text, "not set (whole map)"));
    sdm_free(text);
    const sdm_vdb_opts half = {.dense = true, .half = true};
    write_level_set(&g, v, &half);
    sdm_free(file_verify());
    free(v);
}

// The intersection of a half space with the grid's box: closed form on axis-aligned faces far from
// their rims.
static void test_shape_cut_by_the_grid(void **state)
{
    (void)state;
    const sdm_grid g = test_grid();
    float *v = map_fill(&g, half_space);
    const sdm_vdb_report r = write_level_set(&g, v, NULL);
    assert_true(r.cut);
    char *text = file_verify();
    assert_non_null(strstr(text, "sdm_cut: "));
    sdm_free(text);
    const int32_t pad = 8, n[3] = {44 + 16, 39 + 16, 31 + 16};
    float *back = read_box(&g, pad);
    size_t outside_inside = 0, checked = 0;
    double worst = 0;
    size_t at = 0;
    for (int32_t k = -pad; k < n[2] - pad; k++)
        for (int32_t j = -pad; j < n[1] - pad; j++)
            for (int32_t i = -pad; i < n[0] - pad; i++, at++) {
                const bool in = i >= 0 && j >= 0 && k >= 0 && i < 44 && j < 39 && k < 31;
                if (!in && !(back[at] > 0)) outside_inside++;
                if (i >= 6 && i < 38 && j < 0 && k >= 6 && k < 25) {
                    // Outside of the face y = low: distance to the part of the face inside of the
                    // half space, from the plane's equation.
                    const double index[3] = {(double)i, -0.5, (double)k};
                    double x[3];
                    sdm_grid_world(&g, index, x);
                    const double below = (-0.5 - (double)j) * 0.16, beside = fmax(half_space(x), 0);
                    const double exact = fmin(hypot(below, beside), 0.48);
                    worst = fmax(worst, fabs(exact - (double)back[at]));
                    checked++;
                }
            }
    assert_int_equal(outside_inside, 0);
    assert_true(checked > 1000);
    // Near the rim the part of the face that is inside is known to half a voxel only.
    assert_true(worst < 0.71 * 0.16);
    free(back);
    free(v);
}

// A solid that fills the grid becomes the grid's box.
static void test_all_inside(void **state)
{
    (void)state;
    const sdm_grid g = test_grid();
    float *v = map_fill(&g, all_inside);
    assert_true(write_level_set(&g, v, NULL).cut);
    sdm_free(file_verify());
    const int32_t index[] = {20, 20, 0, 20, 20, -1, 20, 20, -2, 20, 20, 1, 20, 20, 15, 20, 20, 40};
    const float expected[] = {-0.08f, 0.08f, 0.24f, -0.24f, -0.48f, 0.48f};
    float got[6];
    sdm_error err;
    assert_ok(sdm_vdb_sample(FILE_NAME, index, 6, got, &err), &err);
    for (int i = 0; i < 6; i++) assert_true(fabsf(got[i] - expected[i]) < 1e-6f);
    free(v);
}

/* Which map make_map() makes, and how often it was called. */
typedef struct map_maker {
    distance f;
    int calls;
    sdm_status status;
} map_maker;

static sdm_status make_map(void *user, const sdm_grid *g, float *values, sdm_error *err)
{
    map_maker *m = user;
    m->calls++;
    if (m->status) return sdm_fail(err, m->status, "no map");
    float *v = map_fill(g, m->f);
    memcpy(values, v, sdm_grid_count(g) * sizeof *v);
    free(v);
    return SDM_OK;
}

// Largest difference between the file and the function outside of the grid, where the function is
// below the band.
static double error_beyond(const sdm_grid *g, distance f, int32_t pad, double band)
{
    float *back = read_box(g, pad);
    double worst = 0;
    size_t at = 0;
    for (int64_t k = -pad; k < g->n[2] + pad; k++)
        for (int64_t j = -pad; j < g->n[1] + pad; j++)
            for (int64_t i = -pad; i < g->n[0] + pad; i++, at++) {
                double x[3];
                sdm_grid_world(g, (const double[3]){(double)i, (double)j, (double)k}, x);
                const bool in =
                    i >= 0 && j >= 0 && k >= 0 && i < g->n[0] && j < g->n[1] && k < g->n[2];
                if (!in) worst = fmax(worst, fabs(fmin(f(x), band) - (double)back[at]));
            }
    free(back);
    return worst;
}

// The band leaves the grid: with a source of maps its values are those of the map, without one they
// are estimated, which the report tells.
static void test_exact_band_beyond_grid(void **state)
{
    (void)state;
    static const distance shapes[] = {sphere, torus};
    for (size_t k = 0; k < 2; k++) {
        const sdm_grid whole = test_grid();
        float *all = map_fill(&whole, shapes[k]);
        int64_t low[3] = {1000, 1000, 1000}, high[3] = {0, 0, 0}; // of the voxels inside
        for (int64_t i = 0; i < (int64_t)sdm_grid_count(&whole); i++) {
            const int64_t at[3] = {i % whole.n[0], i / whole.n[0] % whole.n[1],
                                   i / whole.n[0] / whole.n[1]};
            for (int a = 0; a < 3 && all[i] < 0; a++) {
                low[a] = at[a] < low[a] ? at[a] : low[a];
                high[a] = at[a] > high[a] ? at[a] : high[a];
            }
        }
        free(all);
        // one voxel around the shape
        sdm_grid g = whole;
        double first[3];
        for (int a = 0; a < 3; a++) {
            first[a] = (double)(low[a] - 1);
            g.n[a] = high[a] - low[a] + 3;
        }
        sdm_grid_world(&whole, first, g.origin);
        float *v = map_fill(&g, shapes[k]);
        const double h = g.spacing[0], band = 5 * h;
        map_maker maker = {.f = shapes[k]};
        sdm_vdb_opts o = {.band_voxels = 5, .map = make_map, .user = &maker};
        sdm_vdb_report r = write_level_set(&g, v, &o);
        assert_true(r.estimated_voxels == 0 && !r.cut && maker.calls == 1);
        assert_true(error_beyond(&g, shapes[k], 7, band) < 1e-6);
        sdm_free(file_verify());
        o.map = NULL;
        r = write_level_set(&g, v, &o);
        assert_true(r.estimated_voxels > 100);
        const double estimated = error_beyond(&g, shapes[k], 7, band);
        if (!(estimated > 1e-3 * h && estimated < 0.25 * h)) fail_msg("%g voxels", estimated / h);
        // an error of the map is one of the writer, and leaves no file
        sdm_error err;
        remove(FILE_NAME);
        maker.status = SDM_E_NOMEM;
        o.map = make_map;
        assert_int_equal(sdm_vdb_write(FILE_NAME, &g, v, &o, NULL, &err), SDM_E_NOMEM);
        assert_true(access(FILE_NAME, F_OK) != 0);
        free(v);
    }
}

// The narrow band leaves the grid, the surface does not: values in the grid are kept, and outside
// the distance is continued.
static void test_band_beyond_grid(void **state)
{
    (void)state;
    const int64_t n[3] = {18, 18, 18};
    const double centre[3] = {0, 0, 0};
    const sdm_grid g = sdm_grid_centred(n, 0.16, centre);
    float *v = map_fill(&g, sphere);
    assert_false(write_level_set(&g, v, NULL).cut);
    double largest;
    assert_int_equal(compare(&g, v, 0.48, &largest), 0);
    sdm_free(file_verify());
    for (int32_t band = 3; band <= 10; band += 7) {
        (void)write_level_set(&g, v, &(sdm_vdb_opts){.band_voxels = band});
        const int32_t pad = band + 3;
        float *back = read_box(&g, pad);
        double worst = 0;
        size_t at = 0;
        for (int32_t k = -pad; k < 18 + pad; k++)
            for (int32_t j = -pad; j < 18 + pad; j++)
                for (int32_t i = -pad; i < 18 + pad; i++, at++) {
                    const double index[3] = {(double)i, (double)j, (double)k};
                    double x[3];
                    sdm_grid_world(&g, index, x);
                    const double exact = fmin(sphere(x), band * 0.16);
                    if (exact > -band * 0.16) worst = fmax(worst, fabs(exact - (double)back[at]));
                }
        assert_true(worst < 0.25 * 0.16);
        free(back);
    }
    free(v);
}

// A rotated and mirrored grid is a level set as well and keeps its position in the world.
static void test_rotated_grid_keeps_its_place(void **state)
{
    (void)state;
    sdm_grid g = test_grid();
    const double c = cos(0.3), s = sin(0.3), dir[9] = {c, -s, 0, s, c, 0, 0, 0, -1};
    memcpy(g.dir, dir, sizeof dir);
    const double middle[3] = {22, 19, 15};
    double x[3];
    sdm_grid_world(&g, middle, x);
    for (int a = 0; a < 3; a++) g.origin[a] -= x[a];
    float *v = map_fill(&g, torus);
    write_level_set(&g, v, NULL);
    double largest;
    assert_int_equal(compare(&g, v, 0.48, &largest), 0);
    char *text = file_verify(), *origin = strstr(text, "origin        ");
    double o[3];
    assert_non_null(origin);
    assert_int_equal(sscanf(origin + 14, "%lf %lf %lf", &o[0], &o[1], &o[2]), 3);
    for (int a = 0; a < 3; a++) assert_true(fabs(o[a] - g.origin[a]) < 1e-12);
    sdm_free(text);
    free(v);
}

// Writes a ball of radius 4 voxels on rotated axes whose spacings differ by the relative amount
// `apart`; it must be a level set.
static void write_turned(double spacing, double apart, const double dir[9])
{
    const double centre[3] = {0, 0, 0}, middle[3] = {6, 6, 6};
    sdm_grid g = sdm_grid_centred((const int64_t[3]){13, 13, 13}, spacing, centre);
    double x[3];
    memcpy(g.dir, dir, sizeof g.dir);
    g.spacing[1] *= 1 + apart;
    g.spacing[2] *= 1 - apart;
    sdm_grid_world(&g, middle, x);
    for (int a = 0; a < 3; a++) g.origin[a] -= x[a];
    float *v = malloc(sdm_grid_count(&g) * sizeof *v);
    assert_non_null(v);
    for (size_t i = 0; i < sdm_grid_count(&g); i++) {
        const double index[3] = {(double)(i % 13), (double)(i / 13 % 13), (double)(i / 169)};
        sdm_grid_world(&g, index, x);
        v[i] = (float)(sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) - 4 * spacing);
    }
    write_level_set(&g, v, NULL);
    double largest;
    (void)compare(&g, v, 3 * spacing, &largest);
    // The background is rounded to the next float.
    assert_true(largest <= 3.6e-7 * spacing);
    sdm_free(file_verify());
    free(v);
}

// OpenVDB rounds the voxel size of rotated grids, which must not make the band too narrow or the
// voxels anisotropic.
static void test_rounded_voxel_size(void **state)
{
    (void)state;
    static const double swapped[9] = {0, 1, 0, -1, 0, 0, 0, 0, 1},
                        straight[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    for (int i = 1; i <= 20; i++) {
        const double a = cos(i), b = sin(i), c = cos(0.7 * i), d = sin(0.7 * i);
        const double dir[9] = {a, -b * c, b * d, b, a * c, -a * d, 0, d, c};
        write_turned(0.5, i % 2 ? 0 : 4e-7, dir);
    }
    static const double spacings[] = {0.001, 0.002, 0.005, 0.01, 3};
    for (size_t i = 0; i < sizeof spacings / sizeof *spacings; i++) {
        write_turned(spacings[i], 0, swapped);
        write_turned(spacings[i], 4e-7, straight);
    }
}

static void write_refused(const sdm_grid *g, const float *v, const sdm_vdb_opts *o,
                          sdm_status expected, const char *said)
{
    sdm_error err;
    unlink(FILE_NAME);
    assert_int_equal(sdm_vdb_write(FILE_NAME, g, v, o, NULL, &err), expected);
    if (!strstr(err.text, said)) fail_msg("\"%s\" not in \"%s\"", said, err.text);
    assert_int_equal(access(FILE_NAME, F_OK), -1);
}

static void test_bad_maps_are_refused(void **state)
{
    (void)state;
    sdm_grid g = test_grid();
    float *v = map_fill(&g, sphere);
    const float kept = v[777];
    v[777] = NAN;
    write_refused(&g, v, NULL, SDM_E_ARG, "need finite");
    write_refused(&g, v, &(sdm_vdb_opts){.dense = true}, SDM_E_ARG, "need finite");
    v[777] = kept;
    g.spacing[2] = 0.17;
    write_refused(&g, v, NULL, SDM_E_ARG, "sdm_vdb_opts.dense");
    g.spacing[2] = 0.16;
    write_refused(&g, v, &(sdm_vdb_opts){.band_voxels = 2}, SDM_E_ARG, "need 3 to 100");
    write_refused(&g, v, &(sdm_vdb_opts){.band_voxels = NAN}, SDM_E_ARG, "need 3 to 100");
    write_refused(&g, v,
                  &(sdm_vdb_opts){.metadata = &(sdm_named_value){"sdm_hash", "1"}, .n_metadata = 1},
                  SDM_E_ARG, "program itself");
    write_refused(&g, v,
                  &(sdm_vdb_opts){.metadata = &(sdm_named_value){NULL, "1"}, .n_metadata = 1},
                  SDM_E_ARG, "no name");
    write_refused(&g, NULL, NULL, SDM_E_ARG, "needed");
    for (int a = 0; a < 3; a++) g.spacing[a] = 22000;
    write_refused(&g, v, &(sdm_vdb_opts){.half = true}, SDM_E_ARG,
                  "too large for the number format");
    for (int a = 0; a < 3; a++) g.spacing[a] = 2e38;
    write_refused(&g, v, NULL, SDM_E_ARG, "too large for the number format");
    for (int a = 0; a < 3; a++) g.spacing[a] = 1e-5;
    write_refused(&g, v, NULL, SDM_E_ARG, "too small for OpenVDB");
    write_refused(&g, v, &(sdm_vdb_opts){.dense = true}, SDM_E_ARG, "too small for OpenVDB");
    for (int a = 0; a < 3; a++) g.spacing[a] = 2e-5;
    const double c = cos(0.3), s = sin(0.3), dir[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
    memcpy(g.dir, dir, sizeof g.dir);
    write_refused(&g, v, NULL, SDM_E_ARG, "on turned axes are not uniform");
    g = test_grid();
    v[777] = 70000.0f;
    write_refused(&g, v, &(sdm_vdb_opts){.dense = true, .half = true}, SDM_E_ARG, "65504");
    free(v);
    const struct {
        distance f;
        sdm_status status;
        const char *said;
    } maps[] = {
        {all_outside, SDM_E_ARG, "no voxel of the map is inside"},
        {step_function, SDM_E_QUALITY, "not a distance map"},
    };
    for (size_t i = 0; i < 2; i++) {
        v = map_fill(&g, maps[i].f);
        write_refused(&g, v, NULL, maps[i].status, maps[i].said);
        free(v);
    }
}

// A gradient of 0.2 is no distance map; one of 0.8 is accepted, since maps of networks may have it.
static void test_gradient_limits(void **state)
{
    (void)state;
    const sdm_grid g = test_grid();
    float *v = map_fill(&g, shallow);
    write_refused(&g, v, NULL, SDM_E_QUALITY, "not a valid level set");
    for (size_t i = 0; i < sdm_grid_count(&g); i++) v[i] *= 4;
    assert_int_equal(write_level_set(&g, v, NULL).adjusted_voxels, 0);
    sdm_free(file_verify());
    free(v);
}

static void test_unwritable_paths_are_errors(void **state)
{
    (void)state;
    const sdm_grid g = test_grid();
    float *v = map_fill(&g, sphere);
    sdm_error err;
    assert_int_equal(sdm_vdb_write("no/such/folder/a.vdb", &g, v, NULL, NULL, &err), SDM_E_IO);
    assert_int_equal(access("no", F_OK), -1);
    assert_int_equal(sdm_vdb_write("", &g, v, NULL, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_vdb_verify("no/such/folder/a.vdb", NULL, &err), SDM_E_IO);
    assert_int_equal(sdm_vdb_sample(NULL, NULL, 0, NULL, &err), SDM_E_ARG);
    free(v);
}

static void file_save(const uint8_t *data, size_t size)
{
    FILE *f = fopen(FILE_NAME, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(data, 1, size, f), size);
    assert_int_equal(fclose(f), 0);
}

static bool stop(void *user) { return --*(int *)user < 0; }

// Cancelled at each call of the hook: no file is left.
static void test_cancelled_leaves_no_file(void **state)
{
    (void)state;
    const int64_t n[3] = {30, 28, 26};
    const double centre[3] = {0, 0, 0};
    const sdm_grid g = sdm_grid_centred(n, 0.15, centre);
    float *v = map_fill(&g, tilted_box); // has creases, and its band leaves the grid
    unlink(FILE_NAME);
    sdm_status s = SDM_E_CANCELLED;
    int calls = 0;
    for (; s == SDM_E_CANCELLED && calls < 1000; calls++) {
        int left = calls;
        sdm_error err;
        const sdm_vdb_opts o = {.band_voxels = 12, .cancelled = stop, .user = &left};
        s = sdm_vdb_write(FILE_NAME, &g, v, &o, NULL, &err);
        if (s) {
            assert_int_equal(s, SDM_E_CANCELLED);
            assert_int_not_equal(access(FILE_NAME, F_OK), 0);
        }
    }
    assert_int_equal(s, SDM_OK);
    assert_true(calls > 26 + 2 * 12); // at least once for each layer of the padded grid
    sdm_free(file_verify());
    free(v);
}

// Every kind of damage is detected before OpenVDB parses the file.
static void test_damage_is_found(void **state)
{
    (void)state;
    const int64_t n[3] = {15, 14, 13};
    const double centre[3] = {0, 0, 0};
    const sdm_grid g = sdm_grid_centred(n, 0.3, centre);
    float *v = map_fill(&g, sphere);
    write_level_set(&g, v, NULL);
    free(v);
    uint8_t *data;
    size_t size;
    sdm_error err;
    assert_ok(sdm_file_read(FILE_NAME, 1u << 24, &data, &size, &err), &err);
    for (size_t bit = 0; bit < size * 8; bit += 97) {
        data[bit / 8] ^= (uint8_t)(1u << (bit % 8));
        file_save(data, size);
        const sdm_status s = sdm_vdb_verify(FILE_NAME, NULL, &err);
        if (s != SDM_E_FORMAT) fail_msg("bit %zu of %zu: %s", bit, size * 8, sdm_status_name(s));
        data[bit / 8] ^= (uint8_t)(1u << (bit % 8));
    }
    for (size_t cut = 1500; cut < size; cut += 211) {
        file_save(data, cut);
        const sdm_status s = sdm_vdb_verify(FILE_NAME, NULL, &err);
        if (s != SDM_E_FORMAT)
            fail_msg("cut to %zu of %zu bytes: %s", cut, size, sdm_status_name(s));
    }
    for (size_t cut = 0; cut < 40; cut++) {
        file_save(data, cut);
        assert_int_equal(sdm_vdb_verify(FILE_NAME, NULL, &err), SDM_E_FORMAT);
    }
    file_save(data, size);
    sdm_free(file_verify());
    sdm_free(data);
    unlink(FILE_NAME);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_smooth_sphere),
        cmocka_unit_test(test_smooth_torus),
        cmocka_unit_test(test_creases_change_few_values),
        cmocka_unit_test(test_thin_parts_stay),
        cmocka_unit_test(test_metadata_and_options),
        cmocka_unit_test(test_half_precision),
        cmocka_unit_test(test_dense_map),
        cmocka_unit_test(test_shape_cut_by_the_grid),
        cmocka_unit_test(test_all_inside),
        cmocka_unit_test(test_exact_band_beyond_grid),
        cmocka_unit_test(test_band_beyond_grid),
        cmocka_unit_test(test_rotated_grid_keeps_its_place),
        cmocka_unit_test(test_rounded_voxel_size),
        cmocka_unit_test(test_bad_maps_are_refused),
        cmocka_unit_test(test_gradient_limits),
        cmocka_unit_test(test_unwritable_paths_are_errors),
        cmocka_unit_test(test_cancelled_leaves_no_file),
        cmocka_unit_test(test_damage_is_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
