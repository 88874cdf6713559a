/* The tables of Slicer's modules, their files and their results. */
#include <string.h>

#include "slicer.h"

enum { FIT = 1, EXACT = 2, GENERATE = 4 };

/* arrays, tables and level sets, which Slicer does not read, and options of the terminal */
#define NOT_FOR_SLICER                                                                             \
    "params points columns gradient jacobian closest normal triangle dense half band json "        \
    "progress quiet help cases part claim "

const slicer_module slicer_modules[SLICER_N_MODULES] = {
    {"SdmgenFit", CLI_FIT, "Fit a shape (sdmgen)",
     "shape param option start-centre start-axis inside outside spacing region", NOT_FOR_SLICER},
    {"SdmgenExact", CLI_EXACT, "Exact distance map (sdmgen)", "shape param option size spacing",
     NOT_FOR_SLICER},
    {"SdmgenGenerate", CLI_GENERATE, "Distance map by a network (sdmgen)",
     "param size spacing policy", NOT_FOR_SLICER "check "}};

const slicer_file slicer_files[] = {
    {"model", NULL, "file", NULL, ".sdm", false, FIT | GENERATE, "Model",
     "trained network, model.sdm (a fit without one needs the name of a shape)"},
    {"image", NULL, "image", NULL, NULL, false, FIT, "Image", "the image to fit to"},
    {"labels", NULL, "image", "label", NULL, false, FIT, "or labels",
     "a label map to fit to instead of an image; the value 1, unless label says another one"},
    {"points", NULL, "geometry", NULL, ".vtp,.ply,.stl,.obj,.vtk", false, FIT, "or surface",
     "a surface to fit to instead of an image"},
    {"mesh", "mesh", "geometry", NULL, ".vtp,.ply,.stl,.obj,.vtk", false, EXACT, "Surface",
     "a surface; leave it empty for a shape by its name"},
    {"reference", "reference", "image", "label", NULL, false, FIT, "Reference labels",
     "a label map to compare the fitted shape with"},
    {"surface", "output", "geometry", NULL, ".vtp,.ply,.stl,.obj,.vtk", true, FIT | GENERATE,
     "Surface (output)", "the surface of the shape"},
    {"segmentation", "label-out", "image", "label", NULL, true, FIT, "Labels (output)",
     "the fitted shape as labels on the grid of the image"},
    {"distances", "output", "image", NULL, NULL, true, FIT | EXACT | GENERATE, "Distances (output)",
     "signed distances, mm, negative inside"},
    {"picture", "output", "file", NULL, ".png,.svg,.pdf", true, FIT, "Picture (output)",
     "the contour over three slices of the image"},
    {"results", "output", "file", NULL, ".json", true, FIT, "Results (output)",
     "all results as JSON"}};
const size_t slicer_n_files = sizeof slicer_files / sizeof *slicer_files;

const slicer_result slicer_results[] = {
    {"verdict", "Verdict", "passed, doubtful or failed", FIT},
    {"reasons", "Reasons", "the checks that did not pass", FIT},
    {"parameters", "Parameters", "name=value of each parameter of the shape", FIT | GENERATE},
    {"deviations", "Standard deviations", "name=value of each parameter", FIT},
    {"rotation", "Rotation", "rotation vector, rad", FIT},
    {"translation", "Translation", "LPS mm", FIT},
    {"dice", "Dice", "overlap with the reference labels, 0 .. 1; empty without them", FIT},
    {"volume", "Volume", "volume that the mesh encloses, mm^3", EXACT},
    {"closed", "Closed", "yes, or no: the mesh has open edges", EXACT},
    {"error", "Error",
     "bound of the error of the distances (exact), rms error on held-out shapes "
     "(network), mm",
     EXACT | GENERATE},
    {"deepest", "Deepest point", "smallest distance of the map, mm", EXACT | GENERATE}};
const size_t slicer_n_results = sizeof slicer_results / sizeof *slicer_results;

const slicer_module *slicer_find_module(const char *path)
{
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    for (size_t i = 0; i < SLICER_N_MODULES; i++)
        if (!strcmp(slicer_modules[i].name, name)) return &slicer_modules[i];
    return NULL;
}

bool slicer_has_word(const char *words, const char *word)
{
    const size_t length = strlen(word);
    for (const char *at = strstr(words, word); at; at = strstr(at + 1, word))
        if ((at == words || at[-1] == ' ') && (at[length] == ' ' || !at[length])) return true;
    return false;
}

static bool has_file(const slicer_module *m, const slicer_file *f)
{
    return (f->modules >> (m - slicer_modules) & 1u) != 0;
}

const slicer_file *slicer_find_file(const slicer_module *m, const char *flag, size_t length)
{
    for (size_t i = 0; i < slicer_n_files; i++) {
        const slicer_file *f = &slicer_files[i];
        if (has_file(m, f) && strlen(f->flag) == length && !strncmp(f->flag, flag, length))
            return f;
    }
    return NULL;
}

bool slicer_has_option(const slicer_module *m, const cli_option *o)
{
    if (!cli_option_fits(o, m->command) || slicer_has_word(m->omitted, o->name)) return false;
    if (!strcmp(o->name, "returnparameterfile")) return false;
    for (size_t i = 0; i < slicer_n_files; i++) {
        const slicer_file *f = &slicer_files[i];
        if (has_file(m, f) && f->option && !strcmp(f->option, o->name)) return false;
    }
    return true;
}
