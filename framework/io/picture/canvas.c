/* An RGB canvas: boxes and antialiased strokes with round ends. */
#include "canvas.h"

#include <math.h>
#include <string.h>

#include "sdm/memory.h"

#define SIDE_MAX 16384

static int least(int a, int b) { return a < b ? a : b; }
static int most(int a, int b) { return a > b ? a : b; }

static void clear_dirty(sdm_canvas *c)
{
    c->dirty[0] = c->w;
    c->dirty[1] = c->h;
    c->dirty[2] = c->dirty[3] = 0;
}

sdm_status sdm_canvas_create(sdm_canvas *c, int w, int h, sdm_error *err)
{
    memset(c, 0, sizeof *c);
    if (w < 1 || h < 1 || w > SIDE_MAX || h > SIDE_MAX)
        return sdm_fail(err, SDM_E_ARG, "picture of %d x %d pixels, need 1 to %d a side", w, h,
                        SIDE_MAX);
    c->w = w;
    c->h = h;
    const size_t n = (size_t)w * (size_t)h;
    sdm_status e = SDM_ALLOC(&c->rgb, 3 * n, "pixels of a picture", err);
    if (!e) e = SDM_ALLOC(&c->mask, n, "mask of a picture", err);
    if (e) {
        sdm_canvas_dispose(c);
        return e;
    }
    memset(c->rgb, 255, 3 * n);
    sdm_canvas_unclip(c);
    clear_dirty(c);
    return SDM_OK;
}

void sdm_canvas_dispose(sdm_canvas *c)
{
    sdm_free(c->rgb);
    sdm_free(c->mask);
    memset(c, 0, sizeof *c);
}

void sdm_canvas_clip(sdm_canvas *c, int x, int y, int w, int h)
{
    c->clip[0] = most(x, 0);
    c->clip[1] = most(y, 0);
    c->clip[2] = least(x + w, c->w);
    c->clip[3] = least(y + h, c->h);
}

void sdm_canvas_unclip(sdm_canvas *c) { sdm_canvas_clip(c, 0, 0, c->w, c->h); }

static void blend(uint8_t *pixel, sdm_colour colour, double alpha)
{
    const uint8_t to[3] = {colour.r, colour.g, colour.b};
    for (int i = 0; i < 3; i++) pixel[i] = (uint8_t)(pixel[i] + alpha * (to[i] - pixel[i]) + 0.5);
}

void sdm_canvas_box(sdm_canvas *c, int x, int y, int w, int h, sdm_colour colour, double alpha)
{
    for (int py = most(y, c->clip[1]); py < least(y + h, c->clip[3]); py++)
        for (int px = most(x, c->clip[0]); px < least(x + w, c->clip[2]); px++)
            blend(c->rgb + 3 * ((size_t)py * (size_t)c->w + (size_t)px), colour, alpha);
}

void sdm_canvas_frame(sdm_canvas *c, int x, int y, int w, int h, sdm_colour colour)
{
    sdm_canvas_box(c, x - 1, y - 1, w + 2, 1, colour, 1);
    sdm_canvas_box(c, x - 1, y + h, w + 2, 1, colour, 1);
    sdm_canvas_box(c, x - 1, y, 1, h, colour, 1);
    sdm_canvas_box(c, x + w, y, 1, h, colour, 1);
}

/* Distance from p to the segment a + t u, t in 0 .. 1. */
static double segment_distance(double px, double py, double ax, double ay, double ux, double uy)
{
    const double length2 = ux * ux + uy * uy;
    double t = length2 > 0 ? ((px - ax) * ux + (py - ay) * uy) / length2 : 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    const double dx = px - ax - t * ux, dy = py - ay - t * uy;
    return sqrt(dx * dx + dy * dy);
}

/* Coordinates far outside the canvas must not overflow an int. */
static int whole(double v, int limit) { return v < -1 ? -1 : v > limit ? limit : (int)floor(v); }

void sdm_canvas_stroke(sdm_canvas *c, double x0, double y0, double x1, double y1, double width)
{
    if (!(isfinite(x0) && isfinite(y0) && isfinite(x1) && isfinite(y1))) return;
    const double reach = width / 2 + 1;
    const int left = most(whole(fmin(x0, x1) - reach, c->w), c->clip[0]);
    const int right = least(whole(fmax(x0, x1) + reach, c->w) + 1, c->clip[2]);
    const int top = most(whole(fmin(y0, y1) - reach, c->h), c->clip[1]);
    const int bottom = least(whole(fmax(y0, y1) + reach, c->h) + 1, c->clip[3]);
    for (int py = top; py < bottom; py++) {
        for (int px = left; px < right; px++) {
            const double d = segment_distance(px + 0.5, py + 0.5, x0, y0, x1 - x0, y1 - y0);
            const double cover = fmin(1, width / 2 + 0.5 - d);
            uint8_t *m = c->mask + (size_t)py * (size_t)c->w + (size_t)px;
            if (cover > 0) *m = (uint8_t)most(*m, (int)(255 * cover + 0.5));
        }
    }
    if (left >= right || top >= bottom) return;
    c->dirty[0] = least(c->dirty[0], left);
    c->dirty[1] = least(c->dirty[1], top);
    c->dirty[2] = most(c->dirty[2], right);
    c->dirty[3] = most(c->dirty[3], bottom);
}

void sdm_canvas_ink(sdm_canvas *c, sdm_colour colour, double alpha)
{
    for (int y = c->dirty[1]; y < c->dirty[3]; y++) {
        for (int x = c->dirty[0]; x < c->dirty[2]; x++) {
            const size_t i = (size_t)y * (size_t)c->w + (size_t)x;
            if (c->mask[i]) blend(c->rgb + 3 * i, colour, alpha * c->mask[i] / 255);
            c->mask[i] = 0;
        }
    }
    clear_dirty(c);
}
