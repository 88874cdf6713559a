/* Measures the methods of this library (sdm/internal/methods.h), and the exact engine on
 * all cores. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench.h"
#include "report/terminal.h"
#include "sdm/internal/brute_force.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/methods.h"

#define TIME_LIMIT_S 3.0 /* s; no run starts after this time */
#define NAIVE_PAIRS 3e7  /* largest (voxels * triangles) of the naive method: takes about 2 s */

/* Times a method on the whole grid: the fastest of several runs. */
static sdm_status time_method(const cli_bench_case *c, const sdm_method *m, int threads,
                              float *values, cli_bench_row *row, sdm_method_report *report,
                              sdm_error *err)
{
    const sdm_method_opts opts = {.exact = {.n_threads = threads, .cancelled = cli_interrupted},
                                  .band_mm = isfinite(c->band_mm) ? c->band_mm : 0};
    const double begin = sdm_clock();
    double best = INFINITY;
    for (size_t i = 0; i < c->repeat && (i == 0 || sdm_clock() - begin < TIME_LIMIT_S); i++) {
        const long before = i == 0 ? cli_bench_peak_start() : -1;
        const double start = threads == 1 ? sdm_thread_clock() : sdm_clock();
        const sdm_status s = m->map(&c->mesh, &c->grid, &opts, values, report, err);
        const double ms = 1e3 * ((threads == 1 ? sdm_thread_clock() : sdm_clock()) - start);
        if (s) return s;
        if (i == 0) row->peak_mb = cli_bench_peak_mb(before);
        if (!(ms < best)) continue;
        best = ms;
        row->ms_prepare = ms * report->ms_prepare / (report->ms_prepare + report->ms_map);
        row->ms_map = ms - row->ms_prepare;
    }
    row->share = 1;
    row->done = true;
    return SDM_OK;
}

/* Times the naive method on a share of the rows and scales the time to all: every voxel costs the
 * same. */
static sdm_status time_naive(const cli_bench_case *c, float *values, cli_bench_row *row,
                             sdm_error *err)
{
    const sdm_grid *g = &c->grid;
    const double share = fmin(c->share, NAIVE_PAIRS / ((double)c->voxels * (double)c->mesh.n_tri));
    int64_t done = 0;
    const double start = sdm_thread_clock();
    for (int64_t r = 0; r < g->n[1] * g->n[2]; r++) {
        const bool wanted = cli_bench_has_row(share, r);
        for (int64_t i = 0; i < g->n[0]; i++) {
            double x[3];
            sdm_grid_world(
                g, (const double[3]){(double)i, (double)(r % g->n[1]), (double)(r / g->n[1])}, x);
            values[r * g->n[0] + i] = wanted ? (float)sdm_naive_point(&c->mesh, x) : NAN;
        }
        if (wanted && cli_is_interrupted()) return cli_check_interrupt(err);
        done += wanted;
    }
    row->share = (double)done / (double)(g->n[1] * g->n[2]);
    row->ms_map = 1e3 * (sdm_thread_clock() - start) / row->share;
    row->peak_mb = 0;
    row->done = true;
    return SDM_OK;
}

static sdm_status measure_method(cli_bench_case *c, const sdm_method *m, int threads, float *values,
                                 cli_bench_rows *rows, sdm_error *err)
{
    char name[48];
    if (threads == 1)
        snprintf(name, sizeof name, "%s", m->name);
    else
        snprintf(name, sizeof name, "%s, %d threads", m->name, threads);
    cli_bench_row *row = NULL;
    sdm_method_report report = {0};
    sdm_status s = cli_bench_add(rows, name, &row, err);
    if (!s && !strcmp(m->name, "naive"))
        s = time_naive(c, values, row, err);
    else if (!s)
        s = time_method(c, m, threads, values, row, &report, err);
    // a failure of a method other than the exact engine leaves its row without figures
    if (s && s != SDM_E_CANCELLED && rows->n > 1) {
        snprintf(row->note, sizeof row->note, "%.200s", err->text);
        return SDM_OK;
    }
    if (s) return s;
    if (rows->n == 1) { // the exact engine comes first; the other methods are compared with it
        c->unioned = report.exact.unioned;
        memcpy(c->exact, values, c->voxels * sizeof *values);
        s = cli_bench_find_signs(c, err);
    }
    snprintf(row->note, sizeof row->note, "%.120s (%.80s)", m->summary, m->reference);
    cli_bench_compare(c, values, row);
    return s;
}

sdm_status cli_bench_own(cli_bench_case *c, cli_bench_rows *rows, sdm_error *err)
{
    float *values = NULL;
    sdm_status s = SDM_ALLOC(&values, c->voxels, "distance map", err);
    for (size_t i = 0; i < sdm_method_count() && !s; i++) {
        s = measure_method(c, sdm_method_at(i), 1, values, rows, err);
        if (!s && i == 0 && c->threads > 1)
            s = measure_method(c, sdm_method_at(i), c->threads, values, rows, err);
        if (!s) s = cli_check_interrupt(err);
    }
    sdm_free(values);
    return s;
}

sdm_status cli_bench_add(cli_bench_rows *rows, const char *name, cli_bench_row **row,
                         sdm_error *err)
{
    if (rows->n == rows->capacity) {
        const size_t capacity = rows->capacity ? 2 * rows->capacity : 16;
        const sdm_status s = sdm_grow((void **)&rows->items, rows->n, capacity, sizeof *rows->items,
                                      "rows of the table", err);
        if (s) return s;
        rows->capacity = capacity;
    }
    *row = &rows->items[rows->n++];
    memset(*row, 0, sizeof **row);
    snprintf((*row)->name, sizeof(*row)->name, "%s", name);
    return SDM_OK;
}
