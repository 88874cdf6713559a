/* Writing of maps as image files: the type follows the name. */
#include "imageparts.h"

static sdm_status write_file(const char *path, const sdm_grid *g, const float *values, const char *text, sdm_error *err)
{
    sdm_outfile *f = NULL;
    sdm_status e = sdm_outfile_open(path, &f, err);
    if (e) return e;
    if (sdm_has_ext(path, ".nrrd"))
        e = sdm_nrrd_write(f, g, values, text, err);
    else if (sdm_has_ext(path, ".mha"))
        e = sdm_metaimage_write(f, g, values, text, err);
    else
        e = sdm_nifti_write(f, sdm_has_ext(path, ".gz"), g, values, text, err);
    if (!e) return sdm_outfile_commit(&f, err);
    sdm_outfile_discard(&f);
    return e;
}

sdm_status sdm_image_write(const char *path, const sdm_grid *grid, const float *values, const char *text,
                           sdm_error *err)
{
    static const char *const known[] = {".nii", ".nii.gz", ".nrrd", ".mha"};
    if (!path || !grid || !values) return sdm_fail(err, SDM_E_ARG, "sdm_image_write: NULL argument");
    const sdm_status e = sdm_grid_check(grid, err);
    if (e) return e;
    if (sdm_has_ext(path, ".npy")) {
        const size_t shape[3] = {(size_t)grid->n[2], (size_t)grid->n[1], (size_t)grid->n[0]};
        return sdm_npy_write(path, values, shape, 3, err);
    }
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (sdm_has_ext(path, known[i])) return write_file(path, grid, values, text ? text : "", err);
    return sdm_fail(err, SDM_E_UNSUPPORTED, "%s: unknown type of image file, known are .nii .nii.gz .nrrd .mha .npy",
                    path);
}
