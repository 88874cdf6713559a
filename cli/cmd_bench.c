/* sdmgen bench: short measurements of speed, all in one process, with ratios. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "evaluate.h"
#include "sdm/config.h"
#include "sdm/memory.h"
#include "setup.h"
#include "terminal.h"

enum { REPEATS = 7 };

typedef struct exact_times {
    double ms_build, ms_query, ms_build_all, ms_query_all; /* one core, all threads; medians */
    double ms_naive, naive_share;
    size_t voxels, triangles;
    int threads;
} exact_times;

static sdm_status time_engine(const sdm_mesh *mesh, const sdm_grid *grid, int threads, float *values, double *build,
                              double *query, sdm_error *err)
{
    double builds[REPEATS], queries[REPEATS];
    for (size_t i = 0; i <= REPEATS; i++) {
        const sdm_exact_opts opts = {.n_threads = threads};
        sdm_exact *engine = NULL;
        const double start = cli_clock();
        sdm_status s = sdm_exact_create(mesh, &opts, &engine, err);
        if (s) return s;
        const double built = cli_clock();
        s = sdm_exact_map(engine, grid, values, err);
        const double end = cli_clock();
        sdm_exact_free(engine);
        if (s) return s;
        if (i == 0) continue; /* warms up */
        builds[i - 1] = 1e3 * (built - start);
        queries[i - 1] = 1e3 * (end - built);
    }
    *build = cli_median(builds, REPEATS);
    *query = cli_median(queries, REPEATS);
    return SDM_OK;
}

/* The cochlea at its default parameters on the paper's grid. */
static sdm_status measure_exact(const cli_args *args, exact_times *t, sdm_error *err)
{
    const cli_list none = {0};
    const sdm_grid grid = sdm_grid_centred((const int64_t[3]){60, 50, 50}, 0.2, (const double[3]){0.5, 0.4, 1.2});
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    sdm_mesh mesh = {0};
    double *p = NULL;
    float *values = NULL;
    size_t n = 0;
    sdm_status s = cli_open_registry(args, &registry, err);
    if (!s) s = cli_open_shape(registry, "cochlea", &none, &shape, err);
    const sdm_param *params = s ? NULL : sdm_instance_params(shape, &n);
    if (!s) s = SDM_ALLOC(&p, n, "parameters", err);
    if (!s) s = cli_read_params(params, n, &none, p, err);
    if (!s) s = sdm_instance_mesh(shape, p, &mesh, err);
    if (!s) s = SDM_ALLOC(&values, sdm_grid_count(&grid), "distance map", err);
    t->voxels = sdm_grid_count(&grid);
    t->triangles = mesh.n_tri;
    t->threads = cli_threads(args->threads);
    if (!s) s = time_engine(&mesh, &grid, 1, values, &t->ms_build, &t->ms_query, err);
    if (!s) s = time_engine(&mesh, &grid, t->threads, values, &t->ms_build_all, &t->ms_query_all, err);
    if (!s) s = cli_time_naive(&mesh, &grid, &t->ms_naive, &t->naive_share, err);
    sdm_free(values);
    sdm_free(p);
    sdm_mesh_dispose(&mesh);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    return s;
}

static sdm_status report_exact(const cli_args *args, const exact_times *t, sdm_error *err)
{
    const double one = t->ms_build + t->ms_query, all = t->ms_build_all + t->ms_query_all;
    if (args->json) {
        sdm_json j = {0};
        sdm_json_open(&j, NULL, '{');
        sdm_json_int(&j, "voxels", (int64_t)t->voxels);
        sdm_json_int(&j, "triangles", (int64_t)t->triangles);
        sdm_json_real(&j, "ms_build", t->ms_build);
        sdm_json_real(&j, "ms_query", t->ms_query);
        sdm_json_real(&j, "ms_total", one);
        sdm_json_int(&j, "threads", t->threads);
        sdm_json_real(&j, "ms_total_threads", all);
        sdm_json_real(&j, "ms_naive", t->ms_naive);
        sdm_json_real(&j, "naive_share", t->naive_share);
        sdm_json_real(&j, "naive_over_exact", t->ms_naive / one);
        sdm_json_close(&j, '}');
        return cli_print_json(&j, err);
    }
    printf("cochlea, %zu triangles, 60 x 50 x 50 voxels of 0.2 mm\n\n", t->triangles);
    printf("  exact, one core     %9.2f ms = build %.2f + query %.2f (%.1f ns a voxel)\n", one, t->ms_build,
           t->ms_query, 1e6 * t->ms_query / (double)t->voxels);
    printf("  exact, %3d threads  %9.2f ms   %.2f x faster\n", t->threads, all, one / all);
    printf("  naive, one core     %9.0f ms   %.0f x slower than exact (from %.0f %% of the voxels)\n", t->ms_naive,
           t->ms_naive / one, 100 * t->naive_share);
    return SDM_OK;
}

static sdm_status report_network(const cli_args *args, const cli_timing *t, const sdm_model_info *info, sdm_error *err)
{
    if (args->json) {
        sdm_json j = {0};
        sdm_json_open(&j, NULL, '{');
        sdm_json_int(&j, "voxels", (int64_t)sdm_grid_count(&info->grid));
        sdm_json_int(&j, "threads", 1);
        sdm_json_real(&j, "ms_network", t->ms_network);
        sdm_json_real(&j, "ms_network_batch", t->ms_batch);
        sdm_json_int(&j, "batch", (int64_t)t->batch_size);
        sdm_json_real(&j, "ms_exact", t->ms_exact);
        sdm_json_real(&j, "exact_over_network", t->ms_exact / t->ms_network);
        sdm_json_close(&j, '}');
        return cli_print_json(&j, err);
    }
    printf("%s, %zu voxels, one core\n\n", info->shape, sdm_grid_count(&info->grid));
    printf("  one map               %9.3f ms\n", t->ms_network);
    printf("  one of a batch of %-3zu %9.3f ms   %.1f x faster\n", t->batch_size, t->ms_batch,
           t->ms_network / t->ms_batch);
    if (isfinite(t->ms_exact))
        printf("  exact engine          %9.3f ms   %.1f x slower than one map\n", t->ms_exact,
               t->ms_exact / t->ms_network);
    return SDM_OK;
}

static sdm_status bench_network(const cli_args *args, sdm_error *err)
{
    if (args->files.n != 2) return sdm_fail(err, SDM_E_ARG, "usage: sdmgen bench network MODEL");
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    sdm_model *model = NULL;
    cli_timing t = {0};
    sdm_status s = cli_open_registry(args, &registry, err);
    if (!s) s = sdm_model_open(args->files.items[1], &model, err);
    if (!s && sdm_registry_find(registry, sdm_model_get_info(model)->shape, NULL))
        s = sdm_runtime_instance(model, registry, &shape, err);
    if (!s && sdm_model_get_info(model)->n_params > SDM_MAX_PARAMS)
        s = sdm_fail(err, SDM_E_UNSUPPORTED, "%zu parameters, at most %d", sdm_model_get_info(model)->n_params,
                     SDM_MAX_PARAMS);
    if (!s) s = cli_time_maps(model, shape, args->seed < 0 ? 1 : (uint64_t)args->seed, 0, &t, err);
    if (!s) s = report_network(args, &t, sdm_model_get_info(model), err);
    sdm_model_free(model);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    return s;
}

sdm_status cmd_bench(const cli_args *args, sdm_error *err)
{
    const char *what = args->files.items[0];
    if (!strcmp(what, "network")) return bench_network(args, err);
    if (strcmp(what, "exact")) return sdm_fail(err, SDM_E_ARG, "bench: '%s': need exact or network MODEL", what);
    if (args->files.n > 1)
        return sdm_fail(err, SDM_E_ARG, "bench exact: unexpected argument '%s'", args->files.items[1]);
    exact_times t = {0};
    const sdm_status s = measure_exact(args, &t, err);
    return s ? s : report_exact(args, &t, err);
}
