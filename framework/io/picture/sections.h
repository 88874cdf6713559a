/* Three orthogonal sections of a grid on a canvas: their positions, their sizes and their axes in
 * mm. */
#pragma once

#include "inside_pieces.h"
#include "panel.h"
#include "sdm/grid.h"

typedef struct sdm_sections {
    const sdm_grid *grid;
    /* section a is normal to axis a of the grid and shows the voxels of index at[a] along it */
    int64_t at[3];
    /* the world axis (0 x, 1 y, 2 z) that is nearest to each grid axis, and the angle between the
       two, 0 .. 90 degrees; below ALIGNED they count as parallel */
    int world[3];
    double degrees[3];
    /* pieces of the shape that no section cuts: their number, and the largest one */
    size_t n_hidden;
    sdm_piece hidden;
    double pixels; /* pixels per mm */
    /* width and height of each section in pixels */
    int w[3], h[3];
    /* width, in pixels, of a column that holds any of the sections */
    int widest;
} sdm_sections;

/* Places the sections where they show most of the negative values of map[nz][ny][nx]
 * (sdm_sections_choose()) and sets their sizes. `grid` must outlive *s. SDM_E_NOMEM. */
sdm_status sdm_sections_place(sdm_sections *s, const sdm_grid *grid, const float *map,
                              sdm_error *err);

#define SDM_SECTIONS_HIDDEN 40 /* room for the two lines of sdm_sections_draw_hidden(), pixels */
/* Writes, centred at x or (centred = false) from x to the right, how many pieces of the shape are
 * in no section, and where the largest one is; nothing if all are shown. */
void sdm_sections_draw_hidden(sdm_canvas *c, const sdm_sections *s, double x, double y,
                              bool centred);

/* The section normal to `axis` of values[nz][ny][nx] on the same grid. */
sdm_slice sdm_section_of(const sdm_sections *s, const float *values, int axis);

/* Draws the frame of a section, its position above it, and numbers in mm along its lower side and,
 * if `left`, along its left side. */
void sdm_section_draw_frame(sdm_canvas *c, const sdm_sections *s, sdm_box box, int axis, bool left);

#define SDM_SECTION_LEFT 66 /* room for numbers and axis names left of a section, pixels */
#define SDM_SECTION_BELOW                                                                          \
    60 /* room for them below a section and for the position of the next one */
#define SDM_SECTION_ABOVE 16 /* room for the position above the first section, pixels */
