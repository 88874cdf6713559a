/* Pictures of an image with contours over it: three orthogonal slices side by side. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "sdm/memory.h"
#include "sdm/picture.h"
#include "sections.h"

/* Limits, and lengths in pixels. */
enum {
    MAPS_MAX = 4,
    TOP = 46 + SDM_SECTION_ABOVE,
    FOOT = 100, /* grey bar with numbers and caption, then the legend of the contours */
    BAR = 14,
    RIGHT = 22,
    SAMPLE = 48 /* length of a line in the legend */
};

static const sdm_colour LINES[MAPS_MAX] = {
    {232, 40, 44}, {255, 214, 10}, {30, 190, 130}, {190, 110, 230}};
static const sdm_colour RIM = {20, 20, 26};

/* The line of map m of n: the last of several lies below and is whole; the others are dashed and
   leave in sight what lies below them, a line or the edge in the image. */
static sdm_contour_line line_of(size_t m, size_t n)
{
    return (sdm_contour_line){.width = 1.6,
                              .colour = LINES[m],
                              .rim = RIM,
                              .turn = (int)m,
                              .turns = n == 1      ? 2
                                       : m + 1 < n ? (int)n
                                                   : 0};
}

/* The data and where everything lies on the canvas. */
typedef struct overlay {
    const float *image;
    const sdm_picture_map *maps;
    size_t n_maps;
    sdm_sections sections;
    double low, high; /* the values shown as black and as white */
} overlay;

static int ascending(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* Finds the values shown as black and as white: the 1st and the 99th percentile of the three
   slices, so that a few bright voxels do not darken the others. */
static sdm_status find_grey_range(overlay *o, sdm_error *err)
{
    size_t n = 0, used = 0;
    sdm_slice slice[3];
    for (int axis = 0; axis < 3; axis++) {
        slice[axis] = sdm_section_of(&o->sections, o->image, axis);
        n += (size_t)slice[axis].n[0] * (size_t)slice[axis].n[1];
    }
    float *values = NULL;
    const sdm_status s = SDM_ALLOC(&values, n, "values of a picture", err);
    if (s) return s;
    for (int axis = 0; axis < 3; axis++)
        for (int64_t j = 0; j < slice[axis].n[1]; j++)
            for (int64_t i = 0; i < slice[axis].n[0]; i++) {
                const float v =
                    slice[axis]
                        .v[(size_t)i * slice[axis].stride[0] + (size_t)j * slice[axis].stride[1]];
                if (isfinite(v)) values[used++] = v;
            }
    qsort(values, used, sizeof *values, ascending);
    o->low = used ? (double)values[(used - 1) / 100] : 0;
    o->high = used ? (double)values[used - 1 - (used - 1) / 100] : 0;
    if (!(o->high > o->low)) o->high = o->low + 1;
    sdm_free(values);
    return SDM_OK;
}

/* Draws one slice with its contours. */
static void draw_panel(sdm_canvas *c, const overlay *o, sdm_box box, int axis)
{
    const sdm_slice grey = sdm_section_of(&o->sections, o->image, axis);
    sdm_panel_colours(c, box, &grey, SDM_MAP_GREY, o->low, o->high);
    for (size_t m = o->n_maps; m-- > 0;) {
        const sdm_slice s = sdm_section_of(&o->sections, o->maps[m].values, axis);
        const sdm_contour_line line = line_of(m, o->n_maps);
        sdm_panel_contour(c, box, &s, 0, &line);
    }
    sdm_section_draw_frame(c, &o->sections, box, axis, true);
}

/* The legend: a sample of each contour's line with its title. */
static void draw_legend(sdm_canvas *c, const overlay *o, double x, double y)
{
    const sdm_type type = {.size = 10, .colour = SDM_INK};
    for (size_t m = 0; m < o->n_maps; m++) {
        const char *title = o->maps[m].title ? o->maps[m].title : "";
        const sdm_contour_line line = line_of(m, o->n_maps);
        sdm_contour_sample(c, x, y - 4.5, SAMPLE, &line);
        sdm_canvas_text(c, x + SAMPLE + 8, y, type, title);
        x += SAMPLE + 8 + sdm_canvas_text_width(c, 10, false, title) + 30;
    }
}

static void draw_overlay(sdm_canvas *c, const overlay *o, int height, const char *title)
{
    const sdm_sections *s = &o->sections;
    int x = SDM_SECTION_LEFT;
    if (title)
        sdm_canvas_text(c, x, TOP - SDM_SECTION_ABOVE - 16,
                        (sdm_type){.size = 13, .bold = true, .colour = SDM_INK}, title);
    for (int axis = 0; axis < 3; axis++) {
        draw_panel(c, o, (sdm_box){x, TOP, s->w[axis], s->h[axis]}, axis);
        x += s->w[axis] + SDM_SECTION_LEFT;
    }
    const int foot = height - FOOT - (s->n_hidden ? SDM_SECTIONS_HIDDEN : 0);
    sdm_colour_bar(c, (sdm_box){SDM_SECTION_LEFT, foot, 260, BAR}, SDM_MAP_GREY, o->low, o->high,
                   "value of the image");
    draw_legend(c, o, SDM_SECTION_LEFT, foot + FOOT - 16);
    sdm_sections_draw_hidden(c, s, SDM_SECTION_LEFT, foot + FOOT + 6, false);
}

static sdm_status check_arguments(const char *path, const sdm_grid *grid, const float *image,
                                  const sdm_picture_map *maps, size_t n_maps, sdm_error *err)
{
    if (!path || !grid || !image || (n_maps && !maps))
        return sdm_fail(err, SDM_E_ARG, "sdm_picture_overlay: NULL argument");
    if (n_maps < 1 || n_maps > MAPS_MAX)
        return sdm_fail(err, SDM_E_ARG, "%zu maps over an image, need 1 to %d", n_maps, MAPS_MAX);
    for (size_t m = 0; m < n_maps; m++)
        if (!maps[m].values)
            return sdm_fail(err, SDM_E_ARG, "map %zu over the image has no values", m);
    return sdm_grid_check(grid, err);
}

sdm_status sdm_picture_overlay(const char *path, const sdm_grid *grid, const float *image,
                               const sdm_picture_map *maps, size_t n_maps, const char *title,
                               sdm_error *err)
{
    sdm_status s = check_arguments(path, grid, image, maps, n_maps, err);
    if (s) return s;
    overlay o = {.image = image, .maps = maps, .n_maps = n_maps};
    s = sdm_sections_place(&o.sections, grid, maps[0].values, err);
    if (s) return s;
    s = find_grey_range(&o, err);
    if (s) return s;
    int w = SDM_SECTION_LEFT, tall = 0;
    for (int axis = 0; axis < 3; axis++) {
        w += o.sections.w[axis] + (axis < 2 ? SDM_SECTION_LEFT : RIGHT);
        if (o.sections.h[axis] > tall) tall = o.sections.h[axis];
    }
    sdm_canvas *c = NULL;
    const int height =
        TOP + tall + SDM_SECTION_BELOW + FOOT + (o.sections.n_hidden ? SDM_SECTIONS_HIDDEN : 0);
    s = sdm_canvas_create(path, w < 480 ? 480 : w, height, &c, err);
    if (s || !c) return s;
    draw_overlay(c, &o, height, title);
    return sdm_canvas_finish(c, err);
}
