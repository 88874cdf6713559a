/* Writes the model file with its measured accuracy, the configuration and the loss curve. */
#include "export_model.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "data/workbench.h"
#include "data_files.h"
#include "forecast.h"
#include "history.h"
#include "judge.h"
#include "kind.h"
#include "map_time.h"
#include "progress.h"
#include "sdm/internal/container.h"
#include "sdm/internal/file.h"
#include "sdm/internal/model_threads.h"
#include "sdm/internal/near.h"
#include "sdm/internal/shape_sums.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "shards/option_texts.h"

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return x < y ? -1 : x > y;
}

/* Nearest-rank quantile of n values in ascending order. */
static double quantile(const double *sorted, size_t n, double q)
{
    size_t i = (size_t)ceil(q * (double)n);
    return sorted[i ? i - 1 : 0];
}

/* The ranks that share the maps of the measurement of the model; NULL: each makes all. */
static sdm_comm *measurers(const trainer *t) { return t->kind->slow ? t->hooks.comm : NULL; }

/* The maps that the ranks make together: number i / ranks * ranks + rank by each of them. */
typedef struct model_maps {
    float *made, *map; // of this rank; that of the shape asked for last
    void *scratch;
} model_maps;

/* maps->map = that of the model for held-out shape i of n. All ranks call it for i = 0, 1, ... */
static sdm_status make_map(const trainer *t, const sdm_model *m, size_t i, size_t n,
                           const model_maps *maps, sdm_error *err)
{
    sdm_comm *comm = measurers(t);
    const dataset *d = &t->data;
    const size_t ranks = (size_t)sdm_comm_size(comm), v = sdm_grid_count(d->grid);
    const int rank = sdm_comm_rank(comm), maker = (int)(i % ranks);
    const size_t own = i - (size_t)maker + (size_t)rank;
    if (maker == 0 && own < n)
        sdm_model_forward_threads(m, d->holdout_params + own * d->n_params, 1, maps->made,
                                  maps->scratch, t->n_threads);
    if (maker == rank) memcpy(maps->map, maps->made, v * sizeof *maps->map);
    return sdm_comm_broadcast(comm, maker, maps->map, v * sizeof *maps->map, err);
}

/* Errors of the model on the first n held-out maps. */
static sdm_status measure_model(const trainer *t, const sdm_model *m, size_t n, sdm_accuracy *out,
                                model_errors *more, sdm_error *err)
{
    const dataset *d = &t->data;
    float *blocked = NULL;
    model_maps maps = {0};
    double *each = NULL;
    sdm_status s = SDM_ALLOC(&maps.map, sdm_grid_count(d->grid), "evaluation", err);
    if (!s) s = SDM_ALLOC(&maps.made, sdm_grid_count(d->grid), "evaluation", err);
    if (!s) s = SDM_ALLOC(&blocked, d->n_voxels, "evaluation", err);
    if (!s)
        s = sdm_alloc(&maps.scratch, sdm_model_scratch_bytes_threads(m, 1, t->n_threads), 1,
                      "evaluation", err);
    if (!s) s = SDM_ALLOC(&each, n, "evaluation", err);
    // a network that learns other maps is compared with exact maps, which are made again
    workbench w = {0};
    if (!s && d->target.make) s = trainer_workbench_create(&w, d, err);
    const size_t n_voxels = sdm_grid_count(d->grid);
    const double voxel = trainer_dataset_voxel(d);
    const float near_mm = (float)sdm_grid_near(d->grid);
    double square = 0, absolute = 0, near = 0, largest = 0, at_surface = 0, dice = 0, dice_min = 1;
    // far from the surface: sums of squares outside and inside, and the largest error
    double far[2] = {0, 0}, far_largest = NAN;
    double largest_at = 0; // exact distance where the error is largest
    size_t n_near = 0, n_at_surface = 0, n_far[2] = {0, 0};
    // sum the errors over maps and voxels
    for (size_t i = 0; i < n && !s; i++) {
        if ((s = make_map(t, m, i, n, &maps, err))) break;
        const float *truth = d->holdout + i * d->n_voxels, *values = blocked;
        if (d->target.make) {
            s = trainer_workbench_exact(&w, d, d->holdout_params + i * d->n_params, err);
            if (s) break;
            truth = w.exact, values = maps.map;
        } else {
            sdm_pod_gather(d->grid, t->blocks, d->n_blocks, maps.map, blocked);
        }
        double here = 0;
        size_t inside = 0, both = 0; // voxels inside: of the two maps together, and of both
        for (size_t v = 0; v < n_voxels; v++) {
            const double e = (double)values[v] - truth[v];
            here += e * e;
            absolute += fabs(e);
            if (fabs(e) > largest) largest = fabs(e), largest_at = (double)truth[v];
            if (fabsf(truth[v]) <= near_mm)
                near += e * e, n_near++;
            else
                far[truth[v] < 0] += e * e, n_far[truth[v] < 0]++,
                    far_largest = fmax(far_largest, fabs(e));
            if (fabs((double)truth[v]) <= voxel) at_surface += e * e, n_at_surface++;
            const bool known = sdm_inside_beside(truth[v], values[v], (float)voxel);
            inside += (size_t)known + (size_t)(values[v] < 0);
            both += known && values[v] < 0;
        }
        const double overlap = inside ? 2 * (double)both / (double)inside : 1;
        dice += overlap;
        dice_min = fmin(dice_min, overlap);
        square += here;
        each[i] = sqrt(here / (double)n_voxels);
    }
    // means and quantiles
    if (!s) {
        const double voxels = (double)n * (double)n_voxels;
        qsort(each, n, sizeof *each, compare_doubles);
        *out = (sdm_accuracy){.samples = (int64_t)n,
                              .mse_mm2 = square / voxels,
                              .rmse_mm = sqrt(square / voxels),
                              .mae_mm = absolute / voxels,
                              .max_abs_mm = largest,
                              .rmse_near_mm = n_near ? sqrt(near / (double)n_near) : 0,
                              .q50_mm = quantile(each, n, 0.5),
                              .q90_mm = quantile(each, n, 0.9),
                              .q99_mm = quantile(each, n, 0.99),
                              .near_mm = sdm_grid_near(d->grid)};
        *more = (model_errors){.rmse_voxel_mm =
                                   n_at_surface ? sqrt(at_surface / (double)n_at_surface) : 0,
                               .dice = dice / (double)n,
                               .dice_min = dice_min,
                               .rmse_inside_mm = sqrt(far[1] / (double)n_far[1]),
                               .rmse_outside_mm = sqrt(far[0] / (double)n_far[0]),
                               .far_mm2 = (far[0] + far[1]) / voxels,
                               .largest_at_mm = largest_at,
                               .far_largest_mm = far_largest};
    }
    trainer_workbench_dispose(&w);
    sdm_free(each);
    sdm_free(maps.scratch);
    sdm_free(blocked);
    sdm_free(maps.made);
    sdm_free(maps.map);
    return s;
}

/* Refuses texts that a model file has no room for. */
static sdm_status check_texts(const trainer *t, sdm_error *err)
{
    enum { VALUE_MAX = 1000 };
    size_t n;
    const sdm_param *params = sdm_instance_params(t->shape, &n);
    for (size_t i = 0; i < n; i++)
        if (strlen(params[i].name) >= SDM_MODEL_NAME_MAX ||
            strlen(params[i].unit) >= sizeof((sdm_model_param *)0)->unit ||
            strpbrk(params[i].unit, "\r\n"))
            return sdm_fail(
                err, SDM_E_PLUGIN,
                "parameter '%.100s' in '%.100s': name or unit is too long for a model file",
                params[i].name, params[i].unit);
    const sdm_shape *shape = sdm_instance_shape(t->shape);
    const sdm_option_value *values = sdm_instance_options(t->shape);
    for (uint32_t i = 0; i < shape->n_options; i++)
        if (values[i].text &&
            (strlen(values[i].text) > VALUE_MAX || strpbrk(values[i].text, "\r\n")))
            return sdm_fail(err, SDM_E_CONFIG,
                            "%s: shape.options.%s is longer than %d characters or has a line break",
                            t->config->file, shape->options[i].name, VALUE_MAX);
    return SDM_OK;
}

sdm_status trainer_export_prepare(trainer *t, sdm_error *err)
{
    // the model stores them, so that the exact engine cannot be used with other files later
    trainer_option_sums(t->shape, t->file_sums);
    return check_texts(t, err);
}

/* loss.png, from the lines of metrics.jsonl. */
static sdm_status curve_write(const trainer *t, sdm_error *err)
{
    history h;
    sdm_status s = trainer_history_read(t, &h, err);
    if (!s) s = trainer_history_picture(t, &h, err);
    trainer_history_dispose(&h);
    return s;
}

sdm_status trainer_export_dump(const trainer *t, sdm_text *out, sdm_error *err)
{
    sdm_config *c = NULL;
    sdm_status s = SDM_ALLOC(&c, 1, "resolved config", err);
    if (s) return s;
    *c = *t->config;
    sdm_config_strip(c);
    sdm_config_dump(c, out);
    if (out->failed)
        s = sdm_fail(err, SDM_E_NOMEM, "no memory for the resolved config");
    else // parse it back: a path that is not UTF-8, for example, would make checkpoints unreadable
        s = sdm_config_parse("config.yaml", out->data, out->size, NULL, 0, c, err);
    sdm_free(c);
    return s;
}

sdm_status trainer_export_config(const trainer *t, sdm_outfile **out, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX + 32];
    snprintf(path, sizeof path, "%s/config.yaml", t->folder);
    sdm_text config = {0};
    sdm_status s = trainer_export_dump(t, &config, err);
    if (!s) s = sdm_outfile_open(path, out, err);
    if (!s) s = sdm_outfile_write(*out, config.data, config.size, err);
    sdm_text_dispose(&config);
    return s;
}

/* Fills params[P], *options and *info with the description of shape, grid and training for the
 * model file. The pointers in *info refer to the other arguments. file: names of the data files,
 * see trainer_option_texts(). */
static void describe_model(const trainer *t, const sdm_text *config, const char *const *file,
                           option_texts *options, sdm_model_param *params, sdm_model_info *info)
{
    size_t n;
    const sdm_param *p = sdm_instance_params(t->shape, &n);
    for (size_t i = 0; i < n; i++) {
        snprintf(params[i].name, sizeof params[i].name, "%s", p[i].name);
        snprintf(params[i].unit, sizeof params[i].unit, "%s", p[i].unit);
        params[i].min = t->data.min[i];
        params[i].max = t->data.max[i];
        params[i].def = fmin(fmax(p[i].def, params[i].min), params[i].max);
        params[i].distribution = t->data.distribution[i];
    }
    trainer_option_texts(t->shape, t->file_sums, file, options);
    *info = (sdm_model_info){.n_params = n,
                             .params = params,
                             .n_options = options->n,
                             .option_names = options->names,
                             .option_values = options->values,
                             .grid = t->config->grid,
                             .seed = t->config->seed,
                             .train_samples = (int64_t)(t->data.n_static + t->data.n_taken),
                             .config = config->data};
    // with a budget of steps the file has the same bits in every run
    info->train_seconds = trainer_by_time(t) ? trainer_seconds(t) : 0;
    snprintf(info->shape, sizeof info->shape, "%s", sdm_instance_shape(t->shape)->name);
}

/* The texts and numbers of a model file, and the memory they point to. */
typedef struct description {
    sdm_text config;
    char names[SDM_MAX_OPTIONS][TRAINER_DATA_FILE_MAX];
    const char *file[SDM_MAX_OPTIONS];
    option_texts options;
    sdm_model_param params[SDM_POD_MAX_PARAMS];
    sdm_model_info info;
} description;

static sdm_status description_create(const trainer *t, description **out, sdm_error *err)
{
    description *d = NULL;
    sdm_status s = SDM_ALLOC(&d, 1, "description of the model", err);
    if (s) return s;
    *out = d;
    trainer_data_file_names(t, d->names, d->file);
    if (!(s = trainer_export_dump(t, &d->config, err)))
        describe_model(t, &d->config, d->file, &d->options, d->params, &d->info);
    return s;
}

static void description_free(description *d)
{
    if (d) sdm_text_dispose(&d->config);
    sdm_free(d);
}

/* Opens the model of the averaged weights from memory, as the runtime would open its file. */
static sdm_status model_open(const trainer *t, const char *path, const description *d,
                             sdm_model **out, sdm_error *err)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    sdm_status s = t->kind->build(t, &d->info, &bytes, &size, err);
    if (!s) s = sdm_model_open_memory(path, bytes, size, out, err);
    sdm_free(bytes);
    return s;
}

sdm_status trainer_export_measure(const trainer *t, sdm_accuracy *out, double *rmse_voxel_mm,
                                  double *map_ms, sdm_error *err)
{
    model_errors more = {0};
    description *d = NULL;
    sdm_model *model = NULL;
    sdm_status s = description_create(t, &d, err);
    if (!s) s = model_open(t, "model", d, &model, err);
    if (!s) s = measure_model(t, model, t->data.n_holdout, out, &more, err);
    if (!s) s = trainer_map_time(&t->data, model, map_ms, err);
    *rmse_voxel_mm = more.rmse_voxel_mm;
    sdm_model_free(model);
    description_free(d);
    return s;
}

sdm_status trainer_export_time(trainer *t, double *seconds, sdm_error *err)
{
    description *d = NULL;
    sdm_model *model = NULL;
    sdm_accuracy one;
    model_errors more;
    sdm_status s = description_create(t, &d, err);
    if (!s) s = model_open(t, "model", d, &model, err);
    const double start = trainer_seconds(t);
    if (!s) s = measure_model(t, model, 1, &one, &more, err);
    const size_t ranks = (size_t)sdm_comm_size(measurers(t)), n = t->data.n_holdout;
    *seconds = (trainer_seconds(t) - start) * (double)((n + ranks - 1) / ranks);
    if (!s) s = sdm_comm_broadcast(t->hooks.comm, 0, seconds, sizeof *seconds, err);
    sdm_model_free(model);
    description_free(d);
    return s;
}

void trainer_export_path(const trainer *t, char path[SDM_PATH_TEXT_MAX])
{
    snprintf(path, SDM_PATH_TEXT_MAX, "%.*s/model.sdm", SDM_PATH_TEXT_MAX - 24, t->folder);
}

/* What the model file keeps of the verdict. */
static sdm_status set_quality(const sdm_verdict *v, const trainer *t, const sdm_model_info *info,
                              sdm_model_quality *q, sdm_error *err)
{
    double p[SDM_MAX_PARAMS];
    *q = (sdm_model_quality){.cut = v->cut,
                             .between_mm = sqrt(v->part_mm2[SDM_CAUSE_GRID]),
                             .thickness_mm = v->thickness_mm,
                             .far_error_mm = v->far_largest_mm,
                             .volume_error = v->volume_error,
                             .surface_volume_error = v->surface_volume_error,
                             .derivative_error = v->derivative_error,
                             .volume_derivative_error = v->volume_derivative_error};
    snprintf(q->grade, sizeof q->grade, "%s", sdm_grade_name(v->grade));
    sdm_verdict_unfit(v, q->unfit);
    for (size_t i = 0; i < info->n_params; i++) p[i] = info->params[i].def;
    sdm_shape_figures f;
    sdm_status s = sdm_shape_sums(t->data.shape, p, &f, err);
    q->mesh_volume_mm3 = f.volume, q->mesh_area_mm2 = f.area, q->mesh_moment_mm3 = f.moment;
    for (size_t k = 0; k < SDM_MODEL_PROBES && !s; k++) {
        for (size_t i = 0; i < info->n_params; i++)
            p[i] = sdm_probe_param(k, i, info->params[i].min, info->params[i].max);
        // a place where mesh() fails tells nothing
        const sdm_status one = sdm_shape_sums(t->data.shape, p, &f, err);
        if (one == SDM_E_NOMEM) s = one;
        q->probe_volume_mm3[k] = one ? NAN : f.volume;
        q->probe_area_mm2[k] = one ? NAN : f.area;
        q->probe_moment_mm3[k] = one ? NAN : f.moment;
    }
    return s;
}

/* Volumes and derivatives. That they cannot be measured is no reason to lose the network: it is
 * told only. */
static void measure_uses(trainer *t, const sdm_model *m, model_errors *more)
{
    sdm_error why = {0};
    if (trainer_volume_check(t, m, &more->volumes, &why)) {
        trainer_volumes_unknown(&more->volumes);
        trainer_message(t, "volumes were not measured: %s", why.text);
    }
    if (trainer_derivative_check(t, m, &more->derivatives, &why)) {
        trainer_derivatives_unknown(&more->derivatives);
        trainer_message(t, "derivatives were not measured: %s", why.text);
    }
}

sdm_status trainer_export_judge(trainer *t, sdm_train_report *report, sdm_error *err)
{
    description *d = NULL;
    sdm_model *model = NULL;
    model_errors more;
    *report = (sdm_train_report){0};
    trainer_export_path(t, report->model_path);
    sdm_status s = description_create(t, &d, err);
    if (!s) s = model_open(t, report->model_path, d, &model, err);
    if (!s) s = measure_model(t, model, t->data.n_holdout, &t->accuracy, &more, err);
    if (!s && !isfinite(t->accuracy.mse_mm2))
        s = sdm_fail(err, SDM_E_QUALITY,
                     "the trained network gives numbers that are not finite: use "
                     "network.weights=f32 or lower the "
                     "learning rates");
    if (!s) measure_uses(t, model, &more);
    double map_ms = NAN;
    if (!s && t->turns->n > 1) s = trainer_map_time(&t->data, model, &map_ms, err);
    sdm_model_free(model);
    if (!s) {
        t->heldout_mse = t->accuracy.mse_mm2;
        s = trainer_metric(t, 0, err);
        if (!s) s = trainer_verdict_make(t, &more, &report->verdict, err);
        if (!s) s = trainer_metric_verdict(t, &report->verdict, err);
        if (!s) s = set_quality(&report->verdict, t, &d->info, &t->quality, err);
        report->accuracy = t->accuracy;
        report->steps = t->step;
        report->samples = d->info.train_samples;
        report->kind = t->config->network.kind;
        report->chosen = t->turns->chosen;
        report->map_ms = map_ms;
        report->pod_minutes = trainer_minutes_asked(t);
    }
    description_free(d);
    return s;
}

sdm_status trainer_export_to(const trainer *t, const char *path, sdm_error *err)
{
    description *d = NULL;
    uint8_t *bytes = NULL;
    size_t size = 0;
    sdm_status s = description_create(t, &d, err);
    if (!s) {
        d->info.accuracy = t->accuracy;
        d->info.quality = t->quality;
        s = t->kind->build(t, &d->info, &bytes, &size, err);
    }
    if (!s) s = sdm_container_write(path, bytes, size, err);
    sdm_free(bytes);
    description_free(d);
    return s;
}

sdm_status trainer_export_model(const trainer *t, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX];
    sdm_error picture = {0};
    trainer_export_path(t, path);
    const sdm_status s = trainer_export_to(t, path, err);
    if (!s && curve_write(t, &picture))
        // a failed picture is no reason to lose the network: a notice only
        trainer_message(t, "%s", picture.text);
    return s;
}
