/* Values, gradients and derivatives of a field at points. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "field_parts.h"
#include "sdm/internal/pod.h"

/* Points that a thread takes at once. */
enum { PIECE = 256 };

/* gradient[3] by the world coordinates, from the derivatives by the coordinates (mm) along the axes
   of the map. */
static void turn(const sdm_field *f, const float along[3], float gradient[3])
{
    for (int x = 0; x < 3; x++)
        gradient[x] = (float)(f->frame.dir[3 * x] * (double)along[0] +
                              f->frame.dir[3 * x + 1] * (double)along[1] +
                              f->frame.dir[3 * x + 2] * (double)along[2]);
}

static void gradient_at(const sdm_field *f, const field_place *p, float gradient[3])
{
    float slope[3][4], along[3];
    for (int a = 0; a < 3; a++) sdm_spline_slopes(p->t[a], slope[a]);
    f->kernels->gradient(f->splines + p->at, f->shape.step[1], f->shape.step[2],
                         (const float(*)[4])p->weight, (const float(*)[4])slope, along);
    for (int a = 0; a < 3; a++) along[a] /= (float)f->frame.spacing[a];
    if (p->outside) {
        // the derivative of sqrt(square + d^2); d does not change along axes that leave the box
        const float d = fmaxf(field_inside(f, p, 0), 0), bound = field_value(f, p);
        for (int a = 0; a < 3; a++)
            along[a] = (p->beyond[a] != 0 ? p->beyond[a] : d * along[a]) / bound;
    }
    turn(f, along, gradient);
}

static void slopes_at(const sdm_field *f, const field_place *p, float *slopes)
{
    float factor = 1;
    if (p->outside) factor = fmaxf(field_inside(f, p, 0), 0) / field_value(f, p);
    for (size_t i = 0; i < f->info->n_params; i++) slopes[i] = factor * field_inside(f, p, i + 1);
}

/* The outcome of a point. */
typedef enum outcome { DONE = 0, NOT_FINITE, OUTSIDE, NO_SLOPES } outcome;

static outcome exact_at(const sdm_field *f, const double x[3], float *value, float *gradient,
                        float *slopes)
{
    double distance, normal[3], closest[3], by[SDM_POD_MAX_PARAMS];
    uint32_t triangle;
    if (slopes && !f->slopes) return NO_SLOPES;
    distance = sdm_exact_point(f->surface.engine, x, closest, normal, &triangle);
    *value = (float)distance;
    for (int a = 0; a < 3 && gradient; a++) gradient[a] = (float)normal[a];
    if (!slopes) return DONE;
    const sdm_exact_at at = {&distance, normal, closest, &triangle};
    sdm_exact_slopes_at(f->slopes, x, &at, 0, by);
    for (size_t i = 0; i < f->surface.n_params; i++) slopes[i] = (float)by[i];
    return DONE;
}

static outcome point(const sdm_field *f, const double x[3], float *value, float *gradient,
                     float *slopes)
{
    if (!isfinite(x[0]) || !isfinite(x[1]) || !isfinite(x[2])) return NOT_FINITE;
    if (field_is_exact(f)) return exact_at(f, x, value, gradient, slopes);
    const field_place p = field_find(f, x);
    if (p.outside && f->opts.outside == SDM_OUTSIDE_REFUSE) return OUTSIDE;
    if (p.outside && f->opts.outside == SDM_OUTSIDE_EXACT)
        return exact_at(f, x, value, gradient, slopes);
    *value = field_value(f, &p);
    if (gradient) gradient_at(f, &p, gradient);
    if (slopes) slopes_at(f, &p, slopes);
    return DONE;
}

static sdm_status report(const sdm_field *f, outcome o, const double x[3], const char *name,
                         sdm_error *err)
{
    char text[200];
    if (o == NOT_FINITE)
        return sdm_fail(err, SDM_E_ARG, "%s (%g, %g, %g): coordinates must be finite", name, x[0],
                        x[1], x[2]);
    if (o == NO_SLOPES)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s (%g, %g, %g) lies outside of the box of the network, and the "
                        "vertices of the exact shape have no derivatives by the parameters: leave "
                        "out the slopes or this point",
                        name, x[0], x[1], x[2]);
    snprintf(text, sizeof text, "%s (%g, %g, %g) mm lies outside of", name, x[0], x[1], x[2]);
    return sdm_field_refuse(f, text, err);
}

sdm_status sdm_field_point(const sdm_field *f, const double x[3], float *value, float gradient[3],
                           float *slopes, sdm_error *err)
{
    if (!f || !x || !value)
        return sdm_fail(err, SDM_E_ARG,
                        "field: a field, a point and a place for the value are needed");
    const sdm_status s = sdm_field_check(f, slopes, err);
    if (s) return s;
    const outcome o = point(f, x, value, gradient, slopes);
    return o ? report(f, o, x, "point", err) : SDM_OK;
}

/* Computes points first .. last - 1; returns the first wrong one, or SIZE_MAX. */
static size_t piece(const sdm_field *f, const double *x, size_t first, size_t last, float *values,
                    float *gradient, float *slopes)
{
    for (size_t i = first; i < last; i++)
        if (point(f, x + 3 * i, values + i, gradient ? gradient + 3 * i : NULL,
                  slopes ? slopes + i * f->info->n_params : NULL))
            return i;
    return SIZE_MAX;
}

sdm_status sdm_field_points(const sdm_field *f, const double *x, size_t n, float *values,
                            float *gradient, float *slopes, sdm_error *err)
{
    if (!f || (n && (!x || !values)))
        return sdm_fail(err, SDM_E_ARG,
                        "sdm_field_points: the field f, the points x and an array "
                        "values[n] must not be NULL");
    const sdm_status s = sdm_field_check(f, slopes, err);
    if (s) return s;
    const size_t pieces = (n + PIECE - 1) / PIECE;
    size_t wrong = SIZE_MAX;
#pragma omp parallel for schedule(static) reduction(min                                            \
                                                    : wrong)                                       \
    num_threads(f->n_threads) if (f->n_threads > 1)
    for (size_t k = 0; k < pieces; k++) {
        const size_t first = k * PIECE, last = n - first < PIECE ? n : first + PIECE;
        const size_t i = piece(f, x, first, last, values, gradient, slopes);
        wrong = i < wrong ? i : wrong;
    }
    if (wrong == SIZE_MAX) return SDM_OK;
    char name[64];
    float value, along[3], *by_params = slopes ? slopes + wrong * f->info->n_params : NULL;
    snprintf(name, sizeof name, "point %zu of %zu", wrong + 1, n);
    return report(f, point(f, x + 3 * wrong, &value, gradient ? along : NULL, by_params),
                  x + 3 * wrong, name, err);
}
