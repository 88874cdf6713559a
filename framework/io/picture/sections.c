/* Places three orthogonal sections of a grid and draws their axes. */
#include "sections.h"

#include <math.h>
#include <stdio.h>

#include "sdm/memory.h"
#include "section_choice.h"

#define PANEL_WIDE 340.0 /* pixels of the widest section */
#define PANEL_TALL 420.0 /* pixels of the tallest section */
/* degrees; a turn of less moves the ends of 100 mm by less than 0.01 mm */
#define ALIGNED 0.005

/* The two axes of the grid that a section normal to `axis` shows: to the right and upwards. */
static void section_axes(int axis, int *right, int *up)
{
    *right = axis == 0 ? 1 : 0;
    *up = axis == 2 ? 1 : 2;
}

/* Finds the world axis nearest to each grid axis. */
static void find_axes(sdm_sections *s)
{
    for (int axis = 0; axis < 3; axis++) {
        const double *dir = s->grid->dir + axis; // its components are dir[0], dir[3], dir[6]
        int nearest = 0;
        for (int w = 1; w < 3; w++)
            if (fabs(dir[3 * w]) > fabs(dir[3 * nearest]) + 1e-9) nearest = w;
        s->world[axis] = nearest;
        s->degrees[axis] = acos(fmin(fabs(dir[3 * nearest]), 1)) * 180 / acos(-1);
    }
}

/* Finds the pieces that no section cuts. */
static sdm_status find_hidden(sdm_sections *s, const float *map, sdm_error *err)
{
    sdm_piece *piece;
    size_t n;
    const sdm_status status = sdm_pieces_find(s->grid->n, map, &piece, &n, err);
    s->n_hidden = 0;
    s->hidden = (sdm_piece){0};
    for (size_t i = 0; i < n; i++) {
        bool cut = false;
        // a piece is connected: every section between its ends cuts it
        for (int a = 0; a < 3; a++)
            cut |= piece[i].low[a] <= s->at[a] && s->at[a] <= piece[i].high[a];
        if (cut) continue;
        s->n_hidden++;
        if (piece[i].voxels > s->hidden.voxels) s->hidden = piece[i];
    }
    sdm_free(piece);
    return status;
}

sdm_status sdm_sections_place(sdm_sections *s, const sdm_grid *grid, const float *map,
                              sdm_error *err)
{
    double wide = 0, tall = 0;
    int right, up;
    s->grid = grid;
    find_axes(s);
    sdm_status status = sdm_sections_choose(grid, map, s->at, err);
    if (!status) status = find_hidden(s, map, err);
    if (status) return status;
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
    return SDM_OK;
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

static bool is_aligned(const sdm_sections *s, int axis) { return s->degrees[axis] < ALIGNED; }

/* Coordinate in mm of index `at` along an axis of the grid: a world coordinate when the axis is
 * parallel to a world axis, else the distance from the first voxel. */
static double position(const sdm_sections *s, int axis, double at)
{
    const sdm_grid *g = s->grid;
    const int w = s->world[axis];
    if (!is_aligned(s, axis)) return at * g->spacing[axis];
    // the other grid axes are orthogonal to this world axis and do not change its coordinate
    return g->origin[w] + g->dir[3 * w + axis] * at * g->spacing[axis];
}

/* "x (mm)" for an axis parallel to a world axis, "20 degrees from -x (mm from the corner)", with
 * the sign of degrees, for an oblique one. */
static void axis_text(const sdm_sections *s, int axis, char text[64])
{
    const int w = s->world[axis];
    const char name = "xyz"[w], *sign = s->grid->dir[3 * w + axis] < 0 ? "-" : "+";
    if (is_aligned(s, axis))
        snprintf(text, 64, "%c (mm)", name);
    else
        snprintf(text, 64, "%.3g\xC2\xB0 from %s%c (mm from the corner)", s->degrees[axis], sign,
                 name);
}

/* Where the section normal to `axis` lies: "z = 12.5 mm"; an oblique one, whose z varies, "z = 12.5
 * mm in the middle". */
static void position_text(const sdm_sections *s, int axis, char text[64])
{
    const sdm_grid *g = s->grid;
    const int w = s->world[axis];
    double index[3], world[3];
    char number[32];
    for (int a = 0; a < 3; a++)
        index[a] = a == axis ? (double)s->at[a] : 0.5 * (double)(g->n[a] - 1);
    sdm_grid_world(g, index, world);
    if (fabs(world[w]) < 0.005) world[w] = 0; // not "-0.00"
    snprintf(text, 64, "%c = %s mm%s", "xyz"[w], sdm_tick_text(world[w], 0.01, number),
             is_aligned(s, axis) ? "" : " in the middle");
}

/* Ticks with numbers in mm along the lower side of the box, or (upwards) along its left side. */
static void draw_axis(sdm_canvas *c, const sdm_sections *s, sdm_box box, int axis, bool upwards)
{
    const double last = (double)s->grid->n[axis] - 0.5, a = position(s, axis, -0.5),
                 b = position(s, axis, last);
    const int length = upwards ? box.h : box.w;
    double first, step;
    char text[64];
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
    axis_text(s, axis, text);
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
    char text[64];
    section_axes(axis, &right, &up);
    sdm_canvas_frame(c, box, SDM_INK_LIGHT);
    position_text(s, axis, text);
    sdm_canvas_text(c, box.x, box.y - 6, (sdm_type){.size = 9, .colour = SDM_INK}, text);
    draw_axis(c, s, box, right, false);
    if (left) draw_axis(c, s, box, up, true);
}

void sdm_sections_draw_hidden(sdm_canvas *c, const sdm_sections *s, double x, double y,
                              bool centred)
{
    const sdm_type type = {.size = 9, .align = centred ? SDM_CENTRE : SDM_LEFT, .colour = SDM_INK};
    double index[3], world[3];
    char text[160];
    if (!s->n_hidden) return;
    for (int a = 0; a < 3; a++) index[a] = 0.5 * (double)(s->hidden.low[a] + s->hidden.high[a]);
    sdm_grid_world(s->grid, index, world);
    snprintf(text, sizeof text, "%zu %s of the shape %s in no slice", s->n_hidden,
             s->n_hidden == 1 ? "piece" : "pieces", s->n_hidden == 1 ? "is" : "are");
    sdm_canvas_text(c, x, y, type, text);
    snprintf(text, sizeof text, "%s x = %.4g, y = %.4g, z = %.4g mm",
             s->n_hidden == 1 ? "near" : "the largest: near", world[0], world[1], world[2]);
    sdm_canvas_text(c, x, y + 17, type, text);
}
