/* Sandwich covariance H^-1 J H^-1 (Huber 1967), H the information and J the covariance of the
 * score. It also holds where the samples are correlated and the observation model is slightly
 * wrong. */
#include "posterior.h"

#include <math.h>
#include <string.h>

#include "fit/solver/open_motions.h"
#include "fit/solver/prior.h"
#include "influence.h"
#include "map_bias.h"
#include "network_bias.h"
#include "pose_params.h"
#include "score_covariance.h"
#include "sdm/memory.h"

// edge of the cubes within which the error of a network's map or of labels is assumed constant, in
// voxels
#define MODEL_STEPS 5.0

// element (i, j) of influence * scatter * influence
static double sandwich(size_t n, const double *influence, const double *scatter, size_t i, size_t j)
{
    double sum = 0;
    for (size_t a = 0; a < n; a++)
        for (size_t b = 0; b < n; b++)
            sum += influence[i * n + a] * scatter[a * n + b] * influence[j * n + b];
    return sum;
}

// rms error of the place of a surface that labels show, in voxels of the labels, and that of maps
// in which softened labels are fitted, in voxels of the map; both hold for cubes of MODEL_STEPS
// voxels
#define LABEL_ERROR 0.12
#define LABEL_MAP_ERROR 0.03
// rms error of the distance near the surface that is interpolated from an exact map, in voxels of
// the map
#define POINT_MAP_ERROR 0.01

// edge (mm) of the larger of the voxels of map and labels
static double coarsest_voxel(const fit_problem *p)
{
    const double map = fit_longest_edge(&p->maps.grid);
    return p->given_labels ? fmax(map, fit_longest_edge(&p->target->grid)) : map;
}

double sdm_fit_network_error(const fit_problem *p)
{
    if (p->maps.exact) return 0;
    const sdm_accuracy *a = &sdm_model_get_info(p->source->model)->accuracy;
    return a->rmse_near_mm > 0 ? a->rmse_near_mm : a->rmse_mm;
}

// error (mm) near the surface: of the network's maps; and of labels, whose surface is known to a
// part of a voxel
static double model_error(const fit_problem *p)
{
    const bool points = p->target->kind == SDM_FIT_POINTS;
    const double network = sdm_fit_network_error(p);
    if (!p->given_labels && !points) return network;
    if (fit_maps_direct(&p->maps)) return 0;
    const double labels = points ? 0 : LABEL_ERROR * fit_longest_edge(&p->target->grid),
                 map =
                     (points ? POINT_MAP_ERROR : LABEL_MAP_ERROR) * fit_longest_edge(&p->maps.grid);
    return sqrt(labels * labels + map * map + network * network);
}

// sd of a variance; NaN for a negative one, since 0 would mean that the unknown is known exactly
static double sd_of(double variance) { return variance >= 0 ? sqrt(variance) : NAN; }

// covariance, sd and correlation from the sandwich; bias[n][n]: what the voxels of the maps add to
// the covariance; change[n]: what exact maps change, NULL: not known; spread[n][n]: scratch memory
static void covariance_fill(const fit_problem *p, const fit_score_covariance *scatter,
                            const double *influence, const double *bias, const double *change,
                            double *spread, sdm_fit_result *out)
{
    const size_t n = p->information.n_unknowns, size = p->n_params + 6;
    const bool points = p->target->kind == SDM_FIT_POINTS;
    size_t list[FIT_UNKNOWNS_MAX];
    // lost: share of the degrees of freedom that the fit of points uses up; residuals about a fit
    // are smaller than about the truth (MacKinnon and White 1985)
    const double lost = points ? fmin((double)sdm_fit_free_unknowns(p, list) *
                                          scatter->noise_factor / fmax((double)p->samples.n, 1),
                                      0.5)
                               : 0;
    // the score of a prior with weight w has the variance w^2 / sd^2; sdm_fit_prior() gives w /
    // sd^2
    memset(spread, 0, n * n * sizeof *spread);
    (void)sdm_fit_prior(p, &p->state, NULL, spread, NULL);
    for (size_t i = 0; i < n; i++) spread[i * (n + 1)] *= p->prior_weight[i];
    // add the noise of the samples and the error of the network
    const double model = out->model_error_mm * out->model_error_mm;
    for (size_t i = 0; i < n * n; i++)
        spread[i] += scatter->noise[i] / (1 - lost) + model * scatter->model[i];
    sdm_fit_add_weak_prior(p, spread);
    // covariance, sd, correlation
    for (size_t i = 0; i < size; i++)
        for (size_t j = 0; j <= i; j++) {
            const double c = sandwich(n, influence, spread, i, j) + bias[i * n + j],
                         more = change ? change[i] * change[j] : 0;
            out->covariance[i * size + j] = out->covariance[j * size + i] = c + more;
        }
    sdm_fit_pose_params_spread(p, out->covariance);
    for (size_t i = 0; i < 6; i++)
        out->pose_sd_determined[i] = sd_of(out->covariance[(p->n_params + i) * (size + 1)]);
    sdm_fit_open_motions_spread(p, out->covariance);
    for (size_t i = 0; i < size; i++) out->sd[i] = sd_of(out->covariance[i * (size + 1)]);
    for (size_t i = 0; i < size; i++)
        for (size_t j = 0; j < size; j++) {
            const double product = out->sd[i] * out->sd[j];
            double *c = &out->correlation[i * size + j];
            *c = isnan(product) ? NAN : 0;
            if (product > 0) *c = i == j ? 1 : out->covariance[i * size + j] / product;
        }
}

sdm_status sdm_fit_weigh_priors(const fit_problem *p, double *weight, double *noise_factor,
                                sdm_error *err)
{
    const size_t n = p->information.n_unknowns;
    size_t list[FIT_UNKNOWNS_MAX];
    const size_t m = sdm_fit_free_unknowns(p, list);
    fit_score_covariance scatter;
    double *work = NULL;
    sdm_status s = sdm_fit_score_covariance_create(p, 0, NULL, &scatter, err);
    if (s) return s;
    *noise_factor = fmax(scatter.noise_factor, 1);
    s = SDM_ALLOC(&work, 4 * n * n, "matrices of the fit", err);
    if (!s) {
        double *influence = work + 3 * n * n;
        const bool known = sdm_fit_influence(p, false, influence, work);
        for (size_t i = 0; i < n; i++) weight[i] = 1;
        for (size_t k = 0; k < m; k++) {
            const size_t i = list[k];
            if (!sdm_fit_may_have_prior(p, i)) continue;
            const double ratio =
                known ? sandwich(n, influence, scatter.noise, i, i) / influence[i * (n + 1)] : 0;
            weight[i] = known ? fmax(ratio, 1) : *noise_factor;
        }
    }
    sdm_free(work);
    sdm_fit_score_covariance_dispose(&scatter);
    return s;
}

sdm_status sdm_fit_posterior(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    const size_t n = p->information.n_unknowns;
    out->model_error_mm = model_error(p);
    const double model_mm = out->model_error_mm > 0 ? MODEL_STEPS * coarsest_voxel(p) : 0;
    fit_score_covariance scatter = {0};
    double *work = NULL;
    sdm_status s = SDM_ALLOC(&work, 5 * n * n, "matrices of the fit", err);
    if (s) return s;
    double *influence = work + 3 * n * n, *bias = work + 4 * n * n, change[FIT_UNKNOWNS_MAX];
    const bool known = sdm_fit_influence(p, true, influence, work);
    s = sdm_fit_score_covariance_create(p, model_mm, known ? influence : NULL, &scatter, err);
    out->noise_factor = scatter.noise_factor;
    memset(bias, 0, n * n * sizeof *bias);
    if (!s && known && p->target->kind == SDM_FIT_POINTS && !fit_maps_direct(&p->maps))
        s = sdm_fit_map_bias(p, influence, bias, err);
    if (!s && known && !p->is_rival && fit_is_image(p) && p->maps.share && p->maps.exact)
        s = sdm_fit_finer_map_bias(p, influence, bias, err);
    bool measured = !s && known && !p->is_rival && sdm_fit_can_measure_network(p);
    p->network_measured = false;
    if (measured) {
        s = sdm_fit_network_bias(p, change, err);
        // a shape without a mesh here leaves the error unknown
        measured = !s;
        p->network_measured = measured;
        if (measured) memcpy(p->network_change, change, p->n_params * sizeof *change);
        if (s != SDM_E_NOMEM && s != SDM_E_CANCELLED) s = SDM_OK;
    }
    if (!s && known)
        covariance_fill(p, &scatter, influence, bias, measured ? change : NULL, work, out);
    if (!s && !known)
        s = sdm_fail(err, SDM_E_QUALITY,
                     "the image does not determine the shape: its information is singular");
    sdm_free(work);
    sdm_fit_score_covariance_dispose(&scatter);
    return s;
}

void sdm_fit_network_error_find(const fit_problem *p, sdm_fit_result *out)
{
    if (!p->network_measured) return;
    out->network_error_sd = 0;
    for (size_t k = 0; k < p->n_params; k++) {
        const double change = fabs(p->network_change[k]),
                     variance = out->sd[k] * out->sd[k] - change * change,
                     moves = variance > 0 ? change / sqrt(variance) : 0;
        if (!(moves > out->network_error_sd) ||
            sqrt(variance) > FIT_BY_PRIOR * sdm_fit_prior_sd(p, k))
            continue;
        out->network_error_sd = moves;
        out->network_error_param = k;
        out->network_error = change;
    }
}
