/* Writes image files; the ending of the name selects the format. */
#include "image_writers.h"
#include "sdm/image.h"

static sdm_status write_file(const char *path, const sdm_image *m, sdm_error *err)
{
    sdm_outfile *f = NULL;
    sdm_status s = sdm_outfile_open(path, &f, err);
    if (s) return s;
    if (sdm_has_ext(path, ".nrrd"))
        s = sdm_nrrd_write(f, m, err);
    else if (sdm_has_ext(path, ".mha"))
        s = sdm_metaimage_write(f, m, err);
    else
        s = sdm_nifti_write(f, sdm_has_ext(path, ".gz"), m, err);
    if (!s) return sdm_outfile_commit(&f, err);
    sdm_outfile_discard(&f);
    return s;
}

sdm_status sdm_volume_write(const char *path, const sdm_grid *grid, const void *values,
                            sdm_voxel_type type, const char *text, sdm_error *err)
{
    static const char *const known[] = {".nii", ".nii.gz", ".nrrd", ".mha"};
    if (!path || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "sdm_volume_write: NULL argument");
    if (!sdm_voxel_size(type))
        return sdm_fail(err, SDM_E_ARG, "%s: %d is no voxel type", path, (int)type);
    const sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    const sdm_image m = {.grid = grid, .values = values, .type = type, .text = text ? text : ""};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (sdm_has_ext(path, known[i])) return write_file(path, &m, err);
    return sdm_fail(
        err, SDM_E_UNSUPPORTED,
        "%s: unknown type of image file, known are .nii .nii.gz .nrrd .mha and, for maps, .npy",
        path);
}

sdm_status sdm_image_write(const char *path, const sdm_grid *grid, const float *values,
                           const char *text, sdm_error *err)
{
    if (!path || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "sdm_image_write: NULL argument");
    if (!sdm_has_ext(path, ".npy"))
        return sdm_volume_write(path, grid, values, SDM_VOXEL_FLOAT32, text, err);
    const sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    const size_t shape[3] = {(size_t)grid->n[2], (size_t)grid->n[1], (size_t)grid->n[0]};
    return sdm_npy_write(path, values, shape, 3, err);
}
