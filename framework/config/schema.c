/* The keys of the experiment configuration: one table a section, and the rules that span several keys. */
#include "schema.h"

#include <stddef.h>
#include <string.h>

#include "special.h"

#define AT(member) offsetof(sdm_config, member)
#define CHECK_ENUM(type) _Static_assert(sizeof(type) == sizeof(int), "a choice is stored as an int")
CHECK_ENUM(sdm_network_kind);
CHECK_ENUM(sdm_activation);
CHECK_ENUM(sdm_loss);
CHECK_ENUM(sdm_weight_type);

#define SPECIAL(name, reader, dumper, type_, range_, def_, unit_, help_)                                               \
    {                                                                                                                  \
        .key = name, .type = SDM_FIELD_SPECIAL, .read = reader, .dump = dumper, .shown_type = type_,                   \
        .shown_range = range_, .shown_def = def_, .unit = unit_, .help = help_                                         \
    }
#define ROW(name, kind, member, low, high, def_, unit_, help_)                                                         \
    {                                                                                                                  \
        .key = name, .type = kind, .offset = AT(member), .min = low, .max = high, .def = def_, .unit = unit_,          \
        .help = help_                                                                                                  \
    }
#define CHOICE(name, member, list, def_, help_)                                                                        \
    {                                                                                                                  \
        .key = name, .type = SDM_FIELD_CHOICE, .offset = AT(member), .choices = list, .def = def_, .unit = "",         \
        .help = help_                                                                                                  \
    }
#define INT SDM_FIELD_INT
#define INT64 SDM_FIELD_INT64
#define REAL SDM_FIELD_REAL
#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

// clang-format off
static const sdm_field SHAPE[] = {
    ROW("name", SDM_FIELD_TEXT, shape.name, 1, SDM_NAME_MAX - 1, NULL, "", "the shape; the command \"shapes\" lists them"),
    SPECIAL("options", sdm_read_key_options, sdm_dump_key_options, "mapping", "names of the shape's options", "none", "",
            "what is the same for all shapes of a run: mesh density, constants, data files"),
    SPECIAL("ranges", sdm_read_key_ranges, sdm_dump_key_ranges, "mapping", "parameter: [min, max]", "the shape's own", "",
            "ranges the network is trained on, within the shape's own"),
};

static const sdm_field GRID[] = {
    SPECIAL("size", sdm_read_key_size, sdm_dump_key_size, "3 integers", "1 .. 1048576", "required", "voxels",
            "number of voxels along x, y and z"),
    SPECIAL("spacing", sdm_read_key_spacing, sdm_dump_key_spacing, "1 or 3 numbers", "1e-06 .. 1000000", "required", "mm",
            "distance of neighbouring voxels"),
    SPECIAL("origin", sdm_read_key_origin, sdm_dump_key_origin, "3 numbers", "-1e+09 .. 1e+09", "from the centre", "mm",
            "centre of the first voxel; not together with grid.centre"),
    SPECIAL("centre", sdm_read_key_centre, NULL, "3 numbers", "-1e+09 .. 1e+09", "[0, 0, 0]", "mm",
            "middle of the box; not together with grid.origin"),
};

static const sdm_field NETWORK[] = {
    CHOICE("kind", network.kind, "pod", "pod", "kind of network; pod: bases per block, coefficients by polynomials and an MLP"),
    ROW("depth", INT, network.depth, 0, 16, "3", "layers", "hidden layers of the MLP; 0: polynomials only"),
    ROW("width", INT, network.width, 8, 1024, "128", "units", "units of a hidden layer"),
    ROW("rank", INT, network.rank, 1, 256, "24", "", "basis functions per block on average"),
    ROW("block", INT, network.block, 2, 16, "8", "voxels", "edge of a block"),
    ROW("modes", INT, network.modes, 8, 2048, "512", "", "global modes the coefficients are learned in"),
    ROW("degree", INT, network.degree, 0, 12, "6", "", "total degree of the polynomial part"),
    ROW("input_degree", INT, network.input_degree, 1, 8, "4", "", "total degree of the products of parameters fed to the MLP"),
    CHOICE("activation", network.activation, "silu|tanh|relu", "silu", "activation of the hidden layers"),
    CHOICE("weights", network.weights, "f32|f16", "f16", "type of the decoder's weights in the model file"),
};

static const sdm_field DATA[] = {
    {.key = "static", .type = SDM_FIELD_SPECIAL, .read = sdm_read_key_static, .dump = sdm_dump_key_static, .def = "5",
     .shown_type = "integer or list", .shown_range = "0 .. 1000", .unit = "points",
     .help = "points of the static grid along each parameter, one number for all or one a parameter; 0: no static grid"},
    ROW("online", INT64, data.online, 0, 1e7, "4096", "shapes", "random shapes made while training goes on"),
    ROW("start", INT64, data.start, 0, 1e6, "3456", "shapes", "random shapes made before training starts, for the bases"),
    ROW("holdout", INT64, data.holdout, 1, 1e5, "100", "shapes", "random shapes that are never trained on, for the accuracy"),
    ROW("static_share", REAL, data.static_share, 0, 1, "0.1", "", "share of each batch drawn from the static grid"),
    ROW("memory_gb", REAL, data.memory_gb, 0.001, 1e6, "6", "GB", "budget for maps kept in memory"),
    ROW("workers", INT, data.workers, 0, 1024, "0", "threads", "threads that make online samples; 0: half of the threads"),
};

static const sdm_field TRAIN[] = {
    ROW("minutes", REAL, train.minutes, 0, 1e6, "0", "min", "budget of time, data and evaluation included; 0: not by time"),
    ROW("steps", INT64, train.steps, 0, 1e12, "0", "steps", "budget of optimiser steps; 0: not by steps"),
    ROW("samples", INT64, train.samples, 0, 1e15, "0", "samples", "budget of samples (steps times batch); 0: not by samples"),
    ROW("batch", INT, train.batch, 1, 65536, "256", "samples", "samples of a step"),
    ROW("learning_rate", REAL, train.learning_rate, 1e-9, 1, "3e-3", "", "highest learning rate of the cosine schedule"),
    ROW("warmup", REAL, train.warmup, 0, 0.5, "0.02", "", "share of the budget in which the learning rate grows"),
    CHOICE("loss", train.loss, "mse|l1|huber", "mse", "what is made small: squared, absolute or Huber error"),
    ROW("near_weight", REAL, train.near_weight, 0, 100, "0", "", "extra weight of voxels near the surface"),
    ROW("near_mm", REAL, train.near_mm, 1e-6, 1e6, "0.4", "mm", "voxels nearer than this count as near"),
    ROW("refine", REAL, train.refine, 0, 1, "0.4", "", "last share of the budget, trained end to end, decoder included"),
    ROW("refine_batch", INT, train.refine_batch, 1, 4096, "32", "samples", "samples of a step in that share"),
    ROW("refine_rate", REAL, train.refine_rate, 1e-9, 1, "3e-4", "", "learning rate in that share"),
    ROW("average", REAL, train.average, 0, 0.99999, "0.998", "", "decay of the average of the weights; 0: no average"),
    ROW("evaluate_seconds", REAL, train.evaluate_seconds, 0.001, 1e6, "20", "s",
        "time between evaluations; every 500 steps when the budget is not a time"),
    ROW("checkpoint_seconds", REAL, train.checkpoint_seconds, 0.001, 1e6, "60", "s", "time between checkpoints"),
};

static const sdm_field OUTPUT[] = {
    {.key = "folder", .type = SDM_FIELD_TEXT, .offset = AT(output.folder), .max = SDM_PATH_TEXT_MAX - 1,
     .shown_def = "runs/NAME, after the file", .unit = "", .help = "folder of the run: model, checkpoint, metrics, pictures"},
};

static const sdm_field TOP[] = {
    {.key = "seed", .type = SDM_FIELD_UINT64, .offset = AT(seed), .def = "1", .unit = "", .help = "of all random numbers of a run"},
    ROW("threads", INT, threads, 0, 1024, "0", "threads", "threads to use; 0: all"),
};

static const sdm_section SECTIONS[] = {
    {.name = "shape", .fields = SHAPE, .n_fields = COUNT(SHAPE)},
    {.name = "grid", .fields = GRID, .n_fields = COUNT(GRID)},
    {.name = "network", .fields = NETWORK, .n_fields = COUNT(NETWORK)},
    {.name = "data", .fields = DATA, .n_fields = COUNT(DATA)},
    {.name = "train", .fields = TRAIN, .n_fields = COUNT(TRAIN)},
    {.name = "output", .fields = OUTPUT, .n_fields = COUNT(OUTPUT)},
    {.name = "", .fields = TOP, .n_fields = COUNT(TOP)},
};
// clang-format on

const sdm_section *sdm_config_sections(size_t *n)
{
    *n = COUNT(SECTIONS);
    return SECTIONS;
}

static bool by_override(const sdm_given *g, int override) { return g->mark.override == override && !g->refused; }

static void budgets(sdm_reader *r, sdm_given *given[3], bool positive[3])
{
    static const char *const KEYS[3] = {"minutes", "steps", "samples"};
    for (int i = 0; i < 3; i++) given[i] = sdm_fields_given(r, "train", KEYS[i]);
    positive[0] = r->config->train.minutes > 0;
    positive[1] = r->config->train.steps > 0;
    positive[2] = r->config->train.samples > 0;
}

void sdm_config_settle_override(sdm_reader *r, int override)
{
    sdm_given *given[3], *origin = sdm_fields_given(r, "grid", "origin"),
                         *centre = sdm_fields_given(r, "grid", "centre");
    bool positive[3], replaces = false;
    if (by_override(origin, override) && centre->mark.override != override) *centre = (sdm_given){0};
    if (by_override(centre, override) && origin->mark.override != override) *origin = (sdm_given){0};

    // a budget given here takes the place of the others
    budgets(r, given, positive);
    for (int i = 0; i < 3; i++) replaces |= positive[i] && by_override(given[i], override);
    if (!replaces) return;
    if (given[0]->mark.override != override) r->config->train.minutes = 0;
    if (given[1]->mark.override != override) r->config->train.steps = 0;
    if (given[2]->mark.override != override) r->config->train.samples = 0;
}

static bool is_later(sdm_mark a, sdm_mark b)
{
    if (a.override != b.override) return a.override > b.override;
    return a.line != b.line ? a.line > b.line : a.column > b.column;
}

static void check_budget(sdm_reader *r, sdm_mark section)
{
    sdm_given *given[3];
    bool positive[3], refused = false;
    int n = 0, last = -1;
    budgets(r, given, positive);
    for (int i = 0; i < 3; i++) {
        refused |= given[i]->refused;
        if (!positive[i]) continue;
        n++;
        if (last < 0 || is_later(given[i]->mark, given[last]->mark)) last = i;
    }
    if (n == 0 && !refused)
        sdm_mistakes_add(r->mistakes, section,
                         "missing key: one of train.minutes, train.steps and train.samples must be positive");
    if (n > 1)
        sdm_mistakes_add(r->mistakes, given[last]->mark,
                         "only one of train.minutes, train.steps and train.samples may be positive, got %d", n);
}

static void require(sdm_reader *r, const char *section, const char *key, sdm_mark mark, const char *example)
{
    if (sdm_mark_is_set(sdm_fields_given(r, section, key)->mark)) return;
    sdm_mistakes_add(r->mistakes, mark, "missing key '%s.%s'; e.g. %s", section, key, example);
}

static void finish_grid(sdm_reader *r, sdm_mark section)
{
    sdm_grid *g = &r->config->grid;
    sdm_given *origin = sdm_fields_given(r, "grid", "origin"), *centre = sdm_fields_given(r, "grid", "centre");
    require(r, "grid", "size", section, "size: [60, 50, 50]");
    require(r, "grid", "spacing", section, "spacing: 0.2");
    bool has_origin = sdm_mark_is_set(origin->mark), has_centre = sdm_mark_is_set(centre->mark);
    if (has_origin && has_centre)
        sdm_mistakes_add(r->mistakes, is_later(origin->mark, centre->mark) ? origin->mark : centre->mark,
                         "only one of grid.origin and grid.centre may be given");
    for (int i = 0; i < 9; i++) g->dir[i] = i % 4 == 0;
    if (!has_origin)
        for (int i = 0; i < 3; i++) g->origin[i] = r->centre[i] - 0.5 * (double)(g->n[i] - 1) * g->spacing[i];

    // sizes that were missing or refused are still 0
    sdm_error err;
    if (g->n[0] == 0 || !(g->spacing[0] > 0)) return;
    if (sdm_grid_check(g, &err))
        sdm_mistakes_add(r->mistakes, sdm_fields_given(r, "grid", "size")->mark, "grid.size: %.200s", err.text);
}

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
    finish_grid(r, section_place(r, "grid", top));
    check_budget(r, section_place(r, "train", top));
}
