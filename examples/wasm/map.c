/* Example for WASI: computes a map from a model. Usage: map MODEL OUT.npy [NAME=VALUE ...].
 * Other parameters have their defaults; outside of the network's range the exact engine computes
 * the map. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "sdm/builtin_shapes.h"
#include "sdm/image.h"
#include "sdm/memory.h"
#include "sdm/runtime.h"

enum { REPEATS = 10 };

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/* Parses NAME=VALUE and stores the value in params[]. */
static sdm_status param_set(const sdm_model_info *info, const char *text, double *params,
                            sdm_error *err)
{
    const char *equal = strchr(text, '=');
    for (size_t i = 0; i < info->n_params && equal; i++) {
        const size_t n = strlen(info->params[i].name);
        if (n != (size_t)(equal - text) || strncmp(text, info->params[i].name, n) != 0) continue;
        char *end;
        params[i] = strtod(equal + 1, &end);
        if (end != equal + 1 && !*end) return SDM_OK;
    }
    return sdm_fail(err, SDM_E_ARG, "'%s' is not NAME=VALUE of a parameter of this model", text);
}

/* Computes the map REPEATS times and prints the shortest time, which is disturbed least by other
 * load. */
static sdm_status map_make(const sdm_model *model, const sdm_instance *shape, const double *params,
                           float *values, sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(model);
    const sdm_generate_opts opts = {.policy = SDM_RANGE_EXACT, .exact_shape = shape};
    sdm_result result;
    double best = 0;
    for (int i = 0; i < REPEATS; i++) {
        const double start = now_ms();
        const sdm_status s = sdm_generate(model, params, &opts, values, &result, err);
        if (s) return s;
        const double ms = now_ms() - start;
        if (i == 0 || ms < best) best = ms;
    }
    printf("%s by %s: %lld x %lld x %lld voxels in %.3f ms\n", info->shape,
           result.source == SDM_SOURCE_EXACT ? "the exact engine" : "the network",
           (long long)info->grid.n[0], (long long)info->grid.n[1], (long long)info->grid.n[2],
           best);
    return SDM_OK;
}

static sdm_status map_write(const sdm_model *model, const sdm_instance *shape, const char *out,
                            char **settings, sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(model);
    const size_t size[3] = {(size_t)info->grid.n[2], (size_t)info->grid.n[1],
                            (size_t)info->grid.n[0]};
    float *values = NULL;
    double *params = NULL;
    sdm_status s = SDM_ALLOC(&values, sdm_grid_count(&info->grid), "map", err);
    if (!s) s = SDM_ALLOC(&params, info->n_params, "parameters", err);
    for (size_t i = 0; i < info->n_params && !s; i++) params[i] = info->params[i].def;
    for (; *settings && !s; settings++) s = param_set(info, *settings, params, err);
    if (!s) s = map_make(model, shape, params, values, err);
    if (!s) s = sdm_npy_write(out, values, size, 3, err);
    sdm_free(params);
    sdm_free(values);
    return s;
}

int main(int argc, char **argv)
{
    if (argc < 3) {
        fputs("usage: map MODEL OUT.npy [NAME=VALUE ...]\n", stderr);
        return 2;
    }
    sdm_error err = {0};
    sdm_model *model = NULL;
    sdm_registry *shapes = NULL;
    sdm_instance *shape = NULL;
    sdm_status s = sdm_model_open(argv[1], &model, &err);
    if (!s) s = sdm_registry_create(&shapes, &err);
    if (!s) s = sdm_builtin_shapes_add(shapes, &err);
    if (!s) s = sdm_runtime_instance(model, shapes, &shape, &err);
    if (!s) s = map_write(model, shape, argv[2], argv + 3, &err);
    if (s) fprintf(stderr, "map: %s\n", err.text);
    sdm_instance_free(shape);
    sdm_registry_free(shapes);
    sdm_model_free(model);
    return s ? 1 : 0;
}
