/* Three orthogonal sections of a grid on a canvas: where they lie, how large they are, their axes
 * in mm. */
#ifndef SDM_IO_SECTIONS_H
#define SDM_IO_SECTIONS_H

#include "panel.h"
#include "sdm/grid.h"

typedef struct sdm_sections {
    const sdm_grid *grid;
    int64_t at[3]; /* index of the section normal to each axis */
    int world[3];  /* axis of the world an axis of the grid runs along, or -1 */
    double pixels; /* per mm */
    int w[3], h[3];
    int widest;
} sdm_sections;

/* Sections through the middle of the box around the negative values of map[nz][ny][nx]; of the grid
 * when there are none. */
void sdm_sections_place(sdm_sections *s, const sdm_grid *grid, const float *map);

/* The section of any map of the grid. */
sdm_slice sdm_section_of(const sdm_sections *s, const float *values, int axis);

/* What surrounds a section: frame, where it lies, numbers along its lower and, if wanted, its left
 * side. */
void sdm_section_draw_frame(sdm_canvas *c, const sdm_sections *s, sdm_box box, int axis, bool left);

#define SDM_SECTION_LEFT 66  /* room for numbers and axis names */
#define SDM_SECTION_BELOW 54 /* the same under a section */

#endif
