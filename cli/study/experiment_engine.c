/* A row without training: a method of sdm/methods.h, or another program. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench.h"
#include "experiment_command.h"
#include "report/terminal.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/methods.h"
#include "sdm/memory.h"

#define MB_OF_MIB 1.048576
#define ENOUGH_S 20.0 /* no further shape is timed after this */
enum { MOST_TIMED = 9 };

sdm_status experiment_check_engine(const char *name, sdm_error *err)
{
    const char *names[64];
    size_t n = 0;
    for (size_t i = 0; i < sdm_method_count() && n < 32; i++) names[n++] = sdm_method_at(i)->name;
    for (size_t i = 0; bench_peer_name(i) && n < 64; i++) names[n++] = bench_peer_name(i);
    for (size_t i = 0; i < n; i++)
        if (!strcmp(names[i], name)) return SDM_OK;
    sdm_text list = {0};
    for (size_t i = 0; i < n; i++) sdm_text_add(&list, "%s%s", i ? ", " : "", names[i]);
    const char *near = sdm_nearest_name(name, names, n);
    const sdm_status s = sdm_fail(err, SDM_E_CONFIG, "engine: '%s' is not one of %s%s%s%s", name,
                                  list.data ? list.data : "", near ? "; did you mean '" : "",
                                  near ? near : "", near ? "'?" : "");
    sdm_text_dispose(&list);
    return s;
}

/* ---- this library's methods ---- */

typedef struct own_method {
    const sdm_method *method;
    const experiment_job *job;
} own_method;

/* Mesh, preparation and map, as an application that changes the shape needs them. */
static sdm_status make_map(const void *user, const double *p, float *values, sdm_error *err)
{
    const own_method *own = user;
    const sdm_method_opts opts = {.exact = {.n_threads = 1, .cancelled = cli_interrupted}};
    sdm_mesh mesh = {0};
    sdm_status s = sdm_instance_mesh(own->job->shape, p, &mesh, err);
    if (!s) s = own->method->map(&mesh, &own->job->maker.grid, &opts, values, NULL, err);
    sdm_mesh_dispose(&mesh);
    return s;
}

static sdm_status time_method(const experiment_run *run, const experiment_job *job, float *values,
                              double *median, sdm_error *err)
{
    double p[SDM_MAX_PARAMS], ms[MOST_TIMED];
    const double begin = sdm_clock();
    size_t n = 0;
    while (n < MOST_TIMED && (n == 0 || sdm_clock() - begin < ENOUGH_S)) {
        cli_maker_params(&job->maker, run->e->experiment.seed, n, p);
        const double start = cli_thread_clock();
        sdm_status s = job->maker.make(job->maker.user, p, values, err);
        if (!s) s = cli_check_interrupt(err);
        if (s) return s;
        ms[n++] = 1e3 * (cli_thread_clock() - start);
    }
    *median = cli_median(ms, n);
    return SDM_OK;
}

/* The naive method costs the same for every voxel: a share of the slices stands for all. */
static sdm_status time_naive(const experiment_run *run, const experiment_job *job, double *median,
                             double *share, sdm_error *err)
{
    double p[SDM_MAX_PARAMS], ms[2];
    sdm_mesh mesh = {0};
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < 2 && !s; i++) {
        cli_maker_params(&job->maker, run->e->experiment.seed, i, p);
        s = sdm_instance_mesh(job->shape, p, &mesh, err);
        if (!s) s = cli_time_naive(&mesh, &job->maker.grid, &ms[i], share, err);
        if (!s) s = cli_check_interrupt(err);
    }
    *median = s ? NAN : cli_median(ms, 2);
    sdm_mesh_dispose(&mesh);
    return s;
}

static sdm_status own_row(const experiment_run *run, experiment_job *job, const sdm_method *method,
                          experiment_result *out, sdm_error *err)
{
    const own_method own = {method, job};
    const size_t n = sdm_grid_count(&job->maker.grid);
    const bool naive = !strcmp(method->name, "naive"), truth = !strcmp(method->name, "exact");
    double share = 1;
    float *values = NULL;
    cli_eval e = {0};
    job->maker.make = make_map;
    job->maker.user = &own;
    const long before = bench_peak_start();
    sdm_status s = SDM_ALLOC(&values, n, "distance map", err);
    if (!s) s = make_map(&own, job->nominal, values, err);
    out->figure[SDM_FIGURE_PEAK] = MB_OF_MIB * bench_peak_mb(before);
    if (!s) s = experiment_draw(run, job, values, err);
    if (!s && naive) s = time_naive(run, job, &out->figure[SDM_FIGURE_MS], &share, err);
    if (!s && !naive) s = time_method(run, job, values, &out->figure[SDM_FIGURE_MS], err);
    if (!s && !truth)
        s = cli_evaluate_maps(&job->maker, run->e->experiment.seed, (size_t)out->row->samples, true,
                              &e, err);
    if (!s && !truth) experiment_set_errors(out, &e);
    int used = snprintf(out->note, sizeof out->note, "%s (%s), %s, mesh and preparation included",
                        method->summary, method->reference, out->grid);
    if (used > 0 && (size_t)used < sizeof out->note && share < 1)
        snprintf(out->note + used, sizeof out->note - (size_t)used,
                 "; timed on %.0f %% of the voxels", 100 * share);
    else if (used > 0 && (size_t)used < sizeof out->note && truth)
        snprintf(out->note + used, sizeof out->note - (size_t)used,
                 "; the errors of all others are from it");
    cli_eval_dispose(&e);
    sdm_free(values);
    return s;
}

/* ---- other programs ---- */

static sdm_status exact_map(const experiment_job *job, float *values, bool *unioned, sdm_error *err)
{
    const sdm_exact_opts opts = {.cancelled = cli_interrupted};
    sdm_exact_report report = {0};
    const sdm_status s = sdm_exact_shape_map(job->shape, job->nominal, &opts, &job->maker.grid,
                                             values, &report, err);
    *unioned = report.unioned;
    return s;
}

/* A map with gaps has no error over all voxels. */
static bool is_whole(const float *values, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(values[i])) return false;
    return true;
}

static sdm_status peer_errors(const experiment_run *run, const experiment_job *job,
                              const bench_case *c, const float *values, experiment_result *out,
                              sdm_error *err)
{
    cli_eval_sample sample = {0};
    cli_eval e = {.sample = &sample, .n = 1};
    sdm_status s = cli_compare_maps(&c->grid, values, c->exact, true, &sample, err);
    if (s) return s;
    cli_eval_reduce(&e);
    experiment_set_errors(out, &e);
    return experiment_draw(run, job, values, err);
}

static sdm_status peer_row(const experiment_run *run, experiment_job *job, const char *name,
                           experiment_result *out, sdm_error *err)
{
    bench_case c = {
        .grid = job->maker.grid, .band_mm = INFINITY, .share = 1, .repeat = 3, .threads = 1};
    bench_row row = {.done = false};
    float *values = NULL;
    c.voxels = sdm_grid_count(&c.grid);
    sdm_status s = sdm_instance_mesh(job->shape, job->nominal, &c.mesh, err);
    if (!s) s = SDM_ALLOC(&c.exact, c.voxels, "distance map", err);
    if (!s) s = SDM_ALLOC(&c.winding, c.voxels, "signs", err);
    if (!s) s = SDM_ALLOC(&values, c.voxels, "distance map", err);
    if (!s) s = exact_map(job, c.exact, &c.unioned, err);
    for (size_t i = 0; i < c.voxels && !s; i++) c.winding[i] = NAN;
    if (!s) s = bench_peer(&c, run->args, name, values, &row, err);
    if (!s && !row.done)
        s = sdm_fail(err, SDM_E_UNSUPPORTED, "%s", row.note);
    else if (!s) {
        out->figure[SDM_FIGURE_MS] = row.ms_prepare + row.ms_map;
        out->figure[SDM_FIGURE_PEAK] = MB_OF_MIB * row.peak_mb;
        snprintf(out->note, sizeof out->note,
                 "%s; %s, preparation included; errors of the default shape", row.note, out->grid);
        if (is_whole(values, c.voxels)) s = peer_errors(run, job, &c, values, out, err);
    }
    sdm_free(values);
    bench_case_dispose(&c);
    return s;
}

sdm_status experiment_engine(const experiment_run *run, experiment_job *job, experiment_result *out,
                             sdm_error *err)
{
    const char *name = out->row->method->engine;
    for (size_t i = 0; i < sdm_method_count(); i++)
        if (!strcmp(sdm_method_at(i)->name, name))
            return own_row(run, job, sdm_method_at(i), out, err);
    return peer_row(run, job, name, out, err);
}
