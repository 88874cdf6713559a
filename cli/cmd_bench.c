/* sdmgen bench: measures the speed of all methods on one map, of distances at points, or of one
 * model. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "inputs/setup.h"
#include "report/terminal.h"
#include "sdm/internal/config.h"
#include "sdm/memory.h"
#include "study/bench.h"
#include "study/evaluate.h"

enum { N_GRIDS = 3, N_MESHES = 3, N_CASES = N_GRIDS + N_MESHES };

static sdm_status measure_case(const cli_args *args, double refine, double scale, cli_bench_case *c,
                               cli_bench_rows *rows, sdm_error *err)
{
    sdm_status s = cli_bench_case_open(args, refine, scale, c, err);
    if (!s) s = cli_bench_own(c, rows, err);
    return s ? s : cli_bench_peers(c, args, rows, err);
}

/* Measures one case. With --growth it measures six: three grids with 4, 2 and 1 times the edge of
 * the voxels, then three meshes with 2, 1 and 0.5 times the edge of the triangles. */
static sdm_status measure_exact(const cli_args *args, sdm_error *err)
{
    static const double scale[N_CASES] = {0.25, 0.5, 1, 1, 1, 1},
                        refine[N_CASES] = {1, 1, 1, 0.5, 1, 2};
    const size_t n_meshes = args->mesh ? 0 : N_MESHES;
    const size_t n = args->growth ? N_GRIDS + n_meshes : 1;
    cli_bench_case *cases = NULL;
    cli_bench_rows rows[N_CASES] = {{0}};
    sdm_json j = {0};
    sdm_status s = SDM_ALLOC(&cases, N_CASES, "cases", err);
    if (!s && args->growth) sdm_json_open(&j, NULL, '[');
    // measure the cases
    for (size_t i = 0; i < n && !s; i++) {
        s = measure_case(args, args->growth ? refine[i] : 1, args->growth ? scale[i] : 1, &cases[i],
                         &rows[i], err);
        if (!s && args->json) cli_bench_json(&j, &cases[i], &rows[i]);
    }
    if (!s && args->growth) sdm_json_close(&j, ']');
    // print the result
    if (!s && args->json)
        s = cli_print_json(&j, err);
    else if (!s && args->growth)
        cli_bench_print_growth(cases, rows, N_GRIDS, n_meshes);
    else if (!s)
        cli_bench_print(&cases[0], &rows[0]);
    sdm_json_dispose(&j);
    for (size_t i = 0; i < N_CASES && cases; i++) {
        cli_bench_case_dispose(&cases[i]);
        sdm_free(rows[i].items);
    }
    sdm_free(cases);
    return s;
}

sdm_status cmd_bench(const cli_args *args, sdm_error *err)
{
    const char *topic = args->files.items[0];
    if (!strcmp(topic, "network")) return cli_bench_network(args, err);
    const sdm_status s = cli_expect_model(args, err);
    if (s) return s;
    const bool points = !strcmp(topic, "points");
    if (!points && strcmp(topic, "exact"))
        return sdm_fail(err, SDM_E_ARG, "bench: '%s': need exact, points or network MODEL", topic);
    if (args->files.n > 1)
        return sdm_fail(err, SDM_E_ARG, "bench %s: unexpected argument '%s'", topic,
                        args->files.items[1]);
    return points ? cli_bench_points(args, err) : measure_exact(args, err);
}
