#include "recent.h"

#include <math.h>

// the steps have one direction if their mean is larger than this share of their mean size
#define ONE_WAY 0.5

void sdm_fit_remember(fit_problem *p, const double *step, const double *plain)
{
    fit_recent *r = &p->recent;
    const size_t n = p->n_params + 6, now = r->n % FIT_RECENT,
                 before = (r->n + FIT_RECENT - 1) % FIT_RECENT;
    for (size_t i = 0; i < n; i++) {
        r->position[now][i] = (r->n ? r->position[before][i] : 0) + step[i];
        r->step[now][i] = plain ? plain[i] : INFINITY;
    }
    r->n++;
}

/* Movement of an unknown in the last FIT_RECENT iterations. */
typedef struct movement {
    /* half of the range of its values */
    double half_range;
    /* mean of its undamped steps, and of their sizes */
    double mean, size;
} movement;

static movement movement_of(const fit_problem *p, size_t i)
{
    const fit_recent *r = &p->recent;
    double low = INFINITY, high = -INFINITY;
    movement m = {0};
    for (size_t k = 0; k < FIT_RECENT; k++) {
        low = fmin(low, r->position[k][i]);
        high = fmax(high, r->position[k][i]);
        m.mean += r->step[k][i] / FIT_RECENT;
        m.size += fabs(r->step[k][i]) / FIT_RECENT;
    }
    m.half_range = 0.5 * (high - low);
    return m;
}

double sdm_fit_unrest(const fit_problem *p, size_t i)
{
    if (p->recent.n < FIT_RECENT) return INFINITY;
    const movement m = movement_of(p, i);
    return fmax(m.half_range, fabs(m.mean));
}

double sdm_fit_swing(const fit_problem *p, size_t i)
{
    if (p->recent.n < FIT_RECENT) return 0;
    const movement m = movement_of(p, i);
    return isfinite(m.size) && fabs(m.mean) <= ONE_WAY * m.size ? m.half_range : 0;
}
