/* Weights of points beyond an open end. */
#include "open_space.h"

#include <math.h>

#include "sdm/internal/open_end.h"
#include "sdm/internal/vec3.h"

// width of the soft border, over the radius of the opening
#define BORDER 0.25
// step of a difference, as a share of the range of the parameter
#define STEP 1e-5

sdm_status sdm_fit_open_end_make(const sdm_instance *shape, const double *params, double margin,
                                 fit_open_end *out, sdm_error *err)
{
    sdm_open_end end;
    const sdm_status s = sdm_instance_open_end(shape, params, &end, err);
    if (s) return s;
    *out = (fit_open_end){.radius = end.radius, .margin = margin};
    for (int k = 0; k < 3; k++) {
        out->centre[k] = end.centre[k];
        out->outward[k] = end.outward[k];
    }
    return SDM_OK;
}

static void numbers_of(const sdm_open_end *end, double n[FIT_OPEN_NUMBERS])
{
    for (int k = 0; k < 3; k++) n[k] = end->centre[k], n[3 + k] = end->outward[k];
    n[6] = end->radius;
}

sdm_status sdm_fit_open_end_slopes(const sdm_instance *shape, double *params,
                                   double (*slopes)[FIT_OPEN_NUMBERS], sdm_error *err)
{
    size_t n;
    const sdm_param *of = sdm_instance_params(shape, &n);
    sdm_status s = SDM_OK;
    for (size_t k = 0; k < n && !s; k++) {
        const double here = params[k], step = STEP * (of[k].max - of[k].min),
                     ends[2] = {fmax(here - step, of[k].min), fmin(here + step, of[k].max)};
        double numbers[2][FIT_OPEN_NUMBERS];
        for (int side = 0; side < 2 && !s; side++) {
            sdm_open_end end;
            params[k] = ends[side];
            s = sdm_instance_open_end(shape, params, &end, err);
            if (!s) numbers_of(&end, numbers[side]);
        }
        params[k] = here;
        for (int i = 0; i < FIT_OPEN_NUMBERS && !s; i++)
            slopes[k][i] = (numbers[1][i] - numbers[0][i]) / (ends[1] - ends[0]);
    }
    return s;
}

// 0 below 0, 1 above 1, between them a cubic polynomial; *slope: its derivative
static double rise(double x, double *slope)
{
    *slope = x > 0 && x < 1 ? 6 * x * (1 - x) : 0;
    return x <= 0 ? 0 : x >= 1 ? 1 : x * x * (3 - 2 * x);
}

double sdm_fit_open_end_weight(const fit_open_end *e, const double y[3], double *by_y,
                               double *by_numbers)
{
    const double d[3] = {y[0] - e->centre[0], y[1] - e->centre[1], y[2] - e->centre[2]};
    const double width = BORDER * e->radius, far = v3_norm(d),
                 ahead = v3_dot(d, e->outward) / width,
                 left = 1 + (e->radius + e->margin - far) / width;
    double slope_ahead, slope_left;
    const double beyond = rise(ahead, &slope_ahead), near = rise(left, &slope_left);
    if (!by_y) return beyond * near;
    const double a = slope_ahead * near, b = slope_left * beyond;
    for (int k = 0; k < 3; k++) {
        by_y[k] = (a * e->outward[k] - (far > 0 ? b * d[k] / far : 0)) / width;
        by_numbers[k] = -by_y[k];
        by_numbers[3 + k] = a * d[k] / width;
    }
    // the radius sets the reach of the ball and the width of the border
    by_numbers[6] = b / width - (a * ahead + b * (left - 1)) / e->radius;
    return beyond * near;
}
