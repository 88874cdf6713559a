/* Maps on disk and on paper: images, .npy arrays, zero surfaces, PNG pictures. */
#ifndef SDM_IMAGE_H
#define SDM_IMAGE_H

#include "sdm/grid.h"
#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes float32 values[nz][ny][nx] atomically; the type follows the name: .nii .nii.gz (RAS, converted), .nrrd (gzip), .mha
   (LPS), .npy ([nz][ny][nx], no grid). `text` (may be NULL) is a one-line description kept where the format has a place.
   SDM_E_UNSUPPORTED for another name, listing those known. */
SDM_API sdm_status sdm_image_write(const char *path, const sdm_grid *grid, const float *values, const char *text,
                                   sdm_error *err);

/* Reads a .npy file (float32/float64, C order, 1 to 4 dimensions) into new memory (sdm_free()). */
SDM_API sdm_status sdm_npy_read(const char *path, double **values, size_t shape[4], int *n_dim, sdm_error *err);
/* Write an array of 1 to 4 dimensions atomically, little endian, C order. */
SDM_API sdm_status sdm_npy_write(const char *path, const float *values, const size_t *shape, int n_dim, sdm_error *err);
SDM_API sdm_status sdm_npy_write_uint32(const char *path, const uint32_t *values, const size_t *shape, int n_dim,
                                        sdm_error *err);

/* The iso-surface at `level` by marching cubes (Lorensen and Cline 1987), closed wherever it does not leave the grid, normals towards
   larger values, vertices shared. *cut (may be NULL): true when the surface leaves the grid. *out is zero-initialised; it has no
   triangle when nothing crosses the level. World coordinates, mm. The same bits in every call. */
SDM_API sdm_status sdm_isosurface(const sdm_grid *grid, const float *values, float level, sdm_mesh *out, bool *cut,
                                  sdm_error *err);

/* One column of a picture of maps: a title and the values; `error` columns are drawn with a scale of their own. */
typedef struct sdm_picture_map {
    const char *title;
    const float *values;
    bool error;
} sdm_picture_map;

/* PNG: a row for each of the three orthogonal slices through the middle of the region where the first map is negative, a column for
   each map, with iso-contours at `levels[n_levels]` (the first in red, the second in yellow), titles, millimetre scale and colour
   bars with numbers. Atomic. */
SDM_API sdm_status sdm_picture_slices(const char *path, const sdm_grid *grid, const sdm_picture_map *maps,
                                      size_t n_maps, const float *levels, size_t n_levels, sdm_error *err);

/* PNG: the three orthogonal slices of image[nz][ny][nx], side by side, through the middle of the region where the first map is
   negative: grey, from the 1st to the 99th percentile of the slices, with the zero contours of maps[n_maps] over it (1 to 4, the
   first in red, the second in yellow; `error` is not read), their titles, millimetre scales and `title` (may be NULL). Atomic.
   SDM_E_ARG. [any thread] */
SDM_API sdm_status sdm_picture_overlay(const char *path, const sdm_grid *grid, const float *image,
                                       const sdm_picture_map *maps, size_t n_maps, const char *title, sdm_error *err);

/* One surface of a picture. */
typedef struct sdm_picture_surface {
    const char *title;
    const sdm_mesh *mesh;
    const double *values; /* [n_vert] mm, shown in colours from -max to max of all surfaces; NULL: one plain colour */
} sdm_picture_surface;

/* PNG: the surfaces side by side, each from +z and obliquely, shaded, to one scale, with a colour bar of `caption` under those that have
   values. The audit's errors; SDM_E_ARG for other than 1 to 8 surfaces. Atomic. */
SDM_API sdm_status sdm_picture_surfaces(const char *path, const sdm_picture_surface *surfaces, size_t n,
                                        const char *caption, sdm_error *err);

/* One curve of a plot. */
typedef struct sdm_curve {
    const char *title;
    const double *x, *y;
    size_t n;
} sdm_curve;

/* PNG line plot with axes, tick labels and a legend; log_y draws a logarithmic axis (values <= 0 are left out). Atomic. */
SDM_API sdm_status sdm_picture_plot(const char *path, const char *title, const char *x_label, const char *y_label,
                                    bool log_y, const sdm_curve *curves, size_t n_curves, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
