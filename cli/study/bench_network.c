/* sdmgen bench network: times of one map, a batch, derivatives and several threads, and the
 * fraction of the machine's arithmetic and memory speed that they use. The fastest of several runs
 * counts, as in bench exact, because other programs can only add to the time. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench.h"
#include "evaluate.h"
#include "inputs/setup.h"
#include "report/json_values.h"
#include "report/terminal.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/config.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

/* Number of runs for one figure: RUNS, or after TIME_LIMIT_S fewer, but at least RUNS_MIN. */
enum { RUNS = 100, RUNS_MIN = 3 };
#define TIME_LIMIT_S 4.0

typedef struct network_times {
    cli_timing maps;
    double ms_jacobian, ms_jvp, ms_vjp; /* one core; the first two include the map */
    double ms_threads;                  /* one map on all cores, wall-clock time */
    int threads;
    double peak_gmacs;  /* 10^9 multiply-adds per second of the matrix product on one core */
    double read_gbs;    /* GB/s of one core reading a block of the size of the weights repeatedly */
    sdm_error no_exact; /* why the exact engine was not timed */
    bool has_field;     /* --size was given */
    cli_field_times field;
} network_times;

/* A model with all memory that its derivatives need, allocated beforehand so that allocation is not
 * timed. */
typedef struct derivative_work {
    const sdm_model *m;
    double p[SDM_MAX_PARAMS], direction[SDM_MAX_PARAMS], gradient[SDM_MAX_PARAMS];
    float *values, *jacobian;
    void *scratch;
} derivative_work;

static void call_jacobian(derivative_work *w)
{
    sdm_model_jacobian(w->m, w->p, w->values, w->jacobian, w->scratch);
}
static void call_jvp(derivative_work *w)
{
    sdm_model_jvp(w->m, w->p, w->direction, w->values, w->jacobian, w->scratch);
}
static void call_vjp(derivative_work *w)
{
    sdm_model_vjp(w->m, w->p, w->values, w->gradient, w->scratch);
}

static sdm_status time_call(derivative_work *w, void (*call)(derivative_work *), double *ms,
                            sdm_error *err)
{
    double each[RUNS];
    const double begin = sdm_clock();
    size_t n = 0;
    call(w);
    while (n < RUNS && (n < RUNS_MIN || sdm_clock() - begin < TIME_LIMIT_S)) {
        const double start = sdm_thread_clock();
        call(w);
        each[n++] = 1e3 * (sdm_thread_clock() - start);
        const sdm_status s = cli_check_interrupt(err);
        if (s) return s;
    }
    *ms = cli_minimum(each, n);
    return SDM_OK;
}

static size_t larger(size_t a, size_t b) { return a > b ? a : b; }

static sdm_status time_derivatives(const sdm_model *m, uint64_t seed, network_times *t,
                                   sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(m);
    const size_t voxels = sdm_grid_count(&info->grid);
    const size_t scratch =
        larger(sdm_model_jacobian_scratch_bytes(m),
               larger(sdm_model_jvp_scratch_bytes(m), sdm_model_vjp_scratch_bytes(m)));
    derivative_work w = {.m = m};
    cli_eval_params(m, seed, 0, w.p);
    for (size_t i = 0; i < info->n_params; i++)
        w.direction[i] = info->params[i].max - info->params[i].min;
    sdm_status s = SDM_ALLOC(&w.values, voxels, "map to time", err);
    if (!s) s = SDM_ALLOC(&w.jacobian, voxels * info->n_params, "derivatives to time", err);
    if (!s) s = sdm_alloc(&w.scratch, scratch, 1, "memory of the network", err);
    if (!s) s = time_call(&w, call_jacobian, &t->ms_jacobian, err);
    if (!s) s = time_call(&w, call_jvp, &t->ms_jvp, err);
    if (!s) s = time_call(&w, call_vjp, &t->ms_vjp, err);
    sdm_free(w.scratch);
    sdm_free(w.jacobian);
    sdm_free(w.values);
    return s;
}

static sdm_status time_threads(const sdm_model *m, uint64_t seed, int threads, network_times *t,
                               sdm_error *err)
{
    const sdm_generate_opts opts = {.policy = SDM_RANGE_REFUSE, .n_threads = threads};
    double p[SDM_MAX_PARAMS], best = INFINITY;
    float *values = NULL;
    sdm_status s =
        SDM_ALLOC(&values, sdm_grid_count(&sdm_model_get_info(m)->grid), "map to time", err);
    const double begin = sdm_clock();
    cli_eval_params(m, seed, 0, p);
    for (size_t i = 0; i < RUNS && !s && (i < RUNS_MIN || sdm_clock() - begin < TIME_LIMIT_S);
         i++) {
        const double start = sdm_clock();
        s = sdm_generate(m, p, &opts, values, NULL, err);
        best = fmin(best, 1e3 * (sdm_clock() - start));
    }
    t->ms_threads = best;
    t->threads = threads;
    sdm_free(values);
    return s;
}

/* Measures the speed of the machine: by a large matrix product, and by reading a block of `bytes`
 * bytes repeatedly. */
static sdm_status measure_machine(size_t bytes, network_times *t, sdm_error *err)
{
    enum { N = 384, REPEATS = 5 };
    typedef uint64_t words __attribute__((vector_size(16)));
    const size_t n_words = bytes / sizeof(words) / 4 * 4 + 4;
    float *a = NULL;
    words *data = NULL, total = {0};
    sdm_status s = SDM_ALLOC(&a, 3 * N * N, "matrix to time", err);
    if (!s) s = sdm_alloc((void **)&data, n_words, sizeof *data, "memory to read", err);
    // matrix product
    double best = INFINITY, read = INFINITY;
    for (int i = 0; i < REPEATS && !s; i++) {
        const double start = sdm_thread_clock();
        sdm_gemm(N, N, N, (sdm_view){a, N, 1}, (sdm_view){a + N * N, N, 1}, false, a + 2 * N * N, N,
                 1);
        best = fmin(best, sdm_thread_clock() - start);
    }
    // reading
    for (int i = 0; i < 2 * REPEATS && !s; i++) {
        const double start = sdm_thread_clock();
        words a0 = {0}, a1 = a0, a2 = a0, a3 = a0;
        for (size_t k = 0; k < n_words; k += 4)
            a0 += data[k], a1 += data[k + 1], a2 += data[k + 2], a3 += data[k + 3];
        total += a0 + a1 + a2 + a3;
        read = fmin(read, sdm_thread_clock() - start);
    }
    t->peak_gmacs = 1e-9 * (double)N * N * N / best;
    t->read_gbs = 1e-9 * (double)(n_words * sizeof *data) / read;
    // the block is zero; the use of the sum keeps the compiler from removing the loop
    if (!s && total[0] + total[1] != 0)
        s = sdm_fail(err, SDM_E_INTERNAL, "zero-initialised memory is not zero");
    sdm_free(data);
    sdm_free(a);
    return s;
}

/* 10^9 multiply-adds per second, from a number of multiply-adds and a time in ms. */
static double gmacs(double macs, double ms) { return 1e-6 * macs / ms; }

static void print_row(const char *name, double ms, double one, const char *note)
{
    printf("  %-26s %9.3f ms  %7.2f x one map%s%s\n", name, ms, ms / one, *note ? "   " : "", note);
}

static void print_field(const cli_field_times *t, double one)
{
    char name[80], note[80];
    print_row("field: new parameters", t->ms_params, one, "");
    snprintf(name, sizeof name, "map of %lld x %lld x %lld", (long long)t->grid.n[0],
             (long long)t->grid.n[1], (long long)t->grid.n[2]);
    print_row(name, t->ms_map, one, "");
    snprintf(note, sizeof note, "%zu blocks of 8 x 8 x 8 voxels", t->blocks);
    print_row("band of 3 voxels", t->ms_band, one, note);
    printf("  %-26s %9.3f us\n  %-26s %9.3f us\n", "point of 100000, gradient", t->us_point,
           "one point, gradient", t->us_single);
}

static void print_times(const network_times *t, const sdm_model_info *info)
{
    const double one = t->maps.ms_network;
    char name[64], note[128];
    printf("%s, %s, %zu voxels, %zu parameters; %.2f million multiply-adds a map, %.1f MB of "
           "weights; %s\n\n",
           info->shape, info->kind, sdm_grid_count(&info->grid), info->n_params, 1e-6 * info->macs,
           1e-6 * (double)info->weight_bytes, sdm_kernels_name());
    // one map and a batch
    const double used = gmacs(info->macs, one), bytes = 1e-6 * (double)info->weight_bytes / one;
    snprintf(note, sizeof note,
             "%.1f GMAC/s, %.0f %% of the peak; %.1f GB/s of weights, %.0f %% of reading", used,
             100 * used / t->peak_gmacs, bytes, 100 * bytes / t->read_gbs);
    print_row("one map", one, one, note);
    const double batch = gmacs(info->macs, t->maps.ms_batch);
    snprintf(name, sizeof name, "one of a batch of %zu", t->maps.batch_size);
    snprintf(note, sizeof note, "%.1f GMAC/s, %.0f %% of the peak", batch,
             100 * batch / t->peak_gmacs);
    print_row(name, t->maps.ms_batch, one, note);
    // derivatives
    snprintf(note, sizeof note, "%zu parameters; finite differences need %zu maps", info->n_params,
             info->n_params + 1);
    print_row("map and Jacobian", t->ms_jacobian, one, note);
    print_row("map and J v", t->ms_jvp, one, "");
    print_row("w J", t->ms_vjp, one, "");
    // threads and exact engine
    snprintf(name, sizeof name, "one map, %d threads", t->threads);
    if (t->threads > 1) print_row(name, t->ms_threads, one, "wall-clock time");
    if (isfinite(t->maps.ms_exact))
        print_row("exact engine", t->maps.ms_exact, one, "");
    else
        printf("  %-26s not measured: %s\n", "exact engine", t->no_exact.text);
    if (t->has_field) print_field(&t->field, one);
    printf("\nThe fastest of several runs, on one core unless stated otherwise. Peak: the matrix "
           "product, %.1f GMAC/s; reading: %.1f GB/s.\n",
           t->peak_gmacs, t->read_gbs);
}

static void add_field_json(const cli_field_times *t, sdm_json *j)
{
    sdm_json_grid(j, "field_grid", &t->grid, false);
    sdm_json_real(j, "ms_field_params", t->ms_params);
    sdm_json_real(j, "ms_field_map", t->ms_map);
    sdm_json_real(j, "ms_field_band", t->ms_band);
    sdm_json_int(j, "field_band_blocks", (int64_t)t->blocks);
    sdm_json_real(j, "us_field_point", t->us_point);
    sdm_json_real(j, "us_field_single_point", t->us_single);
}

static sdm_status print_json(const network_times *t, const sdm_model_info *info, sdm_error *err)
{
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "shape", info->shape);
    sdm_json_text(&j, "kind", info->kind);
    sdm_json_text(&j, "instructions", sdm_kernels_name());
    sdm_json_int(&j, "voxels", (int64_t)sdm_grid_count(&info->grid));
    sdm_json_real(&j, "macs", info->macs);
    sdm_json_int(&j, "weight_bytes", (int64_t)info->weight_bytes);
    // times
    sdm_json_int(&j, "threads", 1);
    sdm_json_real(&j, "ms_network", t->maps.ms_network);
    sdm_json_real(&j, "ms_network_batch", t->maps.ms_batch);
    sdm_json_int(&j, "batch", (int64_t)t->maps.batch_size);
    sdm_json_real(&j, "ms_jacobian", t->ms_jacobian);
    sdm_json_real(&j, "ms_jvp", t->ms_jvp);
    sdm_json_real(&j, "ms_vjp", t->ms_vjp);
    sdm_json_int(&j, "all_threads", t->threads);
    sdm_json_real(&j, "ms_network_all_threads", t->ms_threads);
    // speed, and the exact engine
    sdm_json_real(&j, "gmacs", gmacs(info->macs, t->maps.ms_network));
    sdm_json_real(&j, "gmacs_batch", gmacs(info->macs, t->maps.ms_batch));
    sdm_json_real(&j, "peak_gmacs", t->peak_gmacs);
    sdm_json_real(&j, "read_gb_per_s", t->read_gbs);
    sdm_json_real(&j, "ms_exact", t->maps.ms_exact);
    sdm_json_text(&j, "no_exact", t->no_exact.text);
    sdm_json_real(&j, "exact_over_network", t->maps.ms_exact / t->maps.ms_network);
    if (t->has_field) add_field_json(&t->field, &j);
    sdm_json_close(&j, '}');
    return cli_print_json(&j, err);
}

/* Creates the shape for the exact engine. If the shape is unknown or its data files are missing,
 * *why is the reason and only the network is measured. */
static sdm_status open_shape(const sdm_model *m, const sdm_registry *registry, sdm_instance **shape,
                             sdm_error *why, sdm_error *err)
{
    const sdm_status s = sdm_runtime_instance(m, registry, shape, why);
    if (!s || s == SDM_E_PLUGIN || s == SDM_E_IO || s == SDM_E_FORMAT) return SDM_OK;
    *err = *why;
    return s;
}

sdm_status cli_bench_network(const cli_args *args, sdm_error *err)
{
    if (args->files.n != 2) return sdm_fail(err, SDM_E_ARG, "usage: sdmgen bench network MODEL");
    const uint64_t seed = args->seed < 0 ? 1 : (uint64_t)args->seed;
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    sdm_model *model = NULL;
    network_times t = {0};
    sdm_status s = cli_open_registry(args, &registry, err);
    if (!s) s = cli_open_model(args, args->files.items[1], &model, err);
    const sdm_model_info *info = s ? NULL : sdm_model_get_info(model);
    if (!s) s = open_shape(model, registry, &shape, &t.no_exact, err);
    if (!s && info->n_params > SDM_MAX_PARAMS)
        s = sdm_fail(err, SDM_E_UNSUPPORTED, "%zu parameters, at most %d can be sampled",
                     info->n_params, SDM_MAX_PARAMS);
    if (!s) s = cli_time_maps(model, shape, seed, true, 0, &t.maps, err);
    if (!s) s = time_derivatives(model, seed, &t, err);
    if (!s) s = time_threads(model, seed, sdm_threads((int)args->threads), &t, err);
    t.has_field = args->size[0] > 0;
    if (!s && t.has_field) s = cli_bench_field(model, args, seed, &t.field, err);
    if (!s) s = measure_machine(info->weight_bytes, &t, err);
    if (!s && args->json)
        s = print_json(&t, info, err);
    else if (!s)
        print_times(&t, info);
    sdm_model_free(model);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    return s;
}
