/* Pictures written as PNG and decoded by a small reader: images pixel by pixel, positions of
 * contours and curves, text, colours, ticks, wrong arguments.
 * Tests: canvas.c colours.c overlay.c panel.c plot.c sections.c slices.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "picture/panel.h"
#include "png_reader.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"
#include "sdm/picture.h"

static bool is_colour(const unsigned char *p, int r, int g, int b)
{
    return abs(p[0] - r) < 12 && abs(p[1] - g) < 12 && abs(p[2] - b) < 12;
}

static sdm_colour noise_pixel(const void *user, int x, int y)
{
    const uint64_t i = (uint64_t)(y * *(const int *)user + x);
    return (sdm_colour){(uint8_t)sdm_rng_below(1, 0, i, 256), (uint8_t)(i / 7), (uint8_t)x};
}

/* An image is copied pixel by pixel; what the clip region excludes stays white. */
static void test_image_is_exact(void **state)
{
    (void)state;
    static const int size[][2] = {{1, 1}, {37, 23}, {400, 300}};
    for (size_t k = 0; k < 3; k++) {
        const int w = size[k][0], h = size[k][1];
        sdm_canvas *c;
        assert_int_equal(sdm_canvas_create("test_picture_a.png", w + 7, h + 5, &c, NULL), SDM_OK);
        sdm_canvas_image(c, (sdm_box){4, 2, w, h}, noise_pixel, &w);
        sdm_canvas_clip(c, (sdm_box){0, 0, 2, 2});
        sdm_canvas_fill(c, (sdm_box){0, 0, 3, 3}, (sdm_colour){0, 0, 255}, 1);
        sdm_canvas_unclip(c);
        assert_int_equal(sdm_canvas_finish(c, NULL), SDM_OK);
        picture p = read_png("test_picture_a.png");
        assert_true(p.w == w + 7 && p.h == h + 5);
        for (int y = 0; y < p.h; y++)
            for (int x = 0; x < p.w; x++) {
                const bool inside = x >= 4 && x < 4 + w && y >= 2 && y < 2 + h;
                const sdm_colour want = inside           ? noise_pixel(&w, x - 4, y - 2)
                                        : x < 2 && y < 2 ? (sdm_colour){0, 0, 255}
                                                         : (sdm_colour){255, 255, 255};
                assert_memory_equal(p.rgb + 3 * (y * p.w + x), &want, 3);
            }
        free(p.rgb);
    }
}

/* The contour of a circle that passes through no voxel centre: each coloured pixel is within one
 * pixel of the circle, and there are coloured pixels in all directions. */
static void test_contour_is_subpixel(void **state)
{
    (void)state;
    float v[40 * 30];
    const double cx = 19.3, cy = 14.6, radius = 9.37, pixels = 10;
    for (int i = 0; i < 1200; i++) v[i] = (float)(hypot(i % 40 - cx, i / 40 - cy) - radius);
    const sdm_slice s = {v, {40, 30}, {1, 40}};
    const sdm_box box = {20, 10, 400, 300};
    sdm_canvas *c;
    assert_int_equal(sdm_canvas_create("test_picture_c.png", 440, 320, &c, NULL), SDM_OK);
    const sdm_contour_line line = {.width = 2, .colour = {255, 0, 0}, .rim = {255, 255, 255}};
    sdm_panel_contour(c, box, &s, 0, &line);
    assert_int_equal(sdm_canvas_finish(c, NULL), SDM_OK);
    picture p = read_png("test_picture_c.png");
    bool seen[360] = {false};
    for (int y = 0; y < p.h; y++)
        for (int x = 0; x < p.w; x++) {
            const double dx = x + 0.5 - box.x - (cx + 0.5) * pixels,
                         dy = box.y + box.h - (y + 0.5) - (cy + 0.5) * pixels;
            const bool red = p.rgb[3 * (y * p.w + x) + 1] < 128;
            const double off = fabs(hypot(dx, dy) - radius * pixels);
            if (red) assert_true(off < 1.4);
            if (off < 0.4) assert_true(red);
            if (red) seen[(int)((atan2(dy, dx) + 3.1415926535) / 6.2831853072 * 360) % 360] = true;
        }
    for (int i = 0; i < 360; i++) assert_true(seen[i]);
    free(p.rgb);
}

/* Distance map of a ball on a grid with different spacings. The caller frees it. */
static float *ball_map(sdm_grid *g, double radius)
{
    *g = (sdm_grid){.n = {40, 28, 25},
                    .origin = {-5, 2, 7},
                    .spacing = {0.25, 0.4, 0.5},
                    .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    float *v = malloc(sdm_grid_count(g) * sizeof *v);
    assert_non_null(v);
    for (int i = 0; i < 40 * 28 * 25; i++) {
        const double index[3] = {i % 40, i / 40 % 28, i / 1120};
        double x[3];
        sdm_grid_world(g, index, x);
        v[i] = (float)(sqrt(x[0] * x[0] + (x[1] - 7) * (x[1] - 7) + (x[2] - 13) * (x[2] - 13)) -
                       radius);
    }
    return v;
}

/* In all three slices the ball is a circle of the same diameter. */
static void test_slices_show_equal_circles(void **state)
{
    (void)state;
    sdm_grid g;
    float *v = ball_map(&g, 3), *e = malloc(sdm_grid_count(&g) * sizeof *e);
    const float levels[2] = {0, 1};
    assert_non_null(e);
    for (size_t i = 0; i < sdm_grid_count(&g); i++) e[i] = (float)fabs(0.01 * sin((double)i));
    const sdm_picture_map maps[2] = {{.title = "exact", .values = v},
                                     {.title = "error", .values = e, .error = true}};
    sdm_error err;
    assert_int_equal(sdm_picture_slices("test_picture_s.png", &g, maps, 1, levels, 2, &err),
                     SDM_OK);
    picture p = read_png("test_picture_s.png");
    int runs = 0, top = -1, left = p.w, right = -1, yellow = 0, first = 0;
    for (int y = 0; y < p.h; y++) {
        int n = 0;
        for (int x = 0; x < p.w; x++) {
            const unsigned char *pixel = p.rgb + 3 * ((size_t)y * (size_t)p.w + (size_t)x);
            yellow += is_colour(pixel, 255, 214, 10);
            if (!is_colour(pixel, 214, 28, 36)) continue;
            n++;
            left = x < left ? x : left;
            right = x > right ? x : right;
        }
        if (n && top < 0) top = y;
        if (n || top < 0) continue;
        const int height = y - top, width = right - left + 1;
        if (height > 20) { // a smaller one belongs to the legend
            assert_true(abs(height - width) <= 3);
            if (!runs) first = height;
            assert_true(abs(height - first) <= 3);
            runs++;
        }
        top = right = -1;
        left = p.w;
    }
    assert_int_equal(runs, 3);
    assert_true(yellow > 500);
    /* The longest axis, 12.5 mm, is drawn on 340 or 420 pixels; the circle has a diameter of 6
     * mm. */
    assert_true(first > 6 * 26 && first < 6 * 38);
    assert_true(is_colour(p.rgb, 255, 255, 255));
    const int one = p.w;
    free(p.rgb);
    assert_int_equal(sdm_picture_slices("test_picture_s.png", &g, maps, 2, levels, 1, &err),
                     SDM_OK);
    p = read_png("test_picture_s.png");
    assert_true(p.w > one + 200);
    free(p.rgb);
    free(v);
    free(e);
}

/* Number of pixels of a colour above the legend of an overlay, and their box. */
static int find_colour(const picture *p, int from, int to, sdm_colour want, sdm_box *box)
{
    int n = 0, low[2] = {p->w, p->h}, high[2] = {-1, -1};
    for (int y = 0; y < p->h - 40; y++)
        for (int x = from; x < to; x++) {
            const unsigned char *pixel = p->rgb + 3 * ((size_t)y * (size_t)p->w + (size_t)x);
            if (!is_colour(pixel, want.r, want.g, want.b)) continue;
            n++;
            low[0] = x < low[0] ? x : low[0], high[0] = x > high[0] ? x : high[0];
            low[1] = y < low[1] ? y : low[1], high[1] = y > high[1] ? y : high[1];
        }
    *box = (sdm_box){low[0], low[1], high[0] + 1 - low[0], high[1] + 1 - low[1]};
    return n;
}

/* In the column of a second map the contour is dashed, and that of the first map lies below it. */
static void test_second_map_shows_the_first(void **state)
{
    (void)state;
    sdm_grid g;
    float *v = ball_map(&g, 3), *w = ball_map(&g, 3.5);
    const float level = 0;
    const sdm_picture_map maps[3] = {{.title = "exact", .values = v},
                                     {.title = "network", .values = w},
                                     {.title = "error", .values = w, .error = true}};
    assert_int_equal(sdm_picture_slices("test_picture_d.png", &g, maps, 3, &level, 1, NULL),
                     SDM_OK);
    picture p = read_png("test_picture_d.png");
    const sdm_colour red = {214, 28, 36}, dark = {40, 40, 48};
    sdm_box box, below;
    const int third = p.w / 3, whole = find_colour(&p, 0, third, red, &box),
              dashed = find_colour(&p, third + 10, 2 * third, red, &box);
    assert_true(dashed > whole / 4 && dashed < 3 * whole / 4);
    // the circle of the exact map is the smaller one; numbers and frames lie beside both
    int inner = 0;
    for (int x = box.x + box.w / 2 - 5; x < box.x + box.w / 2 + 5; x++)
        inner += find_colour(&p, x, x + 1, dark, &below) > 0;
    assert_true(inner > 5);
    free(p.rgb);
    free(v);
    free(w);
}

/* Pixels with the ink of points, in a picture of the ball with these points. */
static int dark_pixels(const sdm_grid *g, const float *v, const double *points, size_t n)
{
    const sdm_picture_map map = {.title = "a", .values = v, .points = points, .n_points = n};
    sdm_error err = {0};
    if (sdm_picture_slices("test_picture_p.png", g, &map, 1, NULL, 0, &err))
        fail_msg("%s", err.text);
    picture p = read_png("test_picture_p.png");
    int dark = 0;
    for (int i = 0; i < p.w * p.h; i++) dark += is_colour(p.rgb + 3 * (size_t)i, 40, 40, 48);
    free(p.rgb);
    return dark;
}

/* A point in the middle of the ball lies on all three slices, one above it on two, one beside all
 * slices on none. The legend names points, if there are any. */
static void test_points_on_slices(void **state)
{
    (void)state;
    sdm_grid g;
    float *v = ball_map(&g, 3);
    const double middle[3] = {0, 7, 13}, above[3] = {0, 7, 16}, beside[3] = {2, 9, 16};
    const int none = dark_pixels(&g, v, beside, 1);
    const int three = dark_pixels(&g, v, middle, 1) - none,
              two = dark_pixels(&g, v, above, 1) - none;
    if (!(three > two && two >= 2)) fail_msg("%d %d of %d", three, two, none);
    assert_true(none > dark_pixels(&g, v, NULL, 0) + 2);
    free(v);
}

/* Maps with constant, NaN or huge values, and grids of a single voxel or line, still give a
 * picture. */
static void test_slices_of_odd_maps(void **state)
{
    (void)state;
    static float v[1000];
    const float level = 0;
    const sdm_picture_map maps[2] = {
        {.title = NULL, .values = v},
        {.title = "a title that is much longer than its column is wide, \xFF\xC3",
         .values = v,
         .error = true}};
    static const int64_t sizes[][3] = {
        {1, 1, 1}, {1000, 1, 1}, {1, 1, 1000}, {10, 10, 10}, {2, 500, 1}};
    for (size_t k = 0; k < 5; k++)
        for (int fill = 0; fill < 4; fill++) {
            sdm_grid g = {.spacing = {1, 2, 0.01}, .dir = {0.6, -0.8, 0, 0.8, 0.6, 0, 0, 0, -1}};
            memcpy(g.n, sizes[k], sizeof g.n);
            for (int i = 0; i < 1000; i++)
                v[i] = fill == 0 ? 0 : fill == 1 ? NAN : fill == 2 ? -1e30f : (float)(i % 7 - 3);
            assert_int_equal(sdm_picture_slices("test_picture_o.png", &g, maps, 2, &level, 1, NULL),
                             SDM_OK);
            picture p = read_png("test_picture_o.png");
            free(p.rgb);
        }
}

static const sdm_colour FIRST = {232, 40, 44}, SECOND = {255, 214, 10};

/* A bright ball on a dark ground with two contours. The first contour gives three circles side
 * by side, white inside and black outside. */
static void test_overlay_shows_contours_on_the_image(void **state)
{
    (void)state;
    sdm_grid g;
    float *v = ball_map(&g, 3), *w = ball_map(&g, 2),
          *image = malloc(sdm_grid_count(&g) * sizeof *image);
    assert_non_null(image);
    for (size_t i = 0; i < sdm_grid_count(&g); i++) image[i] = v[i] < 0 ? 900 : -100;
    image[0] = NAN;
    const sdm_picture_map maps[2] = {{.title = "fitted", .values = v},
                                     {.title = "reference", .values = w, .error = true}};
    assert_int_equal(sdm_picture_overlay("test_picture_w.png", &g, image, maps, 2, "a ball", NULL),
                     SDM_OK);
    picture p = read_png("test_picture_w.png");
    int circles = 0, from = 0, gap = 0;
    sdm_box all, box;
    assert_true(find_colour(&p, 0, p.w, SECOND, &all) > 500);
    find_colour(&p, 0, p.w, FIRST, &all);
    for (int x = all.x; x <= all.x + all.w + 40; x++) {
        gap = x < p.w && find_colour(&p, x, x + 1, FIRST, &box) ? 0 : gap + 1;
        if (gap < 40) continue; // the slices are farther apart, the dashes are not
        if (find_colour(&p, from, x < p.w ? x : p.w, FIRST, &box) > 0) {
            const int column = box.x + box.w / 2, row = box.y + box.h / 2;
            const unsigned char *inside = p.rgb + 3 * ((size_t)row * (size_t)p.w + (size_t)column),
                                *outside = inside + 3 * (size_t)p.w * (size_t)(box.h / 2 + 8);
            assert_true(abs(box.h - box.w) <= 6);
            /* A diameter of 6 mm; the longest axis, 12.5 mm, has 340 or 420 pixels. */
            assert_true(box.w > 6 * 26 && box.w < 6 * 38);
            assert_true(is_colour(inside, 255, 255, 255));
            assert_true(is_colour(outside, 0, 0, 0));
            circles++;
        }
        from = x;
    }
    assert_int_equal(circles, 3);
    free(p.rgb);

    /* Two contours in one place are both in sight; under a single one, half of the edge is. */
    const sdm_picture_map same[2] = {maps[0], {.title = "reference", .values = v}};
    int red[2];
    for (size_t n = 1; n <= 2; n++) {
        assert_int_equal(sdm_picture_overlay("test_picture_w.png", &g, image, same, n, "", NULL),
                         SDM_OK);
        p = read_png("test_picture_w.png");
        red[n - 1] = find_colour(&p, 0, p.w, FIRST, &box);
        const int yellow = find_colour(&p, 0, p.w, SECOND, &box);
        if (n == 2 && !(yellow > red[1] / 4 && red[1] > yellow / 4))
            fail_msg("%d and %d pixels", red[1], yellow);
        free(p.rgb);
    }
    assert_true(red[0] > 400 && abs(red[0] - red[1]) < red[0] / 4);

    /* An image of NaN only, and an image of a single voxel. */
    for (size_t i = 0; i < sdm_grid_count(&g); i++) image[i] = NAN;
    assert_int_equal(sdm_picture_overlay("test_picture_w.png", &g, image, maps, 1, NULL, NULL),
                     SDM_OK);
    const sdm_grid one = {.n = {1, 1, 1}, .spacing = {1, 2, 3}, .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    assert_int_equal(sdm_picture_overlay("test_picture_w.png", &one, v, maps, 2, NULL, NULL),
                     SDM_OK);

    const sdm_picture_map none = {.title = "a", .values = NULL};
    assert_int_equal(sdm_picture_overlay(NULL, &g, v, maps, 1, NULL, NULL), SDM_E_ARG);
    assert_int_equal(sdm_picture_overlay("a.png", NULL, v, maps, 1, NULL, NULL), SDM_E_ARG);
    assert_int_equal(sdm_picture_overlay("a.png", &g, NULL, maps, 1, NULL, NULL), SDM_E_ARG);
    assert_int_equal(sdm_picture_overlay("a.png", &g, v, maps, 0, NULL, NULL), SDM_E_ARG);
    assert_int_equal(sdm_picture_overlay("a.png", &g, v, maps, 5, NULL, NULL), SDM_E_ARG);
    assert_int_equal(sdm_picture_overlay("a.png", &g, v, &none, 1, NULL, NULL), SDM_E_ARG);
    assert_int_equal(sdm_picture_overlay("no_such_folder/a.png", &g, v, maps, 1, NULL, NULL),
                     SDM_E_IO);
    free(image);
    free(w);
    free(v);
}

static void test_plot_draws_a_straight_line(void **state)
{
    (void)state;
    double x[101], y[101], z[101];
    for (int i = 0; i < 101; i++) {
        x[i] = i;
        y[i] = pow(10, -i / 25.0);
        z[i] = i == 50 ? NAN : i == 20 ? -1 : 0.01;
    }
    const sdm_curve curves[2] = {{"falling", x, y, 101}, {"", x, z, 101}};
    assert_int_equal(
        sdm_picture_plot("test_picture_p.png", "title", "x", "y", true, curves, 2, NULL), SDM_OK);
    picture p = read_png("test_picture_p.png");
    /* An exponential on a logarithmic axis: its pixels form a straight line whose centre is the
     * centre of the plot. */
    double sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0, n = 0;
    for (int row = 130; row < p.h; row++) /* start below the legend */
        for (int col = 0; col < p.w; col++) {
            if (!is_colour(p.rgb + 3 * ((size_t)row * (size_t)p.w + (size_t)col), 0, 105, 180))
                continue;
            n++;
            sx += col;
            sy += row;
            sxx += (double)col * col;
            syy += (double)row * row;
            sxy += (double)col * row;
        }
    assert_true(n > 400);
    const double r = (n * sxy - sx * sy) / sqrt((n * sxx - sx * sx) * (n * syy - sy * sy));
    assert_true(r > 0.9999);
    free(p.rgb);
}

/* Pixels of the colour of the first curve, in a plot of the curve with or without a legend. */
static int curve_pixels(const char *title, const double *x, const double *y)
{
    const sdm_curve curve = {title, x, y, 2};
    sdm_box box;
    assert_int_equal(
        sdm_picture_plot("test_picture_p.png", NULL, NULL, NULL, false, &curve, 1, NULL), SDM_OK);
    picture p = read_png("test_picture_p.png");
    const int n = find_colour(&p, 0, p.w, (sdm_colour){0, 105, 180}, &box);
    free(p.rgb);
    return n;
}

/* The legend lies in a corner without curves: it hides nothing of one that rises or falls. */
static void test_legend_hides_no_curve(void **state)
{
    (void)state;
    const double x[2] = {0, 1}, ends[2][2] = {{0, 1}, {1, 0}};
    int plain[2], named[2];
    for (int i = 0; i < 2; i++) {
        plain[i] = curve_pixels("", x, ends[i]);
        named[i] = curve_pixels("a curve", x, ends[i]);
    }
    // both legends add the same sample of the line, and nothing is lost
    if (!(plain[0] > 200 && named[0] > plain[0] && named[0] - plain[0] == named[1] - plain[1]))
        fail_msg("%d %d without, %d %d with a legend", plain[0], plain[1], named[0], named[1]);
}

/* A logarithmic axis of 1.7 decades that holds a single power of ten has more numbers than one:
 * rows of pixels with ink left of the axis, counted in groups. */
static void test_log_axis_has_numbers(void **state)
{
    (void)state;
    const double x[2] = {0, 1}, y[2] = {0.00015, 0.0045};
    const sdm_curve curve = {NULL, x, y, 2};
    assert_int_equal(
        sdm_picture_plot("test_picture_p.png", NULL, NULL, NULL, true, &curve, 1, NULL), SDM_OK);
    picture p = read_png("test_picture_p.png");
    int numbers = 0;
    for (int row = 0, before = 0; row < p.h - 70; row++) {
        int ink = 0;
        for (int column = 0; column < 82; column++)
            ink += p.rgb[3 * ((size_t)row * (size_t)p.w + (size_t)column)] < 128;
        numbers += ink && !before;
        before = ink;
    }
    assert_int_equal(numbers, 5); // 0.0002 0.0005 0.001 0.002 0.005
    free(p.rgb);
}

static void test_odd_plots_are_drawn(void **state)
{
    (void)state;
    static const double x[4] = {1, 2, INFINITY, 4}, zero[4] = {0}, huge[4] = {1e300, -1e300, 1, 2},
                        one[1] = {5}, flat[4] = {7, 7, 7, 7};
    const sdm_curve odd[] = {{"zero", x, zero, 4},
                             {"huge", x, huge, 4},
                             {"one", one, one, 1},
                             {NULL, NULL, NULL, 0},
                             {"flat", x, flat, 4}};
    for (size_t i = 0; i < 5; i++)
        for (int log_y = 0; log_y < 2; log_y++) {
            assert_int_equal(
                sdm_picture_plot("test_picture_q.png", NULL, NULL, NULL, log_y, &odd[i], 1, NULL),
                SDM_OK);
            picture p = read_png("test_picture_q.png");
            free(p.rgb);
        }
}

/* Draws text on a white canvas; box receives the bounding box of the drawn pixels: x0 y0 x1 y1. */
static void text_draw(sdm_type type, double x, double y, const char *text, int box[4])
{
    sdm_canvas *c;
    assert_int_equal(sdm_canvas_create("test_picture_t.png", 400, 120, &c, NULL), SDM_OK);
    sdm_canvas_text(c, x, y, type, text);
    assert_int_equal(sdm_canvas_finish(c, NULL), SDM_OK);
    picture p = read_png("test_picture_t.png");
    box[0] = p.w, box[1] = p.h, box[2] = box[3] = -1;
    for (int i = 0; i < p.w * p.h; i++)
        if (p.rgb[3 * i] < 128) {
            box[0] = i % p.w < box[0] ? i % p.w : box[0];
            box[1] = i / p.w < box[1] ? i / p.w : box[1];
            box[2] = i % p.w > box[2] ? i % p.w : box[2];
            box[3] = i / p.w > box[3] ? i / p.w : box[3];
        }
    free(p.rgb);
}

static void test_text_is_aligned(void **state)
{
    (void)state;
    int box[4];
    sdm_canvas *c;
    assert_int_equal(sdm_canvas_create("test_picture_t.png", 4, 4, &c, NULL), SDM_OK);
    const double width = sdm_canvas_text_width(c, 20, false, "HHHHH");
    assert_true(sdm_canvas_text_width(c, 10, false, "mm\xC2\xB2") >
                sdm_canvas_text_width(c, 10, false, "mm"));
    assert_true(fabs(sdm_canvas_text_width(c, 10, false, "HHHHH") - width / 2) < 0.01);
    sdm_canvas_discard(c);

    /* Capital letters stand on the base line with the given height, aligned at the point. */
    for (int align = 0; align < 3; align++) {
        text_draw((sdm_type){.size = 20, .align = (sdm_align)align}, 200, 80, "HHHHH", box);
        const double left = 200 - width * align / 2;
        assert_true(abs(box[3] - 79) <= 1 && abs(box[3] - box[1] - 19) <= 2);
        assert_true(fabs(box[0] - left) < 5 && fabs(box[2] - left - width) < 5);
    }
    text_draw((sdm_type){.size = 20, .align = SDM_CENTRE, .upwards = true}, 200, 60, "HHHHH", box);
    assert_true(abs(box[2] - 199) <= 1 && abs(box[2] - box[0] - 19) <= 2);
    assert_true(abs(box[1] + box[3] - 120) <= 6 && fabs(box[3] - box[1] - width) < 8);

    /* Every byte except the space draws something; malformed UTF-8 is drawn as '?'. */
    for (int code = 1; code < 256; code++) {
        const char text[2] = {(char)code, 0};
        text_draw((sdm_type){.size = 40, .bold = code & 1}, 60, 80, text, box);
        assert_true((box[2] >= box[0]) == (code != ' '));
    }
    static const char *const odd[] = {"\xE2\x88",     "\xF8\x88\x80\x80", "\xC0\x80",
                                      "\xED\xA0\x80", "\xEF\xBF\xBF",     "\xF4\x90\x80\x80"};
    for (size_t i = 0; i < sizeof odd / sizeof *odd; i++) {
        text_draw((sdm_type){.size = 20, .halo = true}, 60, 80, odd[i], box);
        assert_true(box[2] >= box[0]);
    }
    text_draw((sdm_type){.size = 20}, 60, 80, "", box);
    assert_true(box[2] < 0);
    static char long_text[5000];
    memset(long_text, 'm', sizeof long_text - 1);
    text_draw((sdm_type){.size = 20, .align = SDM_RIGHT}, 390, 80, long_text, box);
    assert_true(box[0] == 0 && box[2] > 370);
}

static void test_colours_are_ordered(void **state)
{
    (void)state;
    /* Lightness increases along the colours of errors, and decreases from zero to both ends of
     * the other colour maps. */
    int before = -1;
    for (int i = 0; i <= 100; i++) {
        const sdm_colour c = sdm_map_colour(SDM_MAP_ERROR, 0, 1, i / 100.0);
        const int grey = 2 * c.r + 7 * c.g + c.b;
        assert_true(grey >= before);
        before = grey;
    }
    for (int map = 0; map < 3; map += 2)
        for (int sign = -1; sign <= 1; sign += 2) {
            before = 99999;
            for (int i = 0; i <= 100; i++) {
                const sdm_colour c = sdm_map_colour(map ? SDM_MAP_SIGNED : SDM_MAP_DISTANCE, -2, 7,
                                                    sign * (sign < 0 ? 2 : 7) * i / 100.0);
                const int grey = 2 * c.r + 7 * c.g + c.b;
                assert_true(grey <= before + 3);
                before = grey;
            }
        }
    const sdm_colour inside = sdm_map_colour(SDM_MAP_DISTANCE, -1, 5, -1),
                     outside = sdm_map_colour(SDM_MAP_DISTANCE, -1, 5, 5);
    assert_true(inside.r > inside.b && outside.b > outside.r);
    const sdm_colour none = sdm_map_colour(SDM_MAP_ERROR, 0, 1, NAN);
    assert_true(none.r == none.g && none.g == none.b);
}

static void test_ticks_are_round_numbers(void **state)
{
    (void)state;
    for (uint64_t i = 0; i < 500; i++) {
        const double low = sdm_rng_normal(5, 0, i) * 10,
                     range = pow(10, 8 * sdm_rng_uniform(5, 1, i) - 4);
        double first, step;
        const int n = sdm_ticks(low, low + range, 6, &first, &step);
        assert_true(n >= 2 && n <= 8);
        assert_true(first >= low - 1e-6 * range &&
                    first + (n - 1) * step <= low + range * (1 + 1e-6));
        const double lead = step / pow(10, floor(log10(step) + 1e-9));
        assert_true(fabs(lead - 1) < 1e-6 || fabs(lead - 2) < 1e-6 || fabs(lead - 5) < 1e-6);
    }
    char text[32];
    assert_string_equal(sdm_tick_text(0.30000000000000004, 0.1, text), "0.3");
    assert_string_equal(sdm_tick_text(-1e-17, 0.5, text), "0.0");
    assert_string_equal(sdm_tick_text(-20, 10, text), "\xE2\x88\x92"
                                                      "20");
}

static void test_wrong_arguments_are_refused(void **state)
{
    (void)state;
    sdm_grid g;
    float *v = ball_map(&g, 3);
    const float level = 0;
    const double x[2] = {0, 1};
    const sdm_picture_map map = {.title = "a", .values = v}, none = {.title = "a", .values = NULL};
    const sdm_curve curve = {"a", x, x, 2}, broken = {"a", x, NULL, 2};
    sdm_error err;
    sdm_canvas *c = NULL;
    assert_int_equal(sdm_canvas_create("a.png", 0, 10, &c, &err), SDM_E_ARG);
    assert_int_equal(sdm_canvas_create("a.png", 10, 16385, &c, &err), SDM_E_ARG);
    assert_null(c);
    sdm_canvas_discard(c);
    assert_int_equal(sdm_picture_slices(NULL, &g, &map, 1, &level, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_slices("a.png", NULL, &map, 1, &level, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_slices("a.png", &g, NULL, 1, &level, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_slices("a.png", &g, &map, 0, &level, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_slices("a.png", &g, &map, 17, &level, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_slices("a.png", &g, &map, 1, NULL, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_slices("a.png", &g, &none, 1, &level, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_slices("no_such_folder/a.png", &g, &map, 1, &level, 1, &err),
                     SDM_E_IO);
    assert_int_equal(sdm_picture_plot(NULL, "", "", "", false, &curve, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_plot("a.png", "", "", "", false, NULL, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_plot("a.png", "", "", "", false, &curve, 0, &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_plot("a.png", "", "", "", false, &broken, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_picture_plot("no_such_folder/a.png", "", "", "", false, &curve, 1, &err),
                     SDM_E_IO);
    unsigned long n = 1;
    for (;; n++) {
        sdm_alloc_fail_after(n);
        const sdm_status s =
            sdm_picture_plot("test_picture_none.png", "", "", "", false, &curve, 1, &err);
        sdm_alloc_fail_after(0);
        if (s == SDM_OK) break;
        assert_int_equal(s, SDM_E_NOMEM);
        assert_null(fopen("test_picture_none.png", "rb"));
    }
    assert_true(n > 1);
    remove("test_picture_none.png");
    free(v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_image_is_exact),
        cmocka_unit_test(test_contour_is_subpixel),
        cmocka_unit_test(test_slices_show_equal_circles),
        cmocka_unit_test(test_second_map_shows_the_first),
        cmocka_unit_test(test_points_on_slices),
        cmocka_unit_test(test_slices_of_odd_maps),
        cmocka_unit_test(test_overlay_shows_contours_on_the_image),
        cmocka_unit_test(test_plot_draws_a_straight_line),
        cmocka_unit_test(test_legend_hides_no_curve),
        cmocka_unit_test(test_log_axis_has_numbers),
        cmocka_unit_test(test_odd_plots_are_drawn),
        cmocka_unit_test(test_text_is_aligned),
        cmocka_unit_test(test_colours_are_ordered),
        cmocka_unit_test(test_ticks_are_round_numbers),
        cmocka_unit_test(test_wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
