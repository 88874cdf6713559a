/* Pictures of surfaces: hidden parts, colours, scale, wrong arguments.
 * Tests: surfaces.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "png_reader.h"
#include "sdm/internal/heap.h"
#include "sdm/picture.h"

/* Adds the square |x|, |y| <= half at height z, counter-clockwise seen from above, with `value`
 * at its vertices. */
static void square_append(sdm_mesh *m, double *values, double half, double z, double value)
{
    sdm_error err;
    const size_t v = m->n_vert, t = m->n_tri;
    assert_int_equal(sdm_mesh_reserve(m, v + 4, t + 2, &err), SDM_OK);
    for (size_t i = 0; i < 4; i++) {
        m->vert[3 * (v + i)] = i == 1 || i == 2 ? half : -half;
        m->vert[3 * (v + i) + 1] = i > 1 ? half : -half;
        m->vert[3 * (v + i) + 2] = z;
        values[v + i] = value;
    }
    const uint32_t k = (uint32_t)v, corners[6] = {k, k + 1, k + 2, k, k + 2, k + 3};
    memcpy(m->tri + 3 * t, corners, sizeof corners);
}

/* A small square above a large one hides its centre, in either order of the triangles. Colours
 * follow the sign of the values, and areas in pixels follow the scale. */
static void test_hidden_parts_colours_and_scale(void **state)
{
    (void)state;
    sdm_error err;
    picture p[2];
    for (int order = 0; order < 2; order++) {
        sdm_mesh m = {0};
        double values[8];
        for (int k = 0; k < 2; k++)
            if (k == order)
                square_append(&m, values, 5, 0, 1);
            else
                square_append(&m, values, 2, 1, -1);
        const sdm_picture_surface s = {"squares", &m, values};
        if (sdm_picture_surfaces("test_surfaces.png", &s, 1, "distance", &err))
            fail_msg("%s", err.text);
        p[order] = read_png("test_surfaces.png");
        sdm_mesh_dispose(&m);
    }
    assert_int_equal(p[0].w, p[1].w);
    assert_int_equal(p[0].h, p[1].h);
    assert_memory_equal(p[0].rgb, p[1].rgb, 3 * (size_t)p[0].w * (size_t)p[0].h);
    /* The oblique view is the widest: 10 mm (cos 30 + sin 30) on 400 pixels. The view from above
     * is drawn first. */
    const double pixels = 400 / (10 * (0.5 * sqrt(3) + 0.5)), room = 10 * pixels + 40;
    double green = 0, magenta = 0;
    for (int y = 46; y < 46 + room; y++)
        for (int x = 0; x < p[0].w; x++) {
            const unsigned char *c = p[0].rgb + 3 * ((size_t)y * (size_t)p[0].w + (size_t)x);
            green += c[1] > c[0] + 20 && c[1] > c[2] + 10;
            magenta += c[0] > c[1] + 20 && c[2] > c[1] + 10;
        }
    assert_true(fabs(green / (16 * pixels * pixels) - 1) < 0.03);
    assert_true(fabs(magenta / (84 * pixels * pixels) - 1) < 0.03);
    free(p[0].rgb);
    free(p[1].rgb);
}

/* The top of a plate whose sides share its vertices is flat: one shade from edge to edge. */
static void test_flat_face(void **state)
{
    (void)state;
    sdm_error err;
    sdm_mesh m = {0};
    static const uint32_t TRI[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                     2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    assert_int_equal(sdm_mesh_reserve(&m, 8, 12, &err), SDM_OK);
    for (size_t i = 0; i < 24; i++) m.vert[i] = (i / 3 >> i % 3 & 1) ? (i % 3 < 2 ? 10 : 1) : 0;
    memcpy(m.tri, TRI, sizeof TRI);
    const sdm_picture_surface s = {"plate", &m, NULL};
    if (sdm_picture_surfaces("test_flat.png", &s, 1, "none", &err)) fail_msg("%s", err.text);
    const picture p = read_png("test_flat.png");
    const double pixels = 400 / (10 * (0.5 * sqrt(3) + 0.5));
    size_t count[256] = {0}, most = 0;
    for (int y = 46; y < 46 + 10 * pixels + 40; y++)
        for (int x = 0; x < p.w; x++) {
            const unsigned char *c = p.rgb + 3 * ((size_t)y * (size_t)p.w + (size_t)x);
            if (c[0] > c[2] + 4 && ++count[c[0]] > most) most = count[c[0]]; // not grey
        }
    assert_true((double)most > 0.95 * 100 * pixels * pixels);
    free(p.rgb);
    sdm_mesh_dispose(&m);
}

/* Number of red pixels of a gallery of one mesh. */
static double red_pixels(const sdm_mesh *m)
{
    sdm_error err;
    const sdm_picture_surface s = {"x", m, NULL};
    if (sdm_picture_gallery("test_backs.png", &s, 1, "", &err)) fail_msg("%s", err.text);
    const picture p = read_png("test_backs.png");
    double n = 0;
    for (size_t i = 0; i < (size_t)p.w * (size_t)p.h; i++)
        n += p.rgb[3 * i] > p.rgb[3 * i + 1] + 40 && p.rgb[3 * i] > p.rgb[3 * i + 2] + 40;
    free(p.rgb);
    return n;
}

/* A square seen from its inner side is red, seen from its outer side it is not. The red one above
 * the other hides it only where it lies in front. */
static void test_inner_sides_are_red(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    double values[8];
    square_append(&m, values, 5, 0, 0);
    assert_true(red_pixels(&m) == 0);
    square_append(&m, values, 2, 1, 0);
    for (size_t t = 2; t < 4; t++) { // turn the small one over
        const uint32_t corner = m.tri[3 * t + 1];
        m.tri[3 * t + 1] = m.tri[3 * t + 2];
        m.tri[3 * t + 2] = corner;
    }
    const double pixels = 400 / (10 * (0.5 * sqrt(3) + 0.5));
    assert_true(fabs(red_pixels(&m) / (8 * pixels * pixels) - 1) < 0.05); // half as high as wide
    sdm_mesh_dispose(&m);
}

/* Five surfaces stand in two rows of three columns: the coloured fifth is below the middle of the
 * first row. It is a square of 10 mm, whose oblique view is half as high as wide. */
static void test_gallery(void **state)
{
    (void)state;
    sdm_error err;
    sdm_mesh m = {0};
    double values[4], none[4] = {0, 0, 0, 0};
    square_append(&m, values, 5, 0, 1);
    sdm_picture_surface s[17];
    for (size_t k = 0; k < 17; k++) s[k] = (sdm_picture_surface){"x", &m, k == 4 ? values : none};
    if (sdm_picture_gallery("test_gallery.png", s, 5, "distance", &err)) fail_msg("%s", err.text);
    const picture p = read_png("test_gallery.png");
    double n = 0, sum_x = 0, sum_y = 0;
    for (int y = 0; y < p.h - 92; y++) // without the colour bars
        for (int x = 0; x < p.w; x++) {
            const unsigned char *c = p.rgb + 3 * ((size_t)y * (size_t)p.w + (size_t)x);
            if (!(c[0] > c[1] + 20 && c[2] > c[1] + 10)) continue;
            n++;
            sum_x += x;
            sum_y += y;
        }
    const double pixels = 400 / (10 * (0.5 * sqrt(3) + 0.5));
    assert_true(fabs(n / (50 * pixels * pixels) - 1) < 0.03);
    assert_true(fabs(sum_x / n - 0.5 * p.w) < 3);
    assert_true(sum_y / n > 0.55 * p.h && sum_y / n < 0.85 * p.h);
    free(p.rgb);
    assert_int_equal(sdm_picture_gallery("a.png", s, 17, "", &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_gallery("a.png", s, 0, "", &err), SDM_E_ARG);
    sdm_mesh_dispose(&m);
}

/* Titles of parameters over narrow panels stay within their panels: in lines of at most `room`
 * characters, all parameters if they fit into two lines, else as many as fit and "...". */
static void test_long_titles_are_broken(void **state)
{
    (void)state;
    static const char *const TITLES[] = {
        "short", "width=1.234 height=2.345 length=3.456 edge=4.567",
        "a1=1.234 a2=2.345 a3=3.456 a4=4.567 a5=5.678 a6=6.789 a7=7.891 a8=8.912 a9=9.123"};
    const size_t room = 38; // a panel is 220 pixels wide at least
    sdm_error err;
    sdm_mesh m = {0};
    double values[4];
    square_append(&m, values, 1, 0, 1);
    for (int i = 0; i < 4; i++) m.vert[3 * i] *= 0.01; // narrow
    for (size_t k = 0; k < 3; k++) {
        char said[256] = "";
        const sdm_picture_surface s = {TITLES[k], &m, NULL};
        if (sdm_picture_gallery("test_titles.svg", &s, 1, "", &err)) fail_msg("%s", err.text);
        FILE *f = fopen("test_titles.svg", "r");
        assert_non_null(f);
        char line[4096];
        int lines = 0;
        while (fgets(line, sizeof line, f)) {
            char *begin = strstr(line, "<text "), *end = strstr(line, "</text>");
            if (!begin || !end || !strstr(begin, "\"middle\"") || strstr(begin, "mm<")) continue;
            *end = '\0';
            begin = strchr(begin, '>') + 1;
            assert_true(strlen(begin) <= room);
            snprintf(said + strlen(said), sizeof said - strlen(said), "%s%s", lines++ ? " " : "",
                     begin);
        }
        fclose(f);
        assert_int_equal(lines, k == 0 ? 1 : 2);
        if (k < 2) {
            assert_string_equal(said, TITLES[k]);
        } else {
            const size_t kept = strlen(said) - 4;
            assert_string_equal(said + kept, " ...");
            assert_memory_equal(said, TITLES[k], kept);
            assert_true(TITLES[k][kept] == ' ' && kept > 40);
        }
    }
    sdm_mesh_dispose(&m);
}

static void test_wrong_arguments_are_refused(void **state)
{
    (void)state;
    sdm_error err;
    sdm_mesh mesh = {0};
    double values[4];
    const sdm_picture_surface surface = {"a", &mesh, values}, missing = {"a", NULL, NULL};
    assert_int_equal(sdm_picture_surfaces("a.png", &surface, 1, "", &err),
                     SDM_E_MESH); /* a mesh without triangles */
    square_append(&mesh, values, 1, 0, NAN);
    assert_int_equal(sdm_picture_surfaces("a.png", &surface, 0, "", &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_surfaces("a.png", &surface, 9, "", &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_surfaces("a.png", &missing, 1, "", &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_surfaces("a.png", NULL, 1, "", &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_surfaces("a.png", &surface, 1, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_surfaces("no_such_folder/a.png", &surface, 1, "", &err), SDM_E_IO);
    for (unsigned long n = 1; n < 5; n++) {
        sdm_alloc_fail_after(n);
        const sdm_status s = sdm_picture_surfaces("test_picture_none.png", &surface, 1, "", &err);
        sdm_alloc_fail_after(0);
        assert_int_equal(s, SDM_E_NOMEM);
    }
    sdm_mesh_dispose(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_hidden_parts_colours_and_scale),
        cmocka_unit_test(test_flat_face),
        cmocka_unit_test(test_inner_sides_are_red),
        cmocka_unit_test(test_gallery),
        cmocka_unit_test(test_long_titles_are_broken),
        cmocka_unit_test(test_wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
