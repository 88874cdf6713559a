/* What the methods share: the run's frame, the surface, the sign, the loop over parts. */
#ifndef SDM_GEOM_METHODS_METHOD_H
#define SDM_GEOM_METHODS_METHOD_H

#include "mesh/point_triangle.h"
#include "sdm/internal/methods.h"

/* fmin and fmax without their care for NaN, which costs a call. */
static inline double sdm_lesser(double a, double b) { return a < b ? a : b; }
static inline double sdm_greater(double a, double b) { return a > b ? a : b; }

/* One run of a method. */
typedef struct sdm_run {
    const sdm_mesh *mesh;
    const sdm_grid *grid;
    sdm_method_opts opts; /* the caller's or the defaults */
    float *values;
    sdm_method_report report;
    sdm_exact *engine;       /* NULL for "naive" */
    const sdm_mesh *surface; /* of the engine */
    int n_threads;
    double start; /* sdm_clock(), of the stage that runs */
} sdm_run;

/* Checks the arguments, then prepares the surface with the engine. sdm_run_end() follows in every
 * case. */
sdm_status sdm_run_begin(sdm_run *run, const sdm_mesh *mesh, const sdm_grid *grid,
                         const sdm_method_opts *opts, float *values, sdm_error *err);
/* The checks alone, for "naive". */
sdm_status sdm_run_begin_plain(sdm_run *run, const sdm_mesh *mesh, const sdm_grid *grid,
                               const sdm_method_opts *opts, float *values, sdm_error *err);
/* What follows counts as ms_map, what went before as ms_prepare. */
void sdm_run_prepared(sdm_run *run);
/* Frees the engine; after success hands out the report. Returns s. */
sdm_status sdm_run_end(sdm_run *run, sdm_method_report *report, sdm_status s);

/* Adds count * size bytes to the report; SDM_E_NOMEM over memory_limit. To be asked before
 * allocating. */
sdm_status sdm_run_reserve(sdm_run *run, size_t count, size_t size, sdm_error *err);

/* Calls part(job, i, thread) for i in 0 .. n - 1 on the run's threads, thread below n_threads;
   parts must not touch each other's results. Stops on request. Progress: this is stage `stage` of
   `n_stages`. */
sdm_status sdm_run_parts(const sdm_run *run, int64_t n,
                         void (*part)(void *job, int64_t i, int thread), void *job, int stage,
                         int n_stages, sdm_error *err);

/* values[] >= 0 become negative where the engine has the inside. */
sdm_status sdm_run_sign(const sdm_run *run, sdm_error *err);

/* *frames = new array of the surface's triangles. */
sdm_status sdm_run_frames(sdm_run *run, sdm_frame **frames, sdm_error *err);

extern const sdm_method sdm_method_exact, sdm_method_naive, sdm_method_edt, sdm_method_cells,
    sdm_method_octree;

#endif
