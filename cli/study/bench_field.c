/* sdmgen bench network: times of a model as a field, on one core: a map and a band on another grid,
 * values and gradients at points. */
#include <math.h>

#include "bench.h"
#include "evaluate.h"
#include "inputs/setup.h"
#include "report/terminal.h"
#include "sdm/field.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"

enum { RUNS = 30, RUNS_MIN = 3, POINTS = 100000, SINGLE = 10000, STREAM = 17 };
#define TIME_LIMIT_S 3.0
#define BAND_VOXELS 3.0

/* What is timed, with its memory. */
typedef struct field_work {
    sdm_field *field, *bounded; /* bounded: for the grid, which may leave the box */
    double p[SDM_MAX_PARAMS];
    sdm_grid grid;
    double width;
    float *map, *values, *gradient;
    double *points;
    size_t blocks;
} field_work;

typedef sdm_status (*field_call)(field_work *w, sdm_error *err);

static sdm_status call_params(field_work *w, sdm_error *err)
{
    return sdm_field_set_params(w->field, w->p, NULL, err);
}
static sdm_status call_map(field_work *w, sdm_error *err)
{
    return sdm_field_grid(w->bounded, &w->grid, w->map, NULL, err);
}
static sdm_status call_band(field_work *w, sdm_error *err)
{
    sdm_blocks band;
    const sdm_status s = sdm_field_band(w->bounded, &w->grid, w->width, &band, err);
    w->blocks = band.n_block;
    sdm_blocks_dispose(&band);
    return s;
}
static sdm_status call_points(field_work *w, sdm_error *err)
{
    return sdm_field_points(w->field, w->points, POINTS, w->values, w->gradient, NULL, err);
}
static sdm_status call_single(field_work *w, sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < SINGLE && !s; i++)
        s = sdm_field_point(w->field, w->points + 3 * i, w->values + i, w->gradient + 3 * i, NULL,
                            err);
    return s;
}

/* *ms = the fastest of several calls. */
static sdm_status time_call(field_work *w, field_call call, double *ms, sdm_error *err)
{
    double best = INFINITY, total = 0;
    for (int n = 0; n < RUNS && (n < RUNS_MIN || total < TIME_LIMIT_S); n++) {
        const double start = sdm_thread_clock();
        sdm_status s = call(w, err);
        const double took = sdm_thread_clock() - start;
        if (!s) s = cli_check_interrupt(err);
        if (s) return s;
        best = fmin(best, took);
        total += took;
    }
    *ms = 1e3 * best;
    return SDM_OK;
}

/* Random points in the box of the model. */
static void place_points(const sdm_grid *g, uint64_t seed, double *x)
{
    for (uint64_t i = 0; i < POINTS; i++) {
        double index[3];
        for (uint64_t a = 0; a < 3; a++)
            index[a] = sdm_rng_uniform(seed, STREAM, 3 * i + a) * (double)(g->n[a] - 1);
        sdm_grid_world(g, index, x + 3 * i);
    }
}

static sdm_status prepare(const sdm_model *m, const cli_args *args, uint64_t seed, field_work *w,
                          sdm_error *err)
{
    const sdm_generate_opts one = {.n_threads = 1},
                            bound = {.n_threads = 1, .outside = SDM_OUTSIDE_BOUND};
    const sdm_grid *g = &sdm_model_get_info(m)->grid;
    bool own;
    sdm_status s = cli_model_grid(args, g, &w->grid, &own, err);
    if (!s) s = SDM_ALLOC(&w->map, sdm_grid_count(&w->grid), "map to time", err);
    if (!s) s = SDM_ALLOC(&w->values, POINTS, "values to time", err);
    if (!s) s = SDM_ALLOC(&w->gradient, (size_t)3 * POINTS, "gradients to time", err);
    if (!s) s = SDM_ALLOC(&w->points, (size_t)3 * POINTS, "points to time", err);
    if (s) return s;
    w->width = BAND_VOXELS * fmax(w->grid.spacing[0], fmax(w->grid.spacing[1], w->grid.spacing[2]));
    cli_eval_params(m, seed, 0, w->p);
    place_points(g, seed, w->points);
    s = sdm_field_create(m, &one, false, &w->field, err);
    if (!s) s = sdm_field_create(m, &bound, false, &w->bounded, err);
    return s ? s : sdm_field_set_params(w->bounded, w->p, NULL, err);
}

sdm_status cli_bench_field(const sdm_model *m, const cli_args *args, uint64_t seed,
                           cli_field_times *t, sdm_error *err)
{
    field_work w = {.field = NULL};
    sdm_status s = prepare(m, args, seed, &w, err);
    if (!s) s = time_call(&w, call_params, &t->ms_params, err);
    if (!s) s = time_call(&w, call_map, &t->ms_map, err);
    if (!s) s = time_call(&w, call_band, &t->ms_band, err);
    if (!s) s = time_call(&w, call_points, &t->us_point, err);
    if (!s) s = time_call(&w, call_single, &t->us_single, err);
    t->us_point *= 1e3 / POINTS;
    t->us_single *= 1e3 / SINGLE;
    t->grid = w.grid;
    t->blocks = w.blocks;
    sdm_field_free(w.bounded);
    sdm_field_free(w.field);
    sdm_free(w.points);
    sdm_free(w.gradient);
    sdm_free(w.values);
    sdm_free(w.map);
    return s;
}
