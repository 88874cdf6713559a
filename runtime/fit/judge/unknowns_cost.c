/* Cost of the unknowns by Laplace's method. With the prior N(m, s^2) of each parameter, the
 * estimate x, the covariance C of the k parameters and their prior variances s^2 the cost is 1/2
 * sum log s^2 - 1/2 log det C + 1/2 sum ((x - m) / s)^2. */
#include "unknowns_cost.h"

#include <math.h>

#include "fit/solver/prior.h"
#include "fit/solver/solve.h"

// cost of the parameters list[n]; NaN: their covariance is unknown or singular
static double params_cost(const fit_problem *p, const sdm_fit_result *r, size_t n,
                          const size_t *list)
{
    double c[FIT_PARAMS_MAX * FIT_PARAMS_MAX] = {0}, factor[FIT_PARAMS_MAX * FIT_PARAMS_MAX],
                              scale[FIT_PARAMS_MAX], cost = 0;
    const size_t size = p->n_params + 6;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) c[i * n + j] = r->covariance[list[i] * size + list[j]];
    if (!sdm_fit_cholesky(n, c, factor, scale)) return NAN;
    for (size_t i = 0; i < n; i++) {
        const double sd = sdm_fit_prior_sd(p, list[i]);
        // sd of this parameter where those before it are known
        const double left = factor[i * n + i] / scale[i];
        // the estimate of a parameter at a bound may have a larger deviation than its prior
        cost += fmax(log(sd / left), 0);
        if (!(p->opts->prior_sd > 0)) continue; // uniform over the range
        const double off = (r->params[list[i]] - sdm_fit_prior_mean(p, list[i])) / sd;
        cost += 0.5 * off * off;
    }
    return cost;
}

double sdm_fit_unknowns_cost(const fit_problem *p, const sdm_fit_result *r, double n_independent)
{
    const double each = 0.5 * log(n_independent);
    size_t list[FIT_PARAMS_MAX], n = 0;
    for (size_t k = 0; k < p->n_params; k++)
        if (!fit_param_is_kept(p, k)) list[n++] = k;
    const double params = params_cost(p, r, n, list);
    return (isnan(params) ? (double)n * each : params) + (p->opts->keep_pose ? 0 : 6 * each);
}
