/* Rows of an experiment that need no training: methods of this library (sdm/internal/methods.h),
 * and other programs (peers). */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench.h"
#include "bench_programs.h"
#include "experiment_command.h"
#include "measure/median.h"
#include "report/terminal.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/methods.h"
#include "sdm/memory.h"

#define MB_OF_MIB 1.048576
#define TIME_LIMIT_S 20.0                 /* s; no shape is timed after this */
enum { TIMED_MAX = 9, NAIVE_SHAPES = 2 }; /* timed shapes */

sdm_status cli_experiment_check_engine(const char *name, sdm_error *err)
{
    const char *names[64];
    size_t n = 0;
    for (size_t i = 0; i < sdm_method_count() && n < 32; i++) names[n++] = sdm_method_at(i)->name;
    for (size_t i = 0; cli_peers_known(i) && n < 64; i++) names[n++] = cli_peers_known(i);
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
    const cli_experiment_job *job;
} own_method;

/* Makes the mesh and the map, like an application in which the shape changes. */
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

static sdm_status time_method(const cli_experiment_run *run, const cli_experiment_job *job,
                              float *values, double *median, sdm_error *err)
{
    double p[SDM_MAX_PARAMS], ms[TIMED_MAX];
    const double begin = sdm_clock();
    size_t n = 0;
    while (n < TIMED_MAX && (n == 0 || sdm_clock() - begin < TIME_LIMIT_S)) {
        cli_maker_params(&job->maker, run->e->experiment.seed, n, p);
        const double start = sdm_thread_clock();
        sdm_status s = job->maker.make(job->maker.user, p, values, err);
        if (!s) s = cli_check_interrupt(err);
        if (s) return s;
        ms[n++] = 1e3 * (sdm_thread_clock() - start);
    }
    *median = cli_median(ms, n);
    return SDM_OK;
}

/* Appends the text to out->note, as far as there is room. */
static void note_append(cli_experiment_result *out, const char *text)
{
    const size_t used = strlen(out->note);
    snprintf(out->note + used, sizeof out->note - used, "%s", text);
}

static sdm_status measure_own(const cli_experiment_run *run, cli_experiment_job *job,
                              const sdm_method *method, cli_experiment_result *out, sdm_error *err)
{
    const own_method own = {method, job};
    const size_t n = sdm_grid_count(&job->maker.grid);
    const bool naive = !strcmp(method->name, "naive"), truth = !strcmp(method->name, "exact");
    const uint64_t seed = run->e->experiment.seed;
    double share = 1;
    char timed[64];
    float *values = NULL;
    cli_eval e = {0};
    // memory and pictures
    job->maker.make = make_map;
    job->maker.user = &own;
    const long before = cli_bench_peak_start();
    sdm_status s = SDM_ALLOC(&values, n, "distance map", err);
    if (!s) s = make_map(&own, job->nominal, values, err);
    out->figure[SDM_FIGURE_PEAK] = MB_OF_MIB * cli_bench_peak_mb(before);
    if (!s) s = cli_experiment_draw(run, job, values, err);
    // times and errors
    if (!s && naive)
        s = cli_time_naive(&job->maker, seed, NAIVE_SHAPES, &out->figure[SDM_FIGURE_MS], &share,
                           err);
    if (!s && !naive) s = time_method(run, job, values, &out->figure[SDM_FIGURE_MS], err);
    if (!s && !truth)
        s = cli_evaluate_maps(&job->maker, seed, (size_t)out->row->samples, true, &e, err);
    if (!s && !truth) cli_experiment_set_errors(out, &e);
    // the note
    snprintf(out->note, sizeof out->note, "%s (%s), %s, mesh and preparation included",
             method->summary, method->reference, out->grid);
    snprintf(timed, sizeof timed, "; timed on %.0f %% of the voxels", 100 * share);
    if (share < 1)
        note_append(out, timed);
    else if (truth)
        note_append(out, "; the errors of all other rows refer to it");
    cli_eval_dispose(&e);
    sdm_free(values);
    return s;
}

/* ---- other programs ---- */

/* Makes the exact map of the nominal shape; *unioned: the mesh of the shape overlaps itself. */
static sdm_status make_exact_map(const cli_experiment_job *job, float *values, bool *unioned,
                                 sdm_error *err)
{
    const sdm_exact_opts opts = {.cancelled = cli_interrupted};
    sdm_exact_report report = {0};
    const sdm_status s = sdm_exact_shape_map(job->shape, job->nominal, &opts, &job->maker.grid,
                                             values, &report, err);
    *unioned = report.unioned;
    return s;
}

/* True when every voxel has a value: errors of an incomplete map are not comparable. */
static bool is_complete(const float *values, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(values[i])) return false;
    return true;
}

/* Measures the errors of the peer's map and draws its pictures. */
static sdm_status evaluate_peer(const cli_experiment_run *run, const cli_experiment_job *job,
                                const cli_bench_case *c, const float *values,
                                cli_experiment_result *out, sdm_error *err)
{
    cli_eval_sample sample = {0};
    cli_eval e = {.sample = &sample, .n = 1};
    sdm_status s = cli_compare_maps(&c->grid, values, c->exact, true, &sample, err);
    if (s) return s;
    cli_eval_reduce(&e);
    cli_experiment_set_errors(out, &e);
    return cli_experiment_draw(run, job, values, err);
}

static sdm_status measure_peer(const cli_experiment_run *run, cli_experiment_job *job,
                               const char *name, cli_experiment_result *out, sdm_error *err)
{
    cli_bench_case c = {
        .grid = job->maker.grid, .band_mm = INFINITY, .share = 1, .repeat = 3, .threads = 1};
    cli_bench_row row = {.done = false};
    float *values = NULL;
    c.voxels = sdm_grid_count(&c.grid);
    sdm_status s = sdm_instance_mesh(job->shape, job->nominal, &c.mesh, err);
    if (!s) s = SDM_ALLOC(&c.exact, c.voxels, "distance map", err);
    if (!s) s = SDM_ALLOC(&c.winding, c.voxels, "signs", err);
    if (!s) s = SDM_ALLOC(&values, c.voxels, "distance map", err);
    if (!s) s = make_exact_map(job, c.exact, &c.unioned, err);
    for (size_t i = 0; i < c.voxels && !s; i++) c.winding[i] = NAN;
    if (!s) s = cli_bench_peer(&c, run->args, name, values, &row, err);
    if (!s && !row.done)
        s = sdm_fail(err, SDM_E_UNSUPPORTED, "%s", row.note);
    else if (!s) {
        out->figure[SDM_FIGURE_MS] = row.ms_prepare + row.ms_map;
        out->figure[SDM_FIGURE_PEAK] = MB_OF_MIB * row.peak_mb;
        snprintf(out->note, sizeof out->note,
                 "%s; %s, preparation included; errors of the default shape", row.note, out->grid);
        if (is_complete(values, c.voxels)) s = evaluate_peer(run, job, &c, values, out, err);
    }
    sdm_free(values);
    cli_bench_case_dispose(&c);
    return s;
}

sdm_status cli_experiment_engine(const cli_experiment_run *run, cli_experiment_job *job,
                                 cli_experiment_result *out, sdm_error *err)
{
    const char *name = out->row->method->engine;
    for (size_t i = 0; i < sdm_method_count(); i++)
        if (!strcmp(sdm_method_at(i)->name, name))
            return measure_own(run, job, sdm_method_at(i), out, err);
    return measure_peer(run, job, name, out, err);
}
