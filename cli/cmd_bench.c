/* sdmgen bench: measurements of speed, with ratios. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench.h"
#include "commands.h"
#include "evaluate.h"
#include "sdm/config.h"
#include "sdm/memory.h"
#include "setup.h"
#include "terminal.h"

enum { N_GRIDS = 3, N_MESHES = 3, N_CASES = N_GRIDS + N_MESHES };

static sdm_status measure(const cli_args *args, double refine, double scale, bench_case *c, bench_rows *rows,
                          sdm_error *err)
{
    sdm_status s = bench_case_open(args, refine, scale, c, err);
    if (!s) s = bench_own(c, rows, err);
    return s ? s : bench_peers(c, args, rows, err);
}

/* Voxels of four times, twice and once the edge; then triangles of twice, once and half the edge. */
static sdm_status bench_exact(const cli_args *args, sdm_error *err)
{
    static const double scale[N_CASES] = {0.25, 0.5, 1, 1, 1, 1}, refine[N_CASES] = {1, 1, 1, 0.5, 1, 2};
    const size_t n_meshes = args->mesh ? 0 : N_MESHES;
    const size_t n = args->growth ? N_GRIDS + n_meshes : 1;
    bench_case *cases = NULL;
    bench_rows rows[N_CASES] = {{0}};
    sdm_json j = {0};
    sdm_status s = SDM_ALLOC(&cases, N_CASES, "cases", err);
    if (!s && args->growth) sdm_json_open(&j, NULL, '[');
    for (size_t i = 0; i < n && !s; i++) {
        s = measure(args, args->growth ? refine[i] : 1, args->growth ? scale[i] : 1, &cases[i], &rows[i], err);
        if (!s && args->json) bench_json(&j, &cases[i], &rows[i]);
    }
    if (!s && args->growth) sdm_json_close(&j, ']');
    if (!s && args->json)
        s = cli_print_json(&j, err);
    else if (!s && args->growth)
        bench_print_growth(cases, rows, N_GRIDS, n_meshes);
    else if (!s)
        bench_print(&cases[0], &rows[0]);
    sdm_json_dispose(&j);
    for (size_t i = 0; i < N_CASES && cases; i++) {
        bench_case_dispose(&cases[i]);
        sdm_free(rows[i].items);
    }
    sdm_free(cases);
    return s;
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
    return bench_exact(args, err);
}
