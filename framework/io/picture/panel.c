/* One slice of a map on a canvas: colours, contours, scale bar; and colour bars. */
#include "panel.h"

#include <math.h>
#include <stdio.h>

#define SHADES 2048

static double along_row(const sdm_slice *s, int64_t i, int64_t j)
{
    const float *row = s->v + (size_t)j * s->stride[1];
    const int64_t last = s->n[0] - 1;
    if (i >= 0 && i <= last) return (double)row[(size_t)i * s->stride[0]];
    const int64_t edge = i < 0 ? 0 : last, next = last == 0 ? 0 : i < 0 ? 1 : last - 1;
    return 2 * (double)row[(size_t)edge * s->stride[0]] - (double)row[(size_t)next * s->stride[0]];
}

/* The value at a whole index; one step outside it goes on linearly, so that lines reach the border
 * without a bend. */
static double value_at(const sdm_slice *s, int64_t i, int64_t j)
{
    const int64_t last = s->n[1] - 1;
    if (j >= 0 && j <= last) return along_row(s, i, j);
    const int64_t edge = j < 0 ? 0 : last, next = last == 0 ? 0 : j < 0 ? 1 : last - 1;
    return 2 * along_row(s, i, edge) - along_row(s, i, next);
}

static double interpolate(const sdm_slice *s, double u, double v)
{
    const double fu = floor(u), fv = floor(v), tu = u - fu, tv = v - fv;
    const int64_t i = (int64_t)fu, j = (int64_t)fv;
    const double low = value_at(s, i, j) * (1 - tu) + value_at(s, i + 1, j) * tu;
    const double high = value_at(s, i, j + 1) * (1 - tu) + value_at(s, i + 1, j + 1) * tu;
    return low * (1 - tv) + high * tv;
}

void sdm_panel_colours(sdm_canvas *c, sdm_box box, const sdm_slice *s, sdm_colour_map map,
                       double low, double high)
{
    sdm_colour table[SHADES];
    for (int i = 0; i < SHADES; i++)
        table[i] = sdm_map_colour(map, low, high, low + (high - low) * i / (SHADES - 1));
    for (int y = 0; y < box.h; y++) {
        for (int x = 0; x < box.w; x++) {
            const double u = (x + 0.5) / box.w * (double)s->n[0] - 0.5;
            const double v = (1 - (y + 0.5) / box.h) * (double)s->n[1] - 0.5;
            const double value = interpolate(s, u, v),
                         shade = (value - low) / (high - low) * (SHADES - 1) + 0.5;
            sdm_colour colour = table[shade >= SHADES ? SHADES - 1 : shade > 0 ? (int)shade : 0];
            if (!isfinite(value)) colour = sdm_map_colour(map, low, high, value);
            sdm_canvas_box(c, box.x + x, box.y + y, 1, 1, colour, 1);
        }
    }
}

/* Where the level is crossed on the side from corner `from` to corner `to`, in pixels. */
typedef struct corner {
    double x, y, v;
} corner;

static void crossing(const corner *from, const corner *to, double at[2])
{
    const double t = from->v / (from->v - to->v);
    at[0] = from->x + t * (to->x - from->x);
    at[1] = from->y + t * (to->y - from->y);
}

/* The segments in one cell; values are minus the level. Four crossings are paired by the sign of
 * the bilinear saddle. */
static void trace_cell(sdm_canvas *c, const corner k[4], double width)
{
    double at[4][2];
    int n = 0, first = 0;
    for (int i = 0; i < 4; i++) {
        const corner *a = &k[i], *b = &k[(i + 1) % 4];
        if (!isfinite(a->v) || !isfinite(b->v)) return;
        if ((a->v < 0) != (b->v < 0)) crossing(a, b, at[n++]);
    }
    if (n == 4) {
        const double even = k[0].v * k[2].v, odd = k[1].v * k[3].v;
        const bool cut_off_even =
            (k[0].v < 0) == (odd > even); /* corners 0 and 2 are on their own */
        first = cut_off_even ? 3 : 0;
    }
    for (int i = 0; i + 1 < n; i += 2) {
        const double *a = at[(first + i) % n], *b = at[(first + i + 1) % n];
        sdm_canvas_stroke(c, a[0], a[1], b[0], b[1], width);
    }
}

static void trace(sdm_canvas *c, sdm_box box, const sdm_slice *s, double level, double width)
{
    /* cells between voxel centres, and one more around; what lies outside the box is clipped */
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
            trace_cell(c, k, width);
        }
    }
}

void sdm_panel_contour(sdm_canvas *c, sdm_box box, const sdm_slice *s, double level, double width,
                       sdm_colour colour, sdm_colour rim)
{
    sdm_canvas_clip(c, box.x, box.y, box.w, box.h);
    trace(c, box, s, level, width + 2.2);
    sdm_canvas_ink(c, rim, 0.55);
    trace(c, box, s, level, width);
    sdm_canvas_ink(c, colour, 1);
    sdm_canvas_unclip(c);
}

void sdm_panel_scale_bar(sdm_canvas *c, sdm_box box, double pixels_per_mm)
{
    double first, mm;
    char number[32], text[48];
    sdm_ticks(0, box.w / pixels_per_mm, 4, &first, &mm);
    const double length = mm * pixels_per_mm, x = box.x + 12, y = box.y + box.h - 12;
    if (!(length < box.w - 24)) return;
    for (int pass = 0; pass < 2; pass++) {
        const double width = pass ? 2.5 : 6;
        sdm_canvas_stroke(c, x, y, x + length, y, width);
        sdm_canvas_stroke(c, x, y - 3.5, x, y + 3.5, pass ? 1.6 : 5);
        sdm_canvas_stroke(c, x + length, y - 3.5, x + length, y + 3.5, pass ? 1.6 : 5);
        sdm_canvas_ink(c, pass ? SDM_INK : (sdm_colour){255, 255, 255}, pass ? 1 : 0.75);
    }
    snprintf(text, sizeof text, "%s mm", sdm_tick_text(mm, mm, number));
    sdm_canvas_text(c, x + length / 2, y - 9,
                    (sdm_type){.size = 9, .align = SDM_CENTRE, .colour = SDM_INK, .halo = true},
                    text);
}

void sdm_colour_bar(sdm_canvas *c, sdm_box box, sdm_colour_map map, double low, double high,
                    const char *caption)
{
    for (int x = 0; x < box.w; x++) {
        const double v = low + (x + 0.5) / box.w * (high - low);
        sdm_canvas_box(c, box.x + x, box.y, 1, box.h, sdm_map_colour(map, low, high, v), 1);
    }
    sdm_canvas_frame(c, box.x, box.y, box.w, box.h, SDM_INK_LIGHT);
    double first, step;
    char text[32];
    const sdm_type type = {.size = 9, .align = SDM_CENTRE, .colour = SDM_INK};
    const int n = sdm_ticks(low, high, 9, &first, &step);
    for (int i = 0; i < n; i++) {
        const double v = first + i * step, x = box.x + (v - low) / (high - low) * box.w;
        sdm_canvas_stroke(c, x, box.y + box.h + 1, x, box.y + box.h + 5, 1);
        sdm_canvas_ink(c, SDM_INK_LIGHT, 1);
        sdm_canvas_text(c, x, box.y + box.h + 19, type, sdm_tick_text(v, step, text));
    }
    sdm_canvas_text(c, box.x + box.w / 2.0, box.y + box.h + 38, type, caption);
}
