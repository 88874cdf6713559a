/* Test of parameters that were kept: likelihood ratio against parameters that are free, as for a
 * kept pose. */
#include "kept_params.h"

#include <math.h>
#include <stdio.h>

#include "fit/data/source_params.h"
#include "fit/solver/objective.h"
#include "fit/solver/open_motions.h"
#include "fit/start/even_points.h"
#include "fit/start/other_values.h"
#include "kept_gain.h"

// a gain from which on a kept value is doubtful: a true one is four standard deviations off, once
// in ten thousand times
#define GAIN_DOUBTFUL 8.0

/* What the free parameters gain: in log posterior density, as of independent samples; the kept one
 * whose change moves the surface most, by how much, mm rms along the normal, and its value. */
typedef struct free_params {
    double gain, motion;
    size_t param;
    double value;
} free_params;

// rms motion of the surface along its normal by a change of parameter k, to first order, mm
static double motion_by(const fit_problem *p, size_t k, double change)
{
    const fit_samples *s = &p->samples;
    double square = 0, slope = 0;
    for (size_t i = 0; i < s->n; i++) {
        if (s->row[i] == SIZE_MAX) continue;
        square += pow((double)s->jacobian[s->row[i] * s->n_columns + k] * change, 2);
        slope += sdm_fit_slope_squared(p, i);
    }
    return slope > 0 ? sqrt(square / slope) : 0;
}

// Points: goes on to a higher maximum near the shape on whose surface they lie most evenly, if
// there is one, as each fit to points does. kept: objective of the kept values; *gain: over it
static sdm_status evenly_free(fit_problem *p, const sdm_fit_opts *freed, double kept, double *gain,
                              sdm_error *err)
{
    const sdm_fit_opts *given = p->opts;
    const fit_state state = p->state;
    const double objective = sdm_fit_objective(p);
    double other;
    bool moved;
    if (p->target->kind != SDM_FIT_POINTS) return SDM_OK;
    p->opts = freed;
    sdm_status s = sdm_fit_even_points(p, &moved, err);
    p->opts = given;
    if (!s && moved) s = sdm_fit_free(p, freed, kept, &other, err);
    if (!s && moved && sdm_fit_objective(p) > objective) {
        *gain = other;
        return SDM_OK;
    }
    p->state = state;
    return s ? s : sdm_fit_evaluate(p, err);
}

// Goes on to a higher maximum with other values of the parameters that were kept, if there is one:
// near a value that is far off the likelihood has a maximum of its own. *gain: over `kept`
static sdm_status elsewhere_free(fit_problem *p, const sdm_fit_opts *freed, const fit_state *kept,
                                 double *gain, sdm_error *err)
{
    const sdm_fit_opts *given = p->opts;
    bool found;
    p->opts = freed;
    sdm_status s = sdm_fit_other_values(p, given->kept, &found, err);
    p->opts = given;
    if (s || !found) return s;
    // both states on the samples of the search
    const fit_state other = p->state;
    p->state = *kept;
    s = sdm_fit_evaluate(p, err);
    const double objective = sdm_fit_objective(p);
    p->state = other;
    if (!s) s = sdm_fit_evaluate(p, err);
    return s ? s : sdm_fit_free(p, freed, objective, gain, err);
}

static sdm_status params_free(fit_problem *p, free_params *out, sdm_error *err)
{
    const fit_state kept = p->state;
    sdm_fit_opts freed = *p->opts;
    freed.kept = NULL;
    freed.progress = NULL;
    sdm_status s = sdm_fit_evaluate(p, err); // other checks use the maps, too
    const double objective = sdm_fit_objective(p);
    if (!s) s = sdm_fit_free(p, &freed, objective, &out->gain, err);
    if (!s && !p->is_rival) s = evenly_free(p, &freed, objective, &out->gain, err);
    if (!s && !p->is_rival) s = elsewhere_free(p, &freed, &kept, &out->gain, err);
    for (size_t k = 0; k < p->n_params && !s; k++) {
        const double motion =
            p->opts->kept[k] ? motion_by(p, k, p->state.params[k] - kept.params[k]) : -1;
        if (motion > out->motion)
            out->motion = motion, out->param = k, out->value = p->state.params[k];
    }
    p->state = kept;
    return s ? s : sdm_fit_evaluate(p, err);
}

sdm_status sdm_fit_judge_kept_params(fit_problem *p, sdm_fit_result *r, sdm_error *err)
{
    sdm_error failed = {0};
    free_params found = {.gain = NAN, .motion = -1};
    const char *name;
    double low, high;
    const sdm_status s = params_free(p, &found, &failed);
    if (s == SDM_E_NOMEM || s == SDM_E_CANCELLED) return sdm_fail(err, s, "%s", failed.text);
    const bool refused = found.gain > FIT_FREE_GAIN_MAX &&
                         found.motion > FIT_FREE_MOTION_MAX * fit_longest_edge(&p->maps.grid),
               doubtful = s || !(found.gain <= GAIN_DOUBTFUL);
    sdm_fit_finding f = {.kind = SDM_FIT_CHECK_KEPT_PARAMS,
                         .grade = refused    ? SDM_FIT_FAILED
                                  : doubtful ? SDM_FIT_DOUBTFUL
                                             : SDM_FIT_PASSED,
                         .figure = s ? NAN : found.gain,
                         .limit = refused ? FIT_FREE_GAIN_MAX : GAIN_DOUBTFUL};
    sdm_fit_bounds(p->source, found.param, &low, &high, &name);
    if (s)
        snprintf(f.text, sizeof f.text,
                 "not tested, because the fit with free values fails: %.300s", failed.text);
    else if (doubtful)
        snprintf(
            f.text, sizeof f.text,
            "the data do not want the value at which %.60s is kept: free, it goes to %.4g, and "
            "explains the data better by %.3g (log-likelihood of independent samples); "
            "correct the value, or do not keep it",
            name, found.value, found.gain);
    else
        snprintf(f.text, sizeof f.text,
                 "with '%.60s' free the fit goes to %.60s = %.4g, and explains the data better by "
                 "%.3g (log-likelihood of independent samples)",
                 name, name, found.value, found.gain);
    sdm_fit_verdict_add(&r->verdict, &f);
    return refused ? sdm_fail(err, SDM_E_QUALITY, "%s", f.text) : SDM_OK;
}
