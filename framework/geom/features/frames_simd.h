/* Builds the frames (sdm_frame: local coordinates) of four triangles at once, one per SIMD lane.
   The operations and their order are those of sdm_frame_build() in mesh/point_triangle.c, hence the
   same bits. */
#pragma once

#include "mesh/point_triangle.h"
#include "sdm/internal/vec3.h"
#include "simd/lanes_four.h"

/* Four frames, one per lane. The members have the same order as in sdm_frame, because both structs
   are also accessed as arrays of doubles. */
typedef struct sdm_frame4 {
    d4 a[3], u[3], v[3], n[3], half[3];
    d4 e1x, e1y, kt1, kh1;
    d4 e2x, e2y, kt2, rotation, flat;
} sdm_frame4;

/* Sets (ex, ey) to the unit vector along (dx, dy), or to (-1, 0) where (dx, dy) is 0; returns the
   length of (dx, dy). */
SDM_INLINE d4 direction4(d4 dx, d4 dy, d4 *ex, d4 *ey)
{
    const d4 len = d4_sqrt(dx * dx + dy * dy);
    *ex = d4_select(len > 0.0, dx / len, d4_all(-1));
    *ey = d4_select(len > 0.0, dy / len, d4_all(0));
    return len;
}

SDM_INLINE void subtract4(const d4 a[3], const d4 b[3], d4 r[3])
{
    for (int i = 0; i < 3; i++) r[i] = a[i] - b[i];
}

/* In the lanes of triangles without area: v = any unit vector perpendicular to u. */
static void frame4_set_flat(d4_mask flat, sdm_frame4 *f)
{
    for (int lane = 0; lane < 4; lane++) {
        if (!flat[lane]) continue;
        double v[3];
        v3_perpendicular((const double[3]){f->u[0][lane], f->u[1][lane], f->u[2][lane]}, v);
        for (int i = 0; i < 3; i++) f->v[i][lane] = v[i];
    }
}

/* Builds the frames f of four triangles with the vertices corner[corner][coordinate]. */
SDM_INLINE void sdm_frames_build(const d4 corner[3][3], sdm_frame4 *f)
{
    // rotate the corners so that the longest edge comes first: a is its start
    d4 ab[3], bc[3], ca[3], ac[3], w[3];
    subtract4(corner[0], corner[1], ab);
    subtract4(corner[1], corner[2], bc);
    subtract4(corner[2], corner[0], ca);
    const d4 l0 = d4_dot(ab, ab), l1 = d4_dot(bc, bc), l2 = d4_dot(ca, ca);
    const d4_mask stays = (l0 >= l1) & (l0 >= l2), once = ~stays & (l1 >= l2);
    f->rotation = d4_select(stays, d4_all(0), d4_select(once, d4_all(1), d4_all(2)));
    for (int i = 0; i < 3; i++) {
        const d4 a = corner[0][i], b = corner[1][i], c = corner[2][i];
        f->a[i] = d4_select(stays, a, d4_select(once, b, c));
        ab[i] = d4_select(stays, b, d4_select(once, c, a)) - f->a[i];
        ac[i] = d4_select(stays, c, d4_select(once, a, b)) - f->a[i];
    }
    const d4 length = d4_sqrt(d4_dot(ab, ab));
    for (int i = 0; i < 3; i++) f->u[i] = d4_select(length > 0.0, ab[i] / length, d4_all(i == 0));

    // v: ac orthogonalised against u, twice, so that it is orthogonal for needles as well
    d4 cx = d4_all(0);
    for (int i = 0; i < 3; i++) w[i] = ac[i];
    for (int pass = 0; pass < 2; pass++) {
        const d4 along = d4_dot(w, f->u);
        cx += along;
        for (int i = 0; i < 3; i++) w[i] += -along * f->u[i];
    }
    const d4 cy = d4_sqrt(d4_dot(w, w));
    // if the remainder of ac is below 2^-52 of the longest edge, it is only rounding error: the
    // triangle has no plane
    const d4_mask flat = ~(cy > 2.3e-16 * length);
    for (int i = 0; i < 3; i++) f->v[i] = w[i] / cy;
    const d4 along = d4_dot(f->v, f->u);
    for (int i = 0; i < 3; i++) f->v[i] += -along * f->u[i];
    const d4 across = d4_sqrt(d4_dot(f->v, f->v));
    for (int i = 0; i < 3; i++) f->v[i] /= across;
    if (d4_any(flat)) frame4_set_flat(flat, f);
    for (int i = 0; i < 3; i++)
        f->n[i] = f->u[(i + 1) % 3] * f->v[(i + 2) % 3] - f->u[(i + 2) % 3] * f->v[(i + 1) % 3];

    // the third corner is (x, y) in the frame; edge 1 runs from (length, 0) to (x, y), edge 2 on to
    // (0, 0)
    const d4 y = d4_select(flat, d4_all(0), d4_dot(ac, f->v));
    const d4 x = d4_select(flat, d4_dot(ac, f->u), cx);
    const d4 len1 = direction4(x - length, y, &f->e1x, &f->e1y);
    const d4 len2 = direction4(-x, -y, &f->e2x, &f->e2y);
    f->half[0] = 0.5 * length;
    f->half[1] = 0.5 * len1;
    f->half[2] = 0.5 * len2;
    f->kt1 = f->e1x * 0.5 * (length + x) + f->e1y * 0.5 * y;
    f->kh1 = f->e1y * length;
    f->kt2 = f->e2x * 0.5 * x + f->e2y * 0.5 * y;
    f->flat = d4_select(flat, d4_all(1), d4_all(0));
}
