/* Exact predicates: which side of a line a point lies on. */
#include "predicates.h"

#include <float.h>
#include <math.h>
#include <stddef.h>

/* Adds b to the expansion e[n] (components do not overlap, smallest first); returns the new length. */
static int grow(double *e, int n, double b)
{
    double q = b;
    int m = 0;
    for (int i = 0; i < n; i++) {
        const double sum = q + e[i];
        const double part = sum - q;
        const double rest = (q - (sum - part)) + (e[i] - part);
        q = sum;
        if (rest != 0) e[m++] = rest;
    }
    if (q != 0) e[m++] = q;
    return m;
}

static int exact_sign(const double u[2], const double v[2], const double p[2])
{
    const double factor[6][2] = {{v[0], p[1]}, {-v[0], u[1]}, {-u[0], p[1]}, {-v[1], p[0]}, {v[1], u[0]}, {u[1], p[0]}};
    double e[12];
    int n = 0;
    for (int i = 0; i < 6; i++) {
        const double high = factor[i][0] * factor[i][1];
        const double low = fma(factor[i][0], factor[i][1], -high);
        n = grow(e, n, low);
        n = grow(e, n, high);
    }
    return n == 0 ? 0 : e[n - 1] > 0 ? 1 : -1;
}

int sdm_side(const double u[2], const double v[2], const double p[2], double *area)
{
    const double left = (v[0] - u[0]) * (p[1] - u[1]);
    const double right = (v[1] - u[1]) * (p[0] - u[0]);
    const double det = left - right;
    if (area) *area = det;
    if (fabs(det) > 4 * DBL_EPSILON * (fabs(left) + fabs(right))) return det > 0 ? 1 : -1;
    const int sign = exact_sign(u, v, p);
    if (sign) return sign;
    // on the line: moving p by (e, e^2) changes the determinant by -(vy - uy) e + (vx - ux) e^2
    if (v[1] != u[1]) return v[1] < u[1] ? 1 : -1;
    return v[0] < u[0] ? -1 : 1;
}
