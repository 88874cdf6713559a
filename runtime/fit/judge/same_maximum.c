/* The likelihood half-way between two surfaces. */
#include "same_maximum.h"

#include <math.h>

#include "finding.h"

// loss of log-likelihood, below the worse one of the two, that is no valley
#define VALLEY 0.5

bool sdm_fit_same_maximum(const fit_problem *p, const fit_standing *fit, const double *field,
                          const fit_standing *rival)
{
    const fit_samples *s = &p->samples;
    if (!p->maps.share || !(fit->factor > 0)) return false;
    if (!(fabs(sdm_fit_gain(fit, rival)) < SDM_FIT_PREFERRED)) return false;
    fit_standing between = {.factor = fit->factor};
    for (size_t i = 0; i < s->n; i++) {
        fit_likelihood l;
        sdm_fit_likelihood(&p->observation, (double)s->value[i], fit_sample_weights(s, i),
                           0.5 * (field[i] + s->field[i]), false, &l);
        between.log_likelihood += l.log_likelihood;
    }
    const double below_fit = sdm_fit_gain(fit, &between),
                 below_rival = sdm_fit_gain(rival, &between);
    // much better half-way: the image shows both, or the truth between them
    return fmin(below_fit, below_rival) < VALLEY && below_fit > -SDM_FIT_PREFERRED;
}
