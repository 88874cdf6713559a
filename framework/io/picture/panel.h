/* One slice of a map on a canvas: colours, contours, scale bar; and colour bars. */
#pragma once

#include "canvas.h"

/* A slice of a map: value (i, j) is v[i * stride[0] + j * stride[1]], 0 <= i < n[0] to the right,
 * 0 <= j < n[1] upwards. */
typedef struct sdm_slice {
    const float *v;
    int64_t n[2];
    size_t stride[2];
} sdm_slice;

/* Fills the box, which covers whole voxels, with the colours of the values, interpolated
   bilinearly. */
void sdm_panel_colours(sdm_canvas *c, sdm_box box, const sdm_slice *s, sdm_colour_map map,
                       double low, double high);

/* How a contour is drawn: `width` pixels of `colour` over a wider, translucent line of `rim`. */
typedef struct sdm_contour_line {
    double width;
    sdm_colour colour, rim;
    /* 2 or more: dashed, such that `turns` lines in one place, with turn = 0 .. turns - 1, show one
       after the other; 0: not dashed */
    int turn, turns;
} sdm_contour_line;

/* Draws the line where the slice crosses `level`, by marching squares. Cells with a value that is
   not finite are left out. */
void sdm_panel_contour(sdm_canvas *c, sdm_box box, const sdm_slice *s, double level,
                       const sdm_contour_line *line);

/* Is the title, as one large line, at most as wide as the box? */
bool sdm_panel_title_fits(sdm_canvas *c, sdm_box box, const char *title);

/* Writes the title above the box: one bold line if `large`, else at most two lines of smaller type,
   broken between words; what does not fit becomes "...". It needs 36 pixels above the box. */
void sdm_panel_title(sdm_canvas *c, sdm_box box, bool large, const char *title);

/* Draws a bar that is a round number of mm long in the lower left corner; none if the box is too
   narrow. */
void sdm_panel_scale_bar(sdm_canvas *c, sdm_box box, double pixels_per_mm);

/* Draws a horizontal colour bar, with numbers and a caption below it; `box` is the bar alone. */
void sdm_colour_bar(sdm_canvas *c, sdm_box box, sdm_colour_map map, double low, double high,
                    const char *caption);

/* Draws a sample of a contour's line for a legend, from (x, y) to the right. */
void sdm_contour_sample(sdm_canvas *c, double x, double y, double length,
                        const sdm_contour_line *line);

#define SDM_INK ((sdm_colour){38, 40, 46})
#define SDM_INK_LIGHT ((sdm_colour){120, 124, 132})
#define SDM_WHITE ((sdm_colour){255, 255, 255})
