/* Steps shared by all methods (method.h). */
#include <stdatomic.h>
#include <string.h>

#include "method.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"

sdm_status sdm_run_begin_plain(sdm_run *run, const sdm_mesh *mesh, const sdm_grid *grid,
                               const sdm_method_opts *opts, float *values, sdm_error *err)
{
    memset(run, 0, sizeof *run);
    if (!mesh || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "mesh, grid and values of a map must not be NULL");
    run->mesh = mesh;
    run->grid = grid;
    run->values = values;
    if (opts) run->opts = *opts;
    if (!(run->opts.max_error_mm >= 0 && run->opts.max_error_mm <= 1e100))
        return sdm_fail(err, SDM_E_ARG, "max_error_mm is %g, need a number of 0 or more",
                        run->opts.max_error_mm);
    run->n_threads = sdm_threads(run->opts.exact.n_threads);
    run->start = sdm_clock();
    return sdm_grid_check(grid, err);
}

sdm_status sdm_run_begin(sdm_run *run, const sdm_mesh *mesh, const sdm_grid *grid,
                         const sdm_method_opts *opts, float *values, sdm_error *err)
{
    sdm_status s = sdm_run_begin_plain(run, mesh, grid, opts, values, err);
    if (!s) s = sdm_exact_create(mesh, &run->opts.exact, &run->engine, err);
    if (s) return s;
    run->report.exact = *sdm_exact_get_report(run->engine);
    run->surface = sdm_exact_surface(run->engine);
    sdm_run_prepared(run);
    return SDM_OK;
}

void sdm_run_prepared(sdm_run *run)
{
    const double now = sdm_clock();
    run->report.ms_prepare += 1e3 * (now - run->start);
    run->start = now;
}

sdm_status sdm_run_end(sdm_run *run, sdm_method_report *report, sdm_status s)
{
    run->report.ms_map = 1e3 * (sdm_clock() - run->start);
    sdm_exact_free(run->engine);
    if (!s && report) *report = run->report;
    return s;
}

sdm_status sdm_run_reserve(sdm_run *run, size_t count, size_t size, sdm_error *err)
{
    size_t bytes;
    const size_t limit = run->opts.exact.memory_limit;
    const sdm_status s = sdm_mul(count, size, &bytes, err);
    if (s) return s;
    if (bytes > SIZE_MAX - run->report.bytes)
        return sdm_fail(err, SDM_E_NOMEM, "the method needs too much memory");
    run->report.bytes += bytes;
    if (limit && run->report.bytes > limit)
        return sdm_fail(err, SDM_E_NOMEM,
                        "the method needs at least %zu bytes, memory_limit is %zu; raise it or use "
                        "method exact",
                        run->report.bytes, limit);
    return SDM_OK;
}

sdm_status sdm_run_parts(const sdm_run *run, int64_t n,
                         void (*part)(void *job, int64_t i, int thread), void *job, int stage,
                         int n_stages, sdm_error *err)
{
    const sdm_exact_opts *o = &run->opts.exact;
    atomic_bool stop = false;
#pragma omp parallel for schedule(dynamic) num_threads(run->n_threads)
    for (int64_t i = 0; i < n; i++) {
        const int thread = sdm_thread();
        if (atomic_load(&stop)) continue;
        part(job, i, thread);
        if (thread != 0) continue; // only the calling thread runs the callbacks
        if (run->opts.progress)
            run->opts.progress(o->user, ((double)stage + (double)(i + 1) / (double)n) / n_stages);
        if (o->cancelled && o->cancelled(o->user)) atomic_store(&stop, true);
    }
    return atomic_load(&stop) ? sdm_fail(err, SDM_E_CANCELLED, "map stopped on request") : SDM_OK;
}

sdm_status sdm_run_frames(sdm_run *run, sdm_frame **frames, sdm_error *err)
{
    const sdm_mesh *m = run->surface;
    sdm_status s = sdm_run_reserve(run, m->n_tri, sizeof **frames, err);
    if (!s) s = SDM_ALLOC(frames, m->n_tri, "frames of triangles", err);
    for (size_t t = 0; t < m->n_tri && !s; t++) {
        const uint32_t *v = &m->tri[3 * t];
        sdm_frame_build(&m->vert[3 * (size_t)v[0]], &m->vert[3 * (size_t)v[1]],
                        &m->vert[3 * (size_t)v[2]], &(*frames)[t]);
    }
    return s;
}

sdm_status sdm_run_sign(const sdm_run *run, sdm_error *err)
{
    return sdm_exact_sign(run->engine, run->grid, run->values, err);
}
