/* Pictures of maps: three orthogonal slices of each, side by side, with contours, scales and positions. */
#include "sdm/image.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "panel.h"

#define MAPS_MAX 16
#define LEVELS_MAX 16
#define PANEL_WIDE 340.0 /* pixels of the widest slice */
#define PANEL_TALL 420.0 /* and of the tallest */
#define LEFT 66          /* room for numbers and axis names */
#define RIGHT 22
#define TOP 46
#define GAP 24
#define BELOW 54 /* under each row: numbers and axis name */
#define BAR 14
#define FOOT 84 /* colour bars with numbers and captions */

/* Everything that is known before the first pixel. */
typedef struct layout {
    const sdm_grid *g;
    const sdm_picture_map *maps;
    size_t n_maps;
    const float *levels;
    size_t n_levels;
    int64_t at[3];          /* slice positions */
    int world[3];           /* axis of the world an axis of the grid runs along, or -1 */
    double pixels;          /* per mm */
    sdm_box row[3];         /* panels of the first column; row r is normal to axis r */
    int column;             /* width of a column */
    double low[2], high[2]; /* distance and error scale */
    double unit[2];         /* factor of the printed numbers: 1 for mm, 1000 for micrometres */
} layout;

/* The two axes of the grid that a slice normal to `axis` shows: to the right and upwards. */
static void slice_axes(int axis, int *right, int *up)
{
    *right = axis == 0 ? 1 : 0;
    *up = axis == 2 ? 1 : 2;
}

/* The middle of the box around the negative values of the first map; of the grid when there are none. */
static void find_middle(layout *l)
{
    int64_t low[3], high[3] = {-1, -1, -1};
    memcpy(low, l->g->n, sizeof low);
    const float *v = l->maps[0].values;
    for (int64_t k = 0; k < l->g->n[2]; k++)
        for (int64_t j = 0; j < l->g->n[1]; j++)
            for (int64_t i = 0; i < l->g->n[0]; i++) {
                if (!(*v++ < 0)) continue;
                const int64_t at[3] = {i, j, k};
                for (int d = 0; d < 3; d++) {
                    if (at[d] < low[d]) low[d] = at[d];
                    if (at[d] > high[d]) high[d] = at[d];
                }
            }
    for (int d = 0; d < 3; d++) l->at[d] = high[d] < 0 ? (l->g->n[d] - 1) / 2 : (low[d] + high[d]) / 2;
}

/* Range of the finite values of the maps of one kind. */
static void find_range(layout *l, bool error)
{
    double low = INFINITY, high = -INFINITY;
    for (size_t m = 0; m < l->n_maps; m++) {
        const size_t n = l->maps[m].error == error ? sdm_grid_count(l->g) : 0;
        for (size_t i = 0; i < n; i++) {
            const double v = (double)l->maps[m].values[i];
            if (!isfinite(v)) continue;
            low = fmin(low, v);
            high = fmax(high, v);
        }
    }
    if (!(low <= high)) low = high = 0;
    if (error && low < 0) {
        high = fmax(-low, high);
        low = -high;
    } else {
        low = fmin(low, 0);
        high = fmax(high, 0);
    }
    if (!(high - low > 1e-12)) high = low + (error ? 1e-3 : 1);
    l->low[error] = low;
    l->high[error] = high;
    l->unit[error] = error && high < 0.1 ? 1000 : 1;
}

static void find_axes(layout *l)
{
    for (int axis = 0; axis < 3; axis++) {
        l->world[axis] = -1;
        for (int w = 0; w < 3; w++)
            if (fabs(fabs(l->g->dir[3 * w + axis]) - 1) < 1e-9) l->world[axis] = w;
    }
}

/* Sizes of panels and canvas. */
static void place(layout *l, int *width, int *height)
{
    double wide = 0, tall = 0;
    int right, up, y = TOP;
    for (int r = 0; r < 3; r++) {
        slice_axes(r, &right, &up);
        wide = fmax(wide, (double)l->g->n[right] * l->g->spacing[right]);
        tall = fmax(tall, (double)l->g->n[up] * l->g->spacing[up]);
    }
    l->pixels = fmin(PANEL_WIDE / wide, PANEL_TALL / tall);
    l->column = (int)fmax(220, ceil(wide * l->pixels));
    for (int r = 0; r < 3; r++) {
        slice_axes(r, &right, &up);
        const int w = (int)fmax(4, round((double)l->g->n[right] * l->g->spacing[right] * l->pixels));
        const int h = (int)fmax(4, round((double)l->g->n[up] * l->g->spacing[up] * l->pixels));
        l->row[r] = (sdm_box){LEFT + (l->column - w) / 2, y, w, h};
        y += h + BELOW;
    }
    *width = LEFT + (int)l->n_maps * (l->column + GAP) - GAP + RIGHT;
    *height = y + FOOT;
}

/* Position of index `at` along an axis of the grid: in the world where the axis is one of it, else from the first voxel. */
static double position(const layout *l, int axis, double at)
{
    const int w = l->world[axis];
    if (w < 0) return at * l->g->spacing[axis];
    /* the other indices do not matter for this coordinate */
    return l->g->origin[w] + l->g->dir[3 * w + axis] * at * l->g->spacing[axis];
}

static char axis_name(const layout *l, int axis) { return l->world[axis] < 0 ? "ijk"[axis] : "xyz"[l->world[axis]]; }

/* Numbers along one side of a panel, in mm. */
static void draw_axis(sdm_canvas *c, const layout *l, sdm_box box, int axis, bool upwards)
{
    const double last = (double)l->g->n[axis] - 0.5, a = position(l, axis, -0.5), b = position(l, axis, last);
    const int length = upwards ? box.h : box.w;
    double first, step;
    char text[48];
    const int n = sdm_ticks(fmin(a, b), fmax(a, b), length / 55 + 1, &first, &step);
    sdm_type type = {.size = 9, .align = upwards ? SDM_RIGHT : SDM_CENTRE, .colour = SDM_INK};
    for (int i = 0; i < n; i++) {
        const double v = first + i * step, t = (v - a) / (b - a);
        const double x = upwards ? box.x - 1 : box.x + t * box.w,
                     y = upwards ? box.y + (1 - t) * box.h : box.y + box.h + 1;
        sdm_canvas_stroke(c, x, y, upwards ? x - 4 : x, upwards ? y : y + 4, 1);
        sdm_canvas_ink(c, SDM_INK_LIGHT, 1);
        sdm_canvas_text(c, upwards ? x - 8 : x, upwards ? y + 4.5 : y + 18, type, sdm_tick_text(v, step, text));
    }
    snprintf(text, sizeof text, "%c (mm)", axis_name(l, axis));
    type.align = SDM_CENTRE;
    type.upwards = upwards;
    if (upwards)
        sdm_canvas_text(c, box.x - 44, box.y + box.h / 2.0, type, text);
    else
        sdm_canvas_text(c, box.x + box.w / 2.0, box.y + box.h + 34, type, text);
}

static sdm_slice cut(const layout *l, const float *values, int axis)
{
    const size_t stride[3] = {1, (size_t)l->g->n[0], (size_t)l->g->n[0] * (size_t)l->g->n[1]};
    int right, up;
    slice_axes(axis, &right, &up);
    return (sdm_slice){
        values + (size_t)l->at[axis] * stride[axis], {l->g->n[right], l->g->n[up]}, {stride[right], stride[up]}};
}

static sdm_colour level_colour(size_t i)
{
    static const sdm_colour known[] = {{214, 28, 36}, {255, 214, 10}, {20, 160, 110}, {150, 70, 190}};
    return known[i % (sizeof known / sizeof *known)];
}

/* Distances get their own contours; on an error map the contours of the first map show where the surface is. */
static void draw_contours(sdm_canvas *c, const layout *l, sdm_box box, const sdm_picture_map *map, int axis)
{
    const sdm_colour white = {255, 255, 255}, dark = {40, 40, 48};
    const sdm_slice s = cut(l, map->error ? l->maps[0].values : map->values, axis);
    for (size_t i = l->n_levels; i-- > 0;) {
        if (map->error)
            sdm_panel_contour(c, box, &s, (double)l->levels[i], i ? 0.9 : 1.4, white, dark);
        else
            sdm_panel_contour(c, box, &s, (double)l->levels[i], i ? 1.6 : 2, level_colour(i), i ? dark : white);
    }
}

static sdm_colour_map map_of(const layout *l, bool error)
{
    return !error ? SDM_MAP_DISTANCE : l->low[1] < 0 ? SDM_MAP_SIGNED : SDM_MAP_ERROR;
}

static void draw_panel(sdm_canvas *c, const layout *l, size_t column, int axis)
{
    const sdm_picture_map *map = &l->maps[column];
    const sdm_slice s = cut(l, map->values, axis);
    sdm_box box = l->row[axis];
    int right, up;
    char text[64], number[32];
    slice_axes(axis, &right, &up);
    box.x += (int)column * (l->column + GAP);
    sdm_panel_colours(c, box, &s, map_of(l, map->error), l->low[map->error], l->high[map->error]);
    draw_contours(c, l, box, map, axis);
    sdm_canvas_frame(c, box.x, box.y, box.w, box.h, SDM_INK_LIGHT);
    if (l->world[axis] < 0)
        snprintf(text, sizeof text, "%c = %lld of %lld", axis_name(l, axis), (long long)l->at[axis],
                 (long long)l->g->n[axis]);
    else
        snprintf(text, sizeof text, "%c = %s mm", axis_name(l, axis),
                 sdm_tick_text(position(l, axis, (double)l->at[axis]), 0.01, number));
    sdm_canvas_box(c, box.x, box.y, (int)sdm_text_width(10, text) + 17, 25, (sdm_colour){255, 255, 255}, 0.82);
    sdm_canvas_text(c, box.x + 8, box.y + 18, (sdm_type){.size = 10, .colour = SDM_INK}, text);
    draw_axis(c, l, box, right, false);
    if (column == 0) draw_axis(c, l, box, up, true);
    if (column == 0) sdm_panel_scale_bar(c, box, l->pixels);
}

/* A sample of each contour's line with its level, behind the caption of the distances. */
static void draw_key(sdm_canvas *c, const layout *l, double x, double y)
{
    char text[48];
    const sdm_type type = {.size = 9, .colour = SDM_INK};
    double total = 0;
    for (int pass = 0; pass < 2; pass++) {
        double at = x - total / 2;
        for (size_t i = 0; i < l->n_levels; i++) {
            snprintf(text, sizeof text, "%g mm", (double)l->levels[i]);
            const double w = sdm_text_width(9, text);
            if (pass) {
                sdm_canvas_stroke(c, at, y - 4.5, at + 18, y - 4.5, 4.2);
                sdm_canvas_ink(c, i ? (sdm_colour){40, 40, 48} : (sdm_colour){255, 255, 255}, 0.55);
                sdm_canvas_stroke(c, at, y - 4.5, at + 18, y - 4.5, 2);
                sdm_canvas_ink(c, level_colour(i), 1);
                sdm_canvas_text(c, at + 25, y, type, text);
            }
            at += 25 + w + 18;
            if (!pass) total += 25 + w + (i + 1 < l->n_levels ? 18 : 0);
        }
    }
}

static void draw_column(sdm_canvas *c, const layout *l, size_t column, int foot)
{
    const sdm_picture_map *map = &l->maps[column];
    const int x = LEFT + (int)column * (l->column + GAP), e = map->error;
    const sdm_type title = {.size = 13, .align = SDM_CENTRE, .bold = true, .colour = SDM_INK};
    sdm_canvas_text(c, x + l->column / 2.0, TOP - 16, title, map->title ? map->title : "");
    for (int axis = 0; axis < 3; axis++) draw_panel(c, l, column, axis);
    const sdm_box bar = {x + l->column / 10, foot, l->column - 2 * (l->column / 10), BAR};
    const char *caption = !e ? "signed distance (mm)" : l->unit[1] > 1 ? "error (\xC2\xB5m)" : "error (mm)";
    sdm_colour_bar(c, bar, map_of(l, map->error), l->low[e] * l->unit[e], l->high[e] * l->unit[e], caption);
    if (!e) draw_key(c, l, x + l->column / 2.0, foot + 72);
}

static sdm_status check(const char *path, const sdm_grid *grid, const sdm_picture_map *maps, size_t n_maps,
                        const float *levels, size_t n_levels, sdm_error *err)
{
    if (!path || !grid || !maps || (n_levels && !levels))
        return sdm_fail(err, SDM_E_ARG, "sdm_picture_slices: NULL argument");
    if (n_maps < 1 || n_maps > MAPS_MAX)
        return sdm_fail(err, SDM_E_ARG, "%zu maps in a picture, need 1 to %d", n_maps, MAPS_MAX);
    if (n_levels > LEVELS_MAX)
        return sdm_fail(err, SDM_E_ARG, "%zu levels in a picture, need 0 to %d", n_levels, LEVELS_MAX);
    for (size_t i = 0; i < n_maps; i++)
        if (!maps[i].values) return sdm_fail(err, SDM_E_ARG, "map %zu of the picture has no values", i);
    return sdm_grid_check(grid, err);
}

sdm_status sdm_picture_slices(const char *path, const sdm_grid *grid, const sdm_picture_map *maps, size_t n_maps,
                              const float *levels, size_t n_levels, sdm_error *err)
{
    sdm_status e = check(path, grid, maps, n_maps, levels, n_levels, err);
    if (e) return e;
    layout l = {.g = grid, .maps = maps, .n_maps = n_maps, .levels = levels, .n_levels = n_levels};
    int w, h;
    find_middle(&l);
    find_axes(&l);
    find_range(&l, false);
    find_range(&l, true);
    place(&l, &w, &h);
    sdm_canvas c;
    e = sdm_canvas_create(&c, w, h, err);
    if (e) return e;
    for (size_t m = 0; m < n_maps; m++) draw_column(&c, &l, m, h - FOOT);
    e = sdm_png_write(path, &c, err);
    sdm_canvas_dispose(&c);
    return e;
}
