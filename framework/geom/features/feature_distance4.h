/* Squared distances in double from four points to four features at once. */
#pragma once

#include "feature_distance.h"
#include "simd/lanes.h"

/* ax bx + ay by + az bz */
static inline v4d dot4(v4d ax, v4d bx, v4d ay, v4d by, v4d az, v4d bz)
{
    return v4_add(v4_add(v4_mul(ax, bx), v4_mul(ay, by)), v4_mul(az, bz));
}

/* Squared distances of four points, each from its own feature x[number[i]]. The operations and
   their order are those of sdm_feature_distance2(), hence the same bits. */
static inline v4d distances4(const sdm_feature *x, const uint32_t number[4], v4d px, v4d py, v4d pz)
{
    v4d a[4], u[4];
    for (int i = 0; i < 4; i++) {
        a[i] = v4_load(x[number[i]].a);
        u[i] = v4_load(&x[number[i]].u[1]);
    }
    // after this the rows of a are ax ay az ux, those of u are uy uz length face
    v4_transpose(a);
    v4_transpose(u);
    const v4d wx = v4_sub(px, a[0]), wy = v4_sub(py, a[1]), wz = v4_sub(pz, a[2]);
    const v4d s = dot4(wx, a[3], wy, u[0], wz, u[1]);
    const v4d rx = v4_sub(wx, v4_mul(s, a[3])), ry = v4_sub(wy, v4_mul(s, u[0])),
              rz = v4_sub(wz, v4_mul(s, u[1]));
    return v4_if_negative(u[3], v4_mul(s, s), dot4(rx, rx, ry, ry, rz, rz));
}

/* Distances of four points from one feature, with the bits of the roots of distances4(): for a face
   the root of s * s, rounded, is abs(s). */
static inline v4d distances4_from(const sdm_feature *x, v4d px, v4d py, v4d pz)
{
    const v4d wx = v4_sub(px, v4_all(x->a[0])), wy = v4_sub(py, v4_all(x->a[1])),
              wz = v4_sub(pz, v4_all(x->a[2]));
    const v4d ux = v4_all(x->u[0]), uy = v4_all(x->u[1]), uz = v4_all(x->u[2]);
    const v4d s = dot4(wx, ux, wy, uy, wz, uz);
    if (x->face < 0) return v4_abs(s);
    const v4d rx = v4_sub(wx, v4_mul(s, ux)), ry = v4_sub(wy, v4_mul(s, uy)),
              rz = v4_sub(wz, v4_mul(s, uz));
    return v4_sqrt(dot4(rx, rx, ry, ry, rz, rz));
}
