/* The tables of commands and options, and the parsed command line. Parsing, --help, the manual
 * pages and the completion scripts are all made from these tables. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/internal/text.h"
#include "sdm/status.h"

typedef struct cli_args cli_args;

typedef struct cli_command {
    const char *name;
    const char *synopsis;        /* arguments as in "usage: sdmgen NAME SYNOPSIS" */
    const char *summary;         /* one line, lower case, without a full stop */
    const char *details;         /* paragraphs, separated by \n; NULL: none */
    const char *example;         /* a complete command line; NULL: none */
    size_t min_files, max_files; /* number of positional arguments */
} cli_command;

typedef enum cli_kind {
    CLI_FLAG = 0,
    CLI_INT,    /* int64_t in min..max */
    CLI_REAL,   /* double in min..max */
    CLI_TEXT,   /* const char * */
    CLI_CHOICE, /* const char *, one of `choices` */
    CLI_LIST,   /* cli_list: the option may be repeated */
    CLI_INT3,   /* int64_t[3], comma separated */
    CLI_REAL2,  /* double[2], comma separated */
    CLI_REAL3,  /* double[3], comma separated */
    CLI_REAL6,  /* double[6], comma separated */
    CLI_REAL9,  /* double[9], comma separated */
    CLI_REAL13  /* double[3], comma separated; a single number fills all three */
} cli_kind;

/* A whole turn, rad: the largest value of an option that is an angle. */
#define CLI_TURN 6.283185307179586

typedef struct cli_option {
    const char *name; /* without the dashes */
    char letter;      /* short form, 0: none */
    cli_kind kind;
    const char *value;   /* placeholder of the value in --help, "FILE"; NULL: a flag or a choice */
    const char *choices; /* CLI_CHOICE: "a|b|c" */
    double min, max;     /* allowed range of every number of the value */
    uint32_t commands;   /* one bit per command: CLI_ON(CLI_TRAIN) | ... */
    size_t offset;       /* offset of the field in cli_args for the value */
    const char *help;
} cli_option;

/* Indices into cli_commands. */
enum {
    CLI_TRAIN = 0,
    CLI_DATASET,
    CLI_GENERATE,
    CLI_EXACT,
    CLI_MESH,
    CLI_EVAL,
    CLI_REPORT,
    CLI_SHAPES,
    CLI_INFO,
    CLI_VERIFY,
    CLI_CONFIG,
    CLI_BENCH,
    CLI_EXPERIMENT,
    CLI_PHANTOM,
    CLI_FIT,
    CLI_COLLECT,
    CLI_EXPORT,
    CLI_IMPORT,
    CLI_SLICER,
    CLI_HELP,
    CLI_N_COMMANDS
};

typedef struct cli_list {
    const char **items; /* point into argv */
    size_t n;
} cli_list;

/* An option as given on the command line. */
typedef struct cli_given {
    const cli_option *option;
    const char *value; /* a flag: its name */
} cli_given;

/* A pose: the pose of the shape for `phantom`, the start pose for `fit`. Each vector is NaN when
 * its option is missing. */
typedef struct cli_pose_args {
    double rotation[3];    /* rotation vector (axis times angle), rad */
    double translation[3]; /* LPS mm */
} cli_pose_args;

/* Options of `phantom` alone; numbers are NaN when their option is missing. */
typedef struct cli_phantom_args {
    double random_pose[2];
    bool random_params;
    double frame[3], crop[3];
    double inside[2], outside[2], air[2], air_cells[3];
    double blur[3], texture, noise;
    bool white_noise;
    int64_t supersample; /* 0: option missing */
    const char *type, *label, *truth, *surface;
    int64_t surface_points; /* 0: option missing */
    double surface_noise;
} cli_phantom_args;

/* Options of `fit` alone; numbers are NaN when their option is missing. */
typedef struct cli_fit_args {
    bool exact, polish, ras, find, open_end;
    cli_list labels, reference_labels, keep;
    const char *reference, *truth, *label_out, *start_points, *image_model, *mirror;
    double start_centre[3], start_axis[3], region[6];
    int64_t turns, turns_sphere, max_iterations, candidates; /* 0: option missing */
    double inside[2], outside[2], air[2];
    double blur, l_ref, point_sd, margin, cavity, tissue_field, label_close, least_inside,
        tolerance, beside;
    double prior_sd, prior_rotation, prior_translation, eps;
} cli_fit_args;

/* Options of `fit` for a table of cases; NULL: option missing. */
typedef struct cli_cohort_args {
    const char *cases;
    bool claim;
} cli_cohort_args;

/* Options of `import` alone; 0 or NULL: option missing. */
typedef struct cli_import_args {
    int64_t modes;
    double variance;
    bool scale;
    const char *model, *surface, *particles, *frame, *unit;
} cli_import_args;

/* A parsed command line. Options that are missing keep the default stated in their help text; seed
 * -1, samples -1, maps -1, size[0] 0, spacing[0] 0 and origin[0] NaN mean "option missing". A
 * comment names the commands that have the options. */
struct cli_args {
    const cli_command *command;
    int argc; /* the command line as given, owned by main() */
    char *const *argv;
    cli_list files; /* positional arguments */
    cli_list plugins, params, options, outputs;
    bool quiet, json, help;
    const char *expect;   /* generate, eval, report, info, verify, bench, fit, export */
    const char *progress; /* train, generate, exact, eval, verify, experiment, fit */
    double max_memory;    /* GB; 0: option missing */
    bool isolate;         /* commands with --plugin */
    double isolate_seconds, isolate_memory; /* s, GB; 0: option missing */
    int64_t threads, seed;
    bool resume;                  /* train */
    const char *dataset;          /* train: folder of maps */
    bool plan;                    /* train */
    const char *compare;          /* train: model file */
    int64_t nodes, cores;         /* train; 0: option missing */
    const char *part;             /* fit, dataset; NULL: option missing */
    int64_t maps;                 /* dataset; -1: option missing */
    int64_t ranks;                /* train; 0: option missing */
    bool force;                   /* train, experiment, fit */
    bool dense, half;             /* generate, exact, fit: .vdb */
    bool keep_overlap, certify;   /* exact */
    bool audit;                   /* mesh */
    bool turn_parts;              /* mesh, exact */
    const char *points, *columns; /* generate, exact: file of points, columns */
    double narrow;                /* exact: voxels; 0: option missing */
    double tolerance;             /* exact: mm; 0: option missing */
    bool no_model, changed_files; /* report */
    const char *report;           /* train, fit: file of a page */
    bool dump;                    /* config */
    bool keys;                    /* config, experiment */
    bool markdown;                /* config, experiment, help */
    bool man;                     /* help */
    const char *completion;       /* help: shell */
    const char *out;              /* train, experiment, shapes */
    const char *install;          /* slicer */
    const char *returns;          /* generate, exact, fit: file of results */
    bool measure;                 /* generate, exact, fit */
    const char *depths;           /* generate, exact, fit: list of mm; NULL: option missing */
    const char *rows;             /* generate: the file of --params */
    const char *policy;           /* generate, fit */
    const char *shape;            /* exact, mesh, bench, phantom, fit */
    const char *mesh;             /* exact, mesh, bench */
    const char *sign, *method;    /* exact */
    const char *pictures;         /* eval */
    const char *closest, *normal; /* exact */
    const char *triangle;         /* exact */
    const char *jacobian;         /* exact, generate */
    bool check;                   /* generate */
    double max_error;             /* generate: mm; 0: option missing */
    const char *error_of;         /* generate; NULL: option missing */
    const char *gradient;         /* generate */
    double band;                  /* voxels; 0: option missing */
    double max_mse;               /* eval: mm^2 */
    double spacing[3], origin[3]; /* mm */
    double direction[9];          /* generate; direction[0] NaN: option missing */
    const char *like;             /* exact, generate, phantom */
    const char *outside;          /* generate */
    int64_t size[3];              /* voxels */
    int64_t samples;              /* eval, verify, shapes */
    int64_t naive;                /* eval */
    const char *grid;             /* bench */
    const char *peers;            /* bench, experiment */
    double edge, share;           /* bench; 0: option missing */
    int64_t repeat;               /* bench; 0: option missing */
    bool growth;                  /* bench */
    bool dry_run;                 /* experiment */
    cli_pose_args pose;           /* phantom, fit */
    cli_phantom_args phantom;
    cli_fit_args fit;
    cli_cohort_args cohort; /* fit */
    cli_import_args import;
    cli_given *given; /* [n_given] all options in the order of the command line */
    size_t n_given;
    const char **memory; /* storage of the items of all lists */
};

extern const cli_command cli_commands[CLI_N_COMMANDS];
extern const cli_option cli_options[];
extern const size_t cli_n_options;

/* The bit of a command in cli_option.commands. */
#define CLI_ON(command) (UINT32_C(1) << (command))

/* Parses argv[1..]. *args is written also after an error; cli_args_dispose() frees it. SDM_E_ARG:
 * an unknown command or option (with "did you mean"), a bad value, too few or too many arguments.
 * `--help` anywhere sets args->help; the other arguments are then not checked. */
sdm_status cli_parse(int argc, char **argv, cli_args *args, sdm_error *err);
void cli_args_dispose(cli_args *args);

/* Finds what sdmgen calls a word of other programs. Each call returns one more name: of an option,
 * as "spacing" for "voxel", or of a key of the configuration with an example of its value, as
 * "grid.spacing=0.5". NULL: there is no further name. *row must be 0 before the first call, and is
 * where the search goes on. */
const char *cli_alias_next(const char *word, size_t *row);

/* Returns the command of that name. NULL: there is none; *err holds SDM_E_ARG with "did you
 * mean". */
const cli_command *cli_find_command(const char *name, sdm_error *err);

/* Replaces options of C by those of the command line: "sdm_fit_opts.max_iterations" becomes
 * "--max-iterations". The text gets shorter. */
void cli_name_options(char *text);

/* The option --name of a command (an index into cli_commands); name[length]. NULL: there is none.
 */
const cli_option *cli_find_option(size_t command, const char *name, size_t length);

/* True when `command` (an index into cli_commands) has the option. */
bool cli_option_fits(const cli_option *option, size_t command);

/* True when the option may be given several times: a list, and a flag, which says the same again.
 * cli_parse() refuses a second value of any other option. */
bool cli_may_repeat(const cli_option *option);
