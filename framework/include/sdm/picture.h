/* Pictures of maps, surfaces and curves, as PNG, SVG or PDF.
 *
 * The format follows the ending of `path`: .png, .svg or .pdf; others give SDM_E_UNSUPPORTED.
 * The file is written under a temporary name and then renamed, so that no broken picture appears.
 * Errors of all functions: SDM_E_ARG (a NULL argument, or too many items), SDM_E_IO,
 * SDM_E_NOMEM, and SDM_E_UNSUPPORTED for all pictures in a build with SDM_PICTURE=OFF. Drawing the
 * same picture again gives the same bytes, with the same fonts and version of cairo (SVG: as long
 * as no other thread uses cairo). [any thread] */
#ifndef SDM_PICTURE_H
#define SDM_PICTURE_H

#include "sdm/grid.h"
#include "sdm/mesh.h"
#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Checks the ending of `path`: SDM_OK when this build can write such a picture, else
   SDM_E_UNSUPPORTED. */
SDM_API sdm_status sdm_picture_check(const char *path, sdm_error *err);

/* One column of a picture of maps. */
typedef struct sdm_picture_map {
    const char *title; /* may be NULL; what follows a line break is written small below it */
    /* [nz][ny][nx], mm */
    const float *values;
    /* true: an error map, which has another colour scale than the distances */
    bool error;
    /* [n_points][3] places in the world, mm: a dot on every slice that is at most a voxel away;
       sdm_picture_slices() alone. 0: none */
    const double *points;
    size_t n_points;
} sdm_picture_map;

/* Draws slices of maps[n_maps], 1 to 16 on the same grid: a row for each of three orthogonal
   slices, a column for each map, with contours at levels[n_levels] mm (0 to 16; the first in red,
   the second in yellow), titles, axes in mm and colour bars. A slice lies in the middle of the
   region where the first map is negative, unless another place shows parts or holes of it that the
   other two slices miss; a note says how many of its pieces no slice cuts. From the second map of
   distances on, the red contour is dashed and that of the first map lies below it; an error map
   has the contours of the first map, in white. */
SDM_API sdm_status sdm_picture_slices(const char *path, const sdm_grid *grid,
                                      const sdm_picture_map *maps, size_t n_maps,
                                      const float *levels, size_t n_levels, sdm_error *err);

/* Draws three orthogonal slices of image[nz][ny][nx], side by side, placed by the first map as in
   sdm_picture_slices(). The image is grey, from the 1st to the 99th percentile of the slices. Over
   it lie the zero contours of maps[n_maps] (1 to 4, the first in red, the second in yellow; `error`
   is not used): the last of several is whole, the others are dashed, so that what lies below them
   remains visible. A legend lists the titles of the maps; the picture has axes in
   mm and a `title` (may be NULL). */
SDM_API sdm_status sdm_picture_overlay(const char *path, const sdm_grid *grid, const float *image,
                                       const sdm_picture_map *maps, size_t n_maps,
                                       const char *title, sdm_error *err);

/* One surface of a picture. */
typedef struct sdm_picture_surface {
    const char *title; /* may be NULL */
    const sdm_mesh *mesh;
    /* [n_vert] mm, shown in colours that span -max .. max, where max is the largest absolute value
       of all surfaces; NULL: one plain colour */
    const double *values;
} sdm_picture_surface;

/* Draws surfaces[n], 1 to 8, side by side, shaded and at one scale: each is seen from +z and
   obliquely. Under surfaces with values there is a colour bar with `caption`. Also returns the
   errors of sdm_mesh_audit(). */
SDM_API sdm_status sdm_picture_surfaces(const char *path, const sdm_picture_surface *surfaces,
                                        size_t n, const char *caption, sdm_error *err);

/* Draws surfaces[n], 1 to 16, seen obliquely, in rows of equal length. The inner sides of surfaces
   are red: those of parts that are inside out, and those seen through a hole. Scale, values,
   caption and errors are those of sdm_picture_surfaces(). */
SDM_API sdm_status sdm_picture_gallery(const char *path, const sdm_picture_surface *surfaces,
                                       size_t n, const char *caption, sdm_error *err);

/* One curve of a plot: the points (x[i], y[i]), i < n, joined by lines; markers show up to about 60
   single points. A point that is not finite
   (or, on a logarithmic axis, not positive) is left out and leaves a gap. */
typedef struct sdm_curve {
    const char *title; /* for the legend; NULL or "": not listed */
    const double *x, *y;
    size_t n;
} sdm_curve;

/* Draws curves[n_curves], 1 to 16, with axes, tick labels and a legend; log_y: the y axis is
   logarithmic. title, x_label and y_label may be NULL. */
SDM_API sdm_status sdm_picture_plot(const char *path, const char *title, const char *x_label,
                                    const char *y_label, bool log_y, const sdm_curve *curves,
                                    size_t n_curves, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
