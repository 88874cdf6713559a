/* sdmgen generate: distance maps from a trained network. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "output.h"
#include "progress.h"
#include "sdm/checksum.h"
#include "sdm/config.h"
#include "sdm/memory.h"
#include "setup.h"
#include "terminal.h"

/* What one call works with. */
typedef struct job {
    const cli_args *args;
    sdm_registry *registry;
    sdm_instance *shape; /* for --policy exact, else NULL */
    sdm_model *model;
    const sdm_model_info *info;
    sdm_param *params;
    double *rows; /* [n_rows][n_params] */
    size_t n_rows;
    float *values;
    double ms; /* of all maps */
    size_t n_clamped, n_exact;
    uint64_t hash;
} job;

static sdm_range_policy policy_of(const char *name)
{
    return !strcmp(name, "clamp") ? SDM_RANGE_CLAMP : !strcmp(name, "exact") ? SDM_RANGE_EXACT : SDM_RANGE_REFUSE;
}

static void job_dispose(job *j)
{
    sdm_free(j->values);
    sdm_free(j->rows);
    sdm_free(j->params);
    sdm_model_free(j->model);
    sdm_instance_free(j->shape);
    sdm_registry_free(j->registry);
}

/* What the policy asks of a row. */
static sdm_status check_row(const job *j, const double *p, sdm_error *err)
{
    const size_t n = j->info->n_params;
    const sdm_range_policy policy = policy_of(j->args->policy);
    bool finite = true;
    for (size_t i = 0; i < n; i++) finite = finite && isfinite(p[i]);
    if (policy == SDM_RANGE_REFUSE || !finite) return cli_check_range(j->params, n, p, err);
    if (policy == SDM_RANGE_EXACT && cli_check_range(j->params, n, p, NULL))
        return sdm_instance_check(j->shape, p, err);
    return SDM_OK;
}

/* Every row, before the first map is made: all or nothing. */
static sdm_status check_rows(const job *j, sdm_error *err)
{
    for (size_t i = 0; i < j->n_rows; i++) {
        const sdm_status s = check_row(j, j->rows + i * j->info->n_params, err);
        if (s) return j->args->rows ? sdm_fail_in(err, s, "%s: row %zu", j->args->rows, i + 1) : s;
    }
    return SDM_OK;
}

/* Parameters of every row. */
static sdm_status read_rows(job *j, sdm_error *err)
{
    const size_t n = j->info->n_params;
    double *base = NULL;
    sdm_status s = SDM_ALLOC(&base, n, "parameters", err);
    if (!s) s = cli_read_params(j->params, n, &j->args->params, base, err);
    if (!s && j->args->rows)
        s = cli_read_rows(j->args->rows, j->params, n, base, &j->rows, &j->n_rows, err);
    else if (!s) {
        j->rows = base;
        base = NULL;
        j->n_rows = 1;
    }
    sdm_free(base);
    return s;
}

static sdm_status prepare(job *j, sdm_error *err)
{
    const cli_args *args = j->args;
    if (args->outputs.n == 0 && !args->json) return sdm_fail(err, SDM_E_ARG, "generate: an output is needed: -o FILE");
    sdm_status s = sdm_model_open(args->files.items[0], &j->model, err);
    if (s) return s;
    j->info = sdm_model_get_info(j->model);
    s = cli_model_params(j->info, &j->params, err);
    if (!s) s = read_rows(j, err);
    if (!s && !args->rows) s = cli_check_outputs(&args->outputs, false, err);
    if (!s && policy_of(args->policy) == SDM_RANGE_EXACT) {
        s = cli_open_registry(args, &j->registry, err);
        if (!s) s = sdm_runtime_instance(j->model, j->registry, &j->shape, err);
    }
    if (!s) s = check_rows(j, err);
    if (!s) s = SDM_ALLOC(&j->values, sdm_grid_count(&j->info->grid), "distance map", err);
    return s;
}

/* Checks the numbered names of all rows like those of a single map: the last ones too, before the first is made. */
static sdm_status check_numbered(const job *j, sdm_error *err)
{
    const size_t n = j->args->outputs.n;
    char *paths = NULL;
    const char **items = NULL;
    sdm_status s = SDM_ALLOC(&paths, n * SDM_PATH_TEXT_MAX, "names of the outputs", err);
    if (!s) s = SDM_ALLOC(&items, n, "names of the outputs", err);
    for (size_t i = 0; i < n && !s; i++) {
        items[i] = paths + i * SDM_PATH_TEXT_MAX;
        s = cli_number_path(j->args->outputs.items[i], j->n_rows, paths + i * SDM_PATH_TEXT_MAX, SDM_PATH_TEXT_MAX,
                            err);
    }
    if (!s) s = cli_check_outputs(&(cli_list){items, n}, false, err);
    sdm_free((void *)items);
    sdm_free(paths);
    return s;
}

static sdm_status write_row(const job *j, size_t row, const sdm_result *result, sdm_error *err)
{
    char origin[64], path[SDM_PATH_TEXT_MAX];
    snprintf(origin, sizeof origin, "model %016llx", (unsigned long long)j->info->checksum);
    sdm_text params = {0};
    cli_add_params(j->params, j->info->n_params, j->rows + row * j->info->n_params, &params);
    sdm_status s = params.failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory for the metadata") : SDM_OK;
    const cli_map map = {.grid = &j->info->grid,
                         .values = j->values,
                         .shape = j->info->shape,
                         .params = params.data,
                         .source = result->source,
                         .clamped = result->clamped,
                         .error_mm = result->error_mm,
                         .origin = result->source == SDM_SOURCE_EXACT ? "exact" : origin};
    for (size_t i = 0; i < j->args->outputs.n && !s; i++) {
        const char *name = j->args->outputs.items[i];
        if (j->args->rows) {
            s = cli_number_path(name, row + 1, path, sizeof path, err);
            name = path;
        }
        if (!s) s = cli_write_map(name, &map, j->args, err);
    }
    sdm_text_dispose(&params);
    return s;
}

static sdm_status make_row(job *j, size_t row, sdm_error *err)
{
    const sdm_generate_opts opts = {
        .policy = policy_of(j->args->policy), .exact_shape = j->shape, .n_threads = (int)j->args->threads};
    const size_t n = j->info->n_params, n_values = sdm_grid_count(&j->info->grid);
    sdm_result result = {0};
    const double start = cli_clock();
    const sdm_status s = sdm_generate(j->model, j->rows + row * n, &opts, j->values, &result, err);
    if (s) return j->args->rows ? sdm_fail_in(err, s, "%s: row %zu", j->args->rows, row + 1) : s;
    j->ms += 1e3 * (cli_clock() - start);
    j->n_clamped += result.clamped;
    j->n_exact += result.source == SDM_SOURCE_EXACT;
    j->hash = sdm_crc64(j->hash, j->values, n_values * sizeof *j->values);
    if (result.clamped) cli_notice("row %zu: parameters outside the trained range were moved into it", row + 1);
    if (result.source == SDM_SOURCE_EXACT)
        cli_notice("row %zu: parameters outside the trained range, computed by the exact engine", row + 1);
    return write_row(j, row, &result, err);
}

static sdm_status report(const job *j, sdm_error *err)
{
    if (!j->args->json) return SDM_OK;
    char hash[32];
    snprintf(hash, sizeof hash, "%016llx", (unsigned long long)j->hash);
    sdm_json json = {0};
    sdm_json_open(&json, NULL, '{');
    sdm_json_text(&json, "model", j->args->files.items[0]);
    sdm_json_int(&json, "maps", (int64_t)j->n_rows);
    sdm_json_real(&json, "ms_per_map", j->ms / (double)j->n_rows);
    sdm_json_int(&json, "threads", cli_threads(j->args->threads));
    sdm_json_int(&json, "clamped", (int64_t)j->n_clamped);
    sdm_json_int(&json, "exact", (int64_t)j->n_exact);
    sdm_json_real(&json, "error_rmse_mm", j->info->accuracy.rmse_mm);
    sdm_json_text(&json, "values_crc64", hash);
    cli_json_grid(&json, "grid", &j->info->grid);
    if (j->n_rows == 1) {
        sdm_json_open(&json, "parameters", '{');
        for (size_t i = 0; i < j->info->n_params; i++) sdm_json_real(&json, j->params[i].name, j->rows[i]);
        sdm_json_close(&json, '}');
    }
    sdm_json_close(&json, '}');
    return cli_print_json(&json, err);
}

sdm_status cmd_generate(const cli_args *args, sdm_error *err)
{
    job j = {.args = args};
    cli_progress progress;
    sdm_status s = prepare(&j, err);
    if (!s && args->rows) s = check_numbered(&j, err);
    cli_progress_start(&progress);
    for (size_t i = 0; i < j.n_rows && !s; i++) {
        s = make_row(&j, i, err);
        if (!s && i + 1 < j.n_rows) s = cli_check_interrupt(err);
        cli_progress_show(&progress, "generate", (double)(i + 1) / (double)j.n_rows, NULL);
    }
    cli_progress_clear(&progress);
    if (!s) s = report(&j, err);
    job_dispose(&j);
    return s;
}
