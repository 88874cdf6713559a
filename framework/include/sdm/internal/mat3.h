/* Operations on 3 x 3 matrices of doubles, row-major. */
#pragma once

/* out = a b; out must not overlap a or b */
static inline void m3_product(const double a[9], const double b[9], double out[9])
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            out[3 * i + k] = a[3 * i] * b[k] + a[3 * i + 1] * b[3 + k] + a[3 * i + 2] * b[6 + k];
}

/* out = m x; out must not overlap x */
static inline void m3_apply(const double m[9], const double x[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = m[3 * i] * x[0] + m[3 * i + 1] * x[1] + m[3 * i + 2] * x[2];
}

/* out = the adjugate of a, by cofactors; returns the determinant. a^-1 = out / determinant. */
static inline double m3_adjugate(const double a[9], double out[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int r = (j + 1) % 3, s = (j + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
            out[3 * i + j] = a[3 * r + c] * a[3 * s + d] - a[3 * r + d] * a[3 * s + c];
        }
    return a[0] * out[0] + a[1] * out[3] + a[2] * out[6];
}

/* out = a^-1, all zero if a is singular; returns the determinant of a */
static inline double m3_inverse(const double a[9], double out[9])
{
    const double det = m3_adjugate(a, out);
    for (int i = 0; i < 9; i++) out[i] = det != 0 ? out[i] / det : 0;
    return det;
}
