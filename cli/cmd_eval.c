/* sdmgen eval: measures the accuracy and speed of a network on new random shapes, or at given
   parameters. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "inputs/setup.h"
#include "report/terminal.h"
#include "sdm/internal/config.h"
#include "sdm/internal/file.h"
#include "sdm/internal/near.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"
#include "sdm/picture.h"
#include "study/evaluate.h"

enum { DEFAULT_SAMPLES = 100 };

static void print_time(const char *name, double ms, double ms_network, const char *note)
{
    if (!isfinite(ms)) return;
    printf("  %-22s %10.3f ms", name, ms);
    if (ms != ms_network) printf("  %8.1f x the network", ms / ms_network);
    printf("%s\n", note);
}

/* The shapes that are measured: random ones, or one at given parameters. */
typedef struct subjects {
    uint64_t seed;
    size_t n;
    double *at;     /* [n_params] given by -p; NULL: random shapes */
    sdm_text named; /* `at` as text */
} subjects;

static void print_table(const char *file, const sdm_model_info *info, const cli_eval *e,
                        const cli_timing *t, const subjects *of)
{
    printf("%s: %s, %zu parameters, %lld x %lld x %lld voxels\n", file, info->shape, info->n_params,
           (long long)info->grid.n[0], (long long)info->grid.n[1], (long long)info->grid.n[2]);
    if (of->at)
        printf("at %s, against the exact map\n\n", of->named.data);
    else
        printf(
            "%zu random shapes that the training did not use (seed %llu), against exact maps\n\n",
            e->n, (unsigned long long)of->seed);
    printf("  %-22s %10.3g mm^2\n", "MSE", e->mse_mm2);
    printf("  %-22s %10.5f mm\n", "RMSE", e->rmse_mm);
    printf("  %-22s %10.5f mm (%.3g mm of the surface)\n", "RMSE within 2 voxels", e->rmse_near_mm,
           sdm_grid_near(&info->grid));
    printf("  %-22s %10.5f mm\n", "mean absolute error", e->mae_mm);
    printf("  %-22s %10.5f mm\n", "largest error", e->max_abs_mm);
    printf("  %-22s %10.5f (smallest %.5f)\n", "Dice", e->dice, e->dice_min);
    printf("  %-22s %10.5f mm\n", "surfaces, mean", e->surface_mean_mm);
    printf("  %-22s %10.5f mm (largest %.5f)\n", "surfaces, Hausdorff", e->surface_hausdorff_mm,
           e->surface_hausdorff_max_mm);
    if (e->n_surface < e->n)
        printf("  (surfaces: of the %zu shapes with both, out of %zu)\n", e->n_surface, e->n);
    char batch[48], naive[64];
    snprintf(batch, sizeof batch, "network, batch of %zu", t->batch_size);
    snprintf(naive, sizeof naive, "  (from %.0f %% of the voxels)", 100 * t->naive_share);
    printf("\ntime per map on one core\n");
    print_time("network", t->ms_network, t->ms_network, "");
    print_time(batch, t->ms_batch, t->ms_network, "");
    print_time("exact", t->ms_exact, t->ms_network, "");
    print_time("naive", t->ms_naive, t->ms_network, naive);
}

static void fill_json(sdm_json *j, const char *file, const sdm_model_info *info, const cli_eval *e,
                      const cli_timing *t, const subjects *of, int workers)
{
    sdm_json_open(j, NULL, '{');
    sdm_json_text(j, "model", file);
    sdm_json_text(j, "shape", info->shape);
    sdm_json_int(j, "samples", (int64_t)e->n);
    if (of->at) sdm_json_text(j, "parameters", of->named.data);
    sdm_json_uint(j, "seed", of->seed);
    // errors of the distance
    sdm_json_real(j, "mse_mm2", e->mse_mm2);
    sdm_json_real(j, "rmse_mm", e->rmse_mm);
    sdm_json_real(j, "mae_mm", e->mae_mm);
    sdm_json_real(j, "max_abs_mm", e->max_abs_mm);
    sdm_json_real(j, "rmse_near_mm", e->rmse_near_mm);
    sdm_json_real(j, "dice", e->dice);
    sdm_json_real(j, "dice_min", e->dice_min);
    // distances between the surfaces
    sdm_json_real(j, "surface_mean_mm", e->surface_mean_mm);
    sdm_json_real(j, "surface_hausdorff_mm", e->surface_hausdorff_mm);
    sdm_json_real(j, "surface_hausdorff_max_mm", e->surface_hausdorff_max_mm);
    sdm_json_int(j, "surfaces", (int64_t)e->n_surface);
    sdm_json_int(j, "worst", (int64_t)e->worst);
    sdm_json_real(j, "worst_mse_mm2", e->sample[e->worst].mse_mm2);
    // times
    sdm_json_real(j, "ms_network", t->ms_network);
    sdm_json_real(j, "ms_network_batch", t->ms_batch);
    sdm_json_int(j, "batch", (int64_t)t->batch_size);
    sdm_json_real(j, "ms_exact", t->ms_exact);
    sdm_json_real(j, "ms_naive", t->ms_naive);
    sdm_json_real(j, "naive_share", t->naive_share);
    sdm_json_real(j, "exact_over_network", t->ms_exact / t->ms_network);
    sdm_json_real(j, "naive_over_network", t->ms_naive / t->ms_network);
    sdm_json_int(j, "threads", 1); // the times are those of one thread
    sdm_json_int(j, "workers", workers);
    sdm_json_close(j, '}');
}

static sdm_status write_pictures(const cli_args *args, const sdm_model *m,
                                 const sdm_instance *shape, const subjects *of, const cli_eval *e,
                                 sdm_error *err)
{
    const struct {
        const char *name;
        size_t index;
    } pictures[] = {{of->at ? "compare" : "worst", e->worst}, {"median", e->median}};
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < (of->at ? 1 : 2) && !s; i++) {
        char path[SDM_PATH_TEXT_MAX];
        if (snprintf(path, sizeof path, "%s/%s.png", args->pictures, pictures[i].name) >=
            (int)sizeof path)
            return sdm_fail(err, SDM_E_ARG, "--pictures '%.100s...': the name is too long",
                            args->pictures);
        s = cli_picture_compare(m, shape, of->seed, pictures[i].index, of->at, path, err);
    }
    return s;
}

/* Reads which shapes are measured. sdm_free(of->at) and sdm_text_dispose(&of->named) end it. */
static sdm_status subjects_read(const cli_args *args, const sdm_model *m, subjects *of,
                                sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(m);
    sdm_param *params = NULL;
    of->seed = args->seed < 0 ? 1 : (uint64_t)args->seed;
    of->n = args->samples < 0 ? DEFAULT_SAMPLES : (size_t)args->samples;
    if (!args->params.n) return SDM_OK;
    of->n = 1;
    if (args->samples >= 0 || args->seed >= 0)
        return sdm_fail(err, SDM_E_ARG,
                        "-p measures one shape, --samples and --seed random ones: give one kind");
    sdm_status s = cli_model_params(info, &params, err);
    if (!s) s = SDM_ALLOC(&of->at, info->n_params, "parameters", err);
    if (!s) s = cli_read_params(params, info->n_params, &args->params, of->at, err);
    if (!s) s = cli_check_range(params, info->n_params, of->at, err);
    if (!s) {
        cli_add_params(params, info->n_params, of->at, &of->named);
        if (of->named.failed) s = sdm_fail(err, SDM_E_NOMEM, "out of memory for the parameters");
    }
    sdm_free(params);
    return s;
}

static sdm_status subjects_evaluate(const subjects *of, const sdm_model *m,
                                    const sdm_instance *shape, cli_eval *e, sdm_error *err)
{
    if (!of->at) return cli_evaluate(m, shape, of->seed, of->n, true, e, err);
    cli_map_maker maker = cli_maker_of_model(m, shape);
    // ranges without width: every random shape is this one
    for (size_t i = 0; i < maker.n_params; i++) {
        maker.min[i] = maker.max[i] = of->at[i];
        maker.distribution[i] = (sdm_distribution){.kind = SDM_DISTRIBUTION_UNIFORM};
    }
    return cli_evaluate_maps(&maker, of->seed, 1, true, e, err);
}

static sdm_status measure_model(const cli_args *args, const sdm_model *m, const sdm_instance *shape,
                                sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(m);
    subjects of = {0};
    cli_eval e = {0};
    cli_timing t = {0};
    sdm_json json = {0};
    sdm_status s = subjects_read(args, m, &of, err);
    if (!s && args->pictures) s = sdm_picture_check("worst.png", err);
    if (!s && args->pictures) s = sdm_make_folder(args->pictures, err);
    if (!s) s = subjects_evaluate(&of, m, shape, &e, err);
    const size_t n_naive = of.at ? 0 : (size_t)args->naive;
    if (!s) s = cli_time_maps(m, shape, of.seed, false, n_naive, &t, err);
    if (!s && args->pictures) s = write_pictures(args, m, shape, &of, &e, err);
    if (!s && args->json) {
        fill_json(&json, args->files.items[0], info, &e, &t, &of, sdm_threads((int)args->threads));
        s = cli_print_json(&json, err);
    } else if (!s) {
        print_table(args->files.items[0], info, &e, &t, &of);
    }
    if (!s && !(e.mse_mm2 <= args->max_mse))
        s = sdm_fail(err, SDM_E_QUALITY, "MSE %.3g mm^2, --max-mse allows %.3g mm^2", e.mse_mm2,
                     args->max_mse);
    cli_eval_dispose(&e);
    sdm_text_dispose(&of.named);
    sdm_free(of.at);
    return s;
}

sdm_status cmd_eval(const cli_args *args, sdm_error *err)
{
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    sdm_model *model = NULL;
    sdm_status s = cli_open_registry(args, &registry, err);
    if (!s) s = cli_open_model(args, args->files.items[0], &model, err);
    if (!s) s = sdm_runtime_instance(model, registry, &shape, err);
    if (!s) s = measure_model(args, model, shape, err);
    sdm_model_free(model);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    return s;
}
