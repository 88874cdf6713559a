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

bool sdm_fit_influence(const fit_problem *p, bool with_priors, double *influence, double *work)
{
    const size_t n = p->information.n_unknowns;
    size_t list[FIT_UNKNOWNS_MAX];
    bool held[FIT_UNKNOWNS_MAX];
    const size_t m = sdm_fit_free_unknowns(p, list);
    for (size_t i = 0; i < n; i++) held[i] = true;
    for (size_t i = 0; i < m; i++) held[list[i]] = false;
    for (int complete = 0; complete < 2; complete++) {
        memcpy(work, complete ? p->information.complete : p->information.observed,
               n * n * sizeof *work);
        if (with_priors) (void)sdm_fit_prior(p, &p->state, NULL, work, NULL);
        sdm_fit_add_weak_prior(p, work);
        sdm_fit_open_motions_stop(p, work);
        if (sdm_fit_inverse(n, work, held, influence, work + n * n)) return true;
    }
    return false;
}
