/* Tells early that the maps which are made in any case do not fit into a budget of time. */
#include "forecast.h"

#include <math.h>

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
