/* What the parts of `sdmgen fit` share. */
#ifndef CLI_FIT_H
#define CLI_FIT_H

#include "args/options.h"
#include "sdm/fit.h"
#include "sdm/volume.h"

/* Fitted shape against labels. Of the surfaces the vertices within the field of view count. */
typedef struct cli_overlap {
    bool measured;
    size_t n_fit, n_reference, n_both; /* voxels of the reference's grid */
    double dice;
    bool has_surface; /* both surfaces have vertices in the field of view */
    double mean_mm, q95_mm, hausdorff_mm;
} cli_overlap;

/* Zero-initialise all but args; cli_fit_dispose() frees. */
typedef struct cli_fit {
    const cli_args *args;
    const char *path, *model_path; /* of the image; NULL without a model */

    /* fit_source.c: where maps come from */
    sdm_registry *registry;
    sdm_instance *shape;
    sdm_model *model;
    const char *shape_name;
    sdm_param *params; /* [n_params] */
    size_t n_params;
    double *start;      /* [n_params] */
    bool start_clamped; /* it was moved to its range */
    double pivot[3];    /* middle of the shape at the start, in its frame */
    sdm_fit_source source;

    /* fit_target.c: what is fitted to */
    sdm_volume image;
    float *mask;    /* of a label map; else NULL */
    double *points; /* [n_points][3]; else NULL */
    sdm_fit_target target;

    sdm_fit_opts opts;

    /* fit_compare.c: labels to compare with; those of the target where no others are given */
    sdm_grid reference_grid;
    float *reference; /* NULL: none */
    bool own_reference;

    /* fit_result.c */
    sdm_fit_result result;
    bool found;           /* result holds an estimate */
    sdm_error doubt;      /* status SDM_E_QUALITY: why it is not to be trusted; SDM_OK: it is */
    sdm_fit_source drawn; /* of the maps below: the last one of the fit */
    bool by_network;
    sdm_grid posed;   /* grid of that source in the pose that was found */
    float *map;       /* [posed] distance */
    sdm_mesh surface; /* of it, in the world */
    cli_overlap overlap;
} cli_fit;

/* The model or shape, start parameters, pivot. */
sdm_status cli_fit_open_source(cli_fit *f, sdm_error *err);

/* The image, labels, mesh or points. */
sdm_status cli_fit_read_target(cli_fit *f, sdm_error *err);

/* What was asked for of the fit itself, without the start pose. */
sdm_status cli_fit_read_options(cli_fit *f, sdm_error *err);

/* The pose of the start and the rotations tried. */
sdm_status cli_fit_read_start(cli_fit *f, sdm_error *err);

/* values[grid] = 1 where a voxel has one of the labels (values, or names of segments), else 0. No
   words: all segments, or all voxels but 0. SDM_E_ARG: no such label; SDM_E_FORMAT: no voxel has
   it. */
sdm_status cli_label_mask(const char *path, const sdm_volume *v, const cli_list *words,
                          float *values, sdm_error *err);

/* Labels of a grid, 1 and 0, closed as --label-close says. */
sdm_status cli_close_labels(const cli_fit *f, const sdm_grid *grid, float *values, sdm_error *err);

/* Longest edge of a voxel of the maps, mm. */
double cli_fit_map_voxel(const cli_fit *f);

/* The labels to compare with, before the fit; and the comparison after it. */
sdm_status cli_fit_read_reference(cli_fit *f, sdm_error *err);
sdm_status cli_fit_compare(cli_fit *f, sdm_error *err);

/* Map and surface of the estimate. */
sdm_status cli_fit_draw_up(cli_fit *f, sdm_error *err);

/* What the figures of a command line are called: "image", "labels", "points". */
const char *cli_fit_kind(const cli_fit *f);

/* x and y negated: from RAS to LPS and back. */
void cli_turn_ras(double *points, size_t n);

/* Output files: whether they can be written, before any work; writing them. */
sdm_status cli_fit_check_files(const cli_args *args, sdm_error *err);
sdm_status cli_fit_write_files(const cli_fit *f, sdm_error *err);
sdm_status cli_fit_write_picture(const cli_fit *f, const char *path, sdm_error *err);

/* The result for people on stdout, and as one JSON object. */
void cli_fit_print(const cli_fit *f);
void cli_fit_json(const cli_fit *f, sdm_json *json);

void cli_fit_dispose(cli_fit *f);

#endif
