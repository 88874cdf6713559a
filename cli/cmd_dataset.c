/* sdmgen dataset: makes the exact maps of a configuration and keeps them in files, for trainings.
 */
#include <stdio.h>

#include "commands.h"
#include "inputs/config_shape.h"
#include "inputs/part.h"
#include "report/progress_bar.h"
#include "report/terminal.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/map_store.h"
#include "sdm/memory.h"

/* What the callbacks of a run need. */
typedef struct dataset_view {
    cli_progress progress;
    double start;      /* sdm_clock() */
    size_t first_done; /* maps at the first call: they were there before */
    bool begun;
} dataset_view;

static void on_progress(void *user, size_t done, size_t all)
{
    dataset_view *v = user;
    char text[160], of[32], at[32], rate[64] = "";
    const double seconds = sdm_clock() - v->start;
    if (!v->begun) v->first_done = done, v->begun = true;
    const double speed = seconds > 0 ? (double)(done - v->first_done) / seconds : 0;
    if (speed > 0)
        snprintf(rate, sizeof rate, ", %.3g maps/s, %.0f s left", speed,
                 (double)(all - done) / speed);
    snprintf(text, sizeof text, "%s of %s maps%s", cli_format_count((int64_t)done, at),
             cli_format_count((int64_t)all, of), rate);
    cli_progress_show(&v->progress, "dataset", (double)done / (double)all, text);
}

static void on_warning(void *user, const char *line)
{
    dataset_view *v = user;
    cli_progress_clear(&v->progress);
    cli_warn("%s", line);
}

static sdm_status print_summary(const cli_args *args, const sdm_dataset_report *r, double seconds,
                                sdm_error *err)
{
    if (!args->json) {
        printf("%zu files: %zu made, %zu were there, %zu failed; %zu maps, %.3g MB, %.3g s\n",
               r->end - r->first, r->made, r->kept, r->failed, r->maps_made + r->maps_kept,
               1e-6 * (double)r->bytes, seconds);
        return SDM_OK;
    }
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_int(&j, "files_of_all_parts", (int64_t)r->n_files);
    sdm_json_int(&j, "files", (int64_t)(r->end - r->first));
    sdm_json_int(&j, "made", (int64_t)r->made);
    sdm_json_int(&j, "kept", (int64_t)r->kept);
    sdm_json_int(&j, "failed", (int64_t)r->failed);
    sdm_json_int(&j, "maps_made", (int64_t)r->maps_made);
    sdm_json_int(&j, "maps_kept", (int64_t)r->maps_kept);
    sdm_json_int(&j, "bytes", (int64_t)r->bytes);
    sdm_json_real(&j, "seconds", seconds);
    sdm_json_close(&j, '}');
    return cli_print_json(&j, err);
}

static void notice_part(const cli_part *part, const sdm_dataset_report *r)
{
    if (part->of == 1) return;
    if (r->first == r->end)
        cli_notice("part %zu of %zu: none of the %zu files; the others make them", part->part,
                   part->of, r->n_files);
    else
        cli_notice("part %zu of %zu: files %zu to %zu of %zu; the others are not made by this call",
                   part->part, part->of, r->first + 1, r->end, r->n_files);
}

static sdm_status make(const cli_args *args, const sdm_config *config, const sdm_instance *shape,
                       const cli_part *part, sdm_error *err)
{
    dataset_view view = {.start = sdm_clock()};
    sdm_dataset_report report;
    const sdm_dataset_opts opts = {
        .folder = args->outputs.items[0],
        .part = part->part,
        .n_parts = part->of,
        .n_random =
            (size_t)(args->maps >= 0 ? args->maps : config->data.start + config->data.online),
        .n_threads = config->threads,
        .progress = on_progress,
        .cancelled = cli_interrupted,
        .warning = on_warning,
        .user = &view};
    cli_progress_start(&view.progress);
    sdm_status s = sdm_dataset_make(config, shape, &opts, &report, err);
    cli_progress_end(&view.progress, !s);
    if (s) return s;
    notice_part(part, &report);
    s = print_summary(args, &report, sdm_clock() - view.start, err);
    if (s || !report.failed) return s;
    cli_set_incomplete();
    return sdm_fail(err, SDM_E_QUALITY,
                    "%s: %zu of %zu files failed; the same command tries them again; the first: %s",
                    args->outputs.items[0], report.failed, report.end - report.first,
                    report.reason);
}

sdm_status cmd_dataset(const cli_args *args, sdm_error *err)
{
    sdm_config *config = NULL;
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    cli_part part;
    sdm_status s = SDM_OK;
    if (args->outputs.n != 1)
        s = sdm_fail(err, SDM_E_ARG, "dataset: need one -o DIR, the folder of the files");
    if (!s) s = cli_read_part(args->part, &part, err);
    if (!s) s = cli_open_config(args, &config, &registry, &shape, err);
    if (!s) s = make(args, config, shape, &part, err);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    sdm_free(config);
    return s;
}
