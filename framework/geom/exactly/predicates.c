/* Exact predicate: on which side of a line a point lies. */
#include "predicates.h"

#include <float.h>
#include <math.h>

#include "expansion.h"

/* Sign of (v - u) x (p - u), expanded into six products and summed exactly. */
static int side_exact(const double u[2], const double v[2], const double p[2])
{
    const double factor[6][2] = {{v[0], p[1]},  {-v[0], u[1]}, {-u[0], p[1]},
                                 {-v[1], p[0]}, {v[1], u[0]},  {u[1], p[0]}};
    double e[12];
    int n = 0;
    for (int i = 0; i < 6; i++) n = sdm_expansion_add_product(e, n, factor[i][0], factor[i][1]);
    return sdm_expansion_sign(e, n);
}

int sdm_side(const double u[2], const double v[2], const double p[2], double *area)
{
    const double left = (v[0] - u[0]) * (p[1] - u[1]);
    const double right = (v[1] - u[1]) * (p[0] - u[0]);
    const double det = left - right;
    if (area) *area = det;
    if (fabs(det) > 4 * DBL_EPSILON * (fabs(left) + fabs(right))) return det > 0 ? 1 : -1;
    if (u[0] == v[0] && u[1] == v[1]) return 0;
    const int sign = side_exact(u, v, p);
    if (sign) return sign;
    // p is on the line: the move by (e, e^2) changes the determinant by
    // -(v[1] - u[1]) e + (v[0] - u[0]) e^2, and the first term that is not 0 decides
    if (v[1] != u[1]) return v[1] < u[1] ? 1 : -1;
    return v[0] < u[0] ? -1 : 1;
}
