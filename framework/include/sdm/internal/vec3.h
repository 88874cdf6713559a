/* Operations on three-dimensional vectors of doubles. */
#pragma once

#include <math.h>

/* r = a - b */
static inline void v3_sub(const double a[3], const double b[3], double r[3])
{
    for (int i = 0; i < 3; i++) r[i] = a[i] - b[i];
}

/* a . b */
static inline double v3_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* r = a x b; r must not overlap a or b */
static inline void v3_cross(const double a[3], const double b[3], double r[3])
{
    r[0] = a[1] * b[2] - a[2] * b[1];
    r[1] = a[2] * b[0] - a[0] * b[2];
    r[2] = a[0] * b[1] - a[1] * b[0];
}

/* r = (b - a) x (c - a): normal of the triangle a, b, c, twice as long as its area */
static inline void v3_triangle_normal(const double a[3], const double b[3], const double c[3],
                                      double r[3])
{
    double u[3], v[3];
    v3_sub(b, a, u);
    v3_sub(c, a, v);
    v3_cross(u, v, r);
}

/* length of a */
static inline double v3_norm(const double a[3]) { return sqrt(v3_dot(a, a)); }

/* squared distance of the points a and b */
static inline double v3_dist2(const double a[3], const double b[3])
{
    double d[3];
    v3_sub(a, b, d);
    return v3_dot(d, d);
}

/* r = a + t * d */
static inline void v3_along(const double a[3], double t, const double d[3], double r[3])
{
    for (int i = 0; i < 3; i++) r[i] = a[i] + t * d[i];
}

/* v = some unit vector perpendicular to the unit vector u */
static inline void v3_perpendicular(const double u[3], double v[3])
{
    int least = 0;
    for (int i = 1; i < 3; i++)
        if (fabs(u[i]) < fabs(u[least])) least = i;
    double axis[3] = {0, 0, 0};
    axis[least] = 1;
    v3_cross(u, axis, v);
    const double len = v3_norm(v);
    for (int i = 0; i < 3; i++) v[i] /= len;
}
