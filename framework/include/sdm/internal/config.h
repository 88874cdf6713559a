/* The configuration of a training, read from YAML into a struct by field tables. Unknown, repeated,
 * missing and invalid keys are mistakes; every mistake is reported as a line
 * "file:line:column: message". */
#pragma once

#include <stdbool.h>

#include "sdm/grid.h"
#include "sdm/internal/text.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_MAX_PARAMS 64
#define SDM_MAX_OPTIONS 64
#define SDM_NAME_MAX 64
#define SDM_PATH_TEXT_MAX 1024
/* grid.voxels: its default, and the least, because the margin of the grid takes some voxels. */
#define SDM_GRID_VOXELS 60
#define SDM_GRID_VOXELS_MIN 16

/* Origin of a value. With line == 0 and override == 0 the value is a default. */
typedef struct sdm_mark {
    int line, column; /* position in a file, from 1; 0: not from a file */
    int override;     /* number of the key=value override, from 1; 0: from the configuration file */
    /* For an override: the text of the override, or, if line > 0, the name of the file that
     * contains the override. NULL for the configuration file. Owned by the caller, not copied. */
    const char *source;
} sdm_mark;

/* shape.options.NAME, kept as text; the shape interprets it (sdm_instance_create()). */
typedef struct sdm_config_option {
    char name[SDM_NAME_MAX];
    char value[SDM_PATH_TEXT_MAX];
    sdm_mark mark;
} sdm_config_option;

/* shape.ranges.NAME: range [min, max] of a parameter, within the range that the shape allows. */
typedef struct sdm_config_range {
    char name[SDM_NAME_MAX];
    double min, max;
    sdm_mark mark;
} sdm_config_range;

/* How the distribution of a parameter is chosen; sdm_train_distributions() finds the figures. */
typedef enum sdm_distribution_choice {
    SDM_DISTRIBUTION_OF_SHAPE = 0, /* as the shape states it */
    SDM_DISTRIBUTION_SET_UNIFORM,
    SDM_DISTRIBUTION_SET_NORMAL, /* figures of the shape, or from default and range */
    SDM_DISTRIBUTION_FIGURES     /* normal, with the figures of the configuration */
} sdm_distribution_choice;

/* shape.distribution, for all parameters or for the one of a name. */
typedef struct sdm_config_distribution {
    char name[SDM_NAME_MAX]; /* empty: all parameters */
    sdm_distribution_choice choice;
    double mean, deviation; /* FIGURES */
    sdm_mark mark;
} sdm_config_distribution;

typedef enum sdm_network_kind {
    SDM_NETWORK_POD = 0,
    SDM_NETWORK_SDMNN,
    SDM_NETWORK_DEEPSDF,
    SDM_NETWORK_IMNET,
    SDM_NETWORK_TEMPLATE,
    SDM_NETWORK_AUTO /* the trainer chooses pod or template */
} sdm_network_kind;
typedef enum sdm_activation {
    SDM_ACTIVATION_SILU = 0,
    SDM_ACTIVATION_TANH = 1,
    SDM_ACTIVATION_RELU = 2,
    SDM_ACTIVATION_LEAKY_RELU = 3
} sdm_activation;
typedef enum sdm_output { SDM_OUTPUT_LINEAR = 0, SDM_OUTPUT_TANH = 1 } sdm_output;
typedef enum sdm_sampling { SDM_SAMPLING_UNIFORM = 0, SDM_SAMPLING_ERROR = 1 } sdm_sampling;
typedef enum sdm_loss {
    SDM_LOSS_MSE = 0,
    SDM_LOSS_L1 = 1,
    SDM_LOSS_HUBER = 2,
    SDM_LOSS_CLAMPED_L1 = 3
} sdm_loss;
typedef enum sdm_weight_type {
    SDM_WEIGHT_F32 = 0,
    SDM_WEIGHT_F16 = 1,
    SDM_WEIGHT_I8 = 2
} sdm_weight_type;

#define SDM_STATIC_AUTO (-1) /* data.static: auto */

/* All keys of a training configuration. `sdmgen config --keys` lists their ranges and defaults for
 * every kind of network; unless another kind is named, the comments below give those of pod. */
typedef struct sdm_config {
    char file[SDM_PATH_TEXT_MAX]; /* path as given to sdm_config_read() */
    struct {
        char name[SDM_NAME_MAX]; /* shape.name, required */
        sdm_mark mark;           /* position of the name */
        sdm_config_option options[SDM_MAX_OPTIONS];
        size_t n_options;
        sdm_config_range ranges[SDM_MAX_PARAMS];
        size_t n_ranges;
        /* shape.distribution: a word for all parameters, or single ones; the others are then as
         * the shape states them */
        sdm_config_distribution distribution;
        sdm_config_distribution distributions[SDM_MAX_PARAMS];
        size_t n_distributions;
    } shape;
    /* Either grid.size [nx, ny, nz] and grid.spacing, mm, one number or three, with grid.origin
     * [x, y, z], the centre of the first voxel, or grid.centre [x, y, z], the centre of the grid,
     * default [0, 0, 0]. Or a grid that the caller fits to the shapes (grid: auto): then grid.n is
     * 0, and grid.spacing too unless it was given; sdm_config_set_grid() stores the result. */
    sdm_grid grid;
    int grid_voxels;  /* grid.voxels: voxels along the longest edge of a grid to be fitted, 16 ..
                       * 4096, default 60; 0: the grid is complete, or its spacing was given */
    bool grid_fitted; /* the grid is that of grid: auto, as fine as its limits allow */
    bool grid_auto;   /* no key of grid was given: thin parts may make grid_voxels larger */
    struct {
        sdm_network_kind kind; /* network.kind; some keys and defaults depend on it */
        /* pod: hidden layers of the MLP, 0..16, default 3 (0: polynomials only); sdmnn: levels;
         * deepsdf, imnet: hidden layers */
        int depth;
        int width; /* units per hidden layer (imnet: of the first one), 8..4096, default 128 */
        /* mean number of basis functions per block of the lowest level, 1..256, default 9 */
        int rank;
        int levels; /* levels of blocks, 1..8, default 3 */
        int block;  /* edge of a block of the lowest level in voxels, 2..16, default 4 */
        /* number of global modes in which the coefficients are learned, 8..2048, default 512 */
        int modes;
        int degree;        /* total degree of the polynomial part, 0..12, default 6 */
        int input_degree;  /* total degree of the products fed to the MLP, 1..8, default 4 */
        int fine;          /* units of a hidden layer of the fine level, 0..256, default 0: none */
        int channels;      /* sdmnn: channels of the first level, 1..512 */
        double dropout;    /* sdmnn: fraction dropped at the two deepest levels, 0..0.9 */
        int skip;          /* deepsdf: hidden layer that also gets the input, 1..15; 0: none */
        sdm_output output; /* deepsdf, imnet: activation of the output layer */
        /* activation of the hidden layers, default silu; leaky_relu has the slope 0.02 below 0 */
        sdm_activation activation;
        /* type of the large weights in the model file; default i8 (pod), f16 (others) */
        sdm_weight_type weights;
    } network;
    struct {
        /* data.static: number of points of the static grid (a regular grid in the space of the
         * parameters) along each parameter: one number for all, a list, or SDM_STATIC_AUTO (the
         * default); sdm_config_static_count() says which number that is */
        int64_t static_counts[SDM_MAX_PARAMS];
        size_t n_static_counts; /* 0: no static grid; 1: one number for all parameters */
        int64_t online;         /* random shapes generated during training, 0..10^7, default 4096 */
        int64_t start;          /* random shapes generated before training, 0..10^6, default 3456 */
        int64_t holdout; /* random shapes that are not used for training, 1..10^5, default 100 */
        /* pod: distribution of the online shapes: uniform, or denser where the error is larger */
        sdm_sampling sampling;
        double static_share; /* fraction of each batch from the static grid, 0..1, default 0.1 */
        double memory_gb;    /* memory budget for maps, GB, default 6 */
        int workers;         /* threads that generate shapes; 0: half of the threads, at least 1 */
    } data;
    struct {
        /* Budgets: exactly one of minutes, steps and samples is positive, the others are 0. */
        double minutes;       /* time, including data generation and evaluation */
        int64_t steps;        /* number of optimiser steps */
        int64_t samples;      /* steps * batch */
        int batch;            /* maps per step, 1..65536, default 256 */
        int points;           /* deepsdf, imnet: voxels per map and step, 8..1048576, default 512 */
        double learning_rate; /* maximum of the learning rate, default 3e-3 */
        /* fraction of the budget during which the learning rate increases, 0..0.5, default 0.02 */
        double warmup;
        sdm_loss loss;      /* default mse */
        double clamp_mm;    /* clamped_l1: bound to which distances are clamped; default half of
                             * the smallest spacing (0 until the grid is complete) */
        double eikonal;     /* all but pod: weight of (|gradient| - 1)^2, 0..1000, default 0 */
        double near_weight; /* extra weight of voxels near the surface, 0..100, default 0 */
        /* voxels closer to the surface than this are near; default twice the smallest spacing (0
         * until the grid is complete) */
        double near_mm;
        /* pod: last fraction of the budget, used for refinement (training end to end, decoder
         * included), 0..1, default 0.4 */
        double refine;
        int refine_batch;   /* samples per step during refinement, 1..4096, default 32 */
        double refine_rate; /* learning rate during refinement, default 3e-4 */
        /* fraction of a phase's budget without a gain after which the phase ends, 0..1, default
         * 0.3; 0: never */
        double patience;
        /* decay of the moving average of the weights, 0..0.99999, default 0.998; 0: off */
        double average;
        /* time between evaluations on held-out shapes, default 20 s; if the budget is not a time,
         * they take place every 500 steps instead */
        double evaluate_seconds;
        double checkpoint_seconds; /* time between checkpoints, default 60 s */
    } train;
    struct {
        /* output.folder; default runs/NAME, NAME the file name of the configuration without its
         * extension */
        char folder[SDM_PATH_TEXT_MAX];
    } output;
    uint64_t seed; /* default 1 */
    int threads;   /* 0: all; default 0 */
    /* keys of the file, "network.channels, network.dropout", that count as not given, because an
     * override chose a kind of network without them; cut where they are too many */
    char dropped[240];
} sdm_config;

/* Reads a configuration file (at most 1 MiB, one document, no anchors, aliases or tags, at most 32
 * levels of nesting) and applies the key=value overrides in order. Keys of overrides are dotted and
 * their values are YAML: "network.depth=4", "shape.ranges.a=[2,3]". SDM_E_CONFIG: err->text lists
 * the mistakes, one per line as "file:line:column: message" (in an override: "argument
 * 'network.dpth=4': message"). Mistakes are unknown keys (with "did you mean"), duplicate and
 * missing keys, and values of a wrong type or out of range; *out then holds what could be read and
 * serves for finding further mistakes only. Also SDM_E_IO, SDM_E_ARG, SDM_E_NOMEM.
 * The marks in *out point to the texts of the overrides. */
sdm_status sdm_config_read(const char *path, const char *const *overrides, size_t n_overrides,
                           sdm_config *out, sdm_error *err);

/* The same for text[size] in memory; `name` is the file name in messages. */
sdm_status sdm_config_parse(const char *name, const char *text, size_t size,
                            const char *const *overrides, size_t n_overrides, sdm_config *out,
                            sdm_error *err);

/* Appends every key with its value as YAML; reading this YAML gives the same values. Empty texts
 * are left out, so an empty output.folder reads back as its default. */
void sdm_config_dump(const sdm_config *c, sdm_text *out);

/* Completes a configuration whose grid was to be fitted: stores the grid, and the defaults that
 * follow from its spacing, of the keys that were not given. */
void sdm_config_set_grid(sdm_config *c, const sdm_grid *grid);

/* Number of points of the static grid along parameter i of n_params, 0: no static grid.
 * data.static: auto is the largest number up to 5 with which the grid has at most 256 points, with
 * a budget of time at most 300 for each minute. Where that is below 3, it is 2 along each, and with
 * up to 6 parameters 3 along as many of them, from the first one on, as 750 points in all, or 150
 * for each minute, allow. With more than 9 parameters 2 make too many, and there is no static
 * grid. */
int64_t sdm_config_static_count(const sdm_config *c, size_t n_params, size_t i);

/* Puts this number in place of `auto`. */
void sdm_config_set_static(sdm_config *c, size_t n_params);

/* Clears the members that do not affect the trained network: the numbers of threads, the file name
 * and the output folder. Two configurations of the same network are then equal. */
void sdm_config_strip(sdm_config *c);

/* Changes network.kind from `auto` to `kind`. Keys with the default of `auto` get the default of
 * `kind`. */
void sdm_config_choose_kind(sdm_config *c, sdm_network_kind kind);

/* Appends the names of the keys of a section whose values are not the defaults of the kind of
 * network, e.g. "network.rank, network.modes"; after a comma if *out is not empty. Leaves out
 * data.static, and the keys that `but` names between spaces, e.g. " kind weights ". */
void sdm_config_changed_keys(const sdm_config *c, const char *section, const char *but,
                             sdm_text *out);

/* Appends a table of every key: name, type, range, default, unit, meaning; with `markdown` as a
 * Markdown table, else as aligned text. */
void sdm_config_describe(bool markdown, sdm_text *out);

/* buf[1200] = "file:line:column" or "argument 'key=value'" of a mark, for messages about values
 * that only the caller can check, e.g. names of parameters. The overrides given to
 * sdm_config_read() must still exist. Returns buf. */
const char *sdm_config_where(const sdm_config *c, sdm_mark mark, char *buf);

#ifdef __cplusplus
}
#endif
