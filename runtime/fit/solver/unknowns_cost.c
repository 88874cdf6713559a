/* Cost of the unknowns by Laplace's method. With the prior N(m, s^2) of a parameter, its estimate x
 * and its standard deviation c where the parameters before it are known, the parameter costs log(s
 * / c) + 1/2 ((x - m) / s)^2. */
#include "unknowns_cost.h"

#include <math.h>

#include "prior.h"
#include "solve.h"

// what the parameters list[n] cost, each at most `most`
static double params_cost(const fit_problem *p, const sdm_fit_result *r, size_t n,
                          const size_t *list, double most)
{
    double c[FIT_PARAMS_MAX * FIT_PARAMS_MAX] = {0}, factor[FIT_PARAMS_MAX * FIT_PARAMS_MAX],
                              scale[FIT_PARAMS_MAX], cost = 0;
    const size_t size = p->n_params + 6;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) c[i * n + j] = r->covariance[list[i] * size + list[j]];
    if (!sdm_fit_cholesky(n, c, factor, scale)) return (double)n * most;
    for (size_t i = 0; i < n; i++) {
        const double sd = sdm_fit_prior_sd(p, list[i]), left = factor[i * n + i] / scale[i];
        // without a prior it is uniform over the range
        const double off =
            p->opts->prior_sd > 0 ? (r->params[list[i]] - sdm_fit_prior_mean(p, list[i])) / sd : 0;
        // at a bound the deviation may exceed that of the prior: the parameter then costs nothing
        cost += fmin(fmax(log(sd / left), 0) + 0.5 * off * off, most);
    }
    return cost;
}

double sdm_fit_unknowns_cost(const fit_problem *p, const sdm_fit_result *r, double n_independent)
{
    const double each = 0.5 * log(n_independent);
    size_t list[FIT_PARAMS_MAX], n = 0;
    for (size_t k = 0; k < p->n_params; k++)
        if (!fit_param_is_kept(p, k)) list[n++] = k;
    return params_cost(p, r, n, list, each) + (p->opts->keep_pose ? 0 : 6 * each);
}
