/* Evaluation of the objective: from a state to maps, samples, log-likelihood and derivatives. */
#include "objective.h"

#include <math.h>
#include <string.h>

#include "averaged_maps.h"
#include "fit/data/map_area.h"
#include "prior.h"

// sd of the logistic distribution of scale 1, pi / sqrt(3)
#define LOGISTIC_SD 1.8137993642342178

// Labels: blurring the distance by the sd of the logistic prior offsets a bias; without it the edge
// lies inside a convex surface.
double sdm_fit_field_blur(const fit_problem *p)
{
    const bool labels = !p->maps.share && p->target->kind != SDM_FIT_POINTS;
    return labels ? p->state.l_ref * LOGISTIC_SD : p->maps.share ? p->state.blur : 0;
}

// adds the log density -log(area) of points that are spread evenly over the surface; its second
// derivatives are left out
static void add_even_density(fit_problem *p)
{
    double area, gradient[FIT_PARAMS_MAX];
    if (fit_maps_direct(&p->maps))
        sdm_shape_surface_area(&p->maps.surface, &area, gradient);
    else
        sdm_fit_maps_area(&p->maps, &area, gradient);
    if (!(area > 0)) return;
    p->information.log_likelihood -= p->n_even * log(area);
    for (size_t k = 0; k < p->n_params; k++)
        p->information.gradient[k] -= p->n_even * gradient[k] / area;
}

sdm_status sdm_fit_evaluate(fit_problem *p, sdm_error *err)
{
    const fit_state *state = &p->state;
    sdm_status s = SDM_OK;
    bool same = true;
    // make the maps at the parameters, unless they are up to date
    for (size_t k = 0; k < p->n_params; k++) same = same && p->maps_params[k] == state->params[k];
    if (!same) {
        p->maps_blur = p->maps_params[0] = NAN;
        s = p->averaged ? sdm_fit_averaged_maps(p, err)
                        : sdm_fit_maps_make(&p->maps, state->params, true, err);
        if (!s) memcpy(p->maps_params, state->params, p->n_params * sizeof *state->params);
    } else if (p->maps.cancelled && p->maps.cancelled(p->maps.user)) {
        s = sdm_fail(err, SDM_E_CANCELLED, "fit stopped on request");
    }
    if (s) return s;
    // blur the field
    const double blur = sdm_fit_field_blur(p);
    if (!(p->maps_blur == blur)) {
        sdm_fit_maps_pack(&p->maps, blur, true);
        p->maps_blur = blur;
    }
    // field, log-likelihood and derivatives at the samples
    sdm_fit_observation_prepare(p->opts, p->target->kind, state, &p->observation);
    s = sdm_fit_samples_evaluate(&p->samples, &p->maps, &p->observation, state, err);
    if (!s) s = sdm_fit_beyond_evaluate(&p->samples, &p->maps, state, err);
    if (s) return s;
    sdm_fit_information_compute(&p->information, &p->samples, &p->observation, p->opts->n_threads);
    if (p->n_even > 0) add_even_density(p);
    return s;
}

double sdm_fit_objective(const fit_problem *p)
{
    return p->information.log_likelihood + sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
}

sdm_status sdm_fit_log_likelihood(fit_problem *p, const double *params, double *log_likelihood,
                                  sdm_error *err)
{
    p->maps_params[0] = p->maps_blur = NAN;
    const sdm_status s = sdm_fit_maps_make(&p->maps, params, false, err);
    if (s) return s;
    sdm_fit_maps_pack(&p->maps, sdm_fit_field_blur(p), false);
    *log_likelihood =
        sdm_fit_samples_log_likelihood(&p->samples, &p->maps, &p->observation, &p->state);
    return SDM_OK;
}

double sdm_fit_likelihood_at(const fit_problem *p, const fit_state *state, size_t most)
{
    const size_t step = p->samples.n / most + 1;
    double sum = 0;
    fit_likelihood l;
    fit_open_end end;
    const bool open = sdm_fit_beyond_end(&p->samples, &p->maps, &end);
    for (size_t i = 0; i < p->samples.n; i += step) {
        const double *x = p->samples.world + 3 * i;
        (void)sdm_fit_likelihood_beyond(&p->observation, (double)p->samples.value[i],
                                        fit_sample_weights(&p->samples, i),
                                        sdm_fit_maps_at(&p->maps, state, x),
                                        open ? sdm_fit_beyond_at(&end, state, x) : 0, false, &l);
        sum += l.log_likelihood;
    }
    return sum;
}
