/* The keys of a training configuration: one table per section, and the rules that involve several
 * keys. */
#include "schema.h"

#include <stddef.h>
#include <string.h>

#include "grid_keys.h"
#include "kinds.h"
#include "special.h"

#define AT(member) offsetof(sdm_config, member)
#define CHECK_ENUM(type) _Static_assert(sizeof(type) == sizeof(int), "a choice is stored as an int")
CHECK_ENUM(sdm_network_kind);
CHECK_ENUM(sdm_activation);
CHECK_ENUM(sdm_output);
CHECK_ENUM(sdm_sampling);
CHECK_ENUM(sdm_loss);
CHECK_ENUM(sdm_weight_type);

#define SPECIAL(name, reader, dumper, type_, range_, def_, unit_, help_)                           \
    {                                                                                              \
        .key = name, .type = SDM_FIELD_SPECIAL, .read = reader, .dump = dumper,                    \
        .shown_type = type_, .shown_range = range_, .shown_def = def_, .unit = unit_,              \
        .help = help_                                                                              \
    }
#define ROW(name, kind, member, low, high, def_, unit_, help_)                                     \
    {                                                                                              \
        .key = name, .type = kind, .offset = AT(member), .min = low, .max = high, .def = def_,     \
        .unit = unit_, .help = help_                                                               \
    }
#define CHOICE(name, member, list, def_, help_)                                                    \
    {                                                                                              \
        .key = name, .type = SDM_FIELD_CHOICE, .offset = AT(member), .choices = list, .def = def_, \
        .unit = "", .help = help_                                                                  \
    }
// OF_KIND: a key that only some kinds of network have. BY_KIND: a key with a default that depends
// on the kind.
#define OF_KIND(which, type_, name, member, low, high, def_, unit_, help_)                         \
    {                                                                                              \
        .key = name, .type = type_, .offset = AT(member), .min = low, .max = high, .def = def_,    \
        .unit = unit_, .kinds = which, .help = help_                                               \
    }
#define BY_KIND(type_, name, member, low, high, unit_, list, help_)                                \
    {                                                                                              \
        .key = name, .type = type_, .offset = AT(member), .min = low, .max = high, .unit = unit_,  \
        .kind_defs = list, .help = help_                                                           \
    }
#define INT SDM_FIELD_INT
#define INT64 SDM_FIELD_INT64
#define REAL SDM_FIELD_REAL
#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

enum {
    POD = 1 << SDM_NETWORK_POD,
    SDMNN = 1 << SDM_NETWORK_SDMNN,
    DEEPSDF = 1 << SDM_NETWORK_DEEPSDF,
    IMNET = 1 << SDM_NETWORK_IMNET,
    TEMPLATE = 1 << SDM_NETWORK_TEMPLATE,
    AUTO = 1 << SDM_NETWORK_AUTO
};
enum { POINTS = DEEPSDF | IMNET, BASES = POD | TEMPLATE | AUTO };

// Defaults for pod, sdmnn, deepsdf (from Park et al. 2019), imnet (from Chen and Zhang 2019) and
// template (of its correction, a pod network) and auto (those of pod).
static const char *const
    DEPTH[] = {"3", "4", "8", "5", "0", "3"},
    *const WIDTH[] = {"128", "64", "512", "2048", "64", "128"}, *const BLOCK[] = {"4", "2", "4",
                                                                                  "4", "4", "4"},
    *const ACTIVATION[] = {"silu", "relu", "relu", "leaky_relu", "silu", "silu"},
    *const OUTPUT_TYPE[] = {"linear", "linear", "tanh", "linear", "linear", "linear"},
    *const WEIGHTS[] = {"i8", "f16", "f16", "f16", "i8", "i8"},
    *const BATCH[] = {"256", "8", "16", "16", "256", "256"}, *const RATE[] = {"3e-3", "1e-3",
                                                                              "5e-4", "5e-4",
                                                                              "3e-3", "3e-3"};

static const sdm_field SHAPE[] = {
    ROW("name", SDM_FIELD_TEXT, shape.name, 1, SDM_NAME_MAX - 1, NULL, "",
        "name of the shape; \"sdmgen shapes\" lists them"),
    SPECIAL(
        "options", sdm_read_key_options, sdm_dump_key_options, "mapping",
        "names of the shape's options", "none", "",
        "settings that are the same for all shapes of a run: mesh density, constants, data files"),
    SPECIAL("ranges", sdm_read_key_ranges, sdm_dump_key_ranges, "mapping", "parameter: [min, max]",
            "the shape's own", "",
            "parameter ranges on which the network is trained, within those of the shape"),
    SPECIAL("distribution", sdm_read_key_distribution, sdm_dump_key_distribution, "name or mapping",
            "shape, uniform, normal; or parameter: one of these or {mean: x, deviation: y}",
            "shape", "",
            "distribution of the parameters of random shapes, within their ranges; shape: as the "
            "shape states it"),
};

static bool has_size(const sdm_config *c) { return c->grid.n[0] > 0; }
static bool has_spacing(const sdm_config *c) { return c->grid.spacing[0] > 0; }
static bool has_voxels(const sdm_config *c) { return c->grid_voxels > 0; }
static bool has_near(const sdm_config *c) { return c->train.near_mm > 0; }
static bool has_clamp(const sdm_config *c) { return c->train.clamp_mm > 0; }

#define GRID_KEY(name, has_, range_, unit_, type_, def_, help_)                                    \
    {                                                                                              \
        .key = #name, .type = SDM_FIELD_SPECIAL, .read = sdm_read_key_##name,                      \
        .dump = sdm_dump_key_##name, .has = has_, .shown_type = type_, .shown_range = range_,      \
        .shown_def = def_, .unit = unit_, .help = help_                                            \
    }

static const sdm_field GRID[] = {
    GRID_KEY(size, has_size, "1 .. 1048576", "voxels", "3 integers", "from the shapes",
             "number of voxels along x, y and z; needs grid.spacing"),
    GRID_KEY(spacing, has_spacing, "1e-06 .. 1000000", "mm", "1 or 3 numbers", "from the shapes",
             "distance between neighbouring voxels; without grid.size the grid is fitted to the "
             "shapes"),
    GRID_KEY(origin, has_size, "-1e+09 .. 1e+09", "mm", "3 numbers", "from the centre",
             "centre of the first voxel; only with grid.size, not together with grid.centre"),
    SPECIAL("centre", sdm_read_key_centre, NULL, "3 numbers", "-1e+09 .. 1e+09",
            "[0, 0, 0]; without size from the shapes", "mm",
            "centre of the grid; only with grid.size, not together with grid.origin"),
    {.key = "voxels",
     .type = INT,
     .offset = AT(grid_voxels),
     .min = SDM_GRID_VOXELS_MIN,
     .max = 4096,
     .def = "60",
     .unit = "voxels",
     .has = has_voxels,
     .help = "largest number of voxels along the longest edge of a grid that is fitted to the "
             "shapes; not together with other keys of grid"},
};

static const sdm_field NETWORK[] = {
    CHOICE("kind", network.kind, SDM_KIND_CHOICES, "auto",
           "auto: pod or template, by short trials, or both, and the better one is kept; template: "
           "exact maps of the shape's parts, which move with the parts, and a correction by pod; "
           "pod: basis functions per block, with coefficients from polynomials and an MLP; sdmnn: "
           "3-D convolutional encoder-decoder; deepsdf, imnet: one distance per point, evaluated "
           "at every voxel"),
    BY_KIND(
        INT, "depth", network.depth, 0, 16, "layers", DEPTH,
        "number of hidden layers (pod: of the MLP, 0: polynomials only); sdmnn: number of levels"),
    BY_KIND(INT, "width", network.width, 8, 4096, "units", WIDTH,
            "units per hidden layer; imnet: of the first one, halved in each further layer"),
    OF_KIND(BASES, INT, "rank", network.rank, 1, 256, "9", "",
            "mean number of basis functions per block of the lowest level"),
    OF_KIND(BASES, INT, "levels", network.levels, 1, 8, "3", "levels",
            "number of levels of blocks; the edge of the blocks doubles from level to level"),
    {.key = "block",
     .type = INT,
     .offset = AT(network.block),
     .min = 1,
     .max = 16,
     .unit = "voxels",
     .kinds = BASES | SDMNN,
     .kind_defs = BLOCK,
     .help = "pod: edge of a block of the lowest level, at least 2; sdmnn: edge of a cell of the "
             "volume that the dense layers produce"},
    OF_KIND(BASES, INT, "modes", network.modes, 8, 2048, "512", "",
            "number of global modes in which the coefficients are learned"),
    OF_KIND(BASES, INT, "degree", network.degree, 0, 12, "6", "",
            "total degree of the polynomial part"),
    OF_KIND(BASES, INT, "input_degree", network.input_degree, 1, 8, "4", "",
            "total degree of the products of parameters that are inputs of the MLP"),
    OF_KIND(BASES, INT, "fine", network.fine, 0, 256, "0", "",
            "units of a hidden layer of the fine level, which corrects creases between the voxels "
            "(docs/grids.md); rounded up to a multiple of 4; 0: no fine level"),
    OF_KIND(SDMNN, INT, "channels", network.channels, 1, 512, "16", "",
            "channels of the first level, doubled in each further level"),
    OF_KIND(SDMNN, REAL, "dropout", network.dropout, 0, 0.9, "0.1", "",
            "fraction of units dropped at the two deepest levels during training"),
    {.key = "skip",
     .type = INT,
     .offset = AT(network.skip),
     .max = 15,
     .def = "4",
     .shown_def = "half of the depth",
     .unit = "",
     .kinds = DEEPSDF,
     .help = "hidden layer at which the input is fed in again; 0: none"},
    {.key = "output",
     .type = SDM_FIELD_CHOICE,
     .offset = AT(network.output),
     .choices = "linear|tanh",
     .unit = "",
     .kinds = POINTS,
     .kind_defs = OUTPUT_TYPE,
     .help = "activation of the output layer; tanh: bounded by the largest distance in the maps"},
    {.key = "activation",
     .type = SDM_FIELD_CHOICE,
     .offset = AT(network.activation),
     .choices = "silu|tanh|relu|leaky_relu",
     .unit = "",
     .kind_defs = ACTIVATION,
     .help = "activation of the hidden layers"},
    {.key = "weights",
     .type = SDM_FIELD_CHOICE,
     .offset = AT(network.weights),
     .choices = "f32|f16|i8",
     .unit = "",
     .kind_defs = WEIGHTS,
     .help = "type of the large weights in the model file; i8 (pod only): one byte per weight, two "
             "where one is not precise enough"},
};

static const sdm_field DATA[] = {
    {.key = "static",
     .type = SDM_FIELD_SPECIAL,
     .read = sdm_read_key_static,
     .dump = sdm_dump_key_static,
     .def = "auto",
     .shown_type = "integer or list",
     .shown_range = "auto, 0 .. 1000",
     .unit = "points",
     .help = "number of points along each parameter of the static grid, a regular grid over the "
             "ranges: one number for all or a list with one per parameter; 0: no static grid; "
             "auto: 5 to 2, by the number of parameters and the minutes (docs/configuration.md)"},
    ROW("online", INT64, data.online, 0, 1e7, "4096", "shapes",
        "random shapes generated during training"),
    ROW("start", INT64, data.start, 0, 1e6, "3456", "shapes",
        "random shapes generated before training starts, from which the bases are computed"),
    ROW("holdout", INT64, data.holdout, 1, 1e5, "100", "shapes",
        "random shapes that are not used for training, to measure the accuracy"),
    {.key = "sampling",
     .type = SDM_FIELD_CHOICE,
     .offset = AT(data.sampling),
     .choices = "uniform|error",
     .def = "uniform",
     .unit = "",
     .kinds = POD,
     .help =
         "uniform: the online shapes follow shape.distribution (Sobol'); error: they are denser "
         "where the error of the network is larger"},
    ROW("static_share", REAL, data.static_share, 0, 1, "0.1", "",
        "fraction of each batch drawn from the static grid"),
    ROW("memory_gb", REAL, data.memory_gb, 0.001, 1e6, "6", "GB", "memory budget for maps"),
    ROW("workers", INT, data.workers, 0, 1024, "0", "threads",
        "threads that generate online shapes; 0: half of the threads"),
};

static const sdm_field TRAIN[] = {
    ROW("minutes", REAL, train.minutes, 0, 1e6, "0", "min",
        "time budget, including data generation and evaluation (the maps of data.static and "
        "data.holdout are made in any case); 0: not limited by time"),
    ROW("steps", INT64, train.steps, 0, 1e12, "0", "steps",
        "budget of optimiser steps; 0: not limited by steps"),
    ROW("samples", INT64, train.samples, 0, 1e15, "0", "samples",
        "budget of samples (steps times batch); 0: not limited by samples"),
    BY_KIND(INT, "batch", train.batch, 1, 65536, "samples", BATCH, "maps per step"),
    OF_KIND(POINTS, INT, "points", train.points, 8, 1048576, "512", "voxels",
            "voxels drawn from each map in a step"),
    BY_KIND(REAL, "learning_rate", train.learning_rate, 1e-9, 1, "", RATE,
            "maximum learning rate of the cosine schedule"),
    ROW("warmup", REAL, train.warmup, 0, 0.5, "0.02", "",
        "fraction of the budget during which the learning rate increases"),
    CHOICE("loss", train.loss, "mse|l1|huber|clamped_l1", "mse",
           "training loss: squared, absolute or Huber error, or the absolute error of clamped "
           "distances"),
    {.key = "clamp_mm",
     .type = REAL,
     .offset = AT(train.clamp_mm),
     .max = 1e6,
     .def = "0",
     .shown_def = "half of grid.spacing",
     .unit = "mm",
     .has = has_clamp,
     .help = "clamped_l1: bound to which distances are clamped; 0: the default"},
    OF_KIND(SDMNN | POINTS, REAL, "eikonal", train.eikonal, 0, 1000, "0", "",
            "weight of the eikonal term, the squared deviation of the length of the gradient from "
            "1; 0: off"),
    ROW("near_weight", REAL, train.near_weight, 0, 100, "0", "",
        "extra weight w of voxels near the surface: they count 1 + w times; deepsdf, imnet: they "
        "are "
        "drawn 1 + w times as often"),
    {.key = "near_mm",
     .type = REAL,
     .offset = AT(train.near_mm),
     .max = 1e6,
     .def = "0",
     .shown_def = "twice grid.spacing",
     .unit = "mm",
     .has = has_near,
     .help = "voxels closer to the surface than this count as near; 0: the default"},
    OF_KIND(
        BASES, REAL, "refine", train.refine, 0, 1, "0.4", "",
        "last fraction of the budget, used for refinement: training end to end, decoder included"),
    OF_KIND(BASES, INT, "refine_batch", train.refine_batch, 1, 4096, "32", "samples",
            "samples per step during refinement"),
    OF_KIND(BASES, REAL, "refine_rate", train.refine_rate, 1e-9, 1, "3e-4", "",
            "learning rate during refinement"),
    ROW("patience", REAL, train.patience, 0, 1, "0.3", "",
        "a phase of the training ends early when the error on held-out shapes has not fallen by 1 "
        "% during this fraction of the phase's budget; 0: never"),
    ROW("average", REAL, train.average, 0, 0.99999, "0.998", "",
        "decay of the moving average of the weights; 0: no average"),
    ROW("evaluate_seconds", REAL, train.evaluate_seconds, 0.001, 1e6, "20", "s",
        "longest time between evaluations on held-out shapes; without train.minutes they are at "
        "the steps 10, 20, 50, 100, 200 and every 500 steps"),
    ROW("checkpoint_seconds", REAL, train.checkpoint_seconds, 0.001, 1e6, "60", "s",
        "time between checkpoints"),
};

static const sdm_field OUTPUT[] = {
    {.key = "folder",
     .type = SDM_FIELD_TEXT,
     .offset = AT(output.folder),
     .max = SDM_PATH_TEXT_MAX - 1,
     .shown_def = "runs/NAME, after the file",
     .unit = "",
     .help = "folder of the run: model, checkpoint, metrics, pictures"},
};

static const sdm_field TOP[] = {
    {.key = "seed",
     .type = SDM_FIELD_UINT64,
     .offset = AT(seed),
     .def = "1",
     .unit = "",
     .help = "seed of all random numbers of a run"},
    ROW("threads", INT, threads, 0, 1024, "0", "threads", "number of threads; 0: all"),
};

static const sdm_section SECTIONS[] = {
    {.name = "shape", .fields = SHAPE, .n_fields = COUNT(SHAPE)},
    {.name = "grid",
     .fields = GRID,
     .n_fields = COUNT(GRID),
     .word = "auto",
     .take_word = sdm_config_grid_auto},
    {.name = "network", .fields = NETWORK, .n_fields = COUNT(NETWORK)},
    {.name = "data", .fields = DATA, .n_fields = COUNT(DATA)},
    {.name = "train", .fields = TRAIN, .n_fields = COUNT(TRAIN)},
    {.name = "output", .fields = OUTPUT, .n_fields = COUNT(OUTPUT)},
    {.name = "", .fields = TOP, .n_fields = COUNT(TOP)},
};

const sdm_section *sdm_config_sections(size_t *n)
{
    *n = COUNT(SECTIONS);
    return SECTIONS;
}

/* For the three alternative budgets of `train`: given[] = where each was given, positive[] =
 * whether it is positive. */
static void budgets(sdm_reader *r, sdm_given *given[3], bool positive[3])
{
    static const char *const KEYS[3] = {"minutes", "steps", "samples"};
    for (int i = 0; i < 3; i++) given[i] = sdm_fields_given(r, "train", KEYS[i]);
    positive[0] = r->config->train.minutes > 0;
    positive[1] = r->config->train.steps > 0;
    positive[2] = r->config->train.samples > 0;
}

/* Was the value given by an argument of the command line? (Overrides in files have a line.) */
static bool is_argument(const sdm_given *given)
{
    return given->mark.override > 0 && given->mark.line == 0;
}

void sdm_config_settle_override(sdm_reader *r, int override)
{
    sdm_given *given[3];
    bool positive[3], replaces = false, argument = false;
    sdm_config_settle_grid(r, override);

    // a positive budget given by this override replaces the others
    budgets(r, given, positive);
    for (int i = 0; i < 3; i++) {
        if (!positive[i] || !sdm_given_by(given[i], override)) continue;
        replaces = true;
        argument |= is_argument(given[i]);
    }
    // two arguments that contradict each other both stay, so that check_budget() tells it
    bool stays[3];
    for (int i = 0; i < 3; i++)
        stays[i] =
            !replaces || given[i]->mark.override == override || (argument && is_argument(given[i]));
    if (!stays[0]) r->config->train.minutes = 0;
    if (!stays[1]) r->config->train.steps = 0;
    if (!stays[2]) r->config->train.samples = 0;
}

/* Records a mistake unless exactly one budget is positive. */
static void check_budget(sdm_reader *r, sdm_mark section)
{
    sdm_given *given[3];
    bool positive[3], refused = false;
    int n = 0, last = -1, zero = -1;
    budgets(r, given, positive);
    for (int i = 0; i < 3; i++) {
        refused |= given[i]->refused;
        if (!positive[i] && sdm_mark_is_set(given[i]->mark)) zero = i;
        if (!positive[i]) continue;
        n++;
        if (last < 0 || sdm_mark_is_later(given[i]->mark, given[last]->mark)) last = i;
    }
    if (n == 0 && !refused && zero >= 0)
        sdm_mistakes_add(r->mistakes, given[zero]->mark,
                         "the training has no budget: one of train.minutes, train.steps and "
                         "train.samples must be positive");
    else if (n == 0 && !refused && !sdm_fields_unknown(r, "train"))
        sdm_mistakes_add(
            r->mistakes, section,
            "missing key: one of train.minutes, train.steps and train.samples must be positive");
    if (n > 1)
        sdm_mistakes_add(
            r->mistakes, given[last]->mark,
            "only one of train.minutes, train.steps and train.samples may be positive, got %d", n);
}

/* Records a missing key as a mistake, unless the key was given. */
static void require(sdm_reader *r, const char *section, const char *key, sdm_mark mark,
                    const char *example)
{
    if (sdm_mark_is_set(sdm_fields_given(r, section, key)->mark) || sdm_fields_unknown(r, section))
        return;
    sdm_mistakes_add(r->mistakes, mark, "missing key '%s.%s'; e.g. %s", section, key, example);
}

/* Returns the position at which a section begins, or `top` if the section is missing. */
static sdm_mark section_place(const sdm_reader *r, const char *name, sdm_mark top)
{
    size_t s = 0;
    while (strcmp(r->sections[s].name, name) != 0) s++;
    return sdm_mark_is_set(r->section_mark[s]) ? r->section_mark[s] : top;
}

void sdm_config_finish(sdm_reader *r, sdm_mark top)
{
    require(r, "shape", "name", section_place(r, "shape", top), "name: cochlea");
    r->config->shape.mark = sdm_fields_given(r, "shape", "name")->mark;
    sdm_kinds_settle(r, section_place(r, "network", top));
    sdm_config_finish_grid(r, section_place(r, "grid", top));
    check_budget(r, section_place(r, "train", top));
}
