/* The one table of commands and options: parsing, --help, the manual page and the bash completion
 * come from it. */
#ifndef CLI_OPTIONS_H
#define CLI_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/internal/text.h"
#include "sdm/status.h"

typedef struct cli_args cli_args;

typedef struct cli_command {
    const char *name;
    const char *synopsis; /* what follows "sdmgen NAME" */
    const char *summary;  /* one line */
    const char *details;  /* paragraphs, separated by \n */
    const char *example;
    size_t min_files, max_files; /* positional arguments */
    sdm_status (*run)(const cli_args *args, sdm_error *err);
} cli_command;

typedef enum cli_kind {
    CLI_FLAG = 0,
    CLI_INT,    /* int64_t in min..max */
    CLI_REAL,   /* double in min..max */
    CLI_TEXT,   /* const char * */
    CLI_CHOICE, /* const char *, one of `choices` */
    CLI_LIST,   /* cli_list: may be repeated */
    CLI_INT3,   /* int64_t[3], comma separated */
    CLI_REAL2,  /* double[2], comma separated */
    CLI_REAL3,  /* double[3], comma separated */
    CLI_REAL6,  /* double[6], comma separated */
    CLI_REAL13  /* double[3], one number for all or three */
} cli_kind;

typedef struct cli_option {
    const char *name; /* without the dashes */
    char letter;      /* short form, or 0 */
    cli_kind kind;
    const char *value;   /* what the value is called in --help; NULL for a flag */
    const char *choices; /* CLI_CHOICE: "a|b|c" */
    double min, max;     /* CLI_INT, CLI_REAL and each of CLI_INT3, CLI_REAL13 */
    uint32_t commands;   /* bit per command, CLI_ON(CLI_TRAIN) | ... */
    size_t offset;       /* in cli_args */
    const char *help;
} cli_option;

/* Order of the command table. */
enum {
    CLI_TRAIN = 0,
    CLI_GENERATE,
    CLI_EXACT,
    CLI_MESH,
    CLI_EVAL,
    CLI_SHAPES,
    CLI_INFO,
    CLI_VERIFY,
    CLI_CONFIG,
    CLI_BENCH,
    CLI_EXPERIMENT,
    CLI_PHANTOM,
    CLI_FIT,
    CLI_HELP,
    CLI_N_COMMANDS
};

typedef struct cli_list {
    const char **items; /* of argv */
    size_t n;
} cli_list;

/* Options of `phantom`; numbers that were not given are NaN. */
typedef struct cli_phantom_args {
    double rotation[3], translation[3], random_pose[2];
    bool random_params;
    double frame[3], crop[3];
    double inside[2], outside[2], air[2], air_cells[3];
    double blur[3], texture, noise;
    bool white_noise;
    int64_t supersample; /* 0: not given */
    const char *type, *label, *truth;
} cli_phantom_args;

/* Options of `fit`; numbers that were not given are NaN. The start pose is in cli_phantom_args:
 * rotation, translation. */
typedef struct cli_fit_args {
    bool exact, polish, ras;
    cli_list labels, reference_labels, keep;
    const char *reference, *label_out, *start_points, *image_model;
    double start_centre[3], start_axis[3], region[6];
    int64_t turns, turns_sphere, max_iterations; /* 0: not given */
    double inside[2], outside[2], air[2];
    double blur, l_ref, point_sd, margin, cavity, tissue_places, label_close, least_inside;
    double prior_sd, prior_rotation, prior_translation, eps;
} cli_fit_args;

/* A parsed command line. Numbers that were not given keep the default of the table's help text;
   seed -1, size[0] 0, spacing[0] 0 and origin[0] NaN mean "not given". */
struct cli_args {
    const cli_command *command;
    cli_list files, plugins, params, options, outputs;
    bool quiet, json, help;
    int64_t threads, seed;
    bool resume, force;                   /* train */
    bool dense, half;                     /* .vdb */
    bool keep_overlap, audit;             /* exact, mesh */
    bool certify;                         /* exact */
    double narrow;                        /* exact: voxels; 0: not given */
    double tolerance;                     /* exact; 0: not given */
    bool dump, keys, markdown;            /* config, help */
    bool man, completion;                 /* help */
    const char *out, *rows, *policy;      /* train --out, generate --params, --policy */
    const char *shape, *mesh;             /* exact, mesh */
    const char *sign, *method, *pictures; /* exact, eval */
    const char *closest, *normal;         /* exact */
    const char *triangle, *jacobian;      /* exact; jacobian: generate too */
    bool check;                           /* generate */
    double max_error;                     /* generate; 0: not given */
    const char *error_of, *gradient;      /* generate */
    double band, max_mse, spacing[3], origin[3];
    int64_t size[3], samples, naive;
    const char *grid, *peers; /* bench */
    double edge, share;       /* bench; 0: not given */
    int64_t repeat;           /* bench; 0: not given */
    bool growth;              /* bench */
    bool dry_run;             /* experiment */
    cli_phantom_args phantom;
    cli_fit_args fit;
    const char **memory; /* behind the lists */
};

extern const cli_command cli_commands[CLI_N_COMMANDS];
extern const cli_option cli_options[];
extern const size_t cli_n_options;

/* Bit of a command in cli_option.commands. */
#define CLI_ON(command) (UINT32_C(1) << (command))

/* Parses argv[1..]. *args is written in every case and freed by cli_args_dispose(). SDM_E_ARG: an
   unknown command or option (with "did you mean"), a bad value, too few or too many arguments.
   `--help` anywhere sets args->help and ends the parsing without complaint about the rest. */
sdm_status cli_parse(int argc, char **argv, cli_args *args, sdm_error *err);
void cli_args_dispose(cli_args *args);

/* True when `command` (index in cli_commands) takes the option. */
bool cli_option_fits(const cli_option *option, size_t command);

#endif
