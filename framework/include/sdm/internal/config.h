/* The experiment configuration: YAML -> typed values, strict, by field tables. Every mistake is
   reported as "file:line:column: message", one line each. */
#ifndef SDM_CONFIG_H
#define SDM_CONFIG_H

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

/* Where a value came from: line and column from 1, or 0 for a default. override: 1-based number of
   the key=value argument; then `source` is its text, the caller's and not copied, or the file in
   which it was said in line and column. */
typedef struct sdm_mark {
    int line, column, override;
    const char *source;
} sdm_mark;

/* shape.options.NAME: kept as text; its meaning is the shape's (sdm_instance_create()). */
typedef struct sdm_config_option {
    char name[SDM_NAME_MAX];
    char value[SDM_PATH_TEXT_MAX];
    sdm_mark mark;
} sdm_config_option;

/* shape.ranges.NAME: [min, max] of a parameter; narrower than or equal to the shape's own. */
typedef struct sdm_config_range {
    char name[SDM_NAME_MAX];
    double min, max;
    sdm_mark mark;
} sdm_config_range;

typedef enum sdm_network_kind {
    SDM_NETWORK_POD = 0,
    SDM_NETWORK_SDMNN,
    SDM_NETWORK_DEEPSDF,
    SDM_NETWORK_IMNET
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

typedef struct sdm_config {
    char file[SDM_PATH_TEXT_MAX]; /* as given to sdm_config_read() */
    struct {
        char name[SDM_NAME_MAX]; /* shape.name, required */
        sdm_mark mark;           /* of the name */
        sdm_config_option options[SDM_MAX_OPTIONS];
        size_t n_options;
        sdm_config_range ranges[SDM_MAX_PARAMS];
        size_t n_ranges;
    } shape;
    sdm_grid grid; /* grid.size [nx,ny,nz] required; grid.spacing mm (one number or three) required;
                      grid.origin [x,y,z] (first voxel's centre) or grid.centre [x,y,z] (middle of
                      the box, default [0,0,0]), not both */
    struct {
        sdm_network_kind
            kind;  /* network.kind: pod, sdmnn, deepsdf, imnet; some keys and defaults depend on it:
                      those given below are of pod, the table of keys has all */
        int depth; /* pod: hidden layers of the MLP, 0..16, default 3 (0: polynomials only);
                      sdmnn: levels; deepsdf, imnet: hidden layers */
        int width; /* units of a hidden layer, 8..4096, default 128; imnet: of the first one */
        int rank;  /* basis functions per block of the lowest level on average, 1..256, default 9 */
        int levels;        /* levels of blocks, 1..8, default 3 */
        int block;         /* edge of a block of the lowest level in voxels, 2..16, default 4 */
        int modes;         /* global modes the coefficients are learned in, 8..2048, default 512 */
        int degree;        /* total degree of the polynomial part, 0..12, default 6 */
        int input_degree;  /* total degree of the products fed to the MLP, 1..8, default 4 */
        int channels;      /* sdmnn: channels of the first level, 1..512 */
        double dropout;    /* sdmnn: share of units dropped at the two deepest levels, 0..0.9 */
        int skip;          /* deepsdf: hidden layer where the input enters again, 0 (none)..15 */
        sdm_output output; /* deepsdf, imnet: linear, tanh */
        sdm_activation
            activation; /* silu, tanh, relu, leaky_relu (slope 0.02 below 0); default silu */
        sdm_weight_type
            weights; /* f32, f16, i8 (pod): large weights in the model file; default pod i8, f16 */
    } network;
    struct {
        int64_t static_counts[SDM_MAX_PARAMS]; /* data.static: points per parameter, one number for
                                                  all or a list; default 5 */
        size_t n_static_counts;                /* 0: data.static absent; 1: one number for all */
        int64_t online; /* random shapes drawn while training goes on, 0..10^7, default 4096 */
        int64_t start; /* random shapes made before training starts, for the bases, 0..10^6, default
                          3456 */
        int64_t holdout;       /* random shapes that are never trained on, 1..10^5, default 100 */
        sdm_sampling sampling; /* pod: online shapes uniform over the parameters, or dense where the
                                  network errs */
        double static_share; /* share of each batch drawn from the static grid, 0..1, default 0.1 */
        double memory_gb;    /* budget for maps kept in memory, default 6 */
        int workers; /* threads that make online samples; 0: half of the threads, at least 1 */
    } data;
    struct {
        double minutes;  /* train.minutes: time budget, data and evaluation included; 0: not limited
                            by time */
        int64_t steps;   /* optimiser steps in all; 0: not limited by steps */
        int64_t samples; /* samples in all (steps * batch); 0: not limited. Exactly one of the three
                            is positive */
        int batch;       /* 1..65536, default 256 */
        int points; /* deepsdf, imnet: voxels drawn from each map of a batch, 8..1048576, default
                       512 */
        double learning_rate; /* default 3e-3 */
        double warmup;        /* share of the budget, 0..0.5, default 0.02 */
        sdm_loss loss;        /* mse, l1, huber, clamped_l1; default mse */
        double clamp_mm;      /* clamped_l1: distances beyond count as this, default 0.1 */
        double eikonal;       /* all but pod: weight of (|gradient| - 1)^2, 0..1000, default 0 */
        double near_weight;   /* extra weight of voxels near the surface, 0..100, default 0 */
        double near_mm;       /* what is near, mm, default 0.4 */
        double refine;    /* last share of the budget, trained end to end (decoder included), 0..1,
                             default 0.4 */
        int refine_batch; /* 1..4096, default 32 */
        double refine_rate; /* learning rate there, default 3e-4 */
        double average;     /* decay of the weight average, 0..0.99999, default 0.998; 0: off */
        double evaluate_seconds;   /* between evaluations on held-out shapes, default 20 (in step
                                      mode: every 500 steps) */
        double checkpoint_seconds; /* between checkpoints, default 60 */
    } train;
    struct {
        char folder[SDM_PATH_TEXT_MAX]; /* output.folder, default runs/NAME with NAME the config's
                                           file name */
    } output;
    uint64_t seed; /* default 1 */
    int threads;   /* 0: all; default 0 */
} sdm_config;

/* Reads a config (at most 1 MiB, one document, no anchors, aliases or tags, nesting at most 32) and
   applies the key=value overrides in order (dotted keys, e.g. "network.depth=4",
   "shape.ranges.a=[2,3]", values parsed as YAML). SDM_E_IO; SDM_E_CONFIG: err->text holds every
   mistake found, one "file:line:column: message" line each (overrides: "argument 'network.dpth=4':
   message"): unknown (with "did you mean"), duplicate, missing, mistyped and out-of-range keys. */
sdm_status sdm_config_read(const char *path, const char *const *overrides, size_t n_overrides,
                           sdm_config *out, sdm_error *err);

/* The same for a text in memory; `name` stands for the file in messages. */
sdm_status sdm_config_parse(const char *name, const char *text, size_t size,
                            const char *const *overrides, size_t n_overrides, sdm_config *out,
                            sdm_error *err);

/* Appends the resolved config (every key with its value) as YAML that reads back to the same
   values. A text that is empty is left out: output.folder then reads back as its default. */
void sdm_config_dump(const sdm_config *c, sdm_text *out);

/* Empties what has no part in the network: the numbers of threads, the name of the file and that of
   the folder. Of two that train the same network the rest is the same. */
void sdm_config_strip(sdm_config *c);

/* Appends a table of every key: name, type, range, default, meaning (for --help and the
   documentation), as Markdown when `markdown`, else as aligned text. */
void sdm_config_describe(bool markdown, sdm_text *out);

/* "file:line:column" or "argument 'key=value'" of a mark, for messages of those who check what the
   config cannot know: the texts given to sdm_config_read() must still be there. buf has 1200 bytes.
 */
const char *sdm_config_where(const sdm_config *c, sdm_mark mark, char *buf);

#ifdef __cplusplus
}
#endif
#endif
