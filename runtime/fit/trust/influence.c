/* The inverse of the information matrix, for the unknowns that a fit estimates. */
#include "influence.h"

#include <string.h>

#include "fit/solver/open_motions.h"
#include "fit/solver/prior.h"
#include "fit/solver/solve.h"

size_t sdm_fit_free_unknowns(const fit_problem *p, size_t *list)
{
    const sdm_fit_opts *o = p->opts;
    size_t count = 0;
    for (size_t i = 0; i < p->information.n_unknowns; i++) {
        const size_t n = p->n_params;
        const bool kept = i < n       ? fit_param_is_kept(p, i)
                          : i < n + 6 ? o->keep_pose
                          : i > n + 6 ? fit_mean_is_kept(p, i)
                                      : o->keep_blur || !p->maps.share;
        if (!kept) list[count++] = i;
    }
    return count;
}

// out[m][m]: the rows and columns of a[n][n] in the list
static void submatrix(size_t n, const double *a, size_t m, const size_t *list, double *out)
{
    for (size_t i = 0; i < m; i++)
        for (size_t j = 0; j < m; j++) out[i * m + j] = a[list[i] * n + list[j]];
}

bool sdm_fit_influence(const fit_problem *p, bool with_priors, double *influence, double *work)
{
    const size_t n = p->information.n_unknowns;
    size_t list[FIT_UNKNOWNS_MAX];
    const size_t m = sdm_fit_free_unknowns(p, list);
    double *information = work, *small = work + n * n, *factor = work + 2 * n * n,
           scale[FIT_UNKNOWNS_MAX];
    memset(influence, 0, n * n * sizeof *influence);
    for (int complete = 0; complete < 2; complete++) {
        memcpy(information, complete ? p->information.complete : p->information.observed,
               n * n * sizeof *information);
        if (with_priors) (void)sdm_fit_prior(p, &p->state, NULL, information, NULL);
        sdm_fit_add_weak_prior(p, information);
        sdm_fit_open_motions_stop(p, information);
        submatrix(n, information, m, list, small);
        if (!sdm_fit_cholesky(m, small, factor, scale)) continue;
        for (size_t j = 0; j < m; j++) {
            double column[FIT_UNKNOWNS_MAX] = {0};
            column[j] = 1;
            sdm_fit_solve(m, factor, scale, column);
            for (size_t i = 0; i < m; i++) influence[list[i] * n + list[j]] = column[i];
        }
        return true;
    }
    return false;
}
