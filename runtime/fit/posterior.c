/* Covariance H^-1 J H^-1 (Huber 1967): right also where the values are not independent and the model is not quite that of the image. */
#include "posterior.h"

#include <math.h>
#include <string.h>

#include "score.h"
#include "sdm/memory.h"

// edge of the cubes within which the error of a network's map is alike, in steps of its grid
#define MODEL_STEPS 5.0

// what is known beforehand
static void add_known(const fit_problem *p, double *a)
{
    (void)sdm_fit_prior(p, &p->state, NULL, a, NULL);
    sdm_fit_add_ignorance(p, a);
}

// the unknowns that were estimated
static size_t estimated(const fit_problem *p, size_t *list)
{
    const sdm_fit_opts *o = p->opts;
    size_t count = 0;
    for (size_t i = 0; i < p->sums.n_unknowns; i++) {
        const size_t n = p->n_params;
        const bool kept = i < n       ? o->keep_params
                          : i < n + 6 ? o->keep_pose
                          : i > n + 6 ? fit_mean_stays(p, i)
                                      : o->keep_blur || !p->maps.share;
        if (!kept) list[count++] = i;
    }
    return count;
}

static void take(size_t n, const double *a, size_t m, const size_t *list, double *out)
{
    for (size_t i = 0; i < m; i++)
        for (size_t j = 0; j < m; j++) out[i * m + j] = a[list[i] * n + list[j]];
}

// covariance[m][m] = information^-1 scatter information^-1
static bool sandwich(size_t m, const double *information, const double *scatter, double *covariance, double *work)
{
    double scale[FIT_UNKNOWNS_MAX], column[FIT_UNKNOWNS_MAX], *factor = work;
    if (!sdm_fit_factorise(m, information, factor, scale)) return false;
    for (int side = 0; side < 2; side++) {
        const double *from = side ? covariance : scatter;
        double *to = side ? covariance : work + m * m;
        for (size_t j = 0; j < m; j++) { // columns of the symmetric product so far
            for (size_t i = 0; i < m; i++) column[i] = from[i * m + j];
            sdm_fit_back(m, factor, scale, column);
            for (size_t i = 0; i < m; i++) to[i * m + j] = column[i];
        }
        if (!side)
            for (size_t i = 0; i < m; i++)
                for (size_t j = 0; j < m; j++) covariance[i * m + j] = to[j * m + i];
    }
    return true;
}

static double model_error(const fit_problem *p)
{
    if (p->maps.exact) return 0;
    const sdm_accuracy *a = &sdm_model_get_info(p->source->model)->accuracy;
    return a->rmse_near_mm > 0 ? a->rmse_near_mm : a->rmse_mm;
}

static sdm_status fill(const fit_problem *p, const fit_scatter *scatter, double *work, sdm_fit_result *out,
                       sdm_error *err)
{
    const size_t n = p->sums.n_unknowns, size = p->n_params + 6;
    size_t list[FIT_UNKNOWNS_MAX];
    const size_t m = estimated(p, list);
    double *information = work, *spread = work + n * n, *small = work + 2 * n * n, *covariance = work + 4 * n * n;
    double *prior = work + 5 * n * n;
    // residuals about a fit are smaller than those about the truth (MacKinnon and White 1985)
    const double lost = fmin((double)m / fmax(scatter->effective, 1), 0.5);
    for (size_t i = 0; i < n * n; i++) spread[i] = scatter->noise[i] / (1 - lost);
    for (size_t i = 0; i < n * n; i++) spread[i] += out->model_error_mm * out->model_error_mm * scatter->model[i];
    // what priors of those weights scatter
    memset(prior, 0, n * n * sizeof *prior);
    (void)sdm_fit_prior(p, &p->state, NULL, prior, NULL);
    for (size_t i = 0; i < size; i++) spread[i * (n + 1)] += p->prior_weight[i] * prior[i * (n + 1)];
    sdm_fit_add_ignorance(p, spread);
    take(n, spread, m, list, small + n * n);
    bool done = false;
    for (int complete = 0; complete < 2 && !done; complete++) {
        memcpy(information, complete ? p->sums.complete : p->sums.observed, n * n * sizeof *information);
        add_known(p, information);
        take(n, information, m, list, small);
        done = sandwich(m, small, small + n * n, covariance, work + 5 * n * n);
    }
    if (!done)
        return sdm_fail(err, SDM_E_QUALITY, "the image does not determine the shape: its information is singular");
    memset(out->covariance, 0, size * size * sizeof *out->covariance); // of what was kept
    for (size_t i = 0; i < m; i++)
        for (size_t j = 0; j < m; j++)
            if (list[i] < size && list[j] < size)
                out->covariance[list[i] * size + list[j]] = 0.5 * (covariance[i * m + j] + covariance[j * m + i]);
    for (size_t i = 0; i < size; i++) out->sd[i] = sqrt(fmax(out->covariance[i * (size + 1)], 0));
    for (size_t i = 0; i < size; i++)
        for (size_t j = 0; j < size; j++) {
            const double product = out->sd[i] * out->sd[j];
            out->correlation[i * size + j] = product > 0 ? i == j ? 1 : out->covariance[i * size + j] / product : 0;
        }
    return SDM_OK;
}

// ratio[m]: variances by the sandwich over those of the information alone
static bool variance_ratios(const fit_problem *p, const fit_scatter *scatter, size_t m, const size_t *list,
                            double *work, double *ratio)
{
    const size_t n = p->sums.n_unknowns;
    double *information = work, *naive = work + n * n, *small = work + 2 * n * n, *covariance = work + 4 * n * n;
    take(n, scatter->noise, m, list, small + n * n);
    for (int complete = 0; complete < 2; complete++) {
        memcpy(information, complete ? p->sums.complete : p->sums.observed, n * n * sizeof *information);
        sdm_fit_add_ignorance(p, information);
        take(n, information, m, list, small);
        if (!sandwich(m, small, small + n * n, covariance, work + 5 * n * n)) continue;
        if (!sandwich(m, small, small, naive, work + 5 * n * n)) continue;
        for (size_t i = 0; i < m; i++) ratio[i] = covariance[i * (m + 1)] / naive[i * (m + 1)];
        return true;
    }
    return false;
}

sdm_status sdm_fit_weigh_priors(const fit_problem *p, double *weight, double *noise_factor, sdm_error *err)
{
    const size_t n = p->sums.n_unknowns;
    size_t list[FIT_UNKNOWNS_MAX];
    const size_t m = estimated(p, list);
    fit_scatter scatter;
    double *work = NULL, ratio[FIT_UNKNOWNS_MAX];
    sdm_status s = sdm_fit_scatter_create(p, 0, false, &scatter, err);
    if (s) return s;
    *noise_factor = fmax(scatter.noise_factor, 1);
    s = SDM_ALLOC(&work, 7 * n * n, "matrices of the fit", err);
    if (!s) {
        const bool known = variance_ratios(p, &scatter, m, list, work, ratio);
        for (size_t i = 0; i < p->n_params + 6; i++) weight[i] = 1;
        for (size_t i = 0; i < m; i++)
            if (list[i] < p->n_params + 6) weight[list[i]] = known ? fmax(ratio[i], 1) : *noise_factor;
    }
    sdm_free(work);
    sdm_fit_scatter_dispose(&scatter);
    return s;
}

sdm_status sdm_fit_posterior(const fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    const size_t n = p->sums.n_unknowns;
    const double *spacing = p->maps.grid.spacing;
    out->model_error_mm = model_error(p);
    const double model_mm = out->model_error_mm > 0 ? MODEL_STEPS * fmax(spacing[0], fmax(spacing[1], spacing[2])) : 0;
    fit_scatter scatter;
    double *work = NULL;
    sdm_status s = sdm_fit_scatter_create(p, model_mm, true, &scatter, err);
    if (s) return s;
    s = SDM_ALLOC(&work, 7 * n * n, "matrices of the fit", err);
    out->noise_factor = scatter.noise_factor;
    if (!s) s = fill(p, &scatter, work, out, err);
    sdm_free(work);
    sdm_fit_scatter_dispose(&scatter);
    return s;
}
