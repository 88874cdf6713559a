/* The estimate of a fit through a network is where the score with the network's maps is zero. The
 * score with exact maps of the same shape, times the inverse of their information, is the way from
 * there to the estimate with exact maps, as long as it is short. The derivatives must be those of
 * the exact maps, too: where few samples determine an unknown, such as the end of a leg, the
 * network's derivatives can be off there by more than its distances. */
#include "network_bias.h"

#include <math.h>
#include <string.h>

#include "fit/solver/objective.h"
#include "fit/solver/prior.h"
#include "influence.h"
#include "sdm/memory.h"

bool sdm_fit_can_measure_network(const fit_problem *p)
{
    return p->source->model && p->source->shape && !p->maps.exact;
}

// evaluates the problem with maps of this kind; *score[N]: the derivatives of the log-posterior
static sdm_status evaluate_with(fit_problem *p, bool exact, double *score, sdm_error *err)
{
    p->maps.exact = exact;
    p->maps_params[0] = NAN;
    const sdm_status s = sdm_fit_evaluate(p, err);
    if (s) return s;
    memcpy(score, p->information.gradient, p->information.n_unknowns * sizeof *score);
    (void)sdm_fit_prior(p, &p->state, score, NULL, NULL);
    return SDM_OK;
}

sdm_status sdm_fit_network_bias(fit_problem *p, double *change, sdm_error *err)
{
    const size_t n = p->information.n_unknowns;
    double by_exact[FIT_UNKNOWNS_MAX] = {0}, by_network[FIT_UNKNOWNS_MAX], *influence = NULL;
    memset(change, 0, n * sizeof *change);
    sdm_status s = SDM_ALLOC(&influence, 4 * n * n, "matrices of the fit", err);
    if (s) return s;
    const size_t n_network = p->maps.n_network, n_exact = p->maps.n_exact,
                 n_outside = p->maps.n_outside;
    s = evaluate_with(p, true, by_exact, err);
    if (!s && !sdm_fit_influence(p, true, influence, influence + n * n))
        s = sdm_fail(err, SDM_E_QUALITY, "the information with exact maps is singular");
    // the network's maps again; without them, nothing that follows is possible
    sdm_error trouble = {0};
    const sdm_status back = evaluate_with(p, false, by_network, &trouble);
    if (back && err) *err = trouble;
    // the counts are those of the fit alone, the times those of all maps
    p->maps.n_network = n_network;
    p->maps.n_exact = n_exact;
    p->maps.n_outside = n_outside;
    // at an end of a range, the score is not zero with either kind of maps
    for (size_t a = 0; a < n && !s && !back; a++)
        for (size_t b = 0; b < n; b++)
            change[a] += influence[a * n + b] * (by_exact[b] - by_network[b]);
    sdm_free(influence);
    return back ? back : s;
}
