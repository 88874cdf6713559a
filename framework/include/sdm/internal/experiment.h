/* The configuration of an experiment, which compares methods on the same shapes: each method is a
 * row of a table, and figures reported by others can be shown beside it. The configuration is a
 * YAML file, read and checked as described in sdm/internal/config.h. */
#pragma once

#include "sdm/internal/config.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_EXPERIMENT_ROWS_MAX 64
#define SDM_EXPERIMENT_TITLE_MAX (2 * SDM_NAME_MAX)

/* A figure that is measured for each method: one column of the table. New figures are added at the
 * end. */
typedef enum sdm_figure {
    SDM_FIGURE_MS = 0,
    SDM_FIGURE_MS_BATCH,
    SDM_FIGURE_SPEEDUP,
    SDM_FIGURE_MSE,
    SDM_FIGURE_RMSE,
    SDM_FIGURE_RMSE_NEAR,
    SDM_FIGURE_MAX,
    SDM_FIGURE_DICE,
    SDM_FIGURE_SURFACE_MEAN,
    SDM_FIGURE_SURFACE_MAX,
    SDM_FIGURE_TRAIN,
    SDM_FIGURE_MODEL,
    SDM_FIGURE_PEAK,
    SDM_FIGURE_SHAPES,
    SDM_FIGURE_FITS,
    SDM_FIGURE_FIT,
    SDM_FIGURE_MAPS_NETWORK,
    SDM_FIGURE_MAPS_EXACT,
    SDM_FIGURE_WITHIN,
    SDM_FIGURE_WITHIN_2,
    SDM_N_FIGURES
} sdm_figure;

typedef struct sdm_figure_info {
    const char *key;   /* name in files: "mse_mm2" */
    const char *title; /* title of the column: "MSE" */
    const char *unit;  /* "mm^2"; "" for a number without a unit */
    const char *help;  /* description, one line */
} sdm_figure_info;

/* The description of a figure, constant; NULL for f >= SDM_N_FIGURES. [any thread] */
const sdm_figure_info *sdm_figure_get_info(sdm_figure f);

/* A key of the training configuration with its value, e.g. "train.minutes=4", and its position in
 * the experiment's file; mark.line == 0: it is an argument of the command line. */
typedef struct sdm_override {
    char *text;
    sdm_mark mark;
} sdm_override;

typedef struct sdm_overrides {
    sdm_override *items;
    size_t n, capacity;
} sdm_overrides;

/* How a method fits parameters and pose of a shape to an image: the source of its maps. */
typedef enum sdm_experiment_fit {
    SDM_EXPERIMENT_NO_FIT = 0,  /* no fit: the method makes maps */
    SDM_EXPERIMENT_FIT_NETWORK, /* maps of the method's network */
    /* first maps of the network of the last method with FIT_NETWORK before this one, then exact
     * maps */
    SDM_EXPERIMENT_FIT_POLISH,
    SDM_EXPERIMENT_FIT_EXACT, /* exact maps */
    /* no fit is run: the cost that FIT_EXACT would have if the naive method made its maps is
     * computed */
    SDM_EXPERIMENT_FIT_NAIVE
} sdm_experiment_fit;

/* What is wrong with the test images of a method, whose fits must then be refused. */
typedef enum sdm_experiment_wrong {
    SDM_EXPERIMENT_RIGHT = 0,
    SDM_EXPERIMENT_MIRRORED, /* the image is the mirror image */
    SDM_EXPERIMENT_MOVED,    /* the start lies beside the shape, by its size */
    SDM_EXPERIMENT_ABSENT    /* the image does not hold the shape */
} sdm_experiment_wrong;

/* An element of `methods`: a network to train, or an engine that needs no training. */
typedef struct sdm_experiment_method {
    char name[SDM_NAME_MAX];
    char network[SDM_NAME_MAX]; /* kind of the network; "" if the method is an engine */
    char engine[SDM_NAME_MAX];  /* name of the engine, not checked here; "" for a network */
    int fit;                    /* sdm_experiment_fit; EXACT and NAIVE set `engine` */
    int64_t samples;   /* number of shapes for measuring errors; 0: as given for the experiment */
    sdm_overrides set; /* keys of the training configuration for this method */
    sdm_mark mark;
    /* the test images of a fit: name of the method whose shape they show, which makes the fit a
     * wrong one; "": its own. What else is wrong (sdm_experiment_wrong). 1: labels in place of
     * images */
    char shows[SDM_NAME_MAX];
    int wrong, labels;
    /* factors on noise and texture, on the blur, and on the contrast of the images, default 1 */
    double noise, blur, contrast;
} sdm_experiment_method;

/* An element of `variants`: every method is run once for each variant, e.g. on another grid. */
typedef struct sdm_experiment_variant {
    char name[SDM_NAME_MAX];
    /* the maps have (n - 1) finer + 1 voxels where the configuration has n; default 1 */
    int64_t finer;
    sdm_overrides set;
    sdm_mark mark;
} sdm_experiment_variant;

/* An element of `reference`: figures reported by others for one row. */
typedef struct sdm_experiment_reference {
    char row[SDM_EXPERIMENT_TITLE_MAX]; /* title of the row */
    char source[256];                   /* where the figures were published */
    double value[SDM_N_FIGURES];        /* NaN: not reported */
    /* for a fit: mean of abs(parameter - its value in the exact fit), for each parameter */
    size_t n_differences;
    struct {
        char name[SDM_NAME_MAX];
        double value;
    } differences[SDM_MAX_PARAMS];
    sdm_mark mark;
} sdm_experiment_reference;

/* One row of the table: a method in a variant. */
typedef struct sdm_experiment_row {
    char title[SDM_EXPERIMENT_TITLE_MAX];  /* e.g. "POD" or "POD, 128^3" */
    char folder[SDM_EXPERIMENT_TITLE_MAX]; /* a-z, 0-9 and '-' only, different for every row */
    const sdm_experiment_method *method;
    const sdm_experiment_variant *variant;     /* NULL: there are no variants */
    const sdm_experiment_reference *reference; /* NULL: none */
    /* Index of the row whose network this row uses: its own index, except for FIT_POLISH and for
       variants that differ in `finer` alone from one before them. */
    size_t network_row;
    /* Index of the row whose shape the test images of a fit show: its own index, unless the method
     * has `shows`. */
    size_t shown_row;
    int64_t samples; /* number of shapes on which errors are measured */
} sdm_experiment_row;

typedef struct sdm_experiment {
    char file[SDM_PATH_TEXT_MAX]; /* path as given to sdm_experiment_read() */
    struct {
        char title[256]; /* title of the report; default: the file name without extension */
        /* folder for the results; default runs/NAME, NAME the file name without extension */
        char folder[SDM_PATH_TEXT_MAX];
        uint64_t seed;          /* seed of the random test shapes, default 1 */
        int64_t samples;        /* shapes for measuring errors of a network, 1..10^6, default 100 */
        int64_t engine_samples; /* the same for an engine, default 5 */
        /* time limit: no training is started that would end later; 0 (default): no limit */
        double minutes;
        char baseline[SDM_NAME_MAX];  /* method to which `speedup` refers; "" (default): none */
        char reference[SDM_NAME_MAX]; /* heading of the figures of others, default "reference" */
        int pictures;                 /* 1 (default): pictures are drawn; 0: none */
    } experiment;
    struct {              /* settings for the methods with `fit` */
        int64_t phantoms; /* number of test images of random shapes, 1..10^4, default 9 */
        /* distance and angle of the start pose from the true one, default 1 mm, 15 degrees */
        double off_mm, off_deg;
        double voxel; /* voxel size of the images, mm, default 0.25 */
        /* fraction of every parameter's range, about its middle, from which the shapes are drawn,
         * default 0.8 */
        double range;
        double prior_sd; /* prior_sd of sdm/fit.h, default 1 */
        double eps;      /* polish_eps of sdm/fit.h, default 3e-6 */
        /* path of a trained model for the fit; "": the network is trained */
        char model[SDM_PATH_TEXT_MAX];
    } fit;
    char base[SDM_PATH_TEXT_MAX]; /* path of the base training configuration; "": none */
    char *base_text;              /* content of the base file */
    size_t base_size;
    /* Keys of the training configuration for all rows: `common` from the experiment's file,
     * `command_line` from the command line. */
    sdm_overrides common, command_line;
    sdm_experiment_method *methods;
    size_t n_methods;
    sdm_experiment_variant *variants;
    size_t n_variants;
    sdm_experiment_reference *references;
    size_t n_references;
    /* [n_rows] variant by variant; within a variant the methods in the order of the file */
    sdm_experiment_row *rows;
    size_t n_rows;
} sdm_experiment;

/* Reads an experiment with key=value overrides. Keys of the training configuration
 * ("train.minutes=1") apply to every row, other keys are those of the experiment
 * ("experiment.samples=20"). The training configuration of every row is checked, too. The key
 * `base` names a file in the folder of `path`. *out is freed with sdm_experiment_free(). SDM_E_IO,
 * SDM_E_ARG, SDM_E_NOMEM; SDM_E_CONFIG: err->text lists the mistakes, one per line. */
sdm_status sdm_experiment_read(const char *path, const char *const *overrides, size_t n_overrides,
                               sdm_experiment **out, sdm_error *err);

/* The same for text[size] in memory; `name` is the file name in messages, and the file `base` is
 * read from the folder of `name`. */
sdm_status sdm_experiment_parse(const char *name, const char *text, size_t size,
                                const char *const *overrides, size_t n_overrides,
                                sdm_experiment **out, sdm_error *err);

void sdm_experiment_free(sdm_experiment *e);

/* *out = the training configuration of a row: the base, then the keys of the experiment, of the
 * method, of the variant and of the command line, each overriding the earlier ones. For a row
 * that measures an engine instead of a network, only shape, grid and ranges have a meaning.
 * SDM_E_ARG: no such row; SDM_E_NOMEM. [any thread] */
sdm_status sdm_experiment_config(const sdm_experiment *e, size_t row, sdm_config *out,
                                 sdm_error *err);

/* Appends a table of the keys of an experiment, in the format of sdm_config_describe(). */
void sdm_experiment_describe(bool markdown, sdm_text *out);

#ifdef __cplusplus
}
#endif
