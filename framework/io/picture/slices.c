/* Pictures of maps: a column of three orthogonal slices for each map, with contours, axes in mm and
   colour bars. */
#include "sdm/picture.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sections.h"

#define MAPS_MAX 16
#define LEVELS_MAX 16
/* Lengths of the layout in pixels. */
#define LEFT SDM_SECTION_LEFT
#define RIGHT 22
#define TOP (46 + SDM_SECTION_ABOVE)
#define NOTE 32 /* two lines below the title */
#define GAP 36
#define BELOW SDM_SECTION_BELOW
#define BAR 14
#define SAMPLE 26 /* length of a line in the legend */
#define FOOT 84   /* colour bars with numbers and captions */

/* The data and where everything lies on the canvas. */
typedef struct layout {
    const sdm_grid *g;
    const sdm_picture_map *maps;
    size_t n_maps;
    const float *levels;
    size_t n_levels;
    sdm_sections sections;
    sdm_box row[3];         /* panels of the first column; row r is normal to axis r */
    int top, column;        /* of the first row; width of a column */
    int foot;               /* upper end of the colour bars */
    double low[2], high[2]; /* colour scales: [0] distances, [1] errors, mm */
    double unit[2];         /* printed number per mm: 1, or 1000 for micrometres */
} layout;

/* The colour scale of distances or of errors: the range of their finite values, widened to hold 0;
 * symmetric about 0 for errors of both signs; never empty. */
static void layout_range(layout *l, bool error)
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

/* What the title holds behind its first line; NULL: nothing. */
static const char *note_of(const sdm_picture_map *map)
{
    const char *end = map->title ? strchr(map->title, '\n') : NULL;
    return end ? end + 1 : NULL;
}

/* Chooses the slices, the boxes of the first column and the size of the canvas. */
static sdm_status layout_place(layout *l, int *width, int *height, sdm_error *err)
{
    const sdm_status s = sdm_sections_place(&l->sections, l->g, l->maps[0].values, err);
    if (s) return s;
    l->top = TOP;
    for (size_t m = 0; m < l->n_maps; m++)
        if (note_of(&l->maps[m])) l->top = TOP + NOTE;
    int y = l->top;
    l->column = l->sections.widest;
    for (int r = 0; r < 3; r++) {
        const int w = l->sections.w[r], h = l->sections.h[r];
        l->row[r] = (sdm_box){LEFT + (l->column - w) / 2, y, w, h};
        y += h + BELOW;
    }
    *width = LEFT + (int)l->n_maps * (l->column + GAP) - GAP + RIGHT;
    l->foot = y;
    *height = y + FOOT + (l->sections.n_hidden ? SDM_SECTIONS_HIDDEN : 0);
    return SDM_OK;
}

static const sdm_colour DARK = {40, 40, 48};

static sdm_colour level_colour(size_t i)
{
    static const sdm_colour known[] = {
        {214, 28, 36}, {255, 214, 10}, {20, 160, 110}, {150, 70, 190}};
    return known[i % (sizeof known / sizeof *known)];
}

/* One line of a panel with its entry in the legend. */
typedef struct mark {
    const sdm_picture_map *map;
    float level;
    sdm_contour_line line;
} mark;

/* The number of lines in a panel of column `column`. */
static size_t count_marks(const layout *l, size_t column)
{
    const bool compared = column && !l->maps[column].error && l->n_levels;
    return l->n_levels + compared;
}

/* Line i of a panel. A map of distances has its own contours; under that of the first level, which
 * is then dashed, lies that of the first map, to compare. A map of errors has the contours of the
 * first map, to mark the surface: they are thin and white, so that they hide few errors; those of
 * further levels are dashed. */
static mark mark_of(const layout *l, size_t column, size_t i)
{
    const sdm_picture_map *map = &l->maps[column];
    const bool compared = count_marks(l, column) > l->n_levels;
    if (i == l->n_levels)
        return (mark){l->maps, l->levels[0], {.width = 1.6, .colour = DARK, .rim = SDM_WHITE}};
    if (map->error)
        return (mark){
            l->maps,
            l->levels[i],
            {.width = i ? 0.6 : 0.9, .colour = SDM_WHITE, .rim = DARK, .turns = i ? 2 : 0}};
    return (mark){map,
                  l->levels[i],
                  {.width = i ? 1.4 : 1.8,
                   .colour = level_colour(i),
                   .rim = i ? DARK : SDM_WHITE,
                   .turns = compared && !i ? 2 : 0}};
}

static void draw_contours(sdm_canvas *c, const layout *l, sdm_box box, size_t column, int axis)
{
    for (size_t i = count_marks(l, column); i-- > 0;) {
        const mark m = mark_of(l, column, i);
        const sdm_slice s = sdm_section_of(&l->sections, m.map->values, axis);
        sdm_panel_contour(c, box, &s, (double)m.level, &m.line);
    }
}

static void draw_dot(sdm_canvas *c, double x, double y)
{
    sdm_canvas_line(c, x, y, x, y, 3, DARK); // lines have round ends
}

/* Dots where the points of the map lie, those within a voxel of the slice. */
static void draw_points(sdm_canvas *c, const layout *l, sdm_box box, const sdm_picture_map *map,
                        int axis)
{
    const int right = axis == 0 ? 1 : 0, up = axis == 2 ? 1 : 2;
    sdm_canvas_clip(c, box);
    for (size_t i = 0; i < map->n_points; i++) {
        double at[3];
        sdm_grid_index(l->g, map->points + 3 * i, at);
        if (!(fabs(at[axis] - (double)l->sections.at[axis]) <= 1)) continue;
        const double x = box.x + (at[right] + 0.5) / (double)l->g->n[right] * box.w,
                     y = box.y + (1 - (at[up] + 0.5) / (double)l->g->n[up]) * box.h;
        draw_dot(c, x, y);
    }
    sdm_canvas_unclip(c);
}

static sdm_colour_map map_of(const layout *l, bool error)
{
    return !error ? SDM_MAP_DISTANCE : l->low[1] < 0 ? SDM_MAP_SIGNED : SDM_MAP_ERROR;
}

static void draw_panel(sdm_canvas *c, const layout *l, size_t column, int axis)
{
    const sdm_picture_map *map = &l->maps[column];
    const sdm_slice s = sdm_section_of(&l->sections, map->values, axis);
    sdm_box box = l->row[axis];
    box.x += (int)column * (l->column + GAP);
    sdm_panel_colours(c, box, &s, map_of(l, map->error), l->low[map->error], l->high[map->error]);
    draw_points(c, l, box, map, axis);
    draw_contours(c, l, box, column, axis);
    sdm_section_draw_frame(c, &l->sections, box, axis, column == 0);
}

/* The length of what a title holds in its first line. */
static int first_line(const char *title) { return title ? (int)strcspn(title, "\n") : 0; }

/* The text of a line in the legend of a column. */
static void mark_text(const layout *l, size_t column, const mark *m, char text[80])
{
    const char *title = l->maps[0].title;
    if (m->map == &l->maps[column] || !title)
        snprintf(text, 80, "%g mm", (double)m->level);
    else
        snprintf(text, 80, "%.*s: %g mm", first_line(title) < 24 ? first_line(title) : 24, title,
                 (double)m->level);
}

/* The legend, centred at x: a sample of each contour's line with its level, and a dot if the map
 * has points. The first pass measures, the second draws. */
static void draw_legend(sdm_canvas *c, const layout *l, size_t column, double x, double y)
{
    char text[80];
    const sdm_type type = {.size = 9, .colour = SDM_INK};
    const size_t lines = count_marks(l, column), n = lines + (l->maps[column].n_points > 0);
    double total = 0;
    for (int pass = 0; pass < 2; pass++) {
        double at = x - total / 2;
        for (size_t i = 0; i < n; i++) {
            const mark m = i < lines ? mark_of(l, column, i) : (mark){0};
            snprintf(text, sizeof text, "points of the data");
            if (i < lines) mark_text(l, column, &m, text);
            const double w = sdm_canvas_text_width(c, 9, false, text);
            if (pass && i == lines) draw_dot(c, at + 9, y - 4.5);
            if (pass && i < lines) sdm_contour_sample(c, at, y - 4.5, SAMPLE, &m.line);
            if (pass) sdm_canvas_text(c, at + SAMPLE + 7, y, type, text);
            at += SAMPLE + 7 + w + 18;
            if (!pass) total += SAMPLE + 7 + w + (i + 1 < n ? 18 : 0);
        }
    }
}

static void draw_column(sdm_canvas *c, const layout *l, size_t column)
{
    const sdm_picture_map *map = &l->maps[column];
    const int x = LEFT + (int)column * (l->column + GAP), e = map->error;
    sdm_type title = {.size = 13, .align = SDM_CENTRE, .bold = true, .colour = SDM_INK};
    const char *note = note_of(map);
    char first[160];
    snprintf(first, sizeof first, "%.*s", first_line(map->title), map->title ? map->title : "");
    const double wide = sdm_canvas_text_width(c, title.size, title.bold, first),
                 room = l->column + GAP;
    if (wide > room) title.size *= room / wide; // a narrow column
    sdm_canvas_text(c, x + l->column / 2.0, TOP - SDM_SECTION_ABOVE - 16, title, first);
    const sdm_box under = {x, l->top - SDM_SECTION_ABOVE, l->column, 0};
    if (note) sdm_panel_title(c, under, false, note);
    for (int axis = 0; axis < 3; axis++) draw_panel(c, l, column, axis);
    const sdm_box bar = {x + l->column / 10, l->foot, l->column - 2 * (l->column / 10), BAR};
    const char *caption = !e               ? "signed distance (mm)"
                          : l->unit[1] > 1 ? "error (\xC2\xB5m)"
                                           : "error (mm)";
    sdm_colour_bar(c, bar, map_of(l, map->error), l->low[e] * l->unit[e], l->high[e] * l->unit[e],
                   caption);
    draw_legend(c, l, column, x + l->column / 2.0, l->foot + 72);
}

static sdm_status check_arguments(const char *path, const sdm_grid *grid,
                                  const sdm_picture_map *maps, size_t n_maps, const float *levels,
                                  size_t n_levels, sdm_error *err)
{
    if (!path || !grid || !maps || (n_levels && !levels))
        return sdm_fail(err, SDM_E_ARG, "sdm_picture_slices: NULL argument");
    if (n_maps < 1 || n_maps > MAPS_MAX)
        return sdm_fail(err, SDM_E_ARG, "%zu maps in a picture, need 1 to %d", n_maps, MAPS_MAX);
    if (n_levels > LEVELS_MAX)
        return sdm_fail(err, SDM_E_ARG, "%zu levels in a picture, need 0 to %d", n_levels,
                        LEVELS_MAX);
    for (size_t i = 0; i < n_maps; i++)
        if (!maps[i].values)
            return sdm_fail(err, SDM_E_ARG, "map %zu of the picture has no values", i);
    return sdm_grid_check(grid, err);
}

sdm_status sdm_picture_slices(const char *path, const sdm_grid *grid, const sdm_picture_map *maps,
                              size_t n_maps, const float *levels, size_t n_levels, sdm_error *err)
{
    sdm_status s = check_arguments(path, grid, maps, n_maps, levels, n_levels, err);
    if (s) return s;
    layout l = {.g = grid, .maps = maps, .n_maps = n_maps, .levels = levels, .n_levels = n_levels};
    int w, h;
    layout_range(&l, false);
    layout_range(&l, true);
    s = layout_place(&l, &w, &h, err);
    if (s) return s;
    sdm_canvas *c = NULL;
    s = sdm_canvas_create(path, w, h, &c, err);
    if (s || !c) return s;
    for (size_t m = 0; m < n_maps; m++) draw_column(c, &l, m);
    sdm_sections_draw_hidden(c, &l.sections, LEFT + l.column / 2.0, l.foot + FOOT + 12, true);
    return sdm_canvas_finish(c, err);
}
