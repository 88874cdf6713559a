/* The grid that is fitted to the shapes of a configuration. */
#include <math.h>
#include <stdio.h>

#include "sdm/internal/part_audit.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/shape_survey.h"
#include "sdm/internal/text.h"
#include "sdm/internal/train.h"

enum { BOX_SAMPLES = 256, THIN_SAMPLES = 8, FACE_SAMPLES = 8, BOX_SEED = 1 };

/* Of the random shapes of `shapes check` so many are looked at here. */
enum { CHECK_SAMPLES = 32 };

/* `grid: auto` makes SDM_GRID_THIN_VOXELS voxels across the thinnest part of the shapes, as long as
 * the longest edge has at most VOXELS_MOST of them and the grid at most COUNT_MOST: maps and
 * training cost as much as there are voxels. A longer edge is allowed for LEAST_ACROSS voxels:
 * thinner parts are missing. */
enum { VOXELS_MOST = 96, VOXELS_END = 4096, LEAST_ACROSS = 2 };
static const double COUNT_MOST = 4e5;

/* So many voxels at most where the thinnest part would be missing with fewer: where sdm_too_thin()
 * holds, and `shapes check` warns. SHOWN: the voxels across it then. */
static const double COUNT_SHOWN = 1e6, SHOWN = 1.42;

/* A spacing that is finer by less than this factor is not proposed: it hardly shows more. */
static const double FINER_MIN = 1.1;

/* Most voxels of any fitted grid: a map of floats has 8 GB then. */
static const double COUNT_LIMIT = 2e9;

/* Most voxels of a grid that is proposed with the spacing of the configuration. */
static const double PROPOSED_MAX = 2.5e6;

/* A spacing that would give more voxels than this was probably meant in metres. */
static const double METRES = 1e11;

/* The shapes of a configuration: the ranges of their parameters, and the box that holds them. */
typedef struct family {
    double range[SDM_MAX_PARAMS][2], low[3], high[3];
} family;

static sdm_status find_family(const sdm_config *config, const sdm_instance *shape, family *f,
                              sdm_error *err)
{
    double min[SDM_MAX_PARAMS], max[SDM_MAX_PARAMS];
    size_t n;
    sdm_instance_params(shape, &n);
    const sdm_status s = sdm_train_ranges(config, shape, min, max, err);
    if (s) return s;
    for (size_t i = 0; i < n; i++) f->range[i][0] = min[i], f->range[i][1] = max[i];
    return sdm_shape_box(shape, (const double(*)[2])f->range, BOX_SAMPLES, BOX_SEED, f->low,
                         f->high, err);
}

/* Replaces *grid, which has SDM_GRID_VOXELS along its longest edge, by a finer one if the thinnest
 * part of the shapes, *thick mm, needs it: the grid of `grid: auto`. *limit = what keeps it from
 * SDM_GRID_THIN_VOXELS voxels across this part; NULL: nothing. */
static sdm_status refine_for_thin(const sdm_config *config, const sdm_instance *shape,
                                  const family *f, double *thick, const char **limit,
                                  sdm_grid *grid, sdm_error *err)
{
    size_t n_params;
    sdm_instance_params(shape, &n_params);
    sdm_status s = sdm_shape_thickness(shape, (const double(*)[2])f->range, THIN_SAMPLES, BOX_SEED,
                                       thick, err);
    for (int n = SDM_GRID_VOXELS + 4; n <= VOXELS_END && !s; n += 4) {
        sdm_grid finer;
        const double h = sdm_grid_coarsest(grid);
        *limit = NULL;
        if (isnan(*thick) || SDM_GRID_THIN_VOXELS * h <= *thick) break;
        *limit = n > VOXELS_MOST + 4
                     ? "no more than two voxels across it, as the longest edge has over 96"
                     : "at most 96 voxels along the longest edge";
        if (n > VOXELS_MOST && LEAST_ACROSS * h <= *thick) break;
        s = sdm_grid_around(f->low, f->high, n, NULL, &finer, err);
        if (s) break;
        *limit = "at most 400,000 voxels in all";
        if ((double)sdm_grid_count(&finer) > COUNT_MOST) break;
        *limit = "data.memory_gb does not hold maps of more voxels";
        if (!sdm_train_fits_memory(config, n_params, &finer)) break;
        *grid = finer;
    }
    return s;
}

/* *thick = the thickness of the thinnest part, mm, of the shapes that `shapes check` looks at
 * first; NaN: the grid shows it. */
static sdm_status find_missing(const sdm_config *config, const sdm_instance *shape, const family *f,
                               const sdm_grid *grid, double *thick, sdm_error *err)
{
    double min[SDM_MAX_PARAMS], max[SDM_MAX_PARAMS];
    sdm_distribution distribution[SDM_MAX_PARAMS];
    size_t n;
    *thick = NAN;
    sdm_instance_params(shape, &n);
    for (size_t i = 0; i < n; i++) min[i] = f->range[i][0], max[i] = f->range[i][1];
    sdm_status s = sdm_train_distributions(config, shape, min, max, distribution, err);
    if (s) return s;
    s = sdm_shape_thickness_ends(shape, (const double(*)[2])f->range, distribution, CHECK_SAMPLES,
                                 config->seed, (int)config->threads, thick, err);
    if (!sdm_too_thin(*thick, sdm_grid_coarsest(grid))) *thick = NAN;
    return s;
}

/* Replaces *grid by one that shows a part which is `thick` mm thick and too thin for it, if
 * COUNT_SHOWN voxels and the memory for maps are enough. Returns what keeps it from this; NULL:
 * nothing. */
static const char *show_part(const sdm_config *config, const sdm_instance *shape, const family *f,
                             double thick, sdm_grid *grid)
{
    size_t n_params;
    double longest = 0;
    sdm_instance_params(shape, &n_params);
    for (int i = 0; i < 3; i++) longest = fmax(longest, f->high[i] - f->low[i]);
    sdm_grid finer = *grid;
    for (int n = 8 + (int)(longest / sdm_grid_coarsest(grid));
         SHOWN * sdm_grid_coarsest(&finer) > thick; n += 4)
        if (n > VOXELS_END || sdm_grid_around(f->low, f->high, n, NULL, &finer, NULL) ||
            (double)sdm_grid_count(&finer) > COUNT_SHOWN)
            return "1,000,000 voxels, the most for a part that would be missing, do not show it";
    if (!sdm_train_fits_memory(config, n_params, &finer))
        return "data.memory_gb does not hold maps of the voxels that show it";
    *grid = finer;
    return NULL;
}

/* Moves the grid off the planes of faces that have the same place in all shapes. */
static sdm_status avoid_faces(const sdm_instance *shape, const family *f, sdm_grid *grid,
                              sdm_error *err)
{
    return sdm_grid_avoid_faces(shape, (const double(*)[2])f->range, FACE_SAMPLES, BOX_SEED, grid,
                                err);
}

static void add_three(sdm_text *out, const double v[3])
{
    sdm_text_add(out, "[%.10g, %.10g, %.10g]", v[0], v[1], v[2]);
}

/* Appends a spacing: "3" or "[3, 3, 4]". */
static void add_spacing(sdm_text *out, const sdm_grid *g)
{
    if (g->spacing[0] == g->spacing[1] && g->spacing[0] == g->spacing[2])
        sdm_text_add(out, "%.10g", g->spacing[0]);
    else
        add_three(out, g->spacing);
}

/* Appends the keys of a grid: "size: [59, 52, 37], spacing: 0.23, origin: [-6.1, -5.5, -2.1]". */
static void add_keys(sdm_text *out, const sdm_grid *g)
{
    sdm_text_add(out, "size: [%lld, %lld, %lld], spacing: ", (long long)g->n[0], (long long)g->n[1],
                 (long long)g->n[2]);
    add_spacing(out, g);
    sdm_text_add(out, ", origin: ");
    add_three(out, g->origin);
}

/* Refuses a spacing that makes more voxels than COUNT_LIMIT in the box of the shapes: most often it
 * is in metres. */
static sdm_status check_spacing(const sdm_config *config, const family *f, sdm_error *err)
{
    const double *h = config->grid.spacing;
    double voxels = 1, longest = 0, count = 0, finest = h[0];
    for (int i = 0; i < 3; i++) {
        const double edge = f->high[i] - f->low[i];
        voxels *= ceil(edge / h[i]) + 1 + 2 * SDM_GRID_MARGIN;
        longest = fmax(longest, edge);
        count = fmax(count, edge / h[i]);
        finest = fmin(finest, h[i]);
    }
    if (voxels <= COUNT_LIMIT) return SDM_OK;
    char metres[64] = "";
    const double as_metres = count / 1e3;
    if (as_metres >= 4 && as_metres <= 1000)
        snprintf(metres, sizeof metres, " (%.3g, if it was given in metres)", 1e3 * finest);
    return sdm_fail(err, SDM_E_CONFIG,
                    "%s: grid.spacing is %.3g mm, and the shape is %.3g mm long: that would be "
                    "%.2g voxels, at most %.0g are possible. Give the spacing in mm%s, or "
                    "grid.voxels, the number along the longest edge",
                    config->file, finest, longest, voxels, COUNT_LIMIT, metres);
}

/* Appends the spacing for the thinnest part, `thick` mm, with its price; or that no grid shows it.
 * limit: what keeps the grid coarser; finer: it has become finer for this part. */
static void propose_finer(const sdm_config *config, size_t n_params, const sdm_grid *grid,
                          const char *limit, bool finer, double thick, sdm_text *line)
{
    const double advised = thick / SDM_GRID_THIN_VOXELS,
                 voxels = pow(grid->spacing[0] / advised, 3) * (double)sdm_grid_count(grid);
    if (!(voxels <= COUNT_LIMIT)) {
        sdm_text_add(line,
                     "; %s; no grid shows the thinnest part, which is %.2g mm thick: is one of its "
                     "lengths 0, or not in mm?",
                     limit, thick);
        return;
    }
    sdm_text_add(line, "; %s; %s with grid: {spacing: %.2g}", limit,
                 finer ? "still finer" : "finer for the thinnest part", advised);
    sdm_train_add_price(config, n_params, grid, advised, line);
}

/* Appends why the voxels are smaller than usual. ends: the shapes were also those at the ends of
 * the ranges. */
static void add_reason(sdm_text *line, double spacing, double usual, bool ends, double thick)
{
    char shapes[80];
    snprintf(shapes, sizeof shapes,
             ends ? "the shapes, also at the ends of the ranges," : "%d random shapes",
             THIN_SAMPLES);
    sdm_text_add(line,
                 "; voxels of %.3g mm in place of %.3g, because the thinnest part of %s is %.2g mm "
                 "thick (grid.voxels: %d for the coarser grid)",
                 spacing, usual, shapes, thick, SDM_GRID_VOXELS);
}

sdm_status sdm_train_complete(sdm_config *config, const sdm_instance *shape, sdm_text *line,
                              sdm_error *err)
{
    size_t n_params = 0;
    sdm_instance_params(shape, &n_params);
    sdm_config_set_static(config, n_params);
    if (config->grid.n[0] > 0) return SDM_OK;
    const double *spacing = config->grid.spacing[0] > 0 ? config->grid.spacing : NULL;
    double thick = NAN;
    const char *limit = NULL;
    const bool fitted = config->grid_auto;
    double missing = NAN;
    family f;
    sdm_grid grid;
    sdm_status s = find_family(config, shape, &f, err);
    if (!s && spacing) s = check_spacing(config, &f, err);
    if (s) return s;
    s = sdm_grid_around(f.low, f.high, config->grid_voxels, spacing, &grid, err);
    if (s) return sdm_fail_in(err, SDM_E_CONFIG, "%s: grid", config->file);
    const double usual = grid.spacing[0];
    if (fitted) s = refine_for_thin(config, shape, &f, &thick, &limit, &grid, err);
    if (!s && fitted) s = find_missing(config, shape, &f, &grid, &missing, err);
    if (s) return s;
    if (missing > 0) {
        thick = missing;
        limit = show_part(config, shape, &f, thick, &grid);
    }
    s = avoid_faces(shape, &f, &grid, err);
    if (s) return s;
    const bool finer = grid.spacing[0] < usual;
    const double advised = thick / SDM_GRID_THIN_VOXELS;
    if (limit && grid.spacing[0] < FINER_MIN * advised) limit = NULL;
    sdm_config_set_grid(config, &grid);
    config->grid_fitted = fitted;
    if (!line) return SDM_OK;
    sdm_text_add(line, "grid: ");
    add_keys(line, &grid);
    sdm_text_add(line,
                 "; over the ranges the shape reaches from %.2f to %.2f mm in x, %.2f to %.2f in "
                 "y, %.2f to %.2f in z",
                 f.low[0], f.high[0], f.low[1], f.high[1], f.low[2], f.high[2]);
    if (finer) add_reason(line, grid.spacing[0], usual, missing > 0, thick);
    if (limit) propose_finer(config, n_params, &grid, limit, finer, thick, line);
    return line->failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory") : SDM_OK;
}

sdm_status sdm_train_grid_proposal(const sdm_config *config, const sdm_instance *shape,
                                   sdm_text *out, sdm_error *err)
{
    family f;
    sdm_grid grid;
    sdm_status s = find_family(config, shape, &f, err);
    if (s) return s;
    // the spacing stays, unless that makes very many voxels
    s = sdm_grid_around(f.low, f.high, 0, config->grid.spacing, &grid, NULL);
    const double voxels = s ? INFINITY : (double)sdm_grid_count(&grid);
    if (voxels <= PROPOSED_MAX) {
        s = avoid_faces(shape, &f, &grid, err);
        if (s) return s;
        sdm_text_add(out, "grid: {spacing: ");
        add_spacing(out, &grid);
        sdm_text_add(out, "} (");
    } else {
        double thick;
        const char *limit;
        s = sdm_grid_around(f.low, f.high, SDM_GRID_VOXELS, NULL, &grid, err);
        if (!s) s = refine_for_thin(config, shape, &f, &thick, &limit, &grid, err);
        if (!s) s = avoid_faces(shape, &f, &grid, err);
        if (s) return s;
        sdm_text_add(out, "grid: auto (");
    }
    add_keys(out, &grid);
    sdm_text_add(out, ")");
    if (voxels > PROPOSED_MAX && voxels < INFINITY)
        sdm_text_add(out, ", coarser than yours: with your spacing it has %.3g voxels%s", voxels,
                     voxels > METRES ? "; was it given in metres? It needs mm" : "");
    return out->failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory") : SDM_OK;
}
