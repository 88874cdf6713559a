/* A fit as a page shows it: the result (JSON of `sdmgen fit`), and the image and the standard
 * deviation of the surface in the frame of the shape, so that they stand still while the reader
 * moves the parameters. */
#pragma once

#include "sdm/internal/config.h"
#include "sdm/internal/json_read.h"
#include "sdm/pose.h"
#include "sdm/runtime.h"

/* Zero-initialise; cli_page_fit_dispose() frees, also after an error. */
typedef struct cli_page_fit {
    const char *name; /* of the file, for messages */
    char *text;       /* the JSON */
    sdm_json_document json;
    char model_path[SDM_PATH_TEXT_MAX], image_path[SDM_PATH_TEXT_MAX]; /* "": not found */

    /* cli_page_fit_sample() */
    double *params; /* [n_params] the fitted parameters, in the order of the model */
    sdm_pose pose;
    float *map; /* [grid of the model] the fitted shape, mm */
    float *sd; /* [grid of the model] its standard deviation, mm; NULL: the covariance is unknown */
    sdm_grid image_grid; /* in the frame of the shape */
    uint8_t *image;      /* [image_grid] 0: `low` and below, 255: `high` and above; NULL: none */
    double low, high;
    /* For the page, little-endian: map (int16, in steps of map_step mm), sd (uint8, in steps of
     * sd_step mm; sd_step 0: none), image. */
    uint8_t *bytes;
    size_t size;
    double map_step, sd_step;
} cli_page_fit;

/* Takes the JSON of a fit, text[size] with a zero byte behind it, and finds the files that it
 * names: from the working folder or beside `name`. Only a file with the checksum that the result
 * states for it is taken, unless `changed`: a result of a stranger thereby opens no file whose
 * content the stranger does not know. Without its image the page has none, and a notice says so.
 * SDM_E_FORMAT: it is no result of a fit, or the model has another checksum; SDM_E_UNSUPPORTED: a
 * fit without a model; SDM_E_IO: the model is gone. */
sdm_status cli_page_fit_take(const char *name, char *text, size_t size, bool changed,
                             cli_page_fit *f, sdm_error *err);

/* Computes the maps at the estimate, samples the image if it is there, and packs them. shape: of
 * the model; NULL: not known, then the estimate must lie in the trained range. */
sdm_status cli_page_fit_sample(const sdm_model *model, const sdm_instance *shape, cli_page_fit *fit,
                               sdm_error *err);

void cli_page_fit_dispose(cli_page_fit *fit);
