/* One slice of a map on a canvas: colours, contours, scale bar; and colour bars. */
#ifndef SDM_IO_PANEL_H
#define SDM_IO_PANEL_H

#include "canvas.h"

/* n[0] values to the right, n[1] upwards. */
typedef struct sdm_slice {
    const float *v;
    int64_t n[2];
    size_t stride[2];
} sdm_slice;

/* Where on the canvas, in whole pixels. */
typedef struct sdm_box {
    int x, y, w, h;
} sdm_box;

/* Fills the box with the bilinear interpolant; the box covers whole voxels. */
void sdm_panel_colours(sdm_canvas *c, sdm_box box, const sdm_slice *s, sdm_colour_map map,
                       double low, double high);

/* The line where the slice crosses `level`, by marching squares; colour over a wider line of `rim`.
 */
void sdm_panel_contour(sdm_canvas *c, sdm_box box, const sdm_slice *s, double level, double width,
                       sdm_colour colour, sdm_colour rim);

/* A bar of a round number of mm in the lower left corner. */
void sdm_panel_scale_bar(sdm_canvas *c, sdm_box box, double pixels_per_mm);

/* A horizontal colour bar with numbers and a caption below; `box` is the bar itself. */
void sdm_colour_bar(sdm_canvas *c, sdm_box box, sdm_colour_map map, double low, double high,
                    const char *caption);

#define SDM_INK ((sdm_colour){38, 40, 46})
#define SDM_INK_LIGHT ((sdm_colour){120, 124, 132})

#endif
