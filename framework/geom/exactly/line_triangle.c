/* Line-triangle intersection: floating point with an error bound, and exact arithmetic when the
 * result is within that bound. */
#include "line_triangle.h"

#include <float.h>
#include <math.h>

#include "expansion.h"
#include "predicates.h"

int sdm_line_meets(const double v[3][3], const double p[2], double area[3])
{
    const int sa = sdm_side(&v[1][1], &v[2][1], p, &area[0]);
    const int sb = sdm_side(&v[2][1], &v[0][1], p, &area[1]);
    if (sa != sb) return 0;
    const int sc = sdm_side(&v[0][1], &v[1][1], p, &area[2]);
    return sa == sc ? sa : 0;
}

/* Exact sign of the sum over the three corners of area * (v[i][0] - p[0]), with area as in
 * sdm_line_meets(). */
static int after_exact(const double v[3][3], const double p[3])
{
    double sum[160];
    int n = 0;
    for (int i = 0; i < 3; i++) {
        const double *a = v[(i + 1) % 3], *b = v[(i + 2) % 3];
        double area[12];
        int m = 0;
        m = sdm_expansion_add_product(area, m, b[1], p[2]);
        m = sdm_expansion_add_product(area, m, -b[1], a[2]);
        m = sdm_expansion_add_product(area, m, -a[1], p[2]);
        m = sdm_expansion_add_product(area, m, -b[2], p[1]);
        m = sdm_expansion_add_product(area, m, b[2], a[1]);
        m = sdm_expansion_add_product(area, m, a[2], p[1]);
        for (int k = 0; k < m; k++) {
            n = sdm_expansion_add_product(sum, n, area[k], v[i][0]);
            n = sdm_expansion_add_product(sum, n, area[k], -p[0]);
        }
    }
    return sdm_expansion_sign(sum, n);
}

int sdm_line_meets_after(const double v[3][3], const double p[3], int orientation,
                         const double area[3])
{
    double sum = 0, dx = 0, dy = 0, dz = 0;
    for (int i = 0; i < 3; i++) {
        const double x = v[i][0] - p[0], y = fabs(v[i][1] - p[1]), z = fabs(v[i][2] - p[2]);
        sum += area[i] * x;
        dx += fabs(x);
        if (y > dy) dy = y;
        if (z > dz) dz = z;
    }
    // abs(error of an area) <= 16 epsilon dy dz, and abs(area) <= 4 dy dz
    if (fabs(sum) > 32 * DBL_EPSILON * dy * dz * dx) return (sum > 0) == (orientation > 0) ? 1 : -1;
    return after_exact(v, p) * orientation;
}
