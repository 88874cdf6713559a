/* Centreline of the cochlea (a rising logarithmic spiral with a wave in the basal turn), its frame
 * and tube radius, with derivatives by dual numbers. */
#include "cochlea_curve.h"

#include <math.h>

#define TURN 6.28318530717958647693

dual sdm_dual_of(double v) { return (dual){.v = v}; }

dual sdm_dual_add(dual a, dual b)
{
    a.v += b.v;
    for (int i = 0; i < COCHLEA_UNKNOWNS; i++) a.d[i] += b.d[i];
    return a;
}

dual sdm_dual_sub(dual a, dual b) { return sdm_dual_add(a, sdm_dual_scale(-1, b)); }

dual sdm_dual_scale(double s, dual a)
{
    a.v *= s;
    for (int i = 0; i < COCHLEA_UNKNOWNS; i++) a.d[i] *= s;
    return a;
}

dual sdm_dual_mul(dual a, dual b)
{
    dual r = {.v = a.v * b.v};
    for (int i = 0; i < COCHLEA_UNKNOWNS; i++) r.d[i] = a.d[i] * b.v + a.v * b.d[i];
    return r;
}

dual sdm_dual_div(dual a, dual b)
{
    dual r = {.v = a.v / b.v};
    for (int i = 0; i < COCHLEA_UNKNOWNS; i++) r.d[i] = (a.d[i] - r.v * b.d[i]) / b.v;
    return r;
}

dual sdm_dual_apply(dual a, double f, double df)
{
    a = sdm_dual_scale(df, a);
    a.v = f;
    return a;
}

static dual dual_sqrt(dual a)
{
    const double r = sqrt(a.v);
    return sdm_dual_apply(a, r, 0.5 / r);
}

static dual dual_dot(const dual a[3], const dual b[3])
{
    return sdm_dual_add(sdm_dual_add(sdm_dual_mul(a[0], b[0]), sdm_dual_mul(a[1], b[1])),
                        sdm_dual_mul(a[2], b[2]));
}

static dual dual_exp(dual a)
{
    const double e = exp(a.v);
    return sdm_dual_apply(a, e, e);
}

static dual dual_cos(dual a) { return sdm_dual_apply(a, cos(a.v), -sin(a.v)); }
static dual dual_sin(dual a) { return sdm_dual_apply(a, sin(a.v), cos(a.v)); }

static dual dual_unknown(const double *x, int k)
{
    dual u = sdm_dual_of(x[k]);
    u.d[k] = 1;
    return u;
}

/* r[3] = r, dr/dtheta, d2r/dtheta2 of the logarithmic spiral. */
static void spiral_at(const double *x, dual theta, dual r[3])
{
    const dual b = dual_unknown(x, COCHLEA_B);
    r[0] = sdm_dual_mul(dual_unknown(x, COCHLEA_A),
                        dual_exp(sdm_dual_scale(-1, sdm_dual_mul(b, theta))));
    r[1] = sdm_dual_scale(-1, sdm_dual_mul(b, r[0]));
    r[2] = sdm_dual_scale(-1, sdm_dual_mul(b, r[1]));
}

/* Polynomial start: Taylor polynomial of the spiral at theta2 up to second order plus a cubic term,
 * so that r(0) = p0 and r is C2 at theta2. r[3] as in spiral_at(). */
static void cubic_at(const double *x, dual theta, dual r[3])
{
    const dual end = dual_unknown(x, COCHLEA_THETA2), end2 = sdm_dual_mul(end, end),
               h = sdm_dual_sub(theta, end);
    dual s[3];
    spiral_at(x, end, s);
    const dual half = sdm_dual_scale(0.5, s[2]);
    const dual start =
        sdm_dual_add(sdm_dual_sub(s[0], sdm_dual_mul(end, s[1])), sdm_dual_mul(end2, half));
    const dual k =
        sdm_dual_div(sdm_dual_sub(start, dual_unknown(x, COCHLEA_P0)), sdm_dual_mul(end2, end));
    const dual kh = sdm_dual_mul(k, h);
    r[0] = sdm_dual_add(
        s[0], sdm_dual_mul(h, sdm_dual_add(s[1], sdm_dual_mul(h, sdm_dual_add(half, kh)))));
    r[1] = sdm_dual_add(s[1], sdm_dual_mul(h, sdm_dual_add(s[2], sdm_dual_scale(3, kh))));
    r[2] = sdm_dual_add(s[2], sdm_dual_scale(6, kh));
}

/* z[3] = z, dz/dtheta, d2z/dtheta2 for z = c theta + alpha exp(-kappa theta) cos(theta - phi). */
static void height_at(const double *x, dual theta, dual z[3])
{
    const dual rise = dual_unknown(x, COCHLEA_C), k = dual_unknown(x, COCHLEA_KAPPA);
    const dual turned = sdm_dual_sub(theta, dual_unknown(x, COCHLEA_PHI)), c = dual_cos(turned),
               s = dual_sin(turned);
    const dual decay = dual_exp(sdm_dual_scale(-1, sdm_dual_mul(k, theta)));
    const dual wave = sdm_dual_mul(dual_unknown(x, COCHLEA_ALPHA), decay);
    const dual level = sdm_dual_sub(sdm_dual_mul(k, k), sdm_dual_of(1));
    z[0] = sdm_dual_add(sdm_dual_mul(rise, theta), sdm_dual_mul(wave, c));
    z[1] = sdm_dual_sub(rise, sdm_dual_mul(wave, sdm_dual_add(sdm_dual_mul(k, c), s)));
    z[2] = sdm_dual_mul(
        wave, sdm_dual_add(sdm_dual_mul(level, c), sdm_dual_scale(2, sdm_dual_mul(k, s))));
}

/* curve[0], curve[1], curve[2]: position of the centreline, and its first and second derivatives
   with respect to theta. */
static void curve_at(const cochlea_model *m, const double *x, dual theta, dual curve[3][3])
{
    dual r[3], z[3];
    if (m->cubic && theta.v < x[COCHLEA_THETA2])
        cubic_at(x, theta, r);
    else
        spiral_at(x, theta, r);
    height_at(x, theta, z);
    const dual c = dual_cos(theta), s = dual_sin(theta), level = sdm_dual_sub(r[2], r[0]),
               twice = sdm_dual_scale(2, r[1]);
    curve[0][0] = sdm_dual_mul(c, r[0]);
    curve[0][1] = sdm_dual_mul(s, r[0]);
    curve[1][0] = sdm_dual_sub(sdm_dual_mul(c, r[1]), sdm_dual_mul(s, r[0]));
    curve[1][1] = sdm_dual_add(sdm_dual_mul(s, r[1]), sdm_dual_mul(c, r[0]));
    curve[2][0] = sdm_dual_sub(sdm_dual_mul(c, level), sdm_dual_mul(s, twice));
    curve[2][1] = sdm_dual_add(sdm_dual_mul(s, level), sdm_dual_mul(c, twice));
    for (int k = 0; k < 3; k++) curve[k][2] = z[k];
}

/* Half axes of the cross-section at theta, mm. */
static void tube_at(const cochlea_model *m, dual theta, dual *wide, dual *high)
{
    const double flare = m->flare * exp(-theta.v / m->flare_angle);
    *wide = sdm_dual_apply(theta, m->radius - m->taper * theta.v + flare,
                           -m->taper - flare / m->flare_angle);
    *high = *wide;
    if (!m->ellipse || theta.v >= TURN) return;
    const double u = theta.v / TURN, rest = 1 - m->ratio;
    const dual ratio =
        sdm_dual_apply(theta, m->ratio + rest * u * u * (3 - 2 * u), rest * 6 * u * (1 - u) / TURN);
    *high = sdm_dual_mul(*wide, ratio);
}

void sdm_cochlea_section_at(const cochlea_model *m, const double *x, double fraction,
                            cochlea_section *out)
{
    const dual theta = sdm_dual_scale(fraction, dual_unknown(x, COCHLEA_THETA));
    dual curve[3][3];
    curve_at(m, x, theta, curve);
    const dual *d1 = curve[1], *d2 = curve[2];
    const dual speed2 = dual_dot(d1, d1), speed = dual_sqrt(speed2);
    const dual level =
        dual_sqrt(sdm_dual_add(sdm_dual_mul(d1[0], d1[0]), sdm_dual_mul(d1[1], d1[1])));
    for (int k = 0; k < 3; k++)
        out->centre[k] = curve[0][k], out->tangent[k] = sdm_dual_div(d1[k], speed);

    // e1 = tangent x z, normalised: depends only on the tangent here (unlike a transported frame),
    // so vertices are smooth functions of the parameters
    const dual *t = out->tangent, *e1 = out->e1;
    out->e1[0] = sdm_dual_div(d1[1], level);
    out->e1[1] = sdm_dual_scale(-1, sdm_dual_div(d1[0], level));
    out->e1[2] = sdm_dual_of(0);
    out->e2[0] = sdm_dual_scale(-1, sdm_dual_mul(t[2], e1[1]));
    out->e2[1] = sdm_dual_mul(t[2], e1[0]);
    out->e2[2] = sdm_dual_sub(sdm_dual_mul(t[0], e1[1]), sdm_dual_mul(t[1], e1[0]));

    // curvature vector: component of the second derivative normal to the tangent, per arc length
    out->bend[0] = sdm_dual_div(dual_dot(d2, out->e1), speed2);
    out->bend[1] = sdm_dual_div(dual_dot(d2, out->e2), speed2);
    tube_at(m, theta, &out->wide, &out->high);
}

void sdm_cochlea_centre_at(const cochlea_model *m, const double *x, double theta, double centre[3])
{
    double r = x[COCHLEA_A] * exp(-x[COCHLEA_B] * theta);
    if (m->cubic && theta < x[COCHLEA_THETA2]) {
        dual basal[3];
        cubic_at(x, sdm_dual_of(theta), basal);
        r = basal[0].v;
    }
    centre[0] = r * cos(theta);
    centre[1] = r * sin(theta);
    centre[2] = x[COCHLEA_C] * theta +
                x[COCHLEA_ALPHA] * exp(-x[COCHLEA_KAPPA] * theta) * cos(theta - x[COCHLEA_PHI]);
}

double sdm_cochlea_radius_at(const cochlea_model *m, double theta)
{
    return m->radius - m->taper * theta + m->flare * exp(-theta / m->flare_angle);
}
