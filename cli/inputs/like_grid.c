/* Reads the grid of the file that --like names, a model or an image. */
#include <math.h>

#include "report/files.h"
#include "report/terminal.h"
#include "sdm/volume.h"
#include "setup.h"

static sdm_status check_options(const cli_args *args, sdm_error *err)
{
    const char *other = args->size[0] > 0                ? "size"
                        : args->spacing[0] > 0           ? "spacing"
                        : !isnan(args->origin[0])        ? "origin"
                        : !isnan(args->direction[0])     ? "direction"
                        : !isnan(args->phantom.frame[0]) ? "frame"
                        : !isnan(args->phantom.crop[0])  ? "crop"
                                                         : NULL;
    if (!other) return SDM_OK;
    return sdm_fail(err, SDM_E_ARG,
                    "--like and --%s exclude each other: --like FILE gives the whole grid", other);
}

static sdm_status read_model(const cli_args *args, sdm_grid *out, sdm_error *err)
{
    sdm_model *model = NULL;
    // --expect states the hash of the model that makes maps; this one only lends its grid
    cli_args other = *args;
    other.expect = NULL;
    const sdm_status s = cli_open_model(&other, args->like, &model, err);
    if (!s) *out = sdm_model_get_info(model)->grid;
    sdm_model_free(model);
    return s;
}

static sdm_status read_image(const char *path, sdm_grid *out, sdm_error *err)
{
    sdm_volume image = {0};
    const sdm_status s = sdm_volume_read(path, &image, err);
    if (s) return s;
    *out = image.grid;
    if (!image.placed)
        cli_notice("%s states no frame: the default axes of its format are assumed", path);
    sdm_volume_dispose(&image);
    return SDM_OK;
}

sdm_status cli_like_grid(const cli_args *args, sdm_grid *out, sdm_error *err)
{
    const sdm_status s = check_options(args, err);
    if (s) return s;
    if (cli_ends_with(args->like, ".sdm")) return read_model(args, out, err);
    if (sdm_volume_knows(args->like)) return read_image(args->like, out, err);
    return sdm_fail(err, SDM_E_ARG,
                    "--like '%s': its name must end in .sdm (the grid of a model) or in " //
                    ".nii .nii.gz .nrrd .nhdr .mha .mhd (that of an image)",
                    args->like);
}
