/* Chooses the head after the mode fit. A coefficient of the highest level has as many unknowns as
   there are latent variables. With few maps least squares follow what the mode fit leaves over on
   these maps, and other maps lose. A ridge then keeps the head near the network of the mode fit. */
#include "head_choice.h"

#include <math.h>
#include <string.h>

#include "head.h"
#include "refine.h"
#include "sdm/memory.h"

/* With this many maps for each latent variable or more, least squares need no help. */
static const size_t MANY_MAPS = 4;

static size_t head_size(const pod_state *pod)
{
    return pod->arch.n_coefficients * pod->arch.n_latent;
}

/* Starts from the head of the mode fit, lowers the ridge towards it as long as this helps on
   held-out maps, and sets *mse to their error. */
static sdm_status lower_ridge(pod_state *pod, const head_equations *e, double *mse, sdm_error *err)
{
    static const double RIDGES[] = {1, 0.1, 1e-2, 1e-3, 1e-4, POD_RIDGE};
    const size_t size = head_size(pod);
    float *head = pod->refine.w + pod->head_at, *prior = NULL, *best = NULL;
    sdm_status s = SDM_ALLOC(&prior, size, "head", err);
    if (!s) s = SDM_ALLOC(&best, size, "head", err);
    if (!s) s = trainer_head_of_modes(pod, prior, err);
    if (!s) {
        memcpy(best, prior, size * sizeof *best);
        memcpy(head, prior, size * sizeof *head);
        s = trainer_refine_evaluate(pod, pod->refine.w, mse, err);
    }
    for (size_t i = 0; i < sizeof RIDGES / sizeof *RIDGES && !s; i++) {
        double error = INFINITY;
        s = trainer_head_solve(pod, e, RIDGES[i], prior, head, err);
        if (!s) s = trainer_refine_evaluate(pod, pod->refine.w, &error, err);
        if (s || error > *mse) break;
        *mse = error;
        memcpy(best, head, size * sizeof *best);
    }
    if (!s) memcpy(head, best, size * sizeof *head);
    sdm_free(best);
    sdm_free(prior);
    return s;
}

sdm_status trainer_head_choose(pod_state *pod, double *mse, sdm_error *err)
{
    float *w = pod->refine.w, *head = w + pod->head_at;
    head_equations e = {0};
    sdm_status s = trainer_head_equations(pod, w, &e, err);
    if (!s && e.maps < MANY_MAPS * pod->arch.n_latent) {
        s = lower_ridge(pod, &e, mse, err);
    } else if (!s) {
        s = trainer_head_solve(pod, &e, pod->ridge, NULL, head, err);
        if (!s) s = trainer_refine_evaluate(pod, w, mse, err);
    }
    if (!s) memcpy(pod->refine.average + pod->head_at, head, head_size(pod) * sizeof *head);
    trainer_head_equations_dispose(&e);
    return s;
}
