/* Centreline of the duct, its moving frame and cross-sections. */
#include "duct_curve.h"

#include <math.h>
#include <stdbool.h>

#include "lathe.h"

// The hook ends at this angle, rad: the basal quarter of a turn.
#define HOOK_END (LATHE_PI / 2)

// The apical taper begins so far before the end, rad: half a turn.
#define TIP_LENGTH LATHE_PI

// Half axes below this length, mm, shrink towards 0 instead of becoming negative.
#define LEAST 0.1

// Points of an outline among which the farthest is sought.
#define POINTS 128

/* Adds size * (1 - theta / HOOK_END)^3 and its derivatives below HOOK_END; C2 there. */
static void hook_add(double size, double theta, double f[3])
{
    const double u = 1 - theta / HOOK_END;
    if (u <= 0) return;
    f[0] += size * u * u * u;
    f[1] -= 3 * size * u * u / HOOK_END;
    f[2] += 6 * size * u / (HOOK_END * HOOK_END);
}

/* r[3] = r, dr/dtheta, d2r/dtheta2. */
static void radius_at(const double *x, double theta, double r[3])
{
    r[0] = x[DUCT_A] * exp(-x[DUCT_B] * theta);
    r[1] = -x[DUCT_B] * r[0];
    r[2] = -x[DUCT_B] * r[1];
    hook_add(x[DUCT_HOOK], theta, r);
}

/* z[3] = z, dz/dtheta, d2z/dtheta2. */
static void height_at(const double *x, double theta, double z[3])
{
    // both waves as one, amplitude a and phase 0 and amplitude b and phase pi / 2
    const double k = DUCT_KAPPA, decay = exp(-k * theta),
                 a = decay * (x[DUCT_ALPHA] * cos(x[DUCT_PHI]) + x[DUCT_SURGE]),
                 b = decay * (x[DUCT_ALPHA] * sin(x[DUCT_PHI]) + x[DUCT_SWAY]),
                 c = a * cos(theta) + b * sin(theta), s = a * sin(theta) - b * cos(theta);
    const double end = x[DUCT_THETA], f = theta / end, dome = 4 * x[DUCT_DOME];
    z[0] = x[DUCT_C] * theta + c + dome * f * (1 - f);
    z[1] = x[DUCT_C] - (k * c + s) + dome * (1 - 2 * f) / end;
    z[2] = (k * k - 1) * c + 2 * k * s - 2 * dome / (end * end);
    hook_add(x[DUCT_DIP], theta, z);
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Centre and frame of the section, as in cochlea_curve.c. */
static void frame_at(const double *x, double theta, duct_section *out)
{
    double r[3], z[3];
    radius_at(x, theta, r);
    height_at(x, theta, z);
    const double c = cos(theta), s = sin(theta), level = r[2] - r[0], twice = 2 * r[1];
    const double centre[3] = {c * r[0], s * r[0], z[0]},
                 d1[3] = {c * r[1] - s * r[0], s * r[1] + c * r[0], z[1]},
                 d2[3] = {c * level - s * twice, s * level + c * twice, z[2]};
    const double speed2 = dot(d1, d1), speed = sqrt(speed2), across = hypot(d1[0], d1[1]);
    double *t = out->tangent, *e1 = out->e1, *e2 = out->e2;
    for (int k = 0; k < 3; k++) out->centre[k] = centre[k], t[k] = d1[k] / speed;
    e1[0] = d1[1] / across, e1[1] = -d1[0] / across, e1[2] = 0;
    e2[0] = -t[2] * e1[1], e2[1] = t[2] * e1[0], e2[2] = t[0] * e1[1] - t[1] * e1[0];
    out->bend[0] = dot(d2, e1) / speed2;
    out->bend[1] = dot(d2, e2) / speed2;
}

/* Parabola through v[0], v[1], v[2] at f = 0, 1/2, 1. */
static double parabola(const double v[3], double f)
{
    return v[0] * (1 - f) * (1 - 2 * f) + 4 * v[1] * f * (1 - f) + v[2] * f * (2 * f - 1);
}

/* The spline with the control values v[n] at f, 0 <= f <= 1: a B-spline of the degree 3 (n - 1
 * below 4 values) with evenly spaced knots, the outer ones repeated so that it begins at v[0] and
 * ends at v[n - 1]. Algorithm of de Boor (1972). */
static double spline_at(size_t n, const double *v, double f)
{
    enum { DEGREE = 3 };
    const int degree = n > DEGREE ? DEGREE : (int)n - 1, pieces = (int)n - degree,
              piece = f < 1 ? (int)(f * pieces) : pieces - 1;
    double d[DEGREE + 1];
    for (int i = 0; i <= degree; i++) d[i] = v[piece + i];
    for (int level = 1; level <= degree; level++)
        for (int i = degree; i >= level; i--) {
            const double low = fmax(0, piece + i - degree) / pieces,
                         high = fmin(pieces, piece + i + 1 - level) / (double)pieces,
                         part = (f - low) / (high - low);
            d[i] = (1 - part) * d[i - 1] + part * d[i];
        }
    return d[degree];
}

/* growth[DUCT_HARMONICS] at a fraction. e2 points down, the parameters count upward. */
static void growth_at(size_t n_values, const double *values, double fraction, double *growth)
{
    for (size_t k = 0; k < DUCT_HARMONICS; k++)
        growth[k] = n_values ? spline_at(n_values, values + k * n_values, fraction) : 0;
    growth[DUCT_GROWTH_UPPER] = -growth[DUCT_GROWTH_UPPER];
    growth[DUCT_GROWTH_OBLIQUE] = -growth[DUCT_GROWTH_OBLIQUE];
}

/* A half axis, mm: x from LEAST on, else less but positive; the first derivative is continuous. */
static double half_axis(double x) { return x > LEAST ? x : LEAST * exp(x / LEAST - 1); }

void sdm_duct_section_at(duct_form form, size_t n_values, const double *x, double fraction,
                         duct_section *out)
{
    const double theta = fraction * x[DUCT_THETA];
    frame_at(x, theta, out);
    const double flare = x[DUCT_FLARE] * exp(-theta / DUCT_FLARE_ANGLE),
                 u = fmax(0, 1 - (x[DUCT_THETA] - theta) / TIP_LENGTH),
                 taper = 1 - (1 - x[DUCT_TIP]) * u * u;
    out->wide = taper * half_axis(0.5 * parabola(x + DUCT_WIDTH_BASE, fraction) + flare);
    out->high = out->wide;
    out->tilt[0] = 1, out->tilt[1] = 0;
    out->waist = out->egg = 0;
    growth_at(n_values, x + DUCT_VALUES, fraction, out->growth);
    if (form == DUCT_CIRCLE) return;
    const double early = fmax(0, 1 - theta / HOOK_END),
                 tilt = parabola(x + DUCT_TILT_BASE, fraction) + x[DUCT_TWIST] * early * early,
                 flare_high = flare + x[DUCT_FLARE_HIGH] * exp(-theta / DUCT_FLARE_ANGLE);
    out->high = taper * half_axis(0.5 * parabola(x + DUCT_HEIGHT_BASE, fraction) + flare_high);
    out->tilt[0] = cos(tilt), out->tilt[1] = -sin(tilt); // e2 points down
    if (form == DUCT_LOBES) out->waist = x[DUCT_WAIST], out->egg = -x[DUCT_EGG];
}

void sdm_duct_slant_at(const double *x, double fraction, double slant[2])
{
    double u[3] = {0, 0, 0};
    hook_add(1, fraction * x[DUCT_THETA], u);
    slant[0] = u[0] * x[DUCT_SLANT_OUT];
    slant[1] = -u[0] * x[DUCT_SLANT_UP]; // this parameter counts upwards, e2 points down
}

void sdm_duct_outline_at(const duct_section *s, double co, double si, double at[2])
{
    const double *g = s->growth,
                 growth =
                     exp(g[DUCT_GROWTH_SIZE] + g[DUCT_GROWTH_OUTER] * co +
                         g[DUCT_GROWTH_UPPER] * si + g[DUCT_GROWTH_OVAL] * (co * co - si * si) +
                         g[DUCT_GROWTH_OBLIQUE] * 2 * si * co),
                 across = growth * s->wide * co * (1 - s->waist * co * co) * (1 + s->egg * si),
                 up = growth * s->high * si;
    at[0] = s->tilt[0] * across - s->tilt[1] * up;
    at[1] = s->tilt[1] * across + s->tilt[0] * up;
}

double sdm_duct_reach(const duct_section *s, const double along[2])
{
    double reach[POINTS + 2], best = 0;
    for (int i = 0; i < POINTS + 2; i++) {
        const double angle = 2 * LATHE_PI * i / POINTS;
        double at[2];
        sdm_duct_outline_at(s, cos(angle), sin(angle), at);
        reach[i] = along[0] * at[0] + along[1] * at[1];
    }
    for (int i = 1; i <= POINTS; i++) { // the highest of each parabola through three neighbours
        const double slope = 0.5 * (reach[i + 1] - reach[i - 1]),
                     bend = reach[i + 1] - 2 * reach[i] + reach[i - 1];
        const bool top = reach[i] >= reach[i - 1] && reach[i] >= reach[i + 1] && bend < 0;
        best = fmax(best, top ? reach[i] - 0.5 * slope * slope / bend : reach[i]);
    }
    return best;
}

double sdm_duct_mean_radius(const duct_section *s)
{
    return exp(s->growth[DUCT_GROWTH_SIZE]) * sqrt(s->wide * s->high);
}
