/* Example of a training in C: trains the network of a configuration, and prints its grade and its
 * error. Usage: train CONFIG.yaml FOLDER [KEY=VALUE ...]
 * FOLDER gets model.sdm, the log and pictures; an older run there is replaced. KEY=VALUE, such as
 * train.minutes=1, replaces a key of the configuration. Plug-ins of the folders in the environment
 * variable SDMGEN_PLUGIN_PATH are loaded. */
#include <stdio.h>
#include <stdlib.h>

#include "sdm/builtin_shapes.h"
#include "sdm/train_file.h"

static void show_progress(void *user, const sdm_training_progress *p)
{
    (void)user;
    fprintf(stderr, "\r%-8s %3.0f %%", p->phase, 100 * p->fraction);
}

static sdm_status train(const char *config, const sdm_training_opts *opts,
                        sdm_training_result *result, sdm_error *err)
{
    sdm_registry *registry = NULL; // the shapes that the configuration may name
    sdm_status s = sdm_registry_create(&registry, err);
    if (!s) s = sdm_builtin_shapes_add(registry, err);
    if (!s) s = sdm_registry_load_path(registry, getenv("SDMGEN_PLUGIN_PATH"), err);
    if (!s) s = sdm_training_run(config, registry, opts, result, err);
    sdm_registry_free(registry);
    return s;
}

int main(int argc, char **argv)
{
    sdm_error err = {0};
    sdm_training_result result = {0};
    if (argc < 3) {
        fputs("usage: train CONFIG.yaml FOLDER [KEY=VALUE ...]\n", stderr);
        return 2;
    }
    const sdm_training_opts opts = {
        .folder = argv[2],
        .force = true,
        .settings = (const char *const *)argv + 3,
        .n_settings = (size_t)argc - 3,
        .progress = show_progress,
    };
    const sdm_status s = train(argv[1], &opts, &result, &err);
    if (!s) fputc('\n', stderr); // ends the line of the progress
    if (s)
        fprintf(stderr, "train: %s\n", err.text);
    else
        printf("%s: %s, RMSE %.4f mm, %.0f s\n", result.model_path, result.grade,
               result.accuracy.rmse_mm, result.seconds);
    return s ? 1 : 0;
}
