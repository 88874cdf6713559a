/* Grids that are fitted to the shapes of a configuration.
 * Tests: fitted_grid.c flat_faces.c grid_faces.c shape_grid.c shape_box.c shape_thickness.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/shape_box.h"
#include "train_tools.h"

static void read_config(sdm_config *c, const char *grid)
{
    char text[512];
    sdm_error e = {0};
    snprintf(text, sizeof text,
             "shape: {name: capsule, ranges: {radius: [1, 2]}}\n%s\ntrain: {steps: 1}\n", grid);
    if (sdm_config_parse("test.yaml", text, strlen(text), NULL, 0, c, &e)) fail_msg("%s", e.text);
}

// The grid contains the box and the margin. Its longest edge has at most the number of voxels asked
// for, and only a few less. Its spacing is rounded to two significant digits.
static void check_around(double size, double place, int voxels)
{
    const double low[3] = {place, place - size, -0.3 * size},
                 high[3] = {place + 0.7 * size, place, 0};
    sdm_grid g;
    sdm_error e = {0};
    if (sdm_grid_around(low, high, voxels, NULL, &g, &e)) fail_msg("%s", e.text);
    const double h = g.spacing[0];
    char digits[32];
    snprintf(digits, sizeof digits, "%.1e", h);
    assert_true(fabs(strtod(digits, NULL) - h) < 1e-12 * h);
    assert_true(h == g.spacing[1] && h == g.spacing[2]);
    assert_true(g.n[1] <= voxels && (double)g.n[1] > 0.88 * voxels);
    for (int i = 0; i < 3; i++) {
        const double before = (low[i] - g.origin[i]) / h,
                     after = (g.origin[i] - high[i]) / h + (double)(g.n[i] - 1);
        assert_true(before > 2.89 && after > 2.89 && before + after < 7.01);
    }
}

static void test_around(void **state)
{
    (void)state;
    for (int i = -12; i < 24; i++) check_around(pow(1.7, i), 3.3 * i, 60);
    check_around(10, 0, 16);
    check_around(10, 0, 1000);

    // a spacing that is given; a box without thickness
    const double low[3] = {0, 1, 2}, high[3] = {10, 11, 2}, h[3] = {0.5, 1, 0.25};
    sdm_grid g;
    assert_int_equal(sdm_grid_around(low, high, 0, h, &g, NULL), SDM_OK);
    assert_true(g.n[0] == 27 && g.n[1] == 17 && g.n[2] == 7);
    assert_true(g.origin[0] == -1.5 && g.origin[1] == -2 && fabs(g.origin[2] - 1.25) < 0.01);
    assert_int_equal(sdm_grid_around(high, low, 60, NULL, &g, NULL), SDM_E_ARG);
    assert_int_equal(sdm_grid_around(low, low, 60, NULL, &g, NULL), SDM_E_ARG);
    assert_int_equal(sdm_grid_around(low, high, 7, NULL, &g, NULL), SDM_E_ARG);
    assert_int_equal(sdm_grid_around(low, high, 0, (const double[3]){1e-6, 1, 1}, &g, NULL),
                     SDM_E_ARG);
}

// How much larger than a box a grid is: its voxels over those from 3 voxels before the box to 3
// voxels behind it.
static void test_surplus(void **state)
{
    (void)state;
    const double low[3] = {0, 0, 0}, high[3] = {4, 8, 16}, empty[3] = {-1, 8, 16};
    double along[3];
    // 9, 17 and 33 centres within the box, 6 more in the margins
    sdm_grid g = {
        .n = {15, 23, 39}, .spacing = {0.5, 0.5, 0.5}, .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    assert_true(fabs(sdm_grid_surplus(&g, low, high, along) - 1) < 1e-12);
    g.n[0] = 30, g.n[2] = 117;
    assert_true(fabs(sdm_grid_surplus(&g, low, high, along) - 6) < 1e-12);
    assert_true(fabs(along[0] - 2) < 1e-12 && along[1] == 1 && fabs(along[2] - 3) < 1e-12);
    // the first axis of the grid runs along z: 39 voxels of it are needed, along the third 15
    const double turned[9] = {0, 0, 1, 0, 1, 0, 1, 0, 0};
    memcpy(g.dir, turned, sizeof turned);
    g.n[0] = 39, g.n[2] = 30;
    assert_true(fabs(sdm_grid_surplus(&g, low, high, along) - 2) < 1e-12);
    assert_true(along[0] == 1 && fabs(along[2] - 2) < 1e-12);
    assert_true(isnan(sdm_grid_surplus(&g, low, empty, along)));
}

// The capsule: a cylinder with round ends about z. Its box over the ranges is known.
static void test_capsule(void **state)
{
    (void)state;
    static const char *const GRIDS[] = {"", "grid: auto", "grid: {voxels: 60}"};
    sdm_config c, other;
    sdm_error e = {0};
    sdm_text line = {0};
    const sdm_param *p = sdm_instance_params(capsule, NULL);
    const double reach[3] = {2, 2, 2 + 0.5 * p[1].max};
    read_config(&c, GRIDS[0]);
    if (sdm_train_complete(&c, capsule, &line, &e)) fail_msg("%s", e.text);
    for (int i = 0; i < 3; i++) {
        const double from = c.grid.origin[i], h = c.grid.spacing[i],
                     to = from + (double)(c.grid.n[i] - 1) * h;
        assert_true(from < -reach[i] - 2.5 * h && from > -reach[i] - 4 * h);
        assert_true(to > reach[i] + 2.5 * h && to < reach[i] + 4 * h);
    }
    assert_true(c.grid.n[2] <= 60 && c.train.near_mm == 2 * c.grid.spacing[0]);
    assert_non_null(strstr(line.data, "grid: size: ["));
    assert_non_null(strstr(line.data, "reaches from -2.00 to 2.00 mm in x"));
    sdm_text_dispose(&line);
    for (int k = 1; k < 3; k++) {
        read_config(&other, GRIDS[k]);
        assert_int_equal(sdm_train_complete(&other, capsule, NULL, &e), SDM_OK);
        assert_memory_equal(&other.grid, &c.grid, sizeof c.grid);
    }
    // a complete grid stays as it is
    read_config(&c, "grid: {size: [4, 5, 6], spacing: 1}");
    other = c;
    assert_int_equal(sdm_train_complete(&c, capsule, NULL, &e), SDM_OK);
    assert_memory_equal(&other.grid, &c.grid, sizeof c.grid);
    // a training needs a complete grid
    read_config(&c, "grid: auto");
    assert_int_equal(sdm_train(&c, capsule, folder, false, NULL, NULL, &e), SDM_E_ARG);
    assert_non_null(strstr(e.text, "sdm_train_complete"));
    run_files_remove();
}

// A spacing in metres would make more voxels than any computer holds.
static void test_metres(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    read_config(&c, "grid: {spacing: 0.0002}");
    assert_int_equal(sdm_train_complete(&c, capsule, NULL, &e), SDM_E_CONFIG);
    assert_non_null(strstr(e.text, "test.yaml: grid.spacing is 0.0002 mm, and the shape is "));
    assert_non_null(strstr(e.text, "Give the spacing in mm (0.2, if it was given in metres), or "));
    assert_non_null(strstr(e.text, "grid.voxels"));
    // finer than any unit explains
    read_config(&c, "grid: {spacing: 0.000001}");
    assert_int_equal(sdm_train_complete(&c, capsule, NULL, &e), SDM_E_CONFIG);
    assert_null(strstr(e.text, "metres"));
}

static const sdm_param PLATE[] = {{"thick", "mm", 0.4, 0.5, 0.45, "thickness"}};

/* A plate of 10 mm x 10 mm. */
static int plate_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                      const double *p, sdm_mesh_out *out)
{
    static const uint32_t TRI[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                     2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    (void)self, (void)options;
    const int failed = host->reserve(host, out, 8, 12);
    if (failed) return failed;
    for (int i = 0; i < 8; i++) {
        out->vert[3 * i] = i & 1 ? 5 : -5;
        out->vert[3 * i + 1] = i & 2 ? 5 : -5;
        out->vert[3 * i + 2] = i & 4 ? p[0] : 0;
    }
    memcpy(out->tri, TRI, sizeof TRI);
    return 0;
}

static const sdm_shape plate_shape = {.abi = SDM_SHAPE_ABI,
                                      .size = sizeof(sdm_shape),
                                      .name = "plate",
                                      .summary = "plate",
                                      .params = PLATE,
                                      .n_params = 1,
                                      .mesh = plate_mesh};

// Thin parts get smaller voxels, three across them where 96 voxels along the longest edge and the
// memory for the maps allow it; a number of voxels that is given stays.
static void test_thin(void **state)
{
    (void)state;
    static const char *const KEYS[] = {"", "grid: {voxels: 60}\n",
                                       "data: {start: 9000, memory_gb: 1.2}\n"};
    sdm_config c[3];
    sdm_text line = {0};
    sdm_error e = {0};
    sdm_instance *plate = NULL;
    if (sdm_registry_add(registry, &plate_shape, "test", &e) ||
        sdm_instance_create(&plate_shape, NULL, 0, NULL, &plate, &e))
        fail_msg("%s", e.text);
    for (int k = 0; k < 3; k++) {
        char text[256];
        snprintf(text, sizeof text, "shape: {name: plate}\n%strain: {steps: 1}\n", KEYS[k]);
        if (sdm_config_parse("test.yaml", text, strlen(text), NULL, 0, &c[k], &e) ||
            sdm_train_complete(&c[k], plate, k ? NULL : &line, &e))
            fail_msg("%s", e.text);
    }
    const double fine = c[0].grid.spacing[0], usual = c[1].grid.spacing[0];
    assert_true(c[1].grid.n[0] <= 60 && 3 * usual > 0.5);
    assert_true(c[0].grid.n[0] <= 96 && 3 * fine < 0.42);
    assert_non_null(strstr(line.data, "because the thinnest part of 8 random shapes is 0.4"));
    assert_true(c[2].grid.spacing[0] > fine && c[2].grid.spacing[0] < usual);
    sdm_text_dispose(&line);
    sdm_instance_free(plate);
}

/* A plate of 10 scale x 10 scale mm. */
static int scaled_plate(const sdm_host *host, const double *p, double scale, sdm_mesh_out *out)
{
    const int failed = plate_mesh(NULL, host, NULL, p, out);
    for (int i = 0; i < 8 && !failed; i++)
        for (int a = 0; a < 2; a++) out->vert[3 * i + a] *= scale;
    return failed;
}

static int sheet_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                      const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    return scaled_plate(host, p, 3, out);
}

static int slate_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                      const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    return scaled_plate(host, p, 1.2, out);
}

static int foil_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                     const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    return scaled_plate(host, p, 20, out);
}

static int leaf_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                     const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    return scaled_plate(host, p, 2000, out);
}

// A part that needs over 96 voxels along the longest edge for two voxels across it gets them, up to
// 400,000 in all; the line says what keeps the grid from being finer, and the key that makes it so.
static void test_thinner(void **state)
{
    (void)state;
    static const char text[] = "shape: {name: plate}\ntrain: {steps: 1}\n";
    sdm_error e = {0};
    for (int k = 0; k < 3; k++) {
        sdm_shape thin = plate_shape;
        sdm_config c;
        sdm_text line = {0};
        sdm_instance *sheet = NULL;
        thin.mesh = k > 1 ? leaf_mesh : k ? foil_mesh : sheet_mesh;
        if (sdm_instance_create(&thin, NULL, 0, NULL, &sheet, &e) ||
            sdm_config_parse("test.yaml", text, strlen(text), NULL, 0, &c, &e) ||
            sdm_train_complete(&c, sheet, &line, &e))
            fail_msg("%s", e.text);
        if (!k) assert_true(c.grid.n[0] > 96 && 2 * c.grid.spacing[0] <= 0.42);
        assert_true(sdm_grid_count(&c.grid) <= 400000);
        const bool none = strstr(line.data, "; no grid shows the thinnest part, which is 0.4");
        if (k > 1) {
            if (!none || strstr(line.data, "{spacing: ")) fail_msg("%s", line.data);
        } else if (!strstr(line.data,
                           k ? "; 1,000,000 voxels, the most for a part that would be missing, "
                               "do not show it; still finer with grid: "
                               "{spacing: 0.1"
                             : "; no more than two voxels across it, as the longest edge has "
                               "over 96; still finer with grid: {spacing: 0.1"))
            fail_msg("%s", line.data);
        const char *price =
            strstr(line.data, " times as many, which take as many times longer; maps");
        assert_int_equal(price != NULL, k < 2);
        sdm_text_dispose(&line);
        sdm_instance_free(sheet);
    }
}

static int film_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                     const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    return scaled_plate(host, p, 8, out);
}

// The grid has up to a million voxels where a part would be missing on a coarser one, if the memory
// for maps allows them; also where only an end of the range makes the part so thin. The thinnest
// plate has the thickness at the lower end of the range.
static void test_missing(void **state)
{
    (void)state;
    static const struct {
        double from, to, memory_gb;
        int (*mesh)(const void *, const sdm_host *, const sdm_option_value *, const double *,
                    sdm_mesh_out *);
    } cases[] = {{0.4, 0.5, 40, film_mesh}, {0.1, 2, 40, plate_mesh}, {0.4, 0.5, 4, film_mesh}};
    sdm_error e = {0};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const sdm_param thick = {"thick", "mm", cases[k].from, cases[k].to, cases[k].to, ""};
        sdm_shape thin = plate_shape;
        sdm_config c;
        sdm_text line = {0};
        sdm_instance *plate = NULL;
        char text[128];
        thin.params = &thick, thin.mesh = cases[k].mesh;
        snprintf(text, sizeof text,
                 "shape: {name: plate}\ndata: {memory_gb: %g}\n"
                 "train: {steps: 1}\n",
                 cases[k].memory_gb);
        if (sdm_instance_create(&thin, NULL, 0, NULL, &plate, &e) ||
            sdm_config_parse("test.yaml", text, strlen(text), NULL, 0, &c, &e) ||
            sdm_train_complete(&c, plate, &line, &e))
            fail_msg("%s", e.text);
        const double h = c.grid.spacing[0];
        const bool shown = cases[k].from >= sqrt(2) * h;
        assert_true(c.grid_fitted && sdm_grid_count(&c.grid) <= 1000000);
        if (shown == (k == 2) || !strstr(line.data, "also at the ends of the ranges, is "))
            fail_msg("case %zu, voxels of %g mm: %s", k, h, line.data);
        if (k == 2 && !strstr(line.data, "; data.memory_gb does not hold maps of the voxels that "))
            fail_msg("%s", line.data);
        sdm_text_dispose(&line);
        sdm_instance_free(plate);
    }
}

// A grid that is coarser than three voxels across the thinnest part by less than a tenth is fine
// enough: no finer one is proposed.
static void test_hardly_finer(void **state)
{
    (void)state;
    static const char text[] = "shape: {name: plate}\ntrain: {steps: 1}\n";
    sdm_shape thin = plate_shape;
    sdm_config c;
    sdm_text line = {0};
    sdm_error e = {0};
    sdm_instance *slate = NULL;
    thin.mesh = slate_mesh;
    if (sdm_instance_create(&thin, NULL, 0, NULL, &slate, &e) ||
        sdm_config_parse("test.yaml", text, strlen(text), NULL, 0, &c, &e) ||
        sdm_train_complete(&c, slate, &line, &e))
        fail_msg("%s", e.text);
    if (!strstr(line.data, " in place of ") || strstr(line.data, "finer with"))
        fail_msg("%s", line.data);
    sdm_text_dispose(&line);
    sdm_instance_free(slate);
}

/* Distance, in voxels, of a plane perpendicular to an axis from the closest voxel centres. */
static double plane_distance(const sdm_grid *g, int axis, double at)
{
    const double index = (at - g->origin[axis]) / g->spacing[axis];
    return fabs(index - nearbyint(index));
}

// The faces of the plate at x = -5, x = 5, y = -5, y = 5 and z = 0 stay in place, that at
// z = thick does not. No plane of voxel centres comes near those that stay, the margin is kept, and
// a shape without such faces has the grid around its box.
static void test_faces(void **state)
{
    (void)state;
    static const char *const GRIDS[] = {
        "auto",         "{voxels: 40}",   "{voxels: 17}",    "{spacing: 0.5}",
        "{spacing: 2}", "{spacing: 0.4}", "{spacing: 1.25}", "{spacing: [0.5, 1, 0.3]}"};
    const double low[3] = {-5, -5, 0}, high[3] = {5, 5, 0.5}, range[1][2] = {{0.4, 0.5}};
    sdm_error e = {0};
    sdm_instance *plate = NULL;
    sdm_grid g;
    size_t moved = 0;
    assert_int_equal(sdm_instance_create(&plate_shape, NULL, 0, NULL, &plate, &e), SDM_OK);
    for (size_t k = 0; k < sizeof GRIDS / sizeof *GRIDS; k++) {
        sdm_config c;
        char text[256];
        snprintf(text, sizeof text, "shape: {name: plate}\ngrid: %s\ntrain: {steps: 1}\n",
                 GRIDS[k]);
        if (sdm_config_parse("test.yaml", text, strlen(text), NULL, 0, &c, &e) ||
            sdm_train_complete(&c, plate, NULL, &e))
            fail_msg("%s", e.text);
        assert_true(plane_distance(&c.grid, 2, 0) > 0.19);
        for (int a = 0; a < 3; a++) {
            const double h = c.grid.spacing[a], last = (double)(c.grid.n[a] - 1);
            // of two opposite faces one may be closer if the other is farther away
            const double off = plane_distance(&c.grid, a, low[a]);
            if (a < 2) assert_true(off + plane_distance(&c.grid, a, high[a]) > 0.3);
            assert_true((low[a] - c.grid.origin[a]) / h > 2.39);
            assert_true((c.grid.origin[a] - high[a]) / h + last > 2.39);
        }
        if (sdm_grid_around(low, high, 0, c.grid.spacing, &g, &e)) fail_msg("%s", e.text);
        assert_memory_equal(g.n, c.grid.n, sizeof g.n);
        moved += memcmp(g.origin, c.grid.origin, sizeof g.origin) != 0;
    }
    assert_true(moved > 4);

    const sdm_grid around = g;
    assert_int_equal(sdm_grid_avoid_faces(capsule, NULL, 8, 1, &g, &e), SDM_OK);
    assert_memory_equal(&g, &around, sizeof g);
    assert_int_equal(sdm_grid_avoid_faces(NULL, NULL, 8, 1, &g, &e), SDM_E_ARG);
    assert_int_equal(sdm_grid_avoid_faces(plate, range, 8, 1, NULL, &e), SDM_E_ARG);
    sdm_instance_free(plate);
}

// The plate on a grid whose planes of voxel centres hold its faces: those at x = -5 and 5 and z = 0
// lie in half voxels of 0.05 and 0.25 / 0.4 of the volume. The grid that is moved has none of them.
static void test_faces_on_planes(void **state)
{
    (void)state;
    const double range[1][2] = {{0.4, 0.5}}, p[1] = {0.5};
    sdm_grid g = {.n = {21, 21, 9},
                  .spacing = {1, 1, 0.5},
                  .origin = {-10, -9.7, -2},
                  .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    sdm_error e = {0};
    sdm_instance *plate = NULL;
    sdm_face_hits h;
    sdm_mesh m = {0};
    assert_int_equal(sdm_instance_create(&plate_shape, NULL, 0, NULL, &plate, &e), SDM_OK);
    if (sdm_grid_family_hits(plate, range, 8, 1, &g, &h, &e)) fail_msg("%s", e.text);
    assert_true(h.axis[0] && !h.axis[1] && h.axis[2]);
    assert_true(h.share > 0.1 + 0.25 / 0.5 && h.share < 0.1 + 0.25 / 0.4);
    g = h.moved;
    if (sdm_grid_family_hits(plate, range, 8, 1, &g, &h, &e)) fail_msg("%s", e.text);
    assert_true(h.share == 0 && g.origin[0] != -10 && g.origin[1] == -9.7);
    // one plate alone: its upper face counts as well. Then a grid that is turned, and a grid of one
    // voxel along an axis, whose voxels nobody counts
    if (sdm_instance_mesh(plate, p, &m, &e)) fail_msg("%s", e.text);
    const double turned[9] = {0, 0, 1, 0, 1, 0, 1, 0, 0};
    g = (sdm_grid){.n = {9, 21, 21}, .spacing = {0.5, 1, 1}, .origin = {-10, -9.7, -2}};
    memcpy(g.dir, turned, sizeof turned);
    if (sdm_grid_face_hits(&m, &g, &h, &e)) fail_msg("%s", e.text);
    assert_true(h.axis[0] && !h.axis[1] && h.axis[2] && fabs(h.share - 1.1) < 1e-12);
    g.n[0] = 1;
    if (sdm_grid_face_hits(&m, &g, &h, &e)) fail_msg("%s", e.text);
    assert_true(!h.axis[0] && fabs(h.share - 0.1) < 1e-12);
    assert_int_equal(sdm_grid_face_hits(&m, NULL, &h, &e), SDM_E_ARG);
    assert_int_equal(sdm_grid_family_hits(NULL, range, 8, 1, &g, &h, &e), SDM_E_ARG);
    sdm_mesh_dispose(&m);
    sdm_instance_free(plate);
}

// A proposal keeps the spacing of the configuration and reads as the keys that it names; where the
// spacing makes too many voxels, it says so.
static void test_proposal(void **state)
{
    (void)state;
    static const struct {
        const char *given, *words, *as;
        bool coarser;
    } cases[] = {{"grid: {size: [5, 6, 7], spacing: 1}", "grid: {spacing: 1} (",
                  "grid: {spacing: 1}", false},
                 {"grid: {size: [5, 6, 7], spacing: [1, 1, 0.5]}", "grid: {spacing: [1, 1, 0.5]} (",
                  "grid: {spacing: [1, 1, 0.5]}", false},
                 {"grid: {size: [5, 6, 7], spacing: 0.01}", "grid: auto (", "grid: auto", true}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        sdm_config c;
        sdm_error e = {0};
        sdm_text text = {0};
        read_config(&c, cases[k].given);
        if (sdm_train_grid_proposal(&c, capsule, &text, &e)) fail_msg("%s", e.text);
        assert_memory_equal(text.data, cases[k].words, strlen(cases[k].words));
        assert_int_equal(strstr(text.data, "coarser than yours: ") != NULL, cases[k].coarser);

        char proposed[256];
        const char *keys = strchr(text.data, '(') + 1;
        snprintf(proposed, sizeof proposed, "grid: {%.*s}", (int)strcspn(keys, ")"), keys);
        sdm_config as_keys, as_word;
        read_config(&as_keys, proposed);
        read_config(&as_word, cases[k].as);
        assert_int_equal(sdm_train_complete(&as_word, capsule, NULL, &e), SDM_OK);
        assert_memory_equal(&as_keys.grid, &as_word.grid, sizeof as_keys.grid);
        sdm_text_dispose(&text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_around),          cmocka_unit_test(test_capsule),
        cmocka_unit_test(test_metres),          cmocka_unit_test(test_thin),
        cmocka_unit_test(test_thinner),         cmocka_unit_test(test_missing),
        cmocka_unit_test(test_hardly_finer),    cmocka_unit_test(test_faces),
        cmocka_unit_test(test_surplus),         cmocka_unit_test(test_proposal),
        cmocka_unit_test(test_faces_on_planes),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
