/* One slice of a map on a canvas: colours, contours, scale bar, title; and colour bars. */
#include "panel.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Number of colours in the table for a slice. */
#define SHADES 2048
/* A contour's rim is this much wider than its line, in pixels. */
#define RIM 1.6
#define RIM_ALPHA 0.55
/* Length of a dash in pixels. */
#define DASH 8.0

/* The value at column i, -1 <= i <= n[0], of row j, 0 <= j < n[1]; one column outside of the slice
   it is extrapolated linearly. */
static double row_value(const sdm_slice *s, int64_t i, int64_t j)
{
    const float *row = s->v + (size_t)j * s->stride[1];
    const int64_t last = s->n[0] - 1;
    if (i >= 0 && i <= last) return (double)row[(size_t)i * s->stride[0]];
    const int64_t edge = i < 0 ? 0 : last, next = last == 0 ? 0 : i < 0 ? 1 : last - 1;
    return 2 * (double)row[(size_t)edge * s->stride[0]] - (double)row[(size_t)next * s->stride[0]];
}

/* The value at index (i, j); one step outside of the slice it is extrapolated linearly, so that
 * contours reach the border without a bend. */
static double value_at(const sdm_slice *s, int64_t i, int64_t j)
{
    const int64_t last = s->n[1] - 1;
    if (j >= 0 && j <= last) return row_value(s, i, j);
    const int64_t edge = j < 0 ? 0 : last, next = last == 0 ? 0 : j < 0 ? 1 : last - 1;
    return 2 * row_value(s, i, edge) - row_value(s, i, next);
}

/* The value at (u, v), interpolated bilinearly; whole numbers u, v are the centres of voxels. */
static double interpolate(const sdm_slice *s, double u, double v)
{
    const double fu = floor(u), fv = floor(v), tu = u - fu, tv = v - fv;
    const int64_t i = (int64_t)fu, j = (int64_t)fv;
    const double low = value_at(s, i, j) * (1 - tu) + value_at(s, i + 1, j) * tu;
    const double high = value_at(s, i, j + 1) * (1 - tu) + value_at(s, i + 1, j + 1) * tu;
    return low * (1 - tv) + high * tv;
}

/* A slice and its colour scale. */
typedef struct shading {
    sdm_box box;
    const sdm_slice *slice;
    sdm_colour_map map;
    double low, high;
    /* colours of evenly spaced values from low to high */
    sdm_colour table[SHADES];
} shading;

static sdm_colour slice_pixel(const void *user, int x, int y)
{
    const shading *p = user;
    const double u = (x + 0.5) / p->box.w * (double)p->slice->n[0] - 0.5;
    const double v = (1 - (y + 0.5) / p->box.h) * (double)p->slice->n[1] - 0.5;
    const double value = interpolate(p->slice, u, v),
                 shade = (value - p->low) / (p->high - p->low) * (SHADES - 1) + 0.5;
    if (!isfinite(value)) return sdm_map_colour(p->map, p->low, p->high, value);
    return p->table[shade >= SHADES ? SHADES - 1 : shade > 0 ? (int)shade : 0];
}

void sdm_panel_colours(sdm_canvas *c, sdm_box box, const sdm_slice *s, sdm_colour_map map,
                       double low, double high)
{
    shading p = {.box = box, .slice = s, .map = map, .low = low, .high = high};
    for (int i = 0; i < SHADES; i++)
        p.table[i] = sdm_map_colour(map, low, high, low + (high - low) * i / (SHADES - 1));
    sdm_canvas_image(c, box, slice_pixel, &p);
}

/* A corner of a cell between voxel centres: its place on the canvas, its value less the level. */
typedef struct corner {
    double x, y, v;
} corner;

/* Where the level is crossed on the side from corner `from` to corner `to`. */
static void find_crossing(const corner *from, const corner *to, double at[2])
{
    const double t = from->v / (from->v - to->v);
    at[0] = from->x + t * (to->x - from->x);
    at[1] = from->y + t * (to->y - from->y);
}

/* Adds the line from a to b to the path, or its dashes: the parts of it where x (y, for a line that
 * is steeper than 45 degrees) lies in every turns-th interval of length DASH. */
static void trace_line(sdm_canvas *c, const double a[2], const double b[2],
                       const sdm_contour_line *line)
{
    const int d = fabs(b[1] - a[1]) > fabs(b[0] - a[0]);
    const double *low = a[d] < b[d] ? a : b, *high = a[d] < b[d] ? b : a;
    if (line->turns < 2) {
        sdm_canvas_move_to(c, a[0], a[1]);
        sdm_canvas_line_to(c, b[0], b[1]);
        return;
    }
    for (double q = floor(low[d] / DASH); q * DASH < high[d]; q++) {
        if (q - line->turns * floor(q / line->turns) != line->turn) continue;
        const double end[2] = {fmax(low[d], q * DASH), fmin(high[d], (q + 1) * DASH)};
        for (int i = 0; i < 2; i++) {
            const double t = (end[i] - low[d]) / (high[d] - low[d]),
                         x = low[0] + t * (high[0] - low[0]), y = low[1] + t * (high[1] - low[1]);
            (i ? sdm_canvas_line_to : sdm_canvas_move_to)(c, x, y);
        }
    }
}

/* Adds the contour's lines in one cell to the path. Four crossings are paired by the sign of the
 * bilinear saddle. */
static void trace_cell(sdm_canvas *c, const corner k[4], const sdm_contour_line *line)
{
    double at[4][2];
    int n = 0, first = 0;
    for (int i = 0; i < 4; i++) {
        const corner *a = &k[i], *b = &k[(i + 1) % 4];
        if (!isfinite(a->v) || !isfinite(b->v)) return;
        if ((a->v < 0) != (b->v < 0)) find_crossing(a, b, at[n++]);
    }
    if (n == 4) {
        const double even = k[0].v * k[2].v, odd = k[1].v * k[3].v;
        // true: the lines cut off corners 0 and 2
        const bool cut_off_even = (k[0].v < 0) == (odd > even);
        first = cut_off_even ? 3 : 0;
    }
    for (int i = 0; i + 1 < n; i += 2)
        trace_line(c, at[(first + i) % n], at[(first + i + 1) % n], line);
}

/* Adds the contour of the slice to the path. */
static void trace_contour(sdm_canvas *c, sdm_box box, const sdm_slice *s, double level,
                          const sdm_contour_line *line)
{
    // cells between voxel centres, and one more on each side for the half voxel up to the border
    for (int64_t j = -1; j < s->n[1]; j++) {
        for (int64_t i = -1; i < s->n[0]; i++) {
            corner k[4];
            for (int q = 0; q < 4; q++) {
                const int64_t p[2] = {i + (q == 1 || q == 2), j + (q >= 2)};
                const double u = (double)p[0] + 0.5, v = (double)p[1] + 0.5;
                k[q] = (corner){box.x + u / (double)s->n[0] * box.w,
                                box.y + (1 - v / (double)s->n[1]) * box.h,
                                value_at(s, p[0], p[1]) - level};
            }
            trace_cell(c, k, line);
        }
    }
}

static void stroke_line(sdm_canvas *c, const sdm_contour_line *line)
{
    sdm_canvas_stroke_keep(c, line->width + RIM, line->rim, RIM_ALPHA);
    sdm_canvas_stroke(c, line->width, line->colour);
}

void sdm_panel_contour(sdm_canvas *c, sdm_box box, const sdm_slice *s, double level,
                       const sdm_contour_line *line)
{
    sdm_canvas_clip(c, box);
    trace_contour(c, box, s, level, line);
    stroke_line(c, line);
    sdm_canvas_unclip(c);
}

void sdm_contour_sample(sdm_canvas *c, double x, double y, double length,
                        const sdm_contour_line *line)
{
    trace_line(c, (const double[]){x, y}, (const double[]){x + length, y}, line);
    stroke_line(c, line);
}

/* A line of a title holds at most this many bytes. */
enum { LINE_MAX = 200 };

/* Fills `line` with as many words of *text as are at most `width` pixels wide, but at least one,
 * and moves *text behind them. last: there is no further line, so "..." replaces what is left. */
static void break_line(sdm_canvas *c, sdm_type type, double width, bool last, const char **text,
                       char line[LINE_MAX])
{
    size_t used = 0;
    for (size_t end = strcspn(*text, " ");; end += 1 + strcspn(*text + end + 1, " ")) {
        const bool ends = !(*text)[end];
        char longer[LINE_MAX];
        snprintf(longer, sizeof longer, "%.*s%s", (int)end, *text, last && !ends ? " ..." : "");
        if (used && sdm_canvas_text_width(c, type.size, type.bold, longer) > width) break;
        strcpy(line, longer);
        used = end;
        if (ends) break;
    }
    *text += used;
    *text += strspn(*text, " ");
}

static sdm_type title_type(void)
{
    return (sdm_type){.size = 13, .align = SDM_CENTRE, .bold = true, .colour = SDM_INK};
}

bool sdm_panel_title_fits(sdm_canvas *c, sdm_box box, const char *title)
{
    const sdm_type type = title_type();
    return sdm_canvas_text_width(c, type.size, type.bold, title) <= box.w;
}

void sdm_panel_title(sdm_canvas *c, sdm_box box, bool large, const char *title)
{
    const double middle = box.x + box.w / 2.0;
    if (large) {
        sdm_canvas_text(c, middle, box.y - 18, title_type(), title);
        return;
    }
    const sdm_type type = {.size = 9, .align = SDM_CENTRE, .colour = SDM_INK};
    for (int i = 0; i < 2 && *title; i++) {
        char line[LINE_MAX];
        break_line(c, type, box.w, i == 1, &title, line);
        sdm_canvas_text(c, middle, box.y - 27 + 17 * i, type, line);
    }
}

void sdm_panel_scale_bar(sdm_canvas *c, sdm_box box, double pixels_per_mm)
{
    double first, mm;
    char number[32], text[48];
    sdm_ticks(0, box.w / pixels_per_mm, 4, &first, &mm);
    const double length = mm * pixels_per_mm, x = box.x + 12, y = box.y + box.h - 12;
    if (!(length < box.w - 24)) return;
    // the bar with a cross line at each end
    sdm_canvas_move_to(c, x, y - 3.5);
    sdm_canvas_line_to(c, x, y + 3.5);
    sdm_canvas_move_to(c, x, y);
    sdm_canvas_line_to(c, x + length, y);
    sdm_canvas_move_to(c, x + length, y - 3.5);
    sdm_canvas_line_to(c, x + length, y + 3.5);
    sdm_canvas_stroke_keep(c, 5.5, SDM_WHITE, 0.75);
    sdm_canvas_stroke(c, 2, SDM_INK);
    snprintf(text, sizeof text, "%s mm", sdm_tick_text(mm, mm, number));
    sdm_canvas_text(c, x + length / 2, y - 9,
                    (sdm_type){.size = 9, .align = SDM_CENTRE, .colour = SDM_INK, .halo = true},
                    text);
}

/* As many ticks as have room for their numbers below the bar. */
static int bar_ticks(sdm_canvas *c, sdm_box box, double low, double high, double *first,
                     double *step)
{
    int n = 0;
    for (int wanted = box.w / 33; wanted > 0; wanted--) {
        char text[32];
        double widest = 0;
        n = sdm_ticks(low, high, wanted, first, step);
        for (int i = 0; i < n; i++)
            widest = fmax(widest, sdm_canvas_text_width(
                                      c, 9, false, sdm_tick_text(*first + i * *step, *step, text)));
        if (widest + 8 <= *step / (high - low) * box.w) break;
    }
    return n;
}

void sdm_colour_bar(sdm_canvas *c, sdm_box box, sdm_colour_map map, double low, double high,
                    const char *caption)
{
    // a slice of two voxels: their centres are at a quarter and three quarters of the bar
    const float quarters[2] = {(float)(0.75 * low + 0.25 * high),
                               (float)(0.25 * low + 0.75 * high)};
    sdm_panel_colours(c, box, &(sdm_slice){quarters, {2, 1}, {1, 2}}, map, low, high);
    sdm_canvas_frame(c, box, SDM_INK_LIGHT);
    double first, step;
    char text[32];
    const sdm_type type = {.size = 9, .align = SDM_CENTRE, .colour = SDM_INK};
    const int n = bar_ticks(c, box, low, high, &first, &step);
    for (int i = 0; i < n; i++) {
        const double v = first + i * step, x = box.x + (v - low) / (high - low) * box.w;
        sdm_canvas_line(c, x, box.y + box.h + 1, x, box.y + box.h + 5, 1, SDM_INK_LIGHT);
        sdm_canvas_text(c, x, box.y + box.h + 19, type, sdm_tick_text(v, step, text));
    }
    sdm_canvas_text(c, box.x + box.w / 2.0, box.y + box.h + 38, type, caption);
}
