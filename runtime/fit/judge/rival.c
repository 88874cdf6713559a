/* The gain of a fit over a rival: by the likelihood of voxels, or by the residuals of
 * neighbourhoods. */
#include "rival.h"

#include <math.h>

#include "finding.h"
#include "residuals.h"

// a chi-square is at least this: residuals without any noise
#define CHI_SQUARE_MIN 1e-3
// of points that only one of two shapes takes for strays
#define CHI_SQUARE_STRAY 9.0
// loss of log-likelihood, below the worse one of the two, that is no valley
#define VALLEY 0.5

sdm_status sdm_fit_stand(const fit_problem *p, double factor, fit_standing *out, sdm_error *err)
{
    if (fit_is_image(p)) {
        *out = (fit_standing){.log_likelihood = p->information.log_likelihood, .factor = factor};
        return SDM_OK;
    }
    fit_residuals residuals;
    fit_misfit misfit;
    sdm_status s = sdm_fit_residuals_create(p, &residuals, err);
    if (!s) s = sdm_fit_misfit(p, &residuals, &misfit, err);
    sdm_fit_residuals_dispose(&residuals);
    if (!s)
        *out = (fit_standing){.n_units = misfit.few ? 0 : misfit.n_units[0] + misfit.n_units[1],
                              .chi_square = misfit.noise_chi_square,
                              .n_points = misfit.n_points};
    if (!s && p->target->kind == SDM_FIT_POINTS)
        out->log_likelihood = p->information.log_likelihood, out->factor = factor;
    return s;
}

double sdm_fit_units_gain(double n, double chi_square, double rival_chi_square)
{
    return 0.5 * n * log(fmax(rival_chi_square, CHI_SQUARE_MIN) / fmax(chi_square, CHI_SQUARE_MIN));
}

double sdm_fit_chi_square(const fit_standing *s, const fit_standing *against)
{
    if (s->n_points >= against->n_points) return s->chi_square;
    const double kept = (double)s->n_points / (double)against->n_points;
    return kept * s->chi_square + (1 - kept) * CHI_SQUARE_STRAY;
}

bool sdm_fit_has_units(const fit_standing *fit, const fit_standing *rival)
{
    return fit->n_units && rival->n_units;
}

double sdm_fit_gain(const fit_standing *fit, const fit_standing *rival)
{
    if (fit->factor > 0 && !sdm_fit_has_units(fit, rival))
        return (fit->log_likelihood - rival->log_likelihood) / fit->factor;
    if (!sdm_fit_has_units(fit, rival)) return NAN;
    return sdm_fit_units_gain(0.5 * (double)(fit->n_units + rival->n_units),
                              sdm_fit_chi_square(fit, rival), sdm_fit_chi_square(rival, fit));
}

bool sdm_fit_same_maximum(const fit_problem *p, const fit_standing *fit, const double *field,
                          const fit_standing *rival)
{
    const fit_samples *s = &p->samples;
    if (!fit_is_image(p) || !p->maps.share || !(fit->factor > 0)) return false;
    if (!(fabs(sdm_fit_gain(fit, rival)) < SDM_FIT_PREFERRED)) return false;
    fit_standing between = {.factor = fit->factor};
    for (size_t i = 0; i < s->n; i++) {
        fit_likelihood l;
        (void)sdm_fit_likelihood_beyond(&p->observation, (double)s->value[i],
                                        fit_sample_weights(s, i), 0.5 * (field[i] + s->field[i]),
                                        fit_sample_beyond(s, i), false, &l);
        between.log_likelihood += l.log_likelihood;
    }
    const double below_fit = sdm_fit_gain(fit, &between),
                 below_rival = sdm_fit_gain(rival, &between);
    // much better half-way: the image shows both, or the truth between them
    return fmin(below_fit, below_rival) < VALLEY && below_fit > -SDM_FIT_PREFERRED;
}
