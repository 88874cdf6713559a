/* Line plots with axes, tick labels and a legend. */
#include "sdm/picture.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "panel.h"

#define WIDTH 960
#define HEIGHT 600
#define CURVES_MAX 16

/* The rectangle inside of the axes. */
static const sdm_box area = {92, 56, WIDTH - 92 - 32, HEIGHT - 56 - 70};
static const sdm_colour grid_ink = {228, 230, 234};

/* The range of the axes; y is log10 of the values when log_y is set. */
typedef struct window {
    double low[2], high[2];
    bool log_y;
} window;

/* Point i in the coordinates of the axes; false when it is left out. */
static bool curve_point(const sdm_curve *curve, size_t i, bool log_y, double p[2])
{
    p[0] = curve->x[i];
    p[1] = log_y ? (curve->y[i] > 0 ? log10(curve->y[i]) : NAN) : curve->y[i];
    return fabs(p[0]) <= FLT_MAX && fabs(p[1]) <= FLT_MAX;
}

/* Finds the range of the points. The range of y is widened by 5 % below and above, that of x by
   1.5 % above; a range of length 0 is widened, too. */
static void find_window(window *w, const sdm_curve *curves, size_t n_curves)
{
    for (int d = 0; d < 2; d++) {
        w->low[d] = INFINITY;
        w->high[d] = -INFINITY;
    }
    for (size_t c = 0; c < n_curves; c++)
        for (size_t i = 0; i < curves[c].n; i++) {
            double p[2];
            if (!curve_point(&curves[c], i, w->log_y, p)) continue;
            for (int d = 0; d < 2; d++) {
                w->low[d] = fmin(w->low[d], p[d]);
                w->high[d] = fmax(w->high[d], p[d]);
            }
        }
    for (int d = 0; d < 2; d++) {
        if (!(w->low[d] <= w->high[d])) w->low[d] = w->high[d] = 0;
        const double size = fmax(fabs(w->low[d]), fabs(w->high[d]));
        double room = (d ? 0.05 : 0.015) * (w->high[d] - w->low[d]);
        const bool single = !(w->high[d] - w->low[d] > 1e-12 * size);
        if (single) room = size > 0 ? 0.5 * size : 0.5;
        // curves begin at the y axis; the markers at their ends are whole
        if (d || single) w->low[d] -= room;
        w->high[d] += room;
    }
}

/* Coordinates of the axes to pixels. */
static double to_x(const window *w, double v)
{
    return area.x + (v - w->low[0]) / (w->high[0] - w->low[0]) * area.w;
}
static double to_y(const window *w, double v)
{
    return area.y + (1 - (v - w->low[1]) / (w->high[1] - w->low[1])) * area.h;
}

static void draw_x_axis(sdm_canvas *c, const window *w)
{
    double first, step;
    char text[32];
    const sdm_type type = {.size = 10, .align = SDM_CENTRE, .colour = SDM_INK};
    const int n = sdm_ticks(w->low[0], w->high[0], 8, &first, &step);
    for (int i = 0; i < n; i++) {
        const double v = first + i * step, x = floor(to_x(w, v)) + 0.5;
        sdm_canvas_line(c, x, area.y, x, area.y + area.h, 1, grid_ink);
        sdm_canvas_line(c, x, area.y + area.h, x, area.y + area.h + 5, 1, SDM_INK_LIGHT);
        sdm_canvas_text(c, x, area.y + area.h + 22, type, sdm_tick_text(v, step, text));
    }
}

static void y_tick(sdm_canvas *c, double y, const char *text)
{
    y = floor(y) + 0.5;
    sdm_canvas_line(c, area.x, y, area.x + area.w, y, 1, grid_ink);
    sdm_canvas_line(c, area.x - 5, y, area.x, y, 1, SDM_INK_LIGHT);
    if (text)
        sdm_canvas_text(c, area.x - 10, y + 5,
                        (sdm_type){.size = 10, .align = SDM_RIGHT, .colour = SDM_INK}, text);
}

/* Draws "10" with a small raised exponent. */
static void power_of_ten(sdm_canvas *c, double y, int exponent)
{
    char text[16];
    snprintf(text, sizeof text, "%s%d", exponent < 0 ? "\xE2\x88\x92" : "",
             exponent < 0 ? -exponent : exponent);
    sdm_type type = {.size = 7, .align = SDM_RIGHT, .colour = SDM_INK};
    sdm_canvas_text(c, area.x - 10, y - 1, type, text);
    type.size = 10;
    sdm_canvas_text(c, area.x - 12 - sdm_canvas_text_width(c, 7, false, text), y + 6, type, "10");
}

/* Draws ticks, with labels at the powers of ten (every second, third ... of them when the axis
   spans over ten) and, when the axis holds fewer than three powers, at 2 and 5 times them: an axis
   of a decade or more has three labels. */
static void draw_log_axis(sdm_canvas *c, const window *w)
{
    const double decades = w->high[1] - w->low[1];
    const int every = (int)ceil(decades / 10), from = (int)floor(w->low[1]);
    const bool few = floor(w->high[1]) - ceil(w->low[1]) + 1 < 3;
    for (int e = from; e <= w->high[1]; e++) {
        for (int m = 1; m < 10; m++) {
            const double v = e + log10(m);
            char text[32];
            if (v < w->low[1] || v > w->high[1] || (m > 1 && decades > 4)) continue;
            const bool labelled = few && (m == 2 || m == 5);
            snprintf(text, sizeof text, "%g", m * pow(10, e));
            const double y = to_y(w, v);
            if (m == 1 && !few) {
                if (e % every != 0) continue;
                y_tick(c, y, NULL);
                power_of_ten(c, floor(y) + 0.5, e);
            } else if (m == 1 || labelled) {
                y_tick(c, y, text);
            } else {
                sdm_canvas_line(c, area.x - 3, floor(y) + 0.5, area.x, floor(y) + 0.5, 1,
                                SDM_INK_LIGHT);
            }
        }
    }
}

static void draw_y_axis(sdm_canvas *c, const window *w)
{
    double first, step;
    char text[32];
    // ticks in even steps when the values span less than a decade
    if (w->log_y && w->high[1] - w->low[1] >= 1) {
        draw_log_axis(c, w);
        return;
    }
    const double low = w->log_y ? pow(10, w->low[1]) : w->low[1],
                 high = w->log_y ? pow(10, w->high[1]) : w->high[1];
    const int n = sdm_ticks(low, high, 7, &first, &step);
    for (int i = 0; i < n; i++) {
        const double v = first + i * step;
        y_tick(c, to_y(w, w->log_y ? log10(v) : v), sdm_tick_text(v, step, text));
    }
}

static sdm_colour curve_colour(size_t i)
{
    static const sdm_colour known[] = {{0, 105, 180}, {214, 84, 10},  {0, 150, 110}, {190, 60, 130},
                                       {222, 160, 0}, {80, 165, 220}, {110, 80, 50}, {60, 60, 66}};
    return known[i % (sizeof known / sizeof *known)];
}

/* A marker of 7 pixels: a disc for the first curve, a diamond for the second, and so on in turn. */
static void draw_marker(sdm_canvas *c, double x, double y, size_t number, sdm_colour colour)
{
    if (number % 2 == 0) {
        sdm_canvas_line(c, x, y, x, y, 7, colour); // lines have round ends
        return;
    }
    // lines of falling length, one per row of pixels
    for (int i = -4; i <= 4; i++)
        sdm_canvas_line(c, x - (4 - abs(i)), y + i, x + (4 - abs(i)), y + i, 1.1, colour);
}

/* Draws a marker at each point, unless the points lie too close. */
static void draw_markers(sdm_canvas *c, const window *w, const sdm_curve *curve, size_t number)
{
    enum { ROOM = 14 }; // pixels of width for each marker
    double p[2];
    size_t n = 0;
    for (size_t i = 0; i < curve->n; i++) n += curve_point(curve, i, w->log_y, p);
    if (n > (size_t)(area.w / ROOM)) return;
    for (size_t i = 0; i < curve->n; i++)
        if (curve_point(curve, i, w->log_y, p))
            draw_marker(c, to_x(w, p[0]), to_y(w, p[1]), number, curve_colour(number));
}

static void draw_curve(sdm_canvas *c, const window *w, const sdm_curve *curve, size_t number)
{
    const sdm_colour colour = curve_colour(number);
    double p[2];
    bool is_started = false;
    sdm_canvas_clip(c, area);
    for (size_t i = 0; i < curve->n; i++) {
        const bool ok = curve_point(curve, i, w->log_y, p);
        // a point between two gaps shows as a dot, a line of length 0
        if (ok && !is_started) sdm_canvas_move_to(c, to_x(w, p[0]), to_y(w, p[1]));
        if (ok) sdm_canvas_line_to(c, to_x(w, p[0]), to_y(w, p[1]));
        is_started = ok;
    }
    sdm_canvas_stroke(c, 1.8, colour);
    sdm_canvas_unclip(c);
    draw_markers(c, w, curve, number);
}

/* Pixels of the curves, about, that the box covers: counted at every fourth one. */
static size_t count_covered(const window *w, const sdm_curve *curves, size_t n, sdm_box box)
{
    double a[2], b[2];
    size_t covered = 0;
    for (size_t k = 0; k < n; k++)
        for (size_t i = 0; i + 1 < curves[k].n; i++) {
            if (!curve_point(&curves[k], i, w->log_y, a) ||
                !curve_point(&curves[k], i + 1, w->log_y, b))
                continue;
            const double x = to_x(w, a[0]) - box.x, y = to_y(w, a[1]) - box.y,
                         dx = to_x(w, b[0]) - box.x - x, dy = to_y(w, b[1]) - box.y - y;
            const int steps = 1 + (int)(hypot(dx, dy) / 4);
            for (int q = 0; q <= steps; q++) {
                const double u = x + dx * q / steps, v = y + dy * q / steps;
                covered += u >= 0 && u <= box.w && v >= 0 && v <= box.h;
            }
        }
    return covered;
}

/* Moves the box of the legend to the corner where it covers least of the curves: upper right, upper
 * left, lower left or lower right, in this order if equal. */
static sdm_box choose_corner(const window *w, const sdm_curve *curves, size_t n, sdm_box box)
{
    const int left = area.x + 12, right = area.x + area.w - box.w - 12, top = area.y + 12,
              bottom = area.y + area.h - box.h - 12;
    const int corner[4][2] = {{right, top}, {left, top}, {left, bottom}, {right, bottom}};
    size_t least = SIZE_MAX;
    sdm_box best = box;
    for (int i = 0; i < 4; i++) {
        box.x = corner[i][0];
        box.y = corner[i][1];
        const size_t covered = count_covered(w, curves, n, box);
        if (covered >= least) continue;
        least = covered;
        best = box;
    }
    return best;
}

static void draw_legend(sdm_canvas *c, const window *view, const sdm_curve *curves, size_t n)
{
    double widest = 0;
    int rows = 0;
    for (size_t i = 0; i < n; i++)
        if (curves[i].title && curves[i].title[0]) {
            widest = fmax(widest, sdm_canvas_text_width(c, 10, false, curves[i].title));
            rows++;
        }
    if (!rows) return;
    const sdm_box box =
        choose_corner(view, curves, n, (sdm_box){0, 0, (int)widest + 66, 22 * rows + 12});
    const int x = box.x;
    sdm_canvas_fill(c, box, SDM_WHITE, 0.88);
    sdm_canvas_frame(c, box, grid_ink);
    int y = box.y + 22;
    for (size_t i = 0; i < n; i++) {
        if (!curves[i].title || !curves[i].title[0]) continue;
        sdm_canvas_line(c, x + 12, y - 5, x + 42, y - 5, 2.4, curve_colour(i));
        draw_marker(c, x + 27, y - 5, i, curve_colour(i));
        sdm_canvas_text(c, x + 52, y, (sdm_type){.size = 10, .colour = SDM_INK}, curves[i].title);
        y += 22;
    }
}

static void draw_labels(sdm_canvas *c, const char *title, const char *x_label, const char *y_label)
{
    const double middle = area.x + area.w / 2.0;
    sdm_type type = {.size = 14, .align = SDM_CENTRE, .bold = true, .colour = SDM_INK};
    if (title) sdm_canvas_text(c, middle, 36, type, title);
    type.bold = false;
    type.size = 11;
    if (x_label) sdm_canvas_text(c, middle, HEIGHT - 18, type, x_label);
    type.upwards = true;
    if (y_label) sdm_canvas_text(c, 24, area.y + area.h / 2.0, type, y_label);
}

sdm_status sdm_picture_plot(const char *path, const char *title, const char *x_label,
                            const char *y_label, bool log_y, const sdm_curve *curves,
                            size_t n_curves, sdm_error *err)
{
    if (!path || !curves) return sdm_fail(err, SDM_E_ARG, "sdm_picture_plot: NULL argument");
    if (n_curves < 1 || n_curves > CURVES_MAX)
        return sdm_fail(err, SDM_E_ARG, "%zu curves in a plot, need 1 to %d", n_curves, CURVES_MAX);
    for (size_t i = 0; i < n_curves; i++)
        if (curves[i].n && (!curves[i].x || !curves[i].y))
            return sdm_fail(err, SDM_E_ARG, "curve %zu has no values", i);
    window w = {.log_y = log_y};
    find_window(&w, curves, n_curves);
    sdm_canvas *c = NULL;
    const sdm_status s = sdm_canvas_create(path, WIDTH, HEIGHT, &c, err);
    if (s || !c) return s;
    draw_x_axis(c, &w);
    draw_y_axis(c, &w);
    for (size_t i = 0; i < n_curves; i++) draw_curve(c, &w, &curves[i], i);
    sdm_canvas_frame(c, area, SDM_INK_LIGHT);
    draw_legend(c, &w, curves, n_curves);
    draw_labels(c, title, x_label, y_label);
    return sdm_canvas_finish(c, err);
}
