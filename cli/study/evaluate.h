/* Measures a network against the exact engine on random shapes it was not trained on. */
#ifndef CLI_EVALUATE_H
#define CLI_EVALUATE_H

#include "report/progress.h"
#include "sdm/internal/config.h"
#include "sdm/runtime.h"

/* Stream of the random shapes of eval and verify; training uses other streams. */
#define SDM_STREAM_EVAL 900

/* Voxels with |exact distance| up to this count as near the surface, mm. */
#define CLI_NEAR_MM 0.4

/* One shape: network against exact map. */
typedef struct cli_eval_sample {
    double mse_mm2, mae_mm, max_abs_mm;
    double near_sum; /* squared errors near the surface, mm^2 */
    size_t n_near;
    double dice;            /* overlap of the insides; 1 when both are empty */
    bool has_surface;       /* both maps have a zero surface */
    double surface_mean_mm; /* mean distance between the zero surfaces, both ways */
    double surface_hausdorff_mm;
} cli_eval_sample;

typedef struct cli_eval {
    cli_eval_sample *sample; /* [n], in the order of their index */
    size_t n, n_surface;
    double mse_mm2, rmse_mm, mae_mm, max_abs_mm, rmse_near_mm, dice;
    double surface_mean_mm,
        surface_hausdorff_mm; /* means over the shapes that have both surfaces */
    double surface_hausdorff_max_mm;
    size_t worst, median; /* shapes by MSE */
} cli_eval;

/* Parameters of random shape `index` within the model's trained ranges; p[n_params]. */
void cli_eval_params(const sdm_model *m, uint64_t seed, size_t index, double *p);

/* Anything that makes maps of a shape on a grid from parameters in a box; the exact engine makes
 * the truth from the same shape. */
typedef struct cli_map_maker {
    const sdm_instance *shape;
    sdm_grid grid;
    size_t n_params;
    double min[SDM_MAX_PARAMS], max[SDM_MAX_PARAMS];
    /* values[nz][ny][nx] at p[n_params], on the calling thread alone. [any thread] */
    sdm_status (*make)(const void *user, const double *p, float *values, sdm_error *err);
    const void *user;
} cli_map_maker;

/* The model as a maker; it has at most SDM_MAX_PARAMS parameters. */
cli_map_maker cli_maker_of_model(const sdm_model *m, const sdm_instance *shape);

/* Parameters of random shape `index` within the maker's box; p[n_params]. */
void cli_maker_params(const cli_map_maker *m, uint64_t seed, size_t index, double *p);

/* Figures of one map against the exact one; surfaces: those of the zero surfaces too. */
sdm_status cli_compare_maps(const sdm_grid *g, const float *values, const float *exact,
                            bool surfaces, cli_eval_sample *out, sdm_error *err);

/* Fills the means and largest figures, zero before, from sample[n]. */
void cli_eval_reduce(cli_eval *e);

/* Evaluates n shapes on all threads; the same bits for any number of them. surfaces: measure the
 * zero surfaces too. */
sdm_status cli_evaluate_maps(const cli_map_maker *m, uint64_t seed, size_t n, bool surfaces,
                             cli_eval *out, sdm_error *err);
sdm_status cli_evaluate(const sdm_model *m, const sdm_instance *shape, uint64_t seed, size_t n,
                        bool surfaces, cli_eval *out, sdm_error *err);
void cli_eval_dispose(cli_eval *e);

/* Writes exact | network | error slices of shape `index`, or at parameters p when p is not NULL. */
sdm_status cli_picture_compare(const sdm_model *m, const sdm_instance *shape, uint64_t seed,
                               size_t index, const double *p, const char *path, sdm_error *err);

/* Time per map on one core, of its processor alone: ms, files not included. Mesh making and tree
 * building count for the exact engine. */
typedef struct cli_timing {
    double ms_network, ms_batch; /* one map; one map of a batch of batch_size */
    size_t batch_size;
    double ms_exact;
    double ms_naive,
        naive_share; /* from a share of the slices, scaled to all; NaN when not measured */
    size_t n_network, n_exact, n_naive;
} cli_timing;

/* Medians over random shapes; fastest: the fastest, of one shape again and again, a batch of as
 * many shapes, the naive method as ever. shape may be NULL: the network alone. */
sdm_status cli_time_maps(const sdm_model *m, const sdm_instance *shape, uint64_t seed, bool fastest,
                         size_t n_naive, cli_timing *out, sdm_error *err);

/* Time of the naive method on one core for the mesh, scaled from a share of the slices. */
sdm_status cli_time_naive(const sdm_mesh *mesh, const sdm_grid *grid, double *ms, double *share,
                          sdm_error *err);

/* Sorts v[n] and returns its median. */
double cli_median(double *v, size_t n);

/* The least of v[n]. */
double cli_least(double *v, size_t n);

#endif
