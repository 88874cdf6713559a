/* The configuration of an experiment: methods side by side on the same shapes, each a row of one
   table, the figures of others beside them. YAML, read by strict tables; mistakes are reported as
   sdm/config.h says. */
#ifndef SDM_EXPERIMENT_H
#define SDM_EXPERIMENT_H

#include "sdm/internal/config.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_EXPERIMENT_ROWS_MAX 64
#define SDM_EXPERIMENT_TITLE_MAX (2 * SDM_NAME_MAX)

/* What is measured of a method, a column of the table each; values are added at the end. */
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
    SDM_N_FIGURES
} sdm_figure;

typedef struct sdm_figure_info {
    const char *key;   /* in files: "mse_mm2" */
    const char *title; /* of a column: "MSE" */
    const char *unit;  /* "mm^2"; "" for a pure number */
    const char *help;  /* one line */
} sdm_figure_info;

/* Constant; NULL from SDM_N_FIGURES on. [any thread] */
const sdm_figure_info *sdm_figure_get_info(sdm_figure f);

/* A key of the training configuration with its value, "train.minutes=4", and where the experiment's
   file says it; without a line: an argument of the command line. */
typedef struct sdm_override {
    char *text;
    sdm_mark mark;
} sdm_override;

typedef struct sdm_overrides {
    sdm_override *items;
    size_t n, capacity;
} sdm_overrides;

/* How a method of a fit finds parameters and pose in the images; SDM_EXPERIMENT_NO_FIT: the method
 * makes maps. */
typedef enum sdm_experiment_fit {
    SDM_EXPERIMENT_NO_FIT = 0,
    SDM_EXPERIMENT_FIT_NETWORK, /* maps of its network */
    SDM_EXPERIMENT_FIT_POLISH,  /* then exact maps; the network of the FIT_NETWORK before it */
    SDM_EXPERIMENT_FIT_EXACT,   /* exact maps */
    SDM_EXPERIMENT_FIT_NAIVE /* not run: the cost of the exact fit if the naive method made its maps
                              */
} sdm_experiment_fit;

/* An element of `methods`: either a network to train or an engine that needs no training. */
typedef struct sdm_experiment_method {
    char name[SDM_NAME_MAX];
    char network[SDM_NAME_MAX]; /* kind of the network; "": an engine */
    char engine[SDM_NAME_MAX];  /* its name, which the configuration cannot check; "": a network */
    int fit;                    /* sdm_experiment_fit; exact and naive have that engine */
    int64_t samples;            /* shapes its errors are measured on; 0: the experiment's number */
    sdm_overrides set;          /* keys of the training configuration for this method alone */
    sdm_mark mark;
} sdm_experiment_method;

/* An element of `variants`: every method is done once for each, e.g. on other grids. */
typedef struct sdm_experiment_variant {
    char name[SDM_NAME_MAX];
    sdm_overrides set;
    sdm_mark mark;
} sdm_experiment_variant;

/* An element of `reference`: what others reported. */
typedef struct sdm_experiment_reference {
    char row[SDM_EXPERIMENT_TITLE_MAX];
    char source[256];
    double value[SDM_N_FIGURES]; /* NaN: not reported */
    size_t n_differences;        /* of a fit: mean |difference from the exact fit| of parameters */
    struct {
        char name[SDM_NAME_MAX];
        double value;
    } differences[SDM_MAX_PARAMS];
    sdm_mark mark;
} sdm_experiment_reference;

/* One row of the table: a method in a variant. */
typedef struct sdm_experiment_row {
    char title[SDM_EXPERIMENT_TITLE_MAX];  /* "POD", "POD, 128^3" */
    char folder[SDM_EXPERIMENT_TITLE_MAX]; /* of a-z, 0-9 and '-', another for every row */
    const sdm_experiment_method *method;
    const sdm_experiment_variant *variant;     /* NULL: there are none */
    const sdm_experiment_reference *reference; /* NULL: none */
    size_t network_row; /* whose network it takes: its own, but for FIT_POLISH */
    int64_t samples;
} sdm_experiment_row;

typedef struct sdm_experiment {
    char file[SDM_PATH_TEXT_MAX]; /* as given to sdm_experiment_read() */
    struct {
        char title[256]; /* of the report, default the file's name */
        char
            folder[SDM_PATH_TEXT_MAX]; /* of the results, default runs/NAME after the file's name */
        uint64_t seed;                 /* of the shapes that are measured, default 1 */
        int64_t samples; /* shapes a network's errors are measured on, 1..10^6, default 100 */
        int64_t engine_samples; /* and an engine's, default 5 */
        double minutes; /* no training is begun that would end later; 0 (default): not limited */
        char baseline[SDM_NAME_MAX];  /* method that the factor `speedup` refers to; "" (default):
                                         none */
        char reference[SDM_NAME_MAX]; /* what the column of others' figures is called, default
                                         "reference" */
        int pictures;                 /* 1 (default): pictures are drawn */
    } experiment;
    struct {                    /* of the methods with `fit` */
        int64_t phantoms;       /* images of random shapes, 1..10^4, default 9 */
        double off_mm, off_deg; /* of the start from the true pose, default 1 mm and 15 degrees */
        double voxel;           /* of the images, mm, default 0.25 */
        double range; /* share of every parameter's range, about its middle, that holds the truths,
                         default 0.8 */
        double prior_sd;               /* as in sdm/fit.h, default 1 */
        double eps;                    /* polish_eps of sdm/fit.h, default 1e-6 */
        char model[SDM_PATH_TEXT_MAX]; /* path of a model to fit with, none is trained; "": none */
    } fit;
    char base[SDM_PATH_TEXT_MAX]; /* path of the training configuration under all rows; "": there is
                                     none */
    char *base_text;              /* its content */
    size_t base_size;
    sdm_overrides common; /* keys of the training configuration said in the experiment's own file */
    sdm_overrides command_line; /* and on the command line: they hold for every row */
    sdm_experiment_method *methods;
    size_t n_methods;
    sdm_experiment_variant *variants;
    size_t n_variants;
    sdm_experiment_reference *references;
    size_t n_references;
    sdm_experiment_row
        *rows; /* [n_rows], variant by variant, the methods of each in the order of the file */
    size_t n_rows;
} sdm_experiment;

/* Reads an experiment with key=value overrides: those of training keys ("train.minutes=1") hold for
   every row, others are keys of the experiment ("experiment.samples=20"). The training
   configuration of every row is checked too. `base` names a file beside `path`. SDM_E_IO;
   SDM_E_CONFIG with one line for every mistake. *out is freed with sdm_experiment_free(). */
sdm_status sdm_experiment_read(const char *path, const char *const *overrides, size_t n_overrides,
                               sdm_experiment **out, sdm_error *err);

/* The same for a text in memory; `name` stands for the file in messages and names the folder of
 * `base`. */
sdm_status sdm_experiment_parse(const char *name, const char *text, size_t size,
                                const char *const *overrides, size_t n_overrides,
                                sdm_experiment **out, sdm_error *err);

void sdm_experiment_free(sdm_experiment *e);

/* The training configuration of a row: the base, the experiment's own keys, the method's, the
   variant's, the command line's, each over those before. An engine's has shape, grid and ranges in
   it; its budget means nothing. SDM_E_ARG: no such row. [any thread] */
sdm_status sdm_experiment_config(const sdm_experiment *e, size_t row, sdm_config *out,
                                 sdm_error *err);

/* Appends a table of the keys of an experiment, as sdm_config_describe() does for those of a
 * training. */
void sdm_experiment_describe(bool markdown, sdm_text *out);

#ifdef __cplusplus
}
#endif
#endif
