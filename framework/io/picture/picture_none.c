/* Stands in for the drawing functions in a build without cairo (SDM_PICTURE=OFF): each of them
 * refuses. */
#include "sdm/internal/picture_child.h"
#include "sdm/picture.h"

sdm_status sdm_picture_check(const char *path, sdm_error *err)
{
    if (!path) return sdm_fail(err, SDM_E_ARG, "a picture without a file name");
    return sdm_fail(err, SDM_E_UNSUPPORTED,
                    "%s: built without pictures (configure with -DSDM_PICTURE=ON, needs cairo)",
                    path);
}

sdm_status sdm_picture_slices(const char *path, const sdm_grid *grid, const sdm_picture_map *maps,
                              size_t n_maps, const float *levels, size_t n_levels, sdm_error *err)
{
    (void)grid, (void)maps, (void)n_maps, (void)levels, (void)n_levels;
    return sdm_picture_check(path, err);
}

sdm_status sdm_picture_overlay(const char *path, const sdm_grid *grid, const float *image,
                               const sdm_picture_map *maps, size_t n_maps, const char *title,
                               sdm_error *err)
{
    (void)grid, (void)image, (void)maps, (void)n_maps, (void)title;
    return sdm_picture_check(path, err);
}

sdm_status sdm_picture_surfaces(const char *path, const sdm_picture_surface *surfaces, size_t n,
                                const char *caption, sdm_error *err)
{
    (void)surfaces, (void)n, (void)caption;
    return sdm_picture_check(path, err);
}

sdm_status sdm_picture_gallery(const char *path, const sdm_picture_surface *surfaces, size_t n,
                               const char *caption, sdm_error *err)
{
    (void)surfaces, (void)n, (void)caption;
    return sdm_picture_check(path, err);
}

sdm_status sdm_picture_plot(const char *path, const char *title, const char *x_label,
                            const char *y_label, bool log_y, const sdm_curve *curves,
                            size_t n_curves, sdm_error *err)
{
    (void)title, (void)x_label, (void)y_label, (void)log_y, (void)curves, (void)n_curves;
    return sdm_picture_check(path, err);
}

void sdm_picture_in_child(bool wanted) { (void)wanted; }
