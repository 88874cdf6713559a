/* Measures the time per map on one core for a network, the exact engine and the naive method. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "evaluate.h"
#include "measure/median.h"
#include "report/terminal.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/config.h"
#include "sdm/internal/methods.h"
#include "sdm/memory.h"

enum { N_NETWORK = 51, N_MIN = 3, N_EXACT = 9, BATCH = 32, N_BATCHES = 9, NAIVE_STEP = 16 };
/* For slow networks: no map starts after this time (s), and a batch is small enough to end within
 * it. */
#define TIME_LIMIT_S 6.0
/* Below this ratio of the times the exact engine is about as fast as the network. */
#define ABOUT_AS_FAST 2.5
#define BATCH_BYTES 2e8 /* largest size of the maps of a batch, bytes */

double cli_minimum(double *v, size_t n)
{
    double least = INFINITY;
    for (size_t i = 0; i < n; i++) least = fmin(least, v[i]);
    return least;
}

static double summary(bool fastest, double *ms, size_t n)
{
    return fastest ? cli_minimum(ms, n) : cli_median(ms, n);
}

static sdm_status time_network(const sdm_model *m, uint64_t seed, bool fastest, float *values,
                               cli_timing *out, sdm_error *err)
{
    const sdm_generate_opts opts = {.policy = SDM_RANGE_REFUSE, .n_threads = 1};
    double p[SDM_MAX_PARAMS], ms[N_NETWORK];
    const double begin = sdm_clock();
    size_t n = 0;
    for (size_t i = 0; i <= N_NETWORK && (n < N_MIN || sdm_clock() - begin < TIME_LIMIT_S); i++) {
        cli_eval_params(m, seed, fastest ? 0 : i, p);
        const double start = sdm_thread_clock();
        sdm_status s = sdm_generate(m, p, &opts, values, NULL, err);
        if (!s) s = cli_check_interrupt(err);
        if (s) return s;
        if (i > 0) ms[n++] = 1e3 * (sdm_thread_clock() - start); // the first map warms up
    }
    out->ms_network = summary(fastest, ms, n);
    out->n_network = n;
    return SDM_OK;
}

sdm_status cli_time_maker(const cli_map_maker *m, uint64_t seed, float *values, double *ms,
                          sdm_error *err)
{
    double p[SDM_MAX_PARAMS], each[N_EXACT];
    for (size_t i = 0; i <= N_EXACT; i++) {
        cli_maker_params(m, seed, i, p);
        const double start = sdm_thread_clock();
        sdm_status s = m->make(m->user, p, values, err);
        if (!s) s = cli_check_interrupt(err);
        if (s) return s;
        if (i > 0) each[i - 1] = 1e3 * (sdm_thread_clock() - start);
    }
    *ms = cli_median(each, N_EXACT);
    return SDM_OK;
}

/* BATCH maps, or fewer if the maps are large or slow. */
static size_t batch_size(const sdm_model *m, double ms_network)
{
    const double bytes = (double)sdm_grid_count(&sdm_model_get_info(m)->grid) * sizeof(float);
    return (size_t)fmax(1, fmin(BATCH, fmin(BATCH_BYTES / bytes, 1e3 * TIME_LIMIT_S / ms_network)));
}

static sdm_status time_batch(const sdm_model *m, uint64_t seed, bool fastest, size_t size,
                             cli_timing *out, sdm_error *err)
{
    const sdm_generate_opts opts = {.policy = SDM_RANGE_REFUSE, .n_threads = 1};
    const size_t n_params = sdm_model_get_info(m)->n_params;
    double p[BATCH * SDM_MAX_PARAMS], ms[N_BATCHES];
    const double begin = sdm_clock();
    float *values = NULL;
    size_t n = 0;
    sdm_status s = sdm_alloc((void **)&values, sdm_grid_count(&sdm_model_get_info(m)->grid),
                             size * sizeof *values, "batch of maps to time", err);
    for (size_t i = 0; i < size; i++) cli_eval_params(m, seed, i, p + i * n_params);
    for (size_t k = 0; k <= N_BATCHES && !s && (n < 1 || sdm_clock() - begin < TIME_LIMIT_S); k++) {
        const double start = sdm_thread_clock();
        s = sdm_generate_batch(m, p, size, &opts, values, NULL, err);
        if (!s) s = cli_check_interrupt(err);
        if (k > 0) ms[n++] = 1e3 * (sdm_thread_clock() - start) / (double)size;
    }
    if (!s) out->ms_batch = summary(fastest, ms, n);
    out->batch_size = size;
    sdm_free(values);
    return s;
}

static sdm_status time_exact(const sdm_model *m, const sdm_instance *shape, uint64_t seed,
                             bool fastest, float *values, cli_timing *out, sdm_error *err)
{
    const sdm_exact_opts opts = {.n_threads = 1};
    double p[SDM_MAX_PARAMS], ms[N_EXACT];
    for (size_t i = 0; i <= N_EXACT; i++) {
        cli_eval_params(m, seed, fastest ? 0 : i, p);
        const double start = sdm_thread_clock();
        sdm_status s =
            sdm_exact_shape_map(shape, p, &opts, &sdm_model_get_info(m)->grid, values, NULL, err);
        if (!s) s = cli_check_interrupt(err);
        if (s) return s;
        if (i > 0) ms[i - 1] = 1e3 * (sdm_thread_clock() - start);
    }
    out->ms_exact = summary(fastest, ms, N_EXACT);
    out->n_exact = N_EXACT;
    return SDM_OK;
}

/* Time of the naive method for one mesh. Every voxel costs the same, so a few slices, spread over
 * the box, represent all. */
static sdm_status time_naive_mesh(const sdm_mesh *mesh, const sdm_grid *grid, double *ms,
                                  double *share, sdm_error *err)
{
    sdm_grid thin = *grid;
    thin.n[2] = (grid->n[2] + NAIVE_STEP - 1) / NAIVE_STEP;
    thin.spacing[2] = grid->spacing[2] * (double)grid->n[2] / (double)thin.n[2];
    const sdm_method_opts opts = {.exact = {.n_threads = 1, .cancelled = cli_interrupted}};
    const sdm_method *naive = sdm_method_find("naive", err);
    float *values = NULL;
    sdm_status s = naive ? SDM_ALLOC(&values, sdm_grid_count(&thin), "map of the naive method", err)
                         : SDM_E_INTERNAL;
    if (s) return s;
    const double start = sdm_thread_clock();
    s = naive->map(mesh, &thin, &opts, values, NULL, err);
    *share = (double)thin.n[2] / (double)grid->n[2];
    *ms = 1e3 * (sdm_thread_clock() - start) / *share;
    sdm_free(values);
    return s;
}

sdm_status cli_time_naive(const cli_map_maker *m, uint64_t seed, size_t n, double *ms,
                          double *share, sdm_error *err)
{
    double p[SDM_MAX_PARAMS], *each = NULL;
    sdm_mesh mesh = {0};
    sdm_status s = SDM_ALLOC(&each, n, "times", err);
    *ms = *share = NAN;
    for (size_t i = 0; i < n && !s; i++) {
        cli_maker_params(m, seed, i, p);
        s = sdm_instance_mesh(m->shape, p, &mesh, err);
        if (!s) s = time_naive_mesh(&mesh, &m->grid, &each[i], share, err);
        if (!s) s = cli_check_interrupt(err);
    }
    if (!s && n > 0) *ms = cli_median(each, n);
    sdm_mesh_dispose(&mesh);
    sdm_free(each);
    return s;
}

sdm_status cli_time_two(const sdm_model *m, const sdm_instance *shape, cli_timing *out,
                        sdm_error *err)
{
    *out = (cli_timing){
        .ms_network = NAN, .ms_batch = NAN, .ms_exact = NAN, .ms_naive = NAN, .naive_share = NAN};
    float *values = NULL;
    sdm_status s =
        SDM_ALLOC(&values, sdm_grid_count(&sdm_model_get_info(m)->grid), "map to time", err);
    if (!s) s = time_network(m, 1, false, values, out, err);
    if (!s) s = time_exact(m, shape, 1, false, values, out, err);
    sdm_free(values);
    return s;
}

/* "12.3 ms", or "not measured" for NaN; returns buf. */
static const char *format_ms(double ms, char buf[32])
{
    snprintf(buf, 32, isnan(ms) ? "not measured" : "%.3g ms", ms);
    return buf;
}

void cli_print_two(const char *begin, const cli_timing *t)
{
    char network[32], exact[32];
    const double ratio = t->ms_exact / t->ms_network;
    printf("%sone map on one core: network %s, exact engine %s", begin,
           format_ms(t->ms_network, network), format_ms(t->ms_exact, exact));
    if (!isnan(ratio)) printf(", %.*f times as long", ratio < 10 ? 2 : 0, ratio);
    if (ratio < ABOUT_AS_FAST)
        printf(": exact maps (sdmgen exact, fit --exact) need no network here");
    printf("\n");
}

sdm_status cli_time_maps(const sdm_model *m, const sdm_instance *shape, uint64_t seed, bool fastest,
                         size_t n_naive, cli_timing *out, sdm_error *err)
{
    memset(out, 0, sizeof *out);
    out->ms_exact = out->ms_naive = out->naive_share = NAN;
    out->n_naive = n_naive;
    float *values = NULL;
    const cli_map_maker maker = cli_maker_of_model(m, shape);
    sdm_status s = SDM_ALLOC(&values, sdm_grid_count(&maker.grid), "map to time", err);
    if (!s) s = time_network(m, seed, fastest, values, out, err);
    if (!s) s = time_batch(m, seed, fastest, batch_size(m, out->ms_network), out, err);
    if (!s && shape) s = time_exact(m, shape, seed, fastest, values, out, err);
    if (!s && shape)
        s = cli_time_naive(&maker, seed, n_naive, &out->ms_naive, &out->naive_share, err);
    sdm_free(values);
    return s;
}
