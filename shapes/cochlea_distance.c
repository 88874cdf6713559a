/* Closed-form distance of the cochlea: min over theta of abs(point - c(theta)) - R(theta). */
#include <math.h>

#include "cochlea_curve.h"

// Number of steps along the centreline. A step is shorter than the tube radius, so no minimum is
// narrower than a step.
#define STEPS 512

static double ball_distance(const cochlea_model *m, const double *x, const double point[3],
                            double theta)
{
    double c[3];
    sdm_cochlea_centre_at(m, x, theta, c);
    const double d[3] = {point[0] - c[0], point[1] - c[1], point[2] - c[2]};
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) - sdm_cochlea_radius_at(m, theta);
}

/* Minimum of ball_distance() in [lo, hi], where it is unimodal, by golden section search (Kiefer
   1953). */
static double ball_distance_min(const cochlea_model *m, const double *x, const double point[3],
                                double lo, double hi)
{
    const double golden = 0.61803398874989484820;
    double t1 = hi - golden * (hi - lo), t2 = lo + golden * (hi - lo);
    double f1 = ball_distance(m, x, point, t1), f2 = ball_distance(m, x, point, t2);
    while (hi - lo > 1e-8) {
        if (f1 < f2) {
            hi = t2, t2 = t1, f2 = f1;
            t1 = hi - golden * (hi - lo), f1 = ball_distance(m, x, point, t1);
        } else {
            lo = t1, t1 = t2, f1 = f2;
            t2 = lo + golden * (hi - lo), f2 = ball_distance(m, x, point, t2);
        }
    }
    return f1 < f2 ? f1 : f2;
}

double sdm_cochlea_distance(const cochlea_model *m, const double *x, const double point[3])
{
    const double end = x[COCHLEA_THETA], step = end / STEPS;
    double last = ball_distance(m, x, point, 0), now = ball_distance(m, x, point, step),
           best = last;
    for (int i = 1; i <= STEPS; i++) {
        const double next = i < STEPS ? ball_distance(m, x, point, step * (i + 1)) : INFINITY;
        if (now <= last && now <= next) {
            const double hi = i < STEPS ? step * (i + 1) : end;
            best = fmin(best, ball_distance_min(m, x, point, step * (i - 1), hi));
        }
        if (i == 1 && last <= now) best = fmin(best, ball_distance_min(m, x, point, 0, step));
        last = now, now = next;
    }
    return fmin(best, ball_distance(m, x, point, end));
}
