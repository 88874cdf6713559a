/* Measures networks and other methods against the exact engine on random shapes that no
 * training used. */
#pragma once

#include "report/progress_bar.h"
#include "sdm/internal/config.h"
#include "sdm/runtime.h"

/* Random stream of the shapes of eval and verify; training uses other streams. */
#define CLI_STREAM_EVAL 900

/* Errors of one map against the exact map. */
typedef struct cli_eval_sample {
    double mse_mm2, mae_mm, max_abs_mm;
    double near_sum; /* sum of squared errors within sdm_grid_near() of the surface, mm^2 */
    size_t n_near;
    double dice;            /* overlap of the volumes inside; 1 when both are empty */
    bool has_surface;       /* both maps have a zero surface */
    double surface_mean_mm; /* mean distance between the zero surfaces, in both directions */
    double surface_hausdorff_mm;
} cli_eval_sample;

/* Errors over n shapes. */
typedef struct cli_eval {
    cli_eval_sample *sample; /* [n], in the order of the shape indices */
    size_t n, n_surface;     /* shapes; shapes where both maps have a surface */
    double mse_mm2, rmse_mm, mae_mm, max_abs_mm, rmse_near_mm, dice;
    double dice_min; /* smallest of a shape */
    /* means over the shapes with both surfaces */
    double surface_mean_mm, surface_hausdorff_mm;
    double surface_hausdorff_max_mm;
    size_t worst, median; /* indices of the shapes with the largest and the median MSE */
} cli_eval;

/* p[n_params] = random parameters within the model's trained ranges, from the distributions of its
 * training; a function of seed and index. */
void cli_eval_params(const sdm_model *m, uint64_t seed, size_t index, double *p);

/* A method that makes maps of a shape, on one grid, at parameters in a box with a distribution. The
 * exact engine makes the reference maps from the same shape. */
typedef struct cli_map_maker {
    const sdm_instance *shape;
    sdm_grid grid;
    size_t n_params;
    double min[SDM_MAX_PARAMS], max[SDM_MAX_PARAMS];
    sdm_distribution distribution[SDM_MAX_PARAMS];
    /* values[nz][ny][nx] = the map at p[n_params], mm; uses only the calling thread. [any thread]
     */
    sdm_status (*make)(const void *user, const double *p, float *values, sdm_error *err);
    const void *user;
} cli_map_maker;

/* The model as a map maker, with at most SDM_MAX_PARAMS of its parameters. It refers to m
 * and shape. */
cli_map_maker cli_maker_of_model(const sdm_model *m, const sdm_instance *shape);

/* A model and the grid of its maps. */
typedef struct cli_model_on_grid {
    const sdm_model *model;
    sdm_grid grid;
} cli_model_on_grid;

/* The same for maps on another grid; refers to *on. */
cli_map_maker cli_maker_on_grid(const cli_model_on_grid *on, const sdm_instance *shape);

/* *ms = median time of a map of the maker on one core, over random shapes. */
sdm_status cli_time_maker(const cli_map_maker *m, uint64_t seed, float *values, double *ms,
                          sdm_error *err);

/* p[n_params] = random parameters from the maker's distributions, a function of seed and index. */
void cli_maker_params(const cli_map_maker *m, uint64_t seed, size_t index, double *p);

/* Errors of values[nz][ny][nx] against exact[nz][ny][nx]; surfaces: also the distances between the
 * zero surfaces. */
sdm_status cli_compare_maps(const sdm_grid *g, const float *values, const float *exact,
                            bool surfaces, cli_eval_sample *out, sdm_error *err);

/* Computes the means and maxima of *e from e->sample[n]; these members must be zero before the
 * call. */
void cli_eval_reduce(cli_eval *e);

/* Evaluates n random shapes on all threads; the number of threads does not change a bit of the
 * result. surfaces: also measures the zero surfaces. cli_eval_dispose() frees *out. SDM_E_ARG: n
 * is 0, or the model has too many parameters; SDM_E_CANCELLED. */
sdm_status cli_evaluate_maps(const cli_map_maker *m, uint64_t seed, size_t n, bool surfaces,
                             cli_eval *out, sdm_error *err);
sdm_status cli_evaluate(const sdm_model *m, const sdm_instance *shape, uint64_t seed, size_t n,
                        bool surfaces, cli_eval *out, sdm_error *err);
void cli_eval_dispose(cli_eval *e);

/* Writes slices exact | network | error of random shape `index`, or at p[n_params] if p is
 * not NULL. */
sdm_status cli_picture_compare(const sdm_model *m, const sdm_instance *shape, uint64_t seed,
                               size_t index, const double *p, const char *path, sdm_error *err);

/* Times per map on one core: processor time in ms, without files. The time of the exact engine and
 * of the naive method includes making the mesh and building the tree where they need them. */
typedef struct cli_timing {
    double ms_network, ms_batch; /* a single map; a map in a batch of batch_size */
    size_t batch_size;
    double ms_exact;    /* NaN: not measured */
    double ms_naive;    /* scaled to all voxels; NaN: not measured */
    double naive_share; /* fraction of the slices that the naive method computed; NaN: none */
    size_t n_network, n_exact, n_naive; /* number of timed maps */
} cli_timing;

/* Measures the times. They are medians over random shapes; with `fastest` they are minima over
   repeated maps of one shape and over repeated batches of random shapes. The time of the naive
   method is always a median, over n_naive shapes. shape NULL: only the network is timed. */
sdm_status cli_time_maps(const sdm_model *m, const sdm_instance *shape, uint64_t seed, bool fastest,
                         size_t n_naive, cli_timing *out, sdm_error *err);

/* Measures ms_network and ms_exact only, as medians, within a few seconds; the other members of
 * *out are 0 or NaN. After an error, NaN for the times that were not measured. */
sdm_status cli_time_two(const sdm_model *m, const sdm_instance *shape, cli_timing *out,
                        sdm_error *err);

/* Prints the two times of cli_time_two() and their ratio in one line that begins with `begin`; says
 * so where the exact engine is about as fast as the network. NaN: not measured. */
void cli_print_two(const char *begin, const cli_timing *t);

/* *ms = median time of the naive method on one core over the first n random shapes of the maker.
 * Only a fraction of the slices, *share, is computed; *ms is scaled to all slices. *ms and *share
 * are NaN when n is 0. */
sdm_status cli_time_naive(const cli_map_maker *m, uint64_t seed, size_t n, double *ms,
                          double *share, sdm_error *err);

/* The smallest of v[n]. */
double cli_minimum(double *v, size_t n);
