/* sdmgen generate: makes distance maps with a trained network. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "inputs/grid_cut.h"
#include "inputs/model_grade.h"
#include "inputs/points_file.h"
#include "inputs/points_unit.h"
#include "inputs/setup.h"
#include "measure/map_memory.h"
#include "measure/measures.h"
#include "measure/points_table.h"
#include "report/files.h"
#include "report/generate_files.h"
#include "report/json_values.h"
#include "report/output.h"
#include "report/progress_bar.h"
#include "report/terminal.h"
#include "sdm/field.h"
#include "sdm/image.h"
#include "sdm/internal/block_border.h"
#include "sdm/internal/checksum.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/config.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/threads.h"
#include "sdm/map.h"
#include "slicer/results_file.h"

/* The state of one call of the command. */
typedef struct job {
    const cli_args *args;
    sdm_registry *registry;
    /* for the exact engine and checks, and to compare surfaces with; NULL: not needed, or only to
       compare and not known */
    sdm_instance *shape;
    sdm_model *model;
    const sdm_model_info *info;
    sdm_param *params;
    double *rows; /* [n_rows][n_params] */
    int *lines;   /* [n_rows] lines of the rows in the table of --params; NULL: no table */
    size_t n_rows;
    sdm_grid grid;             /* of all maps */
    bool own;                  /* the grid is that of the model */
    bool thin;                 /* a part of the shapes is too thin for it, as was told */
    bool banded;               /* bands suffice: only level sets are wanted */
    double width;              /* of the bands, mm */
    sdm_blocks band;           /* of the last row */
    float *values;             /* [nz][ny][nx] mm; NULL: not needed yet */
    float *gradient;           /* [3][nz][ny][nx]; NULL: not wanted */
    float *jacobian;           /* [n_params][nz][ny][nx]; NULL: not wanted */
    double ms;                 /* total time of all maps */
    size_t n_clamped, n_exact; /* rows with clamped parameters; maps by the exact engine */
    size_t n_exact_error; /* maps by the exact engine since the network's error was too large */
    size_t n_checked;
    sdm_check check;   /* over checked rows: means of mean, bias and square; largest q95 and max */
    uint64_t hash;     /* CRC-64 of all maps */
    double volume;     /* of the last map, mm^3; NaN: of a band */
    cli_depths depths; /* of --depth */
    sdm_measures measures; /* of --measure */
} job;

/* The statistic of --error-of. */
static sdm_check_stat find_statistic(const cli_args *args)
{
    int stat = SDM_CHECK_MAX;
    while (args->error_of && stat < SDM_CHECK_MEAN &&
           strcmp(args->error_of, sdm_check_stat_name((sdm_check_stat)stat)))
        stat++;
    return (sdm_check_stat)stat;
}

static void job_dispose(job *j)
{
    sdm_blocks_dispose(&j->band);
    sdm_free(j->jacobian);
    sdm_free(j->gradient);
    sdm_free(j->values);
    sdm_free(j->lines);
    sdm_free(j->rows);
    sdm_free(j->params);
    sdm_model_free(j->model);
    sdm_instance_free(j->shape);
    sdm_registry_free(j->registry);
}

/* Checks the parameters of a row according to --policy. */
static sdm_status check_row(const job *j, const double *p, sdm_error *err)
{
    const size_t n = j->info->n_params;
    const sdm_range_policy policy = cli_policy(j->args);
    bool finite = true;
    for (size_t i = 0; i < n; i++) finite = finite && isfinite(p[i]);
    if (policy == SDM_RANGE_REFUSE || !finite)
        return cli_check_trained(j->args, j->model, j->params, p, err);
    if (policy == SDM_RANGE_EXACT && cli_check_range(j->params, n, p, NULL))
        return sdm_instance_check(j->shape, p, err);
    return SDM_OK;
}

/* Puts the place of the row in the table before the message. */
static sdm_status fail_row(const job *j, size_t row, sdm_status s, sdm_error *err)
{
    return j->lines ? sdm_fail_in(err, s, "%s:%d: row %zu", j->args->rows, j->lines[row], row + 1)
                    : s;
}

/* Checks every row before the first map is made, so that a mistake in any row stops the command at
 * once. */
static sdm_status check_rows(const job *j, sdm_error *err)
{
    for (size_t i = 0; i < j->n_rows; i++) {
        const sdm_status s = check_row(j, j->rows + i * j->info->n_params, err);
        if (s) return fail_row(j, i, s, err);
    }
    return SDM_OK;
}

/* Reads the parameters of every row; without --params there is one row. */
static sdm_status read_rows(job *j, sdm_error *err)
{
    const size_t n = j->info->n_params;
    double *base = NULL;
    sdm_status s = SDM_ALLOC(&base, n, "parameters", err);
    if (!s) s = cli_read_params(j->params, n, &j->args->params, base, err);
    if (!s && j->args->rows)
        s = cli_read_rows(j->args->rows, j->params, n, base, &j->args->params, &j->rows, &j->lines,
                          &j->n_rows, err);
    else if (!s) {
        j->rows = base;
        base = NULL;
        j->n_rows = 1;
    }
    sdm_free(base);
    return s;
}

/* Is a surface compared with the shape? A level set only if it is the only one. */
static bool compares_surface(const job *j)
{
    return cli_writes_surface(j->args) || (cli_writes_level_set(j->args) && j->n_rows == 1);
}

/* Warns if the shape of the model is that of a plug-in that was changed after the training. */
static void warn_changed(const job *j)
{
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    sdm_error why = {0};
    size_t i = 0;
    if (!cli_open_registry(j->args, &registry, NULL)) {
        while (i < sdm_registry_count(registry) &&
               strcmp(sdm_registry_at(registry, i)->name, j->info->shape))
            i++;
        if (i < sdm_registry_count(registry) &&
            strcmp(sdm_registry_origin(registry, i), "built in") &&
            sdm_runtime_instance(j->model, registry, &shape, &why) == SDM_E_PLUGIN)
            cli_warn("%s: %s", j->args->files.items[0], why.text);
    }
    sdm_instance_free(shape);
    sdm_registry_free(registry);
}

/* Creates the shape if --check, --max-error, --measure, --policy exact or --outside exact need
 * it; also, if it is known, to compare surfaces with. */
static sdm_status open_shape(job *j, sdm_error *err)
{
    const cli_args *args = j->args;
    const bool checks = args->check || args->max_error > 0 || args->measure;
    const bool exact =
        cli_policy(args) == SDM_RANGE_EXACT || cli_outside(args) == SDM_OUTSIDE_EXACT;
    if (!checks && !exact && !compares_surface(j)) {
        warn_changed(j);
        return SDM_OK;
    }
    sdm_error why = {0};
    sdm_status s = cli_open_registry(args, &j->registry, &why);
    if (!s) s = sdm_runtime_instance(j->model, j->registry, &j->shape, &why);
    if (!s) return SDM_OK;
    if (!checks && !exact) { // not needed: but a shape that is another one is told
        if (j->registry && sdm_registry_find(j->registry, j->info->shape, NULL))
            cli_warn("%s: %s", args->files.items[0], why.text);
        return SDM_OK;
    }
    if (err) *err = why;
    return checks ? sdm_fail_in(err, s, "--%s needs the exact shape",
                                args->check           ? "check"
                                : args->max_error > 0 ? "max-error"
                                                      : "measure")
                  : s;
}

/* Warns of labels of a model whose volumes are off by over 2 %. */
static void warn_label_volumes(const job *j)
{
    sdm_error why = {0};
    bool labels = false;
    for (size_t i = 0; i < j->args->outputs.n; i++)
        labels = labels || cli_ends_with(j->args->outputs.items[i], ".seg.nrrd");
    if (labels && sdm_model_check_use(j->model, SDM_USE_VOLUME, &why) == SDM_E_QUALITY)
        cli_warn("%s: %s", j->args->files.items[0], why.text);
}

/* Maps and points hold distances far from the surface, too. */
static void warn_far(const job *j)
{
    static const char *const maps[] = {".nii", ".nii.gz", ".nrrd", ".mha", ".npy"};
    sdm_error why = {0};
    bool far = j->args->points;
    for (size_t i = 0; i < j->args->outputs.n; i++)
        for (size_t k = 0; k < sizeof maps / sizeof *maps; k++)
            far = far || (cli_ends_with(j->args->outputs.items[i], maps[k]) &&
                          !cli_ends_with(j->args->outputs.items[i], ".seg.nrrd"));
    if (far && sdm_model_check_use(j->model, SDM_USE_DISTANCE, &why) == SDM_E_QUALITY)
        cli_warn("%s: %s", j->args->files.items[0], why.text);
}

/* Warns of the network, once parameters and options are known to be right. */
static void warn_model(job *j)
{
    const char *path = j->args->files.items[0];
    cli_warn_quality(path, j->info);
    if (!j->args->points) j->thin = cli_warn_thin_model(path, j->info, &j->grid);
    warn_label_volumes(j);
    warn_far(j);
}

/* Chooses the grid. On another grid than the model's, level sets alone need no whole maps. */
static sdm_status choose_grid(job *j, sdm_error *err)
{
    const cli_args *args = j->args;
    const sdm_status s = cli_model_grid(args, &j->info->grid, &j->grid, &j->own, err);
    if (s) return s;
    const bool whole = j->own || args->check || args->max_error > 0 || args->gradient ||
                       args->jacobian || cli_policy(args) == SDM_RANGE_EXACT;
    j->banded = !whole && cli_blocks_suffice(args);
    return j->banded ? cli_blocks_band(&j->grid, args, &j->width, err) : SDM_OK;
}

static sdm_status allocate_maps(job *j, sdm_error *err)
{
    const size_t n = sdm_grid_count(&j->grid);
    size_t count;
    if (j->banded) return SDM_OK;
    sdm_status s = cli_allocate_map(&j->grid, &j->values, err);
    if (!s && j->args->gradient) s = SDM_ALLOC(&j->gradient, 3 * n, "gradient", err);
    if (s || !j->args->jacobian) return s;
    s = sdm_mul(n, j->info->n_params, &count, err);
    return s ? s : SDM_ALLOC(&j->jacobian, count, "derivatives", err);
}

static sdm_status open_model(job *j, sdm_error *err)
{
    const sdm_status s = cli_open_model(j->args, j->args->files.items[0], &j->model, err);
    if (s) return s;
    j->info = sdm_model_get_info(j->model);
    return cli_model_params(j->info, &j->params, err);
}

/* Refuses options that would do nothing. */
static sdm_status check_options(const cli_args *args, sdm_error *err)
{
    const bool grid = args->size[0] > 0 || args->spacing[0] > 0 || !isnan(args->origin[0]) ||
                      !isnan(args->direction[0]) || args->like;
    if (args->columns && !args->points)
        return sdm_fail(err, SDM_E_ARG, "generate: --columns belongs to --points FILE");
    if ((args->measure || args->depths) && (args->points || args->rows))
        return sdm_fail(err, SDM_E_ARG,
                        "generate: --measure describes one shape: it does not go with --%s",
                        args->points ? "points" : "params");
    if (args->error_of && !(args->max_error > 0))
        return sdm_fail(err, SDM_E_ARG, "generate: --error-of does nothing without --max-error MM");
    if (cli_outside(args) != SDM_OUTSIDE_REFUSE && !grid && !args->points)
        return sdm_fail(
            err, SDM_E_ARG,
            "generate: --outside does nothing on the grid of the model; it is for "
            "another grid (--size, --spacing, --origin, --direction, --like) or --points");
    return cli_check_vdb_options(args, err);
}

/* Opens the model and checks everything before the first map is made. */
static sdm_status prepare_job(job *j, sdm_error *err)
{
    const cli_args *args = j->args;
    if (!args->outputs.n && !args->json && !args->gradient && !args->jacobian && !args->check &&
        !args->measure)
        return sdm_fail(err, SDM_E_ARG,
                        "generate: an output is needed: -o FILE, --gradient, --jacobian, --check, "
                        "--measure or --json");
    sdm_status s = open_model(j, err);
    if (!s) s = choose_grid(j, err);
    if (!s) s = read_rows(j, err);
    if (!s && !args->rows) s = cli_row_files_check(args, 1, err);
    if (!s) s = open_shape(j, err);
    if (!s) s = cli_read_depths(args, j->shape, &j->depths, err);
    if (!s) s = check_rows(j, err);
    // with --params: check the names of the files of the last row, which are the longest
    if (!s && args->rows) s = cli_row_files_check(args, j->n_rows, err);
    if (!s) warn_model(j);
    return s ? s : allocate_maps(j, err);
}

/* Compares surfaces with the mesh of the row, which is no error where it cannot be made. */
static void compare_shape(const job *j, size_t row, cli_map *map)
{
    sdm_mesh mesh = {0};
    if (!sdm_instance_mesh(j->shape, j->rows + row * j->info->n_params, &mesh, NULL))
        cli_map_compare(&mesh, map);
    sdm_mesh_dispose(&mesh);
}

static sdm_status write_maps(const job *j, size_t row, const sdm_result *result,
                             const cli_row_files *files, sdm_error *err)
{
    char origin[64];
    snprintf(origin, sizeof origin, "model %016llx", (unsigned long long)j->info->checksum);
    sdm_text params = {0};
    cli_add_params(j->params, j->info->n_params, j->rows + row * j->info->n_params, &params);
    sdm_status s =
        params.failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory for the metadata") : SDM_OK;
    cli_map map = {.grid = &j->grid,
                   .values = j->values,
                   .blocks = j->band.tile ? &j->band : NULL,
                   .shape = j->info->shape,
                   .params = params.data,
                   .source = result->source,
                   .clamped = result->clamped,
                   .error_mm = result->error_mm,
                   .thin = j->thin,
                   .origin = result->source == SDM_SOURCE_EXACT ? "exact" : origin,
                   .reason = result->reason,
                   .check = result->checked ? &result->check : NULL};
    if (result->source == SDM_SOURCE_NETWORK) {
        map.trained_mm = sdm_grid_coarsest(&j->info->grid);
        map.quality = &j->info->quality;
    }
    if (j->shape && compares_surface(j)) compare_shape(j, row, &map);
    if (!s) s = cli_write_maps(files->list.items, j->args->outputs.n, &map, j->args, err);
    sdm_text_dispose(&params);
    return s;
}

static sdm_status write_row(const job *j, size_t row, const sdm_result *result, sdm_error *err)
{
    const sdm_grid *g = &j->grid;
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1], nz = (size_t)g->n[2];
    cli_row_files files = {0};
    sdm_status s = cli_row_files_name(j->args, row + 1, &files, err);
    if (!s) s = write_maps(j, row, result, &files, err);
    if (!s && j->gradient)
        s = sdm_map_gradient(g, j->values, (int)j->args->threads, j->gradient, err);
    if (!s && j->gradient)
        s = sdm_npy_write(files.gradient, j->gradient, (const size_t[]){3, nz, ny, nx}, 4, err);
    if (!s && j->jacobian)
        s = sdm_npy_write(files.jacobian, j->jacobian,
                          (const size_t[]){j->info->n_params, nz, ny, nx}, 4, err);
    cli_row_files_dispose(&files);
    return s;
}

static void add_check(job *j, const sdm_check *c)
{
    sdm_check *all = &j->check;
    const double old = (double)j->n_checked++, n = old + 1;
    all->mean_mm = (old * all->mean_mm + c->mean_mm) / n;
    all->bias_mm = (old * all->bias_mm + c->bias_mm) / n;
    all->rmse_mm = sqrt((old * all->rmse_mm * all->rmse_mm + c->rmse_mm * c->rmse_mm) / n);
    if (!(c->q95_mm <= all->q95_mm)) all->q95_mm = c->q95_mm;
    if (!(c->max_mm <= all->max_mm)) all->max_mm = c->max_mm;
    all->used += c->used;
    all->outside += c->outside;
}

/* where = "row 2 (line 3): ", or "" without a table. */
static void name_row(const job *j, size_t row, char where[48])
{
    where[0] = 0;
    if (j->lines) snprintf(where, 48, "row %zu (line %d): ", row + 1, j->lines[row]);
}

/* Moves the parameters of the row into the trained range, with a notice. */
static void notice_clamped(const job *j, size_t row)
{
    char where[48], begin[128];
    name_row(j, row, where);
    snprintf(begin, sizeof begin,
             "%sparameters outside the trained range were clamped to it: ", where);
    cli_clamp(begin, j->params, j->info->n_params, j->rows + row * j->info->n_params);
}

/* Warns if the grid cuts the shape of the row, or if its voxels are too large for it. */
static void warn_cut(const job *j, size_t row)
{
    char where[48];
    name_row(j, row, where);
    if (j->values && !j->band.tile)
        cli_warn_cut_map(where, &j->grid, j->values,
                         j->own ? "train with grid: auto, or give --size or --spacing and "
                                  "--outside exact"
                                : "a larger grid (--size, --spacing, --origin) holds it");
    const char *mend = j->own ? "train with a smaller grid.spacing"
                              : "give a smaller --spacing; where the grid of the training is as "
                                "coarse, train with a smaller grid.spacing";
    if (j->band.tile)
        cli_warn_torn_blocks(where, &j->band, mend);
    else if (j->values)
        cli_warn_torn_map(where, &j->grid, j->values, mend);
}

/* Prints notices about a map by the exact engine and, with --check, the errors of the map. */
static void notice_row(const job *j, size_t row, const sdm_result *r)
{
    char where[48];
    name_row(j, row, where);
    if (r->reason == SDM_REASON_RANGE)
        cli_notice("%sparameters outside the trained range, computed by the exact engine", where);
    if (r->reason == SDM_REASON_ERROR)
        cli_notice("%serror of the network near the surface (%s) %.3g mm, above %g mm: computed by "
                   "the exact engine",
                   where, sdm_check_stat_name(find_statistic(j->args)),
                   sdm_check_get(&r->check, find_statistic(j->args)), j->args->max_error);
    if (!j->args->check || j->args->json) return;
    const sdm_check *c = &r->check;
    fputs(where, stdout);
    if (r->checked)
        printf("error near the surface: max %.3g, q95 %.3g, RMSE %.3g, mean %.3g, bias %.2g mm "
               "(%zu voxels)\n",
               c->max_mm, c->q95_mm, c->rmse_mm, c->mean_mm, c->bias_mm, c->used);
    else
        printf("exact\n");
}

/* Computes the band at the parameters p; leaves it empty if it reaches the border of the grid,
 * where only the whole map can be closed. */
static sdm_status make_band(job *j, const double *p, const sdm_generate_opts *opts,
                            sdm_result *result, sdm_error *err)
{
    sdm_blocks *b = &j->band;
    sdm_blocks_dispose(b);
    const sdm_status s = sdm_generate_band(j->model, p, opts, &j->grid, j->width, b, result, err);
    if (s) return s;
    if (!sdm_blocks_reach_border(b)) {
        j->hash = sdm_crc64(j->hash, b->values, b->n_block * sizeof *b->values);
        return SDM_OK;
    }
    sdm_blocks_dispose(b);
    return j->values ? SDM_OK : cli_allocate_map(&j->grid, &j->values, err);
}

/* Computes the map or the band at the parameters p and adds it to the hash. */
static sdm_status make_map(job *j, const double *p, const sdm_generate_opts *opts,
                           sdm_result *result, sdm_error *err)
{
    const sdm_model *m = j->model;
    sdm_status s = j->banded ? make_band(j, p, opts, result, err) : SDM_OK;
    if (s || j->band.tile) return s;
    if (!j->own)
        s = cli_explain_size(
            j->args, &j->info->grid, &j->grid,
            sdm_generate_grid(m, p, opts, &j->grid, j->values, j->jacobian, result, err), err);
    else if (j->jacobian)
        s = sdm_generate_jacobian(m, p, opts, j->values, j->jacobian, result, err);
    else
        s = sdm_generate(m, p, opts, j->values, result, err);
    if (!s) j->hash = sdm_crc64(j->hash, j->values, sdm_grid_count(&j->grid) * sizeof *j->values);
    return s;
}

static sdm_status make_row(job *j, size_t row, sdm_error *err)
{
    const cli_args *args = j->args;
    // check_rows() has refused rows out of range, so with --policy refuse the exact engine only
    // replaces maps whose error exceeds --max-error
    const sdm_range_policy policy = cli_policy(args);
    const sdm_generate_opts opts = {
        .policy = policy == SDM_RANGE_REFUSE && args->max_error > 0 ? SDM_RANGE_EXACT : policy,
        .exact_shape = j->shape,
        .n_threads = (int)args->threads,
        .check = args->check,
        .max_error_mm = args->max_error,
        .max_error_of = find_statistic(args),
        .outside = cli_outside(args)};
    // the map
    double *p = j->rows + row * j->info->n_params;
    sdm_result result = {0};
    const double start = sdm_clock();
    sdm_status s = make_map(j, p, &opts, &result, err);
    if (s) return fail_row(j, row, s, err);
    j->ms += 1e3 * (sdm_clock() - start);
    // the metadata must hold the clamped parameters
    if (result.clamped) notice_clamped(j, row);
    j->n_clamped += result.clamped;
    j->n_exact += result.source == SDM_SOURCE_EXACT;
    j->n_exact_error += result.reason == SDM_REASON_ERROR;
    if (result.checked) add_check(j, &result.check);
    notice_row(j, row, &result);
    warn_cut(j, row);
    j->volume = NAN;
    if ((args->json || args->measure) && !j->band.tile &&
        (s = sdm_map_volume(&j->grid, j->values, (int)args->threads, &j->volume, err)))
        return s;
    s = write_row(j, row, &result, err);
    if (!s && row == 0 && j->jacobian && result.source == SDM_SOURCE_NETWORK)
        cli_warn_derivatives(args->files.items[0], j->model);
    return s;
}

static void add_check_json(const job *j, sdm_json *json)
{
    const sdm_check *c = &j->check;
    sdm_json_open(json, "check", '{');
    sdm_json_int(json, "maps", (int64_t)j->n_checked);
    if (j->n_checked) {
        sdm_json_real(json, "max_mm", c->max_mm);
        sdm_json_real(json, "q95_mm", c->q95_mm);
        sdm_json_real(json, "rmse_mm", c->rmse_mm);
        sdm_json_real(json, "mean_mm", c->mean_mm);
        sdm_json_real(json, "bias_mm", c->bias_mm);
        sdm_json_int(json, "points", (int64_t)c->used);
        sdm_json_int(json, "outside", (int64_t)c->outside);
    }
    sdm_json_close(json, '}');
}

static sdm_status print_json(const job *j, sdm_error *err)
{
    char hash[32];
    snprintf(hash, sizeof hash, "%016llx", (unsigned long long)j->hash);
    sdm_json json = {0};
    sdm_json_open(&json, NULL, '{');
    sdm_json_text(&json, "model", j->args->files.items[0]);
    sdm_json_int(&json, "maps", (int64_t)j->n_rows);
    sdm_json_real(&json, "ms_per_map", j->ms / (double)j->n_rows);
    sdm_json_int(&json, "threads", sdm_threads((int)j->args->threads));
    sdm_json_int(&json, "clamped", (int64_t)j->n_clamped);
    sdm_json_int(&json, "exact", (int64_t)j->n_exact);
    sdm_json_int(&json, "exact_by_error", (int64_t)j->n_exact_error);
    if (j->shape && (j->args->check || j->args->max_error > 0)) add_check_json(j, &json);
    sdm_json_real(&json, "error_rmse_mm", j->info->accuracy.rmse_mm);
    sdm_json_real(&json, "error_between_mm", j->own ? 0 : j->info->quality.between_mm);
    if (j->n_rows == 1) {
        sdm_json_real(&json, "volume_mm3", j->volume);
        sdm_json_real(&json, "volume_error",
                      j->n_exact ? 0
                      : j->own   ? j->info->quality.volume_error
                                 : NAN);
    }
    if (j->args->measure) cli_json_measures(&j->measures, false, &json);
    sdm_json_text(&json, "values_crc64", hash);
    sdm_json_grid(&json, "grid", &j->grid, false);
    if (j->n_rows == 1) cli_json_params(&json, "parameters", j->params, j->info->n_params, j->rows);
    sdm_json_close(&json, '}');
    return cli_print_json(&json, err);
}

/* The volume of the map, where it is known, above the measures, which are those of the mesh. */
static void print_map_volume(const job *j)
{
    const double error = j->n_exact ? 0 : j->own ? j->info->quality.volume_error : NAN;
    if (isnan(j->volume)) return;
    char number[32];
    printf("volume of the map %s mm^3", cli_number(j->volume, 5, number));
    if (error > 0) printf(" (root mean square error %.2g %%)", 100 * error);
    printf("; of the exact mesh:\n");
}

/* Writes the file of --returnparameterfile: of the last row. */
static sdm_status write_results(const job *j, sdm_error *err)
{
    const size_t n = j->info->n_params;
    double deepest = NAN;
    cli_results r = {0};
    for (size_t i = 0; j->values && i < sdm_grid_count(&j->grid); i++)
        deepest = fmin(deepest, (double)j->values[i]);
    cli_results_params(&r, "parameters", j->params, n, j->rows + (j->n_rows - 1) * n);
    cli_results_real(&r, "error", j->n_exact ? 0 : j->info->accuracy.rmse_mm);
    cli_results_real(&r, "deepest", deepest);
    return cli_results_write(&r, j->args->returns, err);
}

/* The points of --points and what the network says there. */
typedef struct point_answers {
    double *x;     /* [n][3] */
    size_t *lines; /* [n] in the table of --points; NULL: no table */
    size_t n;
    float *values, *gradient, *slopes; /* [n], [n][3], [n][n_params]; NULL: not wanted */
} point_answers;

static sdm_status compute_points(job *j, bool slopes, point_answers *a, sdm_result *result,
                                 sdm_error *err)
{
    const sdm_generate_opts opts = {.policy = cli_policy(j->args),
                                    .exact_shape = j->shape,
                                    .n_threads = (int)j->args->threads,
                                    .outside = cli_outside(j->args)};
    size_t count;
    sdm_status s = SDM_ALLOC(&a->values, a->n, "distances", err);
    if (!s) s = SDM_ALLOC(&a->gradient, 3 * a->n, "gradients", err);
    if (!s && slopes) {
        s = sdm_mul(a->n, j->info->n_params, &count, err);
        if (!s) s = SDM_ALLOC(&a->slopes, count, "derivatives", err);
    }
    return s ? s
             : sdm_generate_points(j->model, j->rows, &opts, a->x, a->n, a->values, a->gradient,
                                   a->slopes, result, err);
}

/* Warns of points in another unit. The box of the model's grid stands for that of its shapes, which
 * are hardly smaller. */
static void warn_unit(const job *j, const point_answers *a)
{
    const sdm_box box = sdm_box_of_grid(&j->info->grid);
    cli_warn_points_unit(j->args->points, a->x, a->n, &box, "the model's grid");
}

/* Puts the line of the first point outside of the model's grid before the message. */
static sdm_status fail_point(const job *j, const point_answers *a, sdm_status s, sdm_error *err)
{
    for (size_t i = 0; i < a->n; i++)
        if (sdm_grid_beyond(&j->info->grid, a->x + 3 * i, NULL) > 0)
            return sdm_fail_in(err, s, "%s:%zu", j->args->points, a->lines[i]);
    return s;
}

static sdm_status write_points(const job *j, const point_answers *a, cli_points_table *t,
                               sdm_error *err)
{
    sdm_status s = cli_points_allocate(t, j->params, j->info->n_params, a->n, err);
    for (size_t i = 0; i < a->n && !s && t->at.distance; i++)
        t->at.distance[i] = (double)a->values[i];
    for (size_t i = 0; i < 3 * a->n && !s && t->at.gradient; i++)
        t->at.gradient[i] = (double)a->gradient[i];
    for (size_t i = 0; i < a->n * t->n_params && !s && t->slopes; i++)
        t->slopes[i] = (double)a->slopes[i];
    return s ? s : cli_points_write(t, a->x, j->args, err);
}

/* Longest edge of a voxel of the model's own grid, mm. */
static double own_voxel(const job *j)
{
    const double *h = j->info->grid.spacing;
    return fmax(h[0], fmax(h[1], h[2]));
}

/* What the stated error of the network leaves out between the voxels of its grid, and how to
 * measure it. */
static void notice_between(const job *j, const char *measure)
{
    const double between = j->info->quality.between_mm, rmse = j->info->accuracy.rmse_mm;
    if (isnan(between))
        cli_notice("the stated error, RMSE %.2g mm, is that at the voxels of the model's own grid; "
                   "interpolation between them adds to it, at creases up to sqrt(3)/2 of their "
                   "edge, %.2g mm; %s",
                   rmse, 0.866 * own_voxel(j), measure);
    else
        cli_notice("the stated error, RMSE %.2g mm, is that at the voxels of the model's own grid; "
                   "interpolation between them adds up to about %.2g mm RMS at the surface; %s",
                   rmse, between, measure);
}

/* Is x between the centres of the first and the last voxels? */
static bool in_box(const sdm_grid *g, const double x[3])
{
    double index[3];
    bool in = true;
    sdm_grid_index(g, x, index);
    for (int a = 0; a < 3; a++) in = in && index[a] >= 0 && index[a] <= (double)(g->n[a] - 1);
    return in;
}

/* Where two parts of the surface are equally far, as in the middle of a handle, the distance has a
 * ridge. A network rounds it off: its gradient is short there, and its distance too small. */
static void notice_ridges(const job *j, const point_answers *a)
{
    enum { PERCENT = 70 };
    size_t n = 0;
    for (size_t i = 0; i < a->n; i++) {
        const float *g = a->gradient + 3 * i;
        n += in_box(&j->info->grid, a->x + 3 * i) &&
             1e4f * (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) < PERCENT * PERCENT;
    }
    if (n)
        cli_notice("at %zu of %zu points the gradient is shorter than 0.%d: they lie about in the "
                   "middle between two parts of the surface, where distances of a network are "
                   "wrong, mostly too small; the errors that the training states are those near "
                   "the surface",
                   n, a->n, PERCENT / 10);
}

/* --outside bound gives less than the distance beyond the box of the network. */
static void notice_bounds(const job *j, const point_answers *a)
{
    size_t n = 0;
    if (cli_outside(j->args) != SDM_OUTSIDE_BOUND) return;
    for (size_t i = 0; i < a->n; i++) n += !in_box(&j->info->grid, a->x + 3 * i);
    if (n)
        cli_notice("%zu of %zu points lie outside of the box of the network: their values are "
                   "lower bounds of the distance (--outside exact computes distances)",
                   n, a->n);
}

/* The limits of answers by the network. */
static void tell_network(const job *j, const point_answers *a)
{
    if (a->slopes) cli_warn_derivatives(j->args->files.items[0], j->model);
    notice_ridges(j, a);
    notice_bounds(j, a);
    notice_between(j, "sdmgen exact --points computes exact distances");
}

/* Does the work of --points. */
static sdm_status run_points(job *j, sdm_error *err)
{
    cli_points_table table = {.n = 0};
    point_answers a = {.n = 0};
    sdm_result result = {0};
    sdm_status s = cli_points_check_model(j->args, &table, err);
    if (!s) s = open_model(j, err);
    if (!s) s = cli_read_points(j->args->points, &a.x, &a.lines, &a.n, err);
    if (!s) s = read_rows(j, err);
    if (!s) s = open_shape(j, err);
    if (!s) s = check_rows(j, err);
    if (!s) warn_model(j);
    if (!s) warn_unit(j, &a);
    if (!s) s = compute_points(j, table.wants_slopes, &a, &result, err);
    if (s == SDM_E_RANGE && a.lines) s = fail_point(j, &a, s, err);
    if (!s && result.clamped) notice_clamped(j, 0);
    if (!s) notice_row(j, 0, &result);
    if (!s) s = write_points(j, &a, &table, err);
    if (!s && result.source != SDM_SOURCE_EXACT) tell_network(j, &a);
    cli_points_dispose(&table);
    sdm_free(a.slopes);
    sdm_free(a.gradient);
    sdm_free(a.values);
    sdm_free(a.lines);
    sdm_free(a.x);
    return s;
}

/* Measures the shape, whose parameters --policy clamp may have moved, and prints the measures. */
static sdm_status measure(job *j, sdm_error *err)
{
    if (!j->args->measure) return SDM_OK;
    const cli_depths *d = &j->depths;
    const sdm_status s = sdm_shape_measure(j->shape, j->rows, d->mm, d->n, &j->measures, err);
    if (!s && !j->args->json && j->args->measure) {
        print_map_volume(j);
        cli_print_measures(&j->measures, false);
    }
    return s;
}

static sdm_status run_maps(job *j, sdm_error *err)
{
    cli_progress progress;
    sdm_status s = prepare_job(j, err);
    cli_progress_start(&progress);
    for (size_t i = 0; i < j->n_rows && !s; i++) {
        s = make_row(j, i, err);
        if (!s && i + 1 < j->n_rows) s = cli_check_interrupt(err);
        cli_progress_show(&progress, "generate", (double)(i + 1) / (double)j->n_rows, NULL);
    }
    cli_progress_end(&progress, !s);
    if (!s && !j->args->json && !j->own && !j->args->check && !(j->args->max_error > 0) &&
        j->n_exact < j->n_rows)
        notice_between(j, "--check measures this map");
    if (!s) s = measure(j, err);
    if (!s && j->args->json) s = print_json(j, err);
    return s ? s : write_results(j, err);
}

sdm_status cmd_generate(const cli_args *args, sdm_error *err)
{
    job j = {.args = args};
    sdm_status s = check_options(args, err);
    if (!s) s = args->points ? run_points(&j, err) : run_maps(&j, err);
    job_dispose(&j);
    return s;
}
