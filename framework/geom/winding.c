/* Generalised winding numbers: exact solid angles near, dipoles of tree nodes far away. */
#include "winding.h"

#include <math.h>

#include "sdm/memory.h"
#include "vec3.h"

#define FAR 3.0       // a node farther than this many radii is a dipole
#define DOUBTFUL 0.05 // distance from 1/2 below which the dipoles are not trusted; their error stays under 0.02

static const double pi = 3.14159265358979323846;

/* Solid angle of a triangle seen from x (Van Oosterom and Strackee 1983), over 4 pi. */
static double share_of_sphere(const sdm_mesh *m, uint32_t t, const double x[3])
{
    double r[3][3], len[3], cross[3];
    for (int k = 0; k < 3; k++) {
        v3_sub(&m->vert[3 * (size_t)m->tri[3 * (size_t)t + (size_t)k]], x, r[k]);
        len[k] = v3_norm(r[k]);
    }
    v3_cross(r[1], r[2], cross);
    const double det = v3_dot(r[0], cross);
    const double den = len[0] * len[1] * len[2] + v3_dot(r[0], r[1]) * len[2] + v3_dot(r[1], r[2]) * len[0] +
                       v3_dot(r[2], r[0]) * len[1];
    return det == 0 && den <= 0 ? 0 : atan2(det, den) / (2 * pi);
}

static void area_vector(const sdm_mesh *m, uint32_t t, double n[3], double middle[3])
{
    double ab[3], ac[3];
    const uint32_t *v = &m->tri[3 * (size_t)t];
    const double *a = &m->vert[3 * (size_t)v[0]], *b = &m->vert[3 * (size_t)v[1]], *c = &m->vert[3 * (size_t)v[2]];
    v3_sub(b, a, ab);
    v3_sub(c, a, ac);
    v3_cross(ab, ac, n);
    for (int i = 0; i < 3; i++) {
        n[i] *= 0.5;
        middle[i] = (a[i] + b[i] + c[i]) / 3;
    }
}

/* Sums over the triangles of a node: area, area * middle, area vectors. */
static void add_up(sdm_winding *w, uint32_t index, double sum[7])
{
    const sdm_bvh_node *n = &w->tree->node[index];
    for (int i = 0; i < 7; i++) sum[i] = 0;
    if (n->count) {
        for (uint32_t i = n->first; i < n->first + n->count; i++) {
            double normal[3], middle[3];
            area_vector(w->mesh, w->tree->order[i], normal, middle);
            const double area = v3_norm(normal);
            sum[0] += area;
            for (int k = 0; k < 3; k++) {
                sum[1 + k] += area * middle[k];
                sum[4 + k] += normal[k];
            }
        }
    } else {
        double part[7];
        for (uint32_t c = n->first; c < n->first + 2; c++) {
            add_up(w, c, part);
            for (int i = 0; i < 7; i++) sum[i] += part[i];
        }
    }
    sdm_dipole *d = &w->dipole[index];
    double far2 = 0;
    for (int i = 0; i < 3; i++) {
        d->middle[i] = sum[0] > 0 ? sum[1 + i] / sum[0] : 0.5 * (n->lo[i] + n->hi[i]);
        d->moment[i] = sum[4 + i];
        const double reach = fmax(d->middle[i] - n->lo[i], n->hi[i] - d->middle[i]);
        far2 += reach * reach;
    }
    d->radius = sqrt(far2);
}

sdm_status sdm_winding_build(const sdm_mesh *m, const sdm_bvh *tree, sdm_winding *w, sdm_error *err)
{
    w->mesh = m;
    w->tree = tree;
    const sdm_status s = SDM_ALLOC(&w->dipole, tree->n_node, "dipoles", err);
    if (s) return s;
    double sum[7];
    add_up(w, 0, sum);
    return SDM_OK;
}

void sdm_winding_dispose(sdm_winding *w)
{
    sdm_free(w->dipole);
    *w = (sdm_winding){0};
}

double sdm_winding_number(const sdm_winding *w, const double x[3], bool exact)
{
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0;
    double sum = 0;
    stack[top++] = 0;
    while (top) {
        const uint32_t index = stack[--top];
        const sdm_bvh_node *n = &w->tree->node[index];
        const sdm_dipole *d = &w->dipole[index];
        double r[3];
        v3_sub(d->middle, x, r);
        const double dist = v3_norm(r);
        if (!exact && dist > FAR * d->radius) {
            sum += v3_dot(r, d->moment) / (4 * pi * dist * dist * dist);
        } else if (n->count) {
            for (uint32_t i = n->first; i < n->first + n->count; i++)
                sum += share_of_sphere(w->mesh, w->tree->order[i], x);
        } else {
            stack[top++] = n->first;
            stack[top++] = n->first + 1;
        }
    }
    return sum;
}

bool sdm_winding_inside(const sdm_winding *w, const double x[3])
{
    const double guess = sdm_winding_number(w, x, false);
    if (fabs(guess - 0.5) > DOUBTFUL) return guess > 0.5;
    return sdm_winding_number(w, x, true) > 0.5;
}
