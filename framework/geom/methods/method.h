/* Helpers shared by all methods (sdm/internal/methods.h): argument checks, preparation of the
 * surface, parallel loop, sign and report of one run. */
#pragma once

#include "mesh/point_triangle.h"
#include "sdm/internal/methods.h"

/* Minimum and maximum without the NaN handling of fmin() and fmax(), which would cost a function
 * call. */
static inline double sdm_lesser(double a, double b) { return a < b ? a : b; }
static inline double sdm_greater(double a, double b) { return a > b ? a : b; }

/* State of one call of a method. */
typedef struct sdm_run {
    const sdm_mesh *mesh;
    const sdm_grid *grid;
    sdm_method_opts opts; /* the caller's options, or all zero */
    float *values;
    sdm_method_report report;
    sdm_exact *engine;       /* NULL for "naive" */
    const sdm_mesh *surface; /* triangles of the engine, owned by it; NULL for "naive" */
    int n_threads;
    /* sdm_clock() at the start of the current stage, s */
    double start;
} sdm_run;

/* Checks the arguments, fills *run and prepares the surface with the exact engine. The caller must
 * call sdm_run_end() in every case, also after an error. SDM_E_ARG, and all errors of
 * sdm_exact_create(). */
sdm_status sdm_run_begin(sdm_run *run, const sdm_mesh *mesh, const sdm_grid *grid,
                         const sdm_method_opts *opts, float *values, sdm_error *err);
/* As sdm_run_begin(), but without the engine: for "naive". SDM_E_ARG. */
sdm_status sdm_run_begin_plain(sdm_run *run, const sdm_mesh *mesh, const sdm_grid *grid,
                               const sdm_method_opts *opts, float *values, sdm_error *err);
/* Ends the preparation: the time so far goes to report.ms_prepare, the time from now on to
 * report.ms_map. */
void sdm_run_prepared(sdm_run *run);
/* Frees the engine and, when s is SDM_OK and report is not NULL, copies the run's report to
 * *report. Returns s. */
sdm_status sdm_run_end(sdm_run *run, sdm_method_report *report, sdm_status s);

/* Adds count * size bytes to report.bytes. Call it before the allocation. SDM_E_NOMEM when the sum
 * exceeds memory_limit. */
sdm_status sdm_run_reserve(sdm_run *run, size_t count, size_t size, sdm_error *err);

/* Calls part(job, i, thread) for every i in 0 .. n - 1, on n_threads threads, 0 <= thread <
 * n_threads. Calls run at the same time, so they must not write to the same memory. The calling
 * thread reports the progress (stage + (i + 1) / n) / n_stages and polls `cancelled`:
 * SDM_E_CANCELLED. */
sdm_status sdm_run_parts(const sdm_run *run, int64_t n,
                         void (*part)(void *job, int64_t i, int thread), void *job, int stage,
                         int n_stages, sdm_error *err);

/* Negates values[] (unsigned distances) at voxels inside the surface. Errors of
 * sdm_exact_sign(). */
sdm_status sdm_run_sign(const sdm_run *run, sdm_error *err);

/* *frames = new array [surface->n_tri] of triangle frames (point_triangle.h), which the caller
 * frees with sdm_free(). SDM_E_NOMEM. */
sdm_status sdm_run_frames(sdm_run *run, sdm_frame **frames, sdm_error *err);

extern const sdm_method sdm_method_exact, sdm_method_naive, sdm_method_edt, sdm_method_cells,
    sdm_method_octree;
