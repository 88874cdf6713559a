/* Prepares the rows of an experiment: their configuration, shape, ranges and files. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "experiment_command.h"
#include "inputs/config_shape.h"
#include "sdm/internal/container.h"
#include "sdm/internal/file.h"
#include "sdm/internal/table.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"

static void describe_grid(const sdm_grid *g, char *buf, size_t size)
{
    const double *h = g->spacing;
    const int used = snprintf(buf, size, "%lld x %lld x %lld voxels of ", (long long)g->n[0],
                              (long long)g->n[1], (long long)g->n[2]);
    const bool same = h[0] == h[1] && h[0] == h[2];
    snprintf(buf + used, size - (size_t)used, same ? "%.4g mm" : "%.4g x %.4g x %.4g mm", h[0],
             h[1], h[2]);
}

/* The grid of the maps of a row. */
static sdm_grid row_grid(const sdm_experiment_row *row, const sdm_grid *trained)
{
    const int64_t finer = row->variant ? row->variant->finer : 1;
    sdm_grid g = *trained;
    for (int a = 0; a < 3; a++) {
        g.n[a] = (g.n[a] - 1) * finer + 1;
        g.spacing[a] /= (double)finer;
    }
    return g;
}

/* Checks that the published differences name parameters of the shape. */
static sdm_status check_reference(const cli_experiment_run *run, const cli_experiment_job *job,
                                  sdm_error *err)
{
    const sdm_experiment_reference *r = run->e->rows[job->index].reference;
    for (size_t i = 0; r && i < r->n_differences; i++)
        if (sdm_instance_param_index(job->shape, r->differences[i].name) < 0)
            return sdm_fail(err, SDM_E_CONFIG,
                            "%s:%d:%d: reference: difference: the shape has no parameter '%s'",
                            run->e->file, r->mark.line, r->mark.column, r->differences[i].name);
    return SDM_OK;
}

static sdm_status job_open(const cli_experiment_run *run, size_t index, cli_experiment_job *job,
                           sdm_error *err)
{
    job->index = index;
    sdm_status s = SDM_ALLOC(&job->config, 1, "configuration", err);
    if (!s) s = sdm_experiment_config(run->e, index, job->config, err);
    if (!s && run->args->threads > 0) job->config->threads = (int)run->args->threads;
    const sdm_experiment_row *row = &run->e->rows[index];
    if (!s)
        s = cli_experiment_path(run, *row->method->engine ? index : row->network_row, "",
                                job->config->output.folder, err);
    if (!s) s = cli_config_shape(job->config, run->registry, &job->shape, err);
    if (s) return s;
    cli_map_maker *m = &job->maker;
    const sdm_param *params = sdm_instance_params(job->shape, &m->n_params);
    m->shape = job->shape;
    m->grid = row_grid(row, &job->config->grid);
    describe_grid(&m->grid, run->results[index].grid, sizeof run->results[index].grid);
    s = sdm_train_ranges(job->config, job->shape, m->min, m->max, err);
    if (!s)
        s = sdm_train_distributions(job->config, job->shape, m->min, m->max, m->distribution, err);
    if (!s) s = check_reference(run, job, err);
    for (size_t i = 0; i < m->n_params && !s; i++)
        job->nominal[i] = fmin(m->max[i], fmax(m->min[i], params[i].def));
    return s;
}

sdm_status cli_experiment_job_open(const cli_experiment_run *run, size_t index,
                                   cli_experiment_job *job)
{
    return job->open_error.status = job_open(run, index, job, &job->open_error);
}

void cli_experiment_job_close(cli_experiment_job *job)
{
    sdm_instance_free(job->shape);
    sdm_free(job->config);
    memset(job, 0, sizeof *job);
}

sdm_status cli_experiment_path(const cli_experiment_run *run, size_t index, const char *name,
                               char path[SDM_PATH_TEXT_MAX], sdm_error *err)
{
    if (snprintf(path, SDM_PATH_TEXT_MAX, "%s/%s%s%s", run->folder, run->e->rows[index].folder,
                 *name ? "/" : "", name) < SDM_PATH_TEXT_MAX)
        return SDM_OK;
    return sdm_fail(err, SDM_E_ARG, "the folder '%.100s...': the name is too long", run->folder);
}

sdm_status cli_experiment_write_file(const cli_experiment_run *run, const char *name,
                                     const sdm_text *text, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX + 16];
    snprintf(path, sizeof path, "%s/%s", run->folder, name);
    return sdm_text_write(text, path, err);
}

/* *x = the keys of the configuration that affect its network. */
static void dump_network_keys(sdm_config *c, sdm_text *x)
{
    sdm_config_strip(c);
    sdm_config_dump(c, x);
}

/* True when the configurations a and text[size] give the same network; keys that do not affect it
 * are ignored. name: the source of the text. With network.kind: auto in `a`, the text may be that
 * of a kind that the trainer chose, with its part of the budget: see ASKED for the whole. */
static bool is_same_config(const sdm_config *a, const char *name, const char *text, size_t size)
{
    sdm_config *copy = NULL, *other = NULL;
    sdm_text x = {0}, y = {0};
    bool same = false;
    if (!SDM_ALLOC(&copy, 1, "configuration", NULL) &&
        !SDM_ALLOC(&other, 1, "configuration", NULL) &&
        !sdm_config_parse(name, text, size, NULL, 0, other, NULL)) {
        *copy = *a;
        const sdm_network_kind chosen = other->network.kind;
        if (a->network.kind == SDM_NETWORK_AUTO &&
            (chosen == SDM_NETWORK_POD || chosen == SDM_NETWORK_TEMPLATE)) {
            sdm_config_choose_kind(copy, chosen);
            copy->train.minutes = other->train.minutes;
            copy->train.steps = other->train.steps;
            copy->train.samples = other->train.samples;
        }
        dump_network_keys(copy, &x);
        dump_network_keys(other, &y);
        same = !x.failed && !y.failed && !strcmp(x.data, y.data);
    }
    sdm_text_dispose(&x);
    sdm_text_dispose(&y);
    sdm_free(copy);
    sdm_free(other);
    return same;
}

/* Name of the file in the folder of a row with network.kind: auto that holds the configuration as
 * the row states it: model and checkpoint hold the kind that the trainer chose, and its part of the
 * budget. Until the training is finished the file begins with the line UNFINISHED: a model beside
 * it may be that of the first of two kinds. */
#define ASKED "asked.yaml"
#define ASKED_BYTES_MAX (1 << 20)
#define UNFINISHED "# not finished\n"

/* True unless the row has network.kind: auto and its folder holds a training of another
 * configuration. *finished = false if it holds one of this configuration that was stopped. */
static bool is_same_asked(const cli_experiment_run *run, const cli_experiment_job *job, size_t row,
                          bool *finished)
{
    char path[SDM_PATH_TEXT_MAX];
    uint8_t *bytes = NULL;
    size_t size = 0;
    *finished = true;
    if (job->config->network.kind != SDM_NETWORK_AUTO) return true;
    const bool same = !cli_experiment_path(run, row, ASKED, path, NULL) &&
                      !sdm_file_read(path, ASKED_BYTES_MAX, &bytes, &size, NULL) &&
                      is_same_config(job->config, path, (const char *)bytes, size);
    *finished = !same || strncmp((const char *)bytes, UNFINISHED, strlen(UNFINISHED));
    sdm_free(bytes);
    return same;
}

/* Writes asked.yaml. */
static sdm_status write_asked(const cli_experiment_run *run, const cli_experiment_job *job,
                              bool finished, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX];
    sdm_config *c = NULL;
    sdm_text text = {0};
    sdm_status s = SDM_ALLOC(&c, 1, "configuration", err);
    if (!s) {
        *c = *job->config;
        sdm_text_add(&text, "%s", finished ? "" : UNFINISHED);
        dump_network_keys(c, &text);
        s = cli_experiment_path(run, job->index, ASKED, path, err);
    }
    if (!s) s = sdm_text_write(&text, path, err);
    sdm_text_dispose(&text);
    sdm_free(c);
    return s;
}

sdm_status cli_experiment_begin_asked(const cli_experiment_run *run, const cli_experiment_job *job,
                                      sdm_error *err)
{
    static const char *const REPLACED[] = {"model.sdm", "checkpoint.sdmc"};
    char path[SDM_PATH_TEXT_MAX];
    if (job->config->network.kind != SDM_NETWORK_AUTO) return SDM_OK;
    sdm_status s = SDM_OK;
    // they would belong to another asked.yaml
    for (size_t i = 0; i < sizeof REPLACED / sizeof *REPLACED && !s; i++) {
        s = cli_experiment_path(run, job->index, REPLACED[i], path, err);
        if (!s) unlink(path);
    }
    if (!s) s = sdm_make_folder(job->config->output.folder, err);
    return s ? s : write_asked(run, job, false, err);
}

sdm_status cli_experiment_end_asked(const cli_experiment_run *run, const cli_experiment_job *job,
                                    sdm_error *err)
{
    return job->config->network.kind == SDM_NETWORK_AUTO ? write_asked(run, job, true, err)
                                                         : SDM_OK;
}

static bool is_same_model(const sdm_config *c, const char *path)
{
    sdm_model *model = NULL;
    if (sdm_model_open(path, &model, NULL)) return false;
    const char *text = sdm_model_get_info(model)->config;
    const bool same = text && is_same_config(c, path, text, strlen(text));
    sdm_model_free(model);
    return same;
}

/* The checkpoint stores the configuration of its training. Its budget must also be the same:
 * continuing a checkpoint with another budget does not give the network of this row. */
static bool is_same_checkpoint(const sdm_config *c, const char *path)
{
    sdm_section section[SDM_CONTAINER_MAX_SECTIONS];
    char name[SDM_CONTAINER_MAX_SECTIONS][24];
    uint8_t *bytes = NULL;
    size_t size = 0, n = 0;
    uint64_t checksum;
    bool same = false;
    if (!sdm_file_read(path, (uint64_t)64 << 30, &bytes, &size, NULL) &&
        !sdm_container_parse(bytes, size, section, name, &n, &checksum, NULL))
        for (size_t i = 0; i < n; i++)
            if (!strcmp(name[i], "config"))
                same = is_same_config(c, path, section[i].data, section[i].size);
    sdm_free(bytes);
    return same;
}

cli_experiment_stored cli_experiment_find_stored(const cli_experiment_run *run,
                                                 const cli_experiment_job *job)
{
    char model[SDM_PATH_TEXT_MAX], checkpoint[SDM_PATH_TEXT_MAX];
    const size_t row = run->e->rows[job->index].network_row;
    if ((run->args->force && row == job->index) ||
        cli_experiment_path(run, row, "model.sdm", model, NULL) ||
        cli_experiment_path(run, row, "checkpoint.sdmc", checkpoint, NULL))
        return CLI_STORED_NONE;
    bool finished;
    if (is_same_asked(run, job, row, &finished)) {
        if (finished && is_same_model(job->config, model)) return CLI_STORED_MODEL;
        if (is_same_checkpoint(job->config, checkpoint)) return CLI_STORED_CHECKPOINT;
        if (!finished) return CLI_STORED_NONE;
    }
    return access(model, F_OK) && access(checkpoint, F_OK) ? CLI_STORED_NONE : CLI_STORED_OTHER;
}
