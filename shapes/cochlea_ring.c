/* Rings of vertices of the cochlea, cut off where neighbouring sections would overlap. */
#include "cochlea_ring.h"

// The cut is smooth (C2) and takes this fraction of the distance to the centre of curvature.
#define CUT_WIDTH 0.16

void sdm_cochlea_cut(const dual bend[2], dual *x, dual *y)
{
    // position along the curvature vector; 1: at the centre of curvature
    const dual u = sdm_dual_add(sdm_dual_mul(*x, bend[0]), sdm_dual_mul(*y, bend[1]));
    const double w = (u.v - COCHLEA_CUT_FROM) / CUT_WIDTH, end = COCHLEA_CUT_FROM + CUT_WIDTH / 2;
    const dual kept =
        w < 1 ? sdm_dual_apply(u, COCHLEA_CUT_FROM + CUT_WIDTH * w * (1 + w * w * (0.5 * w - 1)),
                               1 - w * w * (3 - 2 * w))
              : sdm_dual_of(end);
    const dual bend2 = sdm_dual_add(sdm_dual_mul(bend[0], bend[0]), sdm_dual_mul(bend[1], bend[1]));
    const dual back = sdm_dual_div(sdm_dual_sub(u, kept), bend2);
    *x = sdm_dual_sub(*x, sdm_dual_mul(back, bend[0]));
    *y = sdm_dual_sub(*y, sdm_dual_mul(back, bend[1]));
}

static void vertex_cut_at(const cochlea_section *s, const dual middle[3], dual x, dual y,
                          dual at[3])
{
    sdm_cochlea_cut(s->bend, &x, &y);
    for (int k = 0; k < 3; k++)
        at[k] = sdm_dual_add(middle[k],
                             sdm_dual_add(sdm_dual_mul(x, s->e1[k]), sdm_dual_mul(y, s->e2[k])));
}

void sdm_cochlea_ring_at(const cochlea_model *m, const double *x, const cochlea_ring *r,
                         size_t n_sectors, const double *direction, bool left, size_t first,
                         cochlea_put *put, void *user)
{
    cochlea_section s;
    sdm_cochlea_section_at(m, x, r->fraction, &s);
    // vertex = middle + cosine * wide + sine * high, if it is not cut off
    dual middle[3], wide[3], high[3], at[3];
    for (int k = 0; k < 3; k++) {
        middle[k] =
            sdm_dual_add(s.centre[k], sdm_dual_scale(r->ahead, sdm_dual_mul(s.wide, s.tangent[k])));
        wide[k] = sdm_dual_scale(r->shrink, sdm_dual_mul(s.wide, s.e1[k]));
        high[k] = sdm_dual_scale(r->shrink, sdm_dual_mul(s.high, s.e2[k]));
    }
    for (size_t j = 0; j < n_sectors; j++) {
        const double co = direction[2 * j], si = direction[2 * j + 1];
        if (!r->whole &&
            co * s.wide.v * s.bend[0].v + si * s.high.v * s.bend[1].v > COCHLEA_CUT_FROM)
            vertex_cut_at(&s, middle, sdm_dual_scale(co, s.wide), sdm_dual_scale(si, s.high), at);
        else
            for (int k = 0; k < 3; k++)
                at[k] = sdm_dual_add(middle[k], sdm_dual_add(sdm_dual_scale(co, wide[k]),
                                                             sdm_dual_scale(si, high[k])));
        if (left) at[1] = sdm_dual_scale(-1, at[1]);
        put(user, first + j, at);
    }
}
