/* Tells early whether the maps of a training fit into a budget of time, and how many minutes hold
 * them. */
#include "forecast.h"

#include <math.h>
#include <stdio.h>

#include "progress.h"

bool trainer_forecast(const trainer *t, double since, size_t done, size_t all, double *seconds)
{
    enum { FEWEST = 8 };
    // after a second, or a tenth of a budget of less than ten
    const double now = trainer_seconds(t), budget = 60 * t->config->train.minutes,
                 least = fmin(1, 0.1 * budget);
    *seconds = now;
    if (!trainer_by_time(t) || done < FEWEST || done >= all || now - since < least) return false;
    *seconds += (now - since) / (double)done * (double)(all - done);
    return *seconds > budget;
}

double trainer_maps_asked(const sdm_config *pod, size_t n_params)
{
    const double terms = (double)sdm_poly_count(n_params, (size_t)pod->network.degree);
    return fmin(4 * terms, (double)pod->data.start);
}

double trainer_minutes_for(double maps, double per_map, double after)
{
    const double all = maps * per_map, minutes = fmax(2 * all, 1.5 * (all + after)) / 60;
    return minutes < 1 ? ceil(10 * minutes) / 10 : ceil(2 * minutes) / 2;
}

double trainer_minutes_asked(const trainer *t)
{
    const dataset *d = &t->data;
    const double made = (double)(d->n_static + d->n_start),
                 asked = trainer_maps_asked(t->config, d->n_params);
    if (!trainer_by_time(t) || t->config->network.kind != SDM_NETWORK_POD ||
        !(t->map_seconds > 0) || made >= asked)
        return 0;
    return trainer_minutes_for(asked, t->map_seconds, t->begin_seconds * asked / made);
}

double trainer_tell_pace(trainer *t, const sdm_config *pod, double per_map, double seconds)
{
    size_t n_params;
    sdm_instance_params(t->shape, &n_params);
    const double asked = trainer_maps_asked(pod, n_params), fit = floor(fmax(0, seconds) / per_map);
    if (!trainer_by_time(t) || !(per_map > 0)) return 0;
    // bases take about as long as the maps
    const double minutes = fit < asked ? trainer_minutes_for(asked, per_map, asked * per_map) : 0;
    const char *more = minutes > 0 ? "; if too few limit the model, the last lines of the run name "
                                     "the train.minutes for more"
                                   : "";
    if (!t->pace_told)
        trainer_message(t,
                        "%.3g exact maps a second: about %.0f fit into their part of train.minutes "
                        "(%.4g); %zu %s for %.0f%s",
                        1 / per_map, fit, t->config->train.minutes, n_params,
                        n_params == 1 ? "parameter asks" : "parameters ask", asked, more);
    t->pace_told = true;
    return minutes;
}
