/* Pictures of maps, surfaces and curves. */
#ifndef SDM_PICTURE_H
#define SDM_PICTURE_H

#include "sdm/grid.h"
#include "sdm/mesh.h"
#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* One column of a picture of maps: a title and the values; `error` columns are drawn with a scale
 * of their own. */
typedef struct sdm_picture_map {
    const char *title;
    const float *values;
    bool error;
} sdm_picture_map;

/* PNG: a row for each of the three orthogonal slices through the middle of the region where the
   first map is negative, a column for each map, with iso-contours at `levels[n_levels]` (the first
   in red, the second in yellow), titles, millimetre scale and colour bars with numbers. Atomic. */
SDM_API sdm_status sdm_picture_slices(const char *path, const sdm_grid *grid,
                                      const sdm_picture_map *maps, size_t n_maps,
                                      const float *levels, size_t n_levels, sdm_error *err);

/* PNG: the three orthogonal slices of image[nz][ny][nx], side by side, through the middle of the
   region where the first map is negative: grey, from the 1st to the 99th percentile of the slices,
   with the zero contours of maps[n_maps] over it (1 to 4, the first in red, the second in yellow;
   `error` is not read), their titles, millimetre scales and `title` (may be NULL). Atomic.
   SDM_E_ARG. [any thread] */
SDM_API sdm_status sdm_picture_overlay(const char *path, const sdm_grid *grid, const float *image,
                                       const sdm_picture_map *maps, size_t n_maps,
                                       const char *title, sdm_error *err);

/* One surface of a picture. */
typedef struct sdm_picture_surface {
    const char *title;
    const sdm_mesh *mesh;
    const double *values; /* [n_vert] mm, shown in colours from -max to max of all surfaces; NULL:
                             one plain colour */
} sdm_picture_surface;

/* PNG: the surfaces side by side, each from +z and obliquely, shaded, to one scale, with a colour
   bar of `caption` under those that have values. The audit's errors; SDM_E_ARG for other than 1 to
   8 surfaces. Atomic. */
SDM_API sdm_status sdm_picture_surfaces(const char *path, const sdm_picture_surface *surfaces,
                                        size_t n, const char *caption, sdm_error *err);

/* One curve of a plot. */
typedef struct sdm_curve {
    const char *title;
    const double *x, *y;
    size_t n;
} sdm_curve;

/* PNG line plot with axes, tick labels and a legend; log_y draws a logarithmic axis (values <= 0
 * are left out). Atomic. */
SDM_API sdm_status sdm_picture_plot(const char *path, const char *title, const char *x_label,
                                    const char *y_label, bool log_y, const sdm_curve *curves,
                                    size_t n_curves, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
