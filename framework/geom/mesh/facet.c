/* Normals and heights of triangles. */
#include "facet.h"

#include <string.h>

#include "sdm/internal/vec3.h"

/* A triangle with height / longest edge below this is a needle: the cross product of its edges has
 * lost half of the digits of its height. */
#define NEEDLE 1e-7
/* Squared lengths between these can be squared again without overflow or underflow. */
#define SQUARE_MIN 1e-140
#define SQUARE_MAX 1e140

void sdm_facet_frame(const sdm_mesh *m, size_t t, sdm_frame *f)
{
    const uint32_t *v = &m->tri[3 * t];
    sdm_frame_build(&m->vert[3 * (size_t)v[0]], &m->vert[3 * (size_t)v[1]],
                    &m->vert[3 * (size_t)v[2]], f);
}

void sdm_facet_centre(const sdm_mesh *m, size_t t, double x[3])
{
    const uint32_t *v = &m->tri[3 * t];
    for (size_t i = 0; i < 3; i++)
        x[i] = (m->vert[3 * (size_t)v[0] + i] + m->vert[3 * (size_t)v[1] + i] +
                m->vert[3 * (size_t)v[2] + i]) /
               3;
}

void sdm_facets_build(const sdm_mesh *m, const double apex[3], sdm_facet *facet, double *area,
                      double *volume)
{
    *area = *volume = 0;
    for (size_t t = 0; t < m->n_tri; t++) {
        const uint32_t *v = &m->tri[3 * t];
        const double *a = &m->vert[3 * (size_t)v[0]], *b = &m->vert[3 * (size_t)v[1]],
                     *c = &m->vert[3 * (size_t)v[2]];
        double ab[3], ac[3], bc[3], from[3], n[3];
        v3_sub(b, a, ab);
        v3_sub(c, a, ac);
        v3_sub(c, b, bc);
        v3_sub(a, apex, from);
        v3_cross(ab, ac, n);
        const double lab = v3_dot(ab, ab), lac = v3_dot(ac, ac), lbc = v3_dot(bc, bc);
        const double larger = lab > lac ? lab : lac;
        const double square = larger > lbc ? larger : lbc, longest = sqrt(square),
                     norm = v3_norm(n);
        *volume += v3_dot(from, n) / 6;
        *area += 0.5 * norm;
        // normal and height from the cross product where it is accurate, else from the frame
        sdm_facet *f = &facet[t];
        f->longest = longest;
        if (norm > NEEDLE * square && square > SQUARE_MIN && square < SQUARE_MAX) {
            const double one = 1 / norm;
            for (int i = 0; i < 3; i++) f->n[i] = n[i] * one;
            f->height = norm / longest;
        } else {
            sdm_frame frame;
            sdm_facet_frame(m, t, &frame);
            memcpy(f->n, frame.n, sizeof f->n);
            f->height = sdm_frame_height(&frame);
        }
    }
}
