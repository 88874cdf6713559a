/* The centreline of the cochlea: a logarithmic spiral that rises, with a wave on the basal turn. */
#include "cochlea_curve.h"

#include <math.h>

#define TURN 6.28318530717958647693

dual sdm_dual_of(double v) { return (dual){.v = v}; }

dual sdm_dual_add(dual a, dual b)
{
    a.v += b.v;
    for (int i = 0; i < COCHLEA_PARAMS; i++) a.d[i] += b.d[i];
    return a;
}

dual sdm_dual_sub(dual a, dual b) { return sdm_dual_add(a, sdm_dual_scale(-1, b)); }

dual sdm_dual_scale(double s, dual a)
{
    a.v *= s;
    for (int i = 0; i < COCHLEA_PARAMS; i++) a.d[i] *= s;
    return a;
}

dual sdm_dual_mul(dual a, dual b)
{
    dual r = {.v = a.v * b.v};
    for (int i = 0; i < COCHLEA_PARAMS; i++) r.d[i] = a.d[i] * b.v + a.v * b.d[i];
    return r;
}

dual sdm_dual_div(dual a, dual b)
{
    dual r = {.v = a.v / b.v};
    for (int i = 0; i < COCHLEA_PARAMS; i++) r.d[i] = (a.d[i] - r.v * b.d[i]) / b.v;
    return r;
}

dual sdm_dual_apply(dual a, double f, double df)
{
    a = sdm_dual_scale(df, a);
    a.v = f;
    return a;
}

static dual root(dual a)
{
    const double r = sqrt(a.v);
    return sdm_dual_apply(a, r, 0.5 / r);
}

static dual dot(const dual a[3], const dual b[3])
{
    return sdm_dual_add(sdm_dual_add(sdm_dual_mul(a[0], b[0]), sdm_dual_mul(a[1], b[1])), sdm_dual_mul(a[2], b[2]));
}

// r, dr/dtheta and its derivative
static void spiral(const double *p, double theta, dual r[3])
{
    dual a = sdm_dual_of(p[COCHLEA_A]), b = sdm_dual_of(p[COCHLEA_B]);
    a.d[COCHLEA_A] = 1;
    b.d[COCHLEA_B] = 1;
    const double e = exp(-p[COCHLEA_B] * theta);
    r[0] = sdm_dual_mul(a, sdm_dual_apply(b, e, -theta * e));
    r[1] = sdm_dual_scale(-1, sdm_dual_mul(b, r[0]));
    r[2] = sdm_dual_scale(-1, sdm_dual_mul(b, r[1]));
}

// Taylor's polynomial of the spiral at theta2 up to the second order, and a cubic term that makes r(0) = p0: C2 at theta2
static void basal_cubic(const cochlea_model *m, const double *p, double theta, dual r[3])
{
    dual s[3];
    spiral(p, m->theta2, s);
    const double full = -m->theta2, h = theta - m->theta2;
    dual start = sdm_dual_add(sdm_dual_add(s[0], sdm_dual_scale(full, s[1])), sdm_dual_scale(full * full / 2, s[2]));
    const dual k = sdm_dual_scale(1 / (full * full * full), sdm_dual_sub(sdm_dual_of(m->p0), start));
    r[0] = sdm_dual_add(sdm_dual_add(s[0], sdm_dual_scale(h, s[1])),
                        sdm_dual_add(sdm_dual_scale(h * h / 2, s[2]), sdm_dual_scale(h * h * h, k)));
    r[1] = sdm_dual_add(s[1], sdm_dual_add(sdm_dual_scale(h, s[2]), sdm_dual_scale(3 * h * h, k)));
    r[2] = sdm_dual_add(s[2], sdm_dual_scale(6 * h, k));
}

// z and its first two derivatives: z = c theta + alpha exp(-kappa theta) cos(theta - phi)
static void height(const cochlea_model *m, const double *p, double theta, dual z[3])
{
    dual alpha = sdm_dual_of(p[COCHLEA_ALPHA]), turned = sdm_dual_of(theta - p[COCHLEA_PHI]);
    alpha.d[COCHLEA_ALPHA] = 1;
    turned.d[COCHLEA_PHI] = -1;
    const double k = m->kappa, co = cos(turned.v), si = sin(turned.v);
    const dual wave = sdm_dual_scale(exp(-k * theta), alpha);
    const dual c = sdm_dual_apply(turned, co, -si), s = sdm_dual_apply(turned, si, co);
    z[0] = sdm_dual_add(sdm_dual_of(m->c * theta), sdm_dual_mul(wave, c));
    z[1] = sdm_dual_sub(sdm_dual_of(m->c), sdm_dual_mul(wave, sdm_dual_add(sdm_dual_scale(k, c), s)));
    z[2] = sdm_dual_mul(wave, sdm_dual_add(sdm_dual_scale(k * k - 1, c), sdm_dual_scale(2 * k, s)));
}

// curve[order][3]: position and derivatives with respect to theta
static void curve_at(const cochlea_model *m, const double *p, double theta, dual curve[3][3])
{
    dual r[3], z[3];
    if (m->cubic && theta < m->theta2)
        basal_cubic(m, p, theta, r);
    else
        spiral(p, theta, r);
    height(m, p, theta, z);
    const double c = cos(theta), s = sin(theta);
    const dual level = sdm_dual_sub(r[2], r[0]);
    curve[0][0] = sdm_dual_scale(c, r[0]);
    curve[0][1] = sdm_dual_scale(s, r[0]);
    curve[1][0] = sdm_dual_sub(sdm_dual_scale(c, r[1]), sdm_dual_scale(s, r[0]));
    curve[1][1] = sdm_dual_add(sdm_dual_scale(s, r[1]), sdm_dual_scale(c, r[0]));
    curve[2][0] = sdm_dual_sub(sdm_dual_scale(c, level), sdm_dual_scale(2 * s, r[1]));
    curve[2][1] = sdm_dual_add(sdm_dual_scale(s, level), sdm_dual_scale(2 * c, r[1]));
    for (int k = 0; k < 3; k++) curve[k][2] = z[k];
}

void sdm_cochlea_section_at(const cochlea_model *m, const double *p, double theta, cochlea_section *out)
{
    dual curve[3][3];
    curve_at(m, p, theta, curve);
    const dual *d1 = curve[1], *d2 = curve[2];
    const dual speed2 = dot(d1, d1), speed = root(speed2);
    const dual level = root(sdm_dual_add(sdm_dual_mul(d1[0], d1[0]), sdm_dual_mul(d1[1], d1[1])));
    for (int k = 0; k < 3; k++) out->centre[k] = curve[0][k], out->tangent[k] = sdm_dual_div(d1[k], speed);

    // e1 = tangent x z, normalised: a fixed rule, so that vertices are functions of the parameters here and nowhere else
    const dual *t = out->tangent, *e1 = out->e1;
    out->e1[0] = sdm_dual_div(d1[1], level);
    out->e1[1] = sdm_dual_scale(-1, sdm_dual_div(d1[0], level));
    out->e1[2] = sdm_dual_of(0);
    out->e2[0] = sdm_dual_scale(-1, sdm_dual_mul(t[2], e1[1]));
    out->e2[1] = sdm_dual_mul(t[2], e1[0]);
    out->e2[2] = sdm_dual_sub(sdm_dual_mul(t[0], e1[1]), sdm_dual_mul(t[1], e1[0]));

    // the part of the second derivative across the tangent, by arc length
    out->bend[0] = sdm_dual_div(dot(d2, out->e1), speed2);
    out->bend[1] = sdm_dual_div(dot(d2, out->e2), speed2);
}

void sdm_cochlea_centre_at(const cochlea_model *m, const double *p, double theta, double centre[3])
{
    double r = p[COCHLEA_A] * exp(-p[COCHLEA_B] * theta);
    if (m->cubic && theta < m->theta2) {
        dual basal[3];
        basal_cubic(m, p, theta, basal);
        r = basal[0].v;
    }
    centre[0] = r * cos(theta);
    centre[1] = r * sin(theta);
    centre[2] = m->c * theta + p[COCHLEA_ALPHA] * exp(-m->kappa * theta) * cos(theta - p[COCHLEA_PHI]);
}

double sdm_cochlea_radius_at(const cochlea_model *m, double theta)
{
    return m->radius - m->taper * theta + m->flare * exp(-theta / m->flare_angle);
}

double sdm_cochlea_ratio_at(const cochlea_model *m, double theta)
{
    if (!m->ellipse || theta >= TURN) return 1;
    const double u = theta / TURN;
    return m->ratio + (1 - m->ratio) * u * u * (3 - 2 * u);
}
