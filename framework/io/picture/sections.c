/* Places three orthogonal sections of a grid and draws their axes. */
#include "sections.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define PANEL_WIDE 340.0 /* pixels of the widest section */
#define PANEL_TALL 420.0 /* pixels of the tallest section */

/* The two axes of the grid that a section normal to `axis` shows: to the right and upwards. */
static void section_axes(int axis, int *right, int *up)
{
    *right = axis == 0 ? 1 : 0;
    *up = axis == 2 ? 1 : 2;
}

/* The index of each section: the middle of the negative values' bounding box. */
static void find_middle(sdm_sections *s, const float *v)
{
    const int64_t *n = s->grid->n;
    int64_t low[3], high[3] = {-1, -1, -1};
    memcpy(low, n, sizeof low);
    for (int64_t k = 0; k < n[2]; k++)
        for (int64_t j = 0; j < n[1]; j++)
            for (int64_t i = 0; i < n[0]; i++) {
                if (!(*v++ < 0)) continue;
                const int64_t at[3] = {i, j, k};
                for (int d = 0; d < 3; d++) {
                    if (at[d] < low[d]) low[d] = at[d];
                    if (at[d] > high[d]) high[d] = at[d];
                }
            }
    for (int d = 0; d < 3; d++) s->at[d] = high[d] < 0 ? (n[d] - 1) / 2 : (low[d] + high[d]) / 2;
}

/* Finds the grid axes that are parallel to a world axis. */
static void find_axes(sdm_sections *s)
{
    for (int axis = 0; axis < 3; axis++) {
        s->world[axis] = -1;
        for (int w = 0; w < 3; w++)
            if (fabs(fabs(s->grid->dir[3 * w + axis]) - 1) < 1e-9) s->world[axis] = w;
    }
}

void sdm_sections_place(sdm_sections *s, const sdm_grid *grid, const float *map)
{
    double wide = 0, tall = 0;
    int right, up;
    s->grid = grid;
    find_middle(s, map);
    find_axes(s);
    for (int axis = 0; axis < 3; axis++) {
        section_axes(axis, &right, &up);
        wide = fmax(wide, (double)grid->n[right] * grid->spacing[right]);
        tall = fmax(tall, (double)grid->n[up] * grid->spacing[up]);
    }
    s->pixels = fmin(PANEL_WIDE / wide, PANEL_TALL / tall);
    s->widest = (int)fmax(220, ceil(wide * s->pixels));
    for (int axis = 0; axis < 3; axis++) {
        section_axes(axis, &right, &up);
        s->w[axis] = (int)fmax(4, round((double)grid->n[right] * grid->spacing[right] * s->pixels));
        s->h[axis] = (int)fmax(4, round((double)grid->n[up] * grid->spacing[up] * s->pixels));
    }
}

sdm_slice sdm_section_of(const sdm_sections *s, const float *values, int axis)
{
    const int64_t *n = s->grid->n;
    const size_t stride[3] = {1, (size_t)n[0], (size_t)n[0] * (size_t)n[1]};
    int right, up;
    section_axes(axis, &right, &up);
    return (sdm_slice){values + (size_t)s->at[axis] * stride[axis],
                       {n[right], n[up]},
                       {stride[right], stride[up]}};
}

/* Coordinate in mm of index `at` along an axis of the grid: a world coordinate when the axis is
 * parallel to a world axis, else the distance from the first voxel. */
static double position(const sdm_sections *s, int axis, double at)
{
    const sdm_grid *g = s->grid;
    const int w = s->world[axis];
    if (w < 0) return at * g->spacing[axis];
    // the other grid axes are orthogonal to this world axis and do not change its coordinate
    return g->origin[w] + g->dir[3 * w + axis] * at * g->spacing[axis];
}

/* x, y, z for a world axis; i, j, k for an oblique grid axis. */
static char axis_name(const sdm_sections *s, int axis)
{
    return s->world[axis] < 0 ? "ijk"[axis] : "xyz"[s->world[axis]];
}

/* Ticks with numbers in mm along the lower side of the box, or (upwards) along its left side. */
static void draw_axis(sdm_canvas *c, const sdm_sections *s, sdm_box box, int axis, bool upwards)
{
    const double last = (double)s->grid->n[axis] - 0.5, a = position(s, axis, -0.5),
                 b = position(s, axis, last);
    const int length = upwards ? box.h : box.w;
    double first, step;
    char text[48];
    const int n = sdm_ticks(fmin(a, b), fmax(a, b), length / 55 + 1, &first, &step);
    sdm_type type = {.size = 9, .align = upwards ? SDM_RIGHT : SDM_CENTRE, .colour = SDM_INK};
    for (int i = 0; i < n; i++) {
        const double v = first + i * step, t = (v - a) / (b - a);
        const double x = upwards ? box.x - 1 : box.x + t * box.w,
                     y = upwards ? box.y + (1 - t) * box.h : box.y + box.h + 1;
        sdm_canvas_line(c, x, y, upwards ? x - 4 : x, upwards ? y : y + 4, 1, SDM_INK_LIGHT);
        sdm_canvas_text(c, upwards ? x - 8 : x, upwards ? y + 4.5 : y + 18, type,
                        sdm_tick_text(v, step, text));
    }
    snprintf(text, sizeof text, "%c (mm)", axis_name(s, axis));
    type.align = SDM_CENTRE;
    type.upwards = upwards;
    if (upwards)
        sdm_canvas_text(c, box.x - 44, box.y + box.h / 2.0, type, text);
    else
        sdm_canvas_text(c, box.x + box.w / 2.0, box.y + box.h + 34, type, text);
}

void sdm_section_draw_frame(sdm_canvas *c, const sdm_sections *s, sdm_box box, int axis, bool left)
{
    int right, up;
    char text[64], number[32];
    section_axes(axis, &right, &up);
    sdm_canvas_frame(c, box, SDM_INK_LIGHT);
    if (s->world[axis] < 0)
        snprintf(text, sizeof text, "%c = %lld of %lld", axis_name(s, axis), (long long)s->at[axis],
                 (long long)s->grid->n[axis]);
    else
        snprintf(text, sizeof text, "%c = %s mm", axis_name(s, axis),
                 sdm_tick_text(position(s, axis, (double)s->at[axis]), 0.01, number));
    sdm_canvas_text(c, box.x, box.y - 6, (sdm_type){.size = 9, .colour = SDM_INK}, text);
    draw_axis(c, s, box, right, false);
    if (left) draw_axis(c, s, box, up, true);
}
