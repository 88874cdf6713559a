/* Whether the data want parameters beyond the bounds at which the fit has stopped them. */
#include "bounds.h"

#include <math.h>
#include <stdio.h>

#include "fit/data/source_params.h"

/* Gain in log-likelihood by the Newton step of parameter k alone, where it leads out of the range;
 * else 0. The other unknowns stay, which makes the gain smaller than it is. */
static double gain_beyond(const fit_problem *p, size_t k, bool upper)
{
    const fit_information *f = &p->information;
    const double slope = f->gradient[k] * (upper ? 1 : -1),
                 curvature = f->complete[k * (f->n_unknowns + 1)];
    return slope > 0 && curvature > 0 ? 0.5 * slope * slope / curvature : 0;
}

fit_at_bounds sdm_fit_at_bounds(const fit_problem *p, const sdm_fit_result *r, double factor)
{
    fit_at_bounds b = {.n = 0};
    double most = SDM_FIT_PREFERRED;
    for (size_t k = 0; k < p->n_params && !p->opts->keep_params; k++) {
        const bool upper = p->state.params[k] >= p->high[k];
        if (!r->at_bound[k]) continue;
        b.n++;
        const double gain = gain_beyond(p, k, upper) / factor;
        if (!(gain > SDM_FIT_PREFERRED)) continue;
        b.n_wanted++;
        if (!(gain > most)) continue;
        const char *name = "";
        double low, high;
        most = gain;
        sdm_fit_bounds(p->source, k, &low, &high, &name);
        snprintf(b.text, sizeof b.text,
                 "%.60s ends at its bound: the data want %s than %.6g, the %s value of its range",
                 name, upper ? "more" : "less", upper ? p->high[k] : p->low[k],
                 upper ? "largest" : "smallest");
    }
    return b;
}
