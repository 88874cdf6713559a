/* The keys of an experiment: a field table for each section of the file and for the elements of
 * each list, and functions that read these lists. */
#include "experiment_schema.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "config_parse.h"
#include "overrides.h"
#include "sdm/memory.h"

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))
#define ROW(owner, name, kind, member, low, high, def_, unit_, help_)                              \
    {                                                                                              \
        .key = name, .type = kind, .offset = offsetof(owner, member), .min = low, .max = high,     \
        .def = def_, .unit = unit_, .help = help_                                                  \
    }
#define TEXT(owner, name, member, bytes, shown, help_)                                             \
    {                                                                                              \
        .key = name, .type = SDM_FIELD_TEXT, .offset = offsetof(owner, member), .max = (bytes)-1,  \
        .shown_def = shown, .unit = "", .help = help_                                              \
    }
#define SPECIAL(name, reader, type_, range_, def_, help_)                                          \
    {                                                                                              \
        .key = name, .type = SDM_FIELD_SPECIAL, .read = reader, .shown_type = type_,               \
        .shown_range = range_, .shown_def = def_, .unit = "", .help = help_                        \
    }

static const sdm_figure_info FIGURES[SDM_N_FIGURES] = {
    [SDM_FIGURE_MS] = {"ms", "one map", "ms", "time of one map on one core, without file access"},
    [SDM_FIGURE_MS_BATCH] = {"ms_batch", "one of a batch", "ms",
                             "time per map of a batch on one core"},
    [SDM_FIGURE_SPEEDUP] = {"speedup", "speed-up", "x",
                            "time of one map of the baseline divided by that of this method"},
    [SDM_FIGURE_MSE] = {"mse_mm2", "MSE", "mm^2", "mean squared error over all voxels and shapes"},
    [SDM_FIGURE_RMSE] = {"rmse_mm", "RMSE", "mm", "square root of the MSE"},
    [SDM_FIGURE_RMSE_NEAR] = {"rmse_near_mm", "RMSE near", "mm",
                              "RMSE over voxels within 0.4 mm of the surface"},
    [SDM_FIGURE_MAX] = {"max_abs_mm", "largest error", "mm",
                        "largest absolute error over all voxels and shapes"},
    [SDM_FIGURE_DICE] = {"dice", "Dice", "",
                         "Dice coefficient of the insides, mean over the shapes"},
    [SDM_FIGURE_SURFACE_MEAN] = {"surface_mean_mm", "surface", "mm",
                                 "mean distance between the surfaces at value 0"},
    [SDM_FIGURE_SURFACE_MAX] =
        {"surface_hausdorff_mm", "Hausdorff", "mm",
         "largest distance between the surfaces at value 0, mean over the shapes"},
    [SDM_FIGURE_TRAIN] = {"train_s", "training", "s", "time of the training"},
    [SDM_FIGURE_MODEL] = {"model_mb", "model", "MB", "size of the model file"},
    [SDM_FIGURE_PEAK] = {"peak_mb", "memory", "MB",
                         "peak resident memory for one map, including the map"},
    [SDM_FIGURE_SHAPES] = {"shapes", "shapes", "",
                           "number of shapes on which the errors are measured"},
    [SDM_FIGURE_FITS] = {"fits", "fits accepted", "",
                         "number of fits that are to be trusted, out of `shapes`"},
    [SDM_FIGURE_FIT] = {"fit_s", "one fit", "s", "mean time of a fit on one core"},
    [SDM_FIGURE_MAPS_NETWORK] = {"maps_network", "network maps", "",
                                 "maps with derivatives by the network, mean per fit"},
    [SDM_FIGURE_MAPS_EXACT] = {"maps_exact", "exact maps", "",
                               "maps with derivatives by the exact engine, mean per fit"},
    [SDM_FIGURE_WITHIN] = {"within_3sd", "within 3 sd", "",
                           "fraction of the estimates, over all parameters, within three standard "
                           "deviations of the truth"},
    [SDM_FIGURE_WITHIN_2] = {"within_2sd", "within 2 sd", "",
                             "the same for two standard deviations"},
};

const sdm_figure_info *sdm_figure_get_info(sdm_figure f)
{
    return (unsigned)f < SDM_N_FIGURES ? &FIGURES[f] : NULL;
}

static bool read_set(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                     const char *path);
static bool read_training(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                          const char *path);
static bool read_methods(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                         const char *path);
static bool read_variants(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                          const char *path);
static bool read_references(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                            const char *path);
static bool read_differences(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                             const char *path);

#define E sdm_experiment
static const sdm_field EXPERIMENT[] = {
    TEXT(E, "title", experiment.title, 256, "the file's name", "title above the table"),
    TEXT(E, "folder", experiment.folder, SDM_PATH_TEXT_MAX, "runs/NAME, after the file",
         "folder for the results"),
    ROW(E, "seed", SDM_FIELD_UINT64, experiment.seed, 0, 0, "1", "",
        "seed of the random test shapes; training has its own seed"),
    ROW(E, "samples", SDM_FIELD_INT64, experiment.samples, 1, 1e6, "100", "shapes",
        "random test shapes on which the errors of a network are measured"),
    ROW(E, "engine_samples", SDM_FIELD_INT64, experiment.engine_samples, 1, 1e6, "5", "shapes",
        "the same for an engine"),
    ROW(E, "minutes", SDM_FIELD_REAL, experiment.minutes, 0, 1e6, "0", "min",
        "time limit: no training is started that would end later; 0: no limit"),
    TEXT(E, "baseline", experiment.baseline, SDM_NAME_MAX, "none",
         "method to which the speed-up refers"),
    TEXT(E, "reference", experiment.reference, SDM_NAME_MAX, "reference",
         "column heading of the figures in `reference`"),
    {.key = "pictures",
     .type = SDM_FIELD_CHOICE,
     .offset = offsetof(E, experiment.pictures),
     .choices = "no|yes",
     .def = "yes",
     .unit = "",
     .help = "draw slices with contours, and surfaces, for every row"},
};

static const sdm_field FIT[] = {
    ROW(E, "phantoms", SDM_FIELD_INT64, fit.phantoms, 1, 1e4, "9", "images",
        "test images, of random shapes in random poses, for the methods with `fit`"),
    ROW(E, "off_mm", SDM_FIELD_REAL, fit.off_mm, 0, 1e6, "1", "mm",
        "distance of the start position from the true one, in a random direction"),
    ROW(E, "off_deg", SDM_FIELD_REAL, fit.off_deg, 0, 180, "15", "degrees",
        "angle of the start orientation from the true one, about a random axis"),
    ROW(E, "voxel", SDM_FIELD_REAL, fit.voxel, 1e-6, 1e6, "0.25", "mm", "voxel size of the images"),
    ROW(E, "range", SDM_FIELD_REAL, fit.range, 0, 1, "0.8", "",
        "fraction of the range of every parameter, about its middle, from which the shapes are "
        "drawn"),
    ROW(E, "prior_sd", SDM_FIELD_REAL, fit.prior_sd, 0, 1e6, "1", "",
        "standard deviation of the prior of every parameter: of a normal one in units of its "
        "deviation, about its mean; of another one in units of half its range, about the middle of "
        "the range; 0: no prior. Exact fits use distribution and range of the shape itself"),
    ROW(E, "eps", SDM_FIELD_REAL, fit.eps, 1e-12, 1e-4, "3e-6", "",
        "a fit with exact maps has converged when all steps are smaller than this: as fraction of "
        "a parameter range, in rad, as fraction of the size of the shape"),
    TEXT(E, "model", fit.model, SDM_PATH_TEXT_MAX, "none",
         "model file of the network for the fit; a path in this file is relative to its folder; "
         "none: the network is trained"),
};

static const sdm_field TOP[] = {
    TEXT(E, "base", base, SDM_NAME_MAX, "none",
         "training configuration on which all rows are based: the name of a file in the same "
         "folder"),
    SPECIAL("shape", read_training, "mapping", "keys of a training", "none",
            "as in a training configuration, for every row; overrides the base"),
    SPECIAL("grid", read_training, "mapping", "keys of a training", "none", "the same"),
    SPECIAL("network", read_training, "mapping", "keys of a training", "none", "the same"),
    SPECIAL("data", read_training, "mapping", "keys of a training", "none", "the same"),
    SPECIAL("train", read_training, "mapping", "keys of a training", "none", "the same"),
    SPECIAL("seed", read_training, "integer", "0 .. 18446744073709551615", "the base's",
            "seed of the training runs"),
    SPECIAL("threads", read_training, "integer", "0 .. 1024", "the base's",
            "threads of the training runs"),
    SPECIAL("methods", read_methods, "list", "1 to 64 methods", "required",
            "the methods to compare, each with the keys methods[]"),
    SPECIAL("variants", read_variants, "list", "0 to 64 variants", "none",
            "every method is run once for each variant"),
    SPECIAL("reference", read_references, "list", "0 to 64 references", "none",
            "figures reported by others, shown beside those of the row"),
};

#define M sdm_experiment_method
static const sdm_field METHOD[] = {
    TEXT(M, "name", name, SDM_NAME_MAX, "required", "title of the row of the method"),
    TEXT(M, "network", network, SDM_NAME_MAX, "none", "kind of network to train (network.kind)"),
    TEXT(M, "engine", engine, SDM_NAME_MAX, "none",
         "method without training: exact, naive, cells, octree, edt, or an external program: vtk, "
         "cgal, embree, openvdb, itk, scipy"),
    {.key = "fit",
     .type = SDM_FIELD_CHOICE,
     .offset = offsetof(M, fit),
     .choices = "none|network|polish|exact|naive",
     .def = "none",
     .unit = "",
     .help = "fit shapes to images. network: with maps of the network of this method; polish: the "
             "same with the last such network above, then with exact maps; exact: with exact maps; "
             "naive: not run, the cost of exact if the naive method made the maps"},
    TEXT(M, "shows", shows, SDM_NAME_MAX, "none",
         "fits: name of the method whose shape the test images show; the fits are then wrong and "
         "must be refused; none: its own"),
    {.key = "wrong",
     .type = SDM_FIELD_CHOICE,
     .offset = offsetof(M, wrong),
     .choices = "none|mirrored|moved|absent",
     .def = "none",
     .unit = "",
     .help = "fits: what else is wrong, so that they must be refused. mirrored: the images are "
             "mirror images; moved: the start lies beside the shape; absent: no shape is there"},
    {.key = "labels",
     .type = SDM_FIELD_CHOICE,
     .offset = offsetof(M, labels),
     .choices = "no|yes",
     .def = "no",
     .unit = "",
     .help = "fits: to labels in place of images"},
    ROW(M, "noise", SDM_FIELD_REAL, noise, 0, 100, "1", "",
        "fits: factor on noise and texture of the images"),
    ROW(M, "blur", SDM_FIELD_REAL, blur, 0, 100, "1", "", "fits: factor on the blur of the images"),
    ROW(M, "contrast", SDM_FIELD_REAL, contrast, 0.01, 100, "1", "",
        "fits: factor on the contrast of the images"),
    ROW(M, "samples", SDM_FIELD_INT64, samples, 0, 1e6, "0", "shapes",
        "shapes on which its errors are measured; 0: as given in experiment"),
    SPECIAL("set", read_set, "mapping", "keys of a training", "none",
            "keys of the training configuration for this method, e.g. {train.minutes: 4}"),
};

#define V sdm_experiment_variant
static const sdm_field VARIANT[] = {
    TEXT(V, "name", name, SDM_NAME_MAX, "required", "appended to the name of the method"),
    ROW(V, "finer", SDM_FIELD_INT64, finer, 1, 64, "1", "",
        "maps are made and measured with the spacing of the configuration divided by this number; "
        "networks are trained on the grid of the configuration, once for all variants that differ "
        "in this key alone"),
    SPECIAL("set", read_set, "mapping", "keys of a training", "none",
            "keys of the training configuration in this variant, e.g. {grid.spacing: 0.1}"),
};

#define R sdm_experiment_reference
#define FIGURE(name, which, help_)                                                                 \
    {                                                                                              \
        .key = name, .type = SDM_FIELD_REAL, .offset = offsetof(R, value[which]), .max = 1e12,     \
        .shown_def = "none", .unit = "", .help = help_                                             \
    }
static const sdm_field REFERENCE[] = {
    TEXT(R, "row", row, SDM_EXPERIMENT_TITLE_MAX, "required",
         "title of the row to which it belongs"),
    TEXT(R, "source", source, 256, "none", "source of the figures"),
    FIGURE("ms", SDM_FIGURE_MS, "ms, one map"),
    FIGURE("ms_batch", SDM_FIGURE_MS_BATCH, "ms, per map of a batch"),
    FIGURE("speedup", SDM_FIGURE_SPEEDUP, "times faster than the baseline"),
    FIGURE("mse_mm2", SDM_FIGURE_MSE, "mm^2"),
    FIGURE("rmse_mm", SDM_FIGURE_RMSE, "mm"),
    FIGURE("rmse_near_mm", SDM_FIGURE_RMSE_NEAR, "mm"),
    FIGURE("max_abs_mm", SDM_FIGURE_MAX, "mm"),
    FIGURE("dice", SDM_FIGURE_DICE, "0 .. 1"),
    FIGURE("surface_mean_mm", SDM_FIGURE_SURFACE_MEAN, "mm"),
    FIGURE("surface_hausdorff_mm", SDM_FIGURE_SURFACE_MAX, "mm"),
    FIGURE("train_s", SDM_FIGURE_TRAIN, "s"),
    FIGURE("model_mb", SDM_FIGURE_MODEL, "MB"),
    FIGURE("peak_mb", SDM_FIGURE_PEAK, "MB"),
    FIGURE("shapes", SDM_FIGURE_SHAPES, "number of shapes"),
    FIGURE("fits", SDM_FIGURE_FITS, "number of fits that converged"),
    FIGURE("fit_s", SDM_FIGURE_FIT, "s, one fit"),
    FIGURE("maps_network", SDM_FIGURE_MAPS_NETWORK, "maps per fit"),
    FIGURE("maps_exact", SDM_FIGURE_MAPS_EXACT, "maps per fit"),
    FIGURE("within_3sd", SDM_FIGURE_WITHIN, "0 .. 1"),
    FIGURE("within_2sd", SDM_FIGURE_WITHIN_2, "0 .. 1"),
    SPECIAL("difference", read_differences, "mapping", "names of parameters", "none",
            "mean absolute difference of each parameter from the exact fit, e.g. {a: 2e-8}"),
};

/* Indices in SECTIONS: first the sections of the file, then those of the elements of its lists. */
enum { N_FILE_SECTIONS = 3, OF_METHODS = N_FILE_SECTIONS, OF_VARIANTS, OF_REFERENCES };
static const sdm_section SECTIONS[] = {
    {.name = "experiment", .fields = EXPERIMENT, .n_fields = COUNT(EXPERIMENT)},
    {.name = "fit", .fields = FIT, .n_fields = COUNT(FIT)},
    {.name = "", .fields = TOP, .n_fields = COUNT(TOP)},
    {.name = "methods[]", .fields = METHOD, .n_fields = COUNT(METHOD)},
    {.name = "variants[]", .fields = VARIANT, .n_fields = COUNT(VARIANT)},
    {.name = "reference[]", .fields = REFERENCE, .n_fields = COUNT(REFERENCE)},
};

const sdm_section *sdm_experiment_sections(size_t *n)
{
    *n = N_FILE_SECTIONS;
    return SECTIONS;
}

void sdm_experiment_describe(bool markdown, sdm_text *out)
{
    sdm_fields_describe(SECTIONS, COUNT(SECTIONS), markdown, out);
}

bool sdm_experiment_is_training_key(const char *key, size_t length)
{
    static const char *const NAMES[] = {"shape", "grid", "network", "data",
                                        "train", "seed", "threads"};
    size_t first = 0;
    while (first < length && key[first] != '.') first++;
    for (size_t i = 0; i < COUNT(NAMES); i++)
        if (strlen(NAMES[i]) == first && !strncmp(key, NAMES[i], first)) return true;
    return false;
}

/* ---- keys of the training configuration ---- */

/* Adds the keys of a mapping to `set` as overrides. */
static bool add_keys(sdm_reader *r, sdm_overrides *set, const char *prefix,
                     const sdm_tree_node *node, const char *path)
{
    if (sdm_tree_is_empty(node)) return true; // all keys are commented out
    if (node->kind != SDM_TREE_MAP) return sdm_refuse_type(r, node, path, "keys with values");
    return sdm_overrides_add_tree(set, prefix, node, r->mistakes);
}

static bool read_set(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node, const char *path)
{
    const bool is_method = f == &METHOD[COUNT(METHOD) - 1];
    sdm_overrides *set = is_method ? &((M *)r->target)->set : &((V *)r->target)->set;
    return add_keys(r, set, "", node, path);
}

static bool read_training(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                          const char *path)
{
    E *e = r->target;
    const bool is_section = strcmp(f->key, "seed") != 0 && strcmp(f->key, "threads") != 0,
               is_word = !strcmp(f->key, "grid") && node->kind == SDM_TREE_SCALAR && *node->text;
    if (is_section && !is_word) return add_keys(r, &e->common, f->key, node, path);
    if (node->kind != SDM_TREE_SCALAR) return sdm_refuse_type(r, node, path, "an integer");
    sdm_tree_node one = *node;
    one.next = NULL;
    const sdm_tree_node alone = {
        .kind = SDM_TREE_MAP, .n_children = 1, .first = &one, .last = &one};
    return sdm_overrides_add_tree(&e->common, "", &alone, r->mistakes);
}

/* ---- lists ---- */

/* Reads the elements of a list into a new array (*array)[*n] with elements of `size` bytes, by the
 * field table of `section`; the first key of the table is required. begin() initialises an
 * element. */
static bool read_list(sdm_reader *r, const sdm_tree_node *node, const char *path,
                      const sdm_section *section, void **array, size_t *n, size_t size,
                      void (*begin)(void *element, sdm_mark mark))
{
    char wanted[64];
    bool fits = true;
    if (node->mark.override > 0) {
        sdm_mistakes_add(r->mistakes, node->mark, "%s: a list of the file cannot be replaced here",
                         path);
        return false;
    }
    snprintf(wanted, sizeof wanted, "a list of at most %d", SDM_EXPERIMENT_ROWS_MAX);
    if (node->kind != SDM_TREE_LIST || node->n_children > SDM_EXPERIMENT_ROWS_MAX)
        return sdm_refuse_type(r, node, path, wanted);
    if (sdm_alloc(array, node->n_children, size, path, NULL)) {
        sdm_mistakes_starve(r->mistakes);
        return false;
    }
    const sdm_section alone = {
        .name = "", .fields = section->fields, .n_fields = section->n_fields};
    for (const sdm_tree_node *child = node->first; child; child = child->next) {
        void *element = (char *)*array + size * (*n)++;
        const size_t before = r->mistakes->count;
        sdm_reader one = {
            .target = element, .mistakes = r->mistakes, .sections = &alone, .n_sections = 1};
        begin(element, child->mark);
        sdm_fields_set_defaults(&one);
        sdm_fields_read(&one, child);
        if (r->mistakes->count == before && !sdm_mark_is_set(one.given[0][0].mark))
            sdm_mistakes_add(r->mistakes, child->mark, "%s: missing key '%s'", path,
                             section->fields[0].key);
        fits &= r->mistakes->count == before;
    }
    return fits;
}

static void begin_method(void *element, sdm_mark mark) { ((M *)element)->mark = mark; }
static void begin_variant(void *element, sdm_mark mark) { ((V *)element)->mark = mark; }
static void begin_reference(void *element, sdm_mark mark)
{
    R *reference = element;
    reference->mark = mark;
    for (int i = 0; i < SDM_N_FIGURES; i++) reference->value[i] = NAN;
}

static bool refuse_method(sdm_reader *r, const M *m, const char *why)
{
    sdm_mistakes_add(r->mistakes, m->mark, "method '%s' %s", m->name, why);
    return false;
}

/* Checks the keys of a method with `fit`, and sets the engine of an exact or naive fit. */
static bool finish_fit(sdm_reader *r, M *m)
{
    if (m->fit == SDM_EXPERIMENT_FIT_NETWORK) {
        if (!*m->network || *m->engine)
            return refuse_method(r, m, "with fit: network needs the key network, no engine");
        return true;
    }
    if (*m->network || *m->engine)
        return refuse_method(r, m, "with this fit needs none of the keys network and engine");
    if (m->fit == SDM_EXPERIMENT_FIT_POLISH && m->set.n > 0)
        return refuse_method(r, m, "with fit: polish takes the network before it: no key set");
    if (m->fit != SDM_EXPERIMENT_FIT_POLISH)
        snprintf(m->engine, sizeof m->engine,
                 m->fit == SDM_EXPERIMENT_FIT_EXACT ? "exact" : "naive");
    return true;
}

static bool read_methods(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                         const char *path)
{
    E *e = r->target;
    (void)f;
    bool fits = read_list(r, node, path, &SECTIONS[OF_METHODS], (void **)&e->methods, &e->n_methods,
                          sizeof *e->methods, begin_method);
    for (size_t i = 0; i < e->n_methods && fits; i++) {
        M *m = &e->methods[i];
        if (m->fit)
            fits = finish_fit(r, m);
        else if ((*m->network != 0) == (*m->engine != 0))
            fits = refuse_method(r, m,
                                 *m->network ? "needs only one of the keys network and engine"
                                             : "needs one of the keys network and engine");
    }
    return fits;
}

static bool read_variants(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                          const char *path)
{
    E *e = r->target;
    (void)f;
    return read_list(r, node, path, &SECTIONS[OF_VARIANTS], (void **)&e->variants, &e->n_variants,
                     sizeof *e->variants, begin_variant);
}

static bool read_references(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                            const char *path)
{
    E *e = r->target;
    (void)f;
    return read_list(r, node, path, &SECTIONS[OF_REFERENCES], (void **)&e->references,
                     &e->n_references, sizeof *e->references, begin_reference);
}

/* Reads {PARAMETER: number, ...}; the shape is not known here, so the names are not checked. */
static bool read_differences(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                             const char *path)
{
    R *reference = r->target;
    bool fits = true;
    (void)f;
    if (node->kind != SDM_TREE_MAP || node->n_children > SDM_MAX_PARAMS)
        return sdm_refuse_type(r, node, path, "numbers by names of parameters");
    for (const sdm_tree_node *child = node->first; child; child = child->next) {
        const size_t i = reference->n_differences++;
        if (strlen(child->key) >= SDM_NAME_MAX)
            return sdm_refuse_type(r, child, path, "short names");
        snprintf(reference->differences[i].name, SDM_NAME_MAX, "%s", child->key);
        fits &= sdm_read_real(r, child, path, 0, 1e12, &reference->differences[i].value);
    }
    return fits;
}
