/* Generalised winding numbers of points: if the boundary is short, by the crossings of one ray and
 * the strips of the boundary (boundary.h); otherwise by far-field expansions of the nodes of a tree
 * of triangles. */
#include "winding.h"

#include <math.h>

#include "mesh/crossings.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

// up to this number of boundary edges the strips are faster than the tree of far fields
#define SHORT_BOUNDARY 100

static const double pi = 3.14159265358979323846;

/* Solid angle of triangle t seen from x over 4 pi (Van Oosterom and Strackee 1983). */
static double triangle_winding(const sdm_mesh *m, uint32_t t, const double x[3])
{
    double r[3][3], len[3], cross[3];
    for (int k = 0; k < 3; k++) {
        v3_sub(&m->vert[3 * (size_t)m->tri[3 * (size_t)t + (size_t)k]], x, r[k]);
        len[k] = v3_norm(r[k]);
    }
    v3_cross(r[1], r[2], cross);
    const double det = v3_dot(r[0], cross);
    const double den = len[0] * len[1] * len[2] + v3_dot(r[0], r[1]) * len[2] +
                       v3_dot(r[1], r[2]) * len[0] + v3_dot(r[2], r[0]) * len[1];
    return det == 0 && den <= 0 ? 0 : atan2(det, den) / (2 * pi);
}

/* Adds a part (a triangle or a child node), given by its centroid, normal, area and spread, to the
 * far field c, whose own centroid is already set. */
static void far_field_add(sdm_far_field *c, const double centroid[3], const double normal[3],
                          double area, double spread)
{
    double r[3];
    v3_sub(centroid, c->centroid, r);
    c->spread += spread + area * v3_dot(r, r);
    for (int i = 0; i < 3; i++) {
        c->normal[i] += normal[i];
        c->second[i] += normal[i] * r[i];
        c->second[3 + i] += 0.5 * (normal[i] * r[(i + 1) % 3] + normal[(i + 1) % 3] * r[i]);
    }
}

static void triangle_moments(const sdm_mesh *m, uint32_t t, double centroid[3], double normal[3],
                             double *area, double *spread)
{
    double ab[3], ac[3];
    const double *v[3];
    for (size_t k = 0; k < 3; k++) v[k] = &m->vert[3 * (size_t)m->tri[3 * (size_t)t + k]];
    v3_sub(v[1], v[0], ab);
    v3_sub(v[2], v[0], ac);
    v3_cross(ab, ac, normal);
    for (int i = 0; i < 3; i++) {
        normal[i] *= 0.5;
        centroid[i] = v[0][i] + (ab[i] + ac[i]) / 3;
    }
    *area = v3_norm(normal);
    *spread = *area / 12 *
              (v3_dist2(v[0], centroid) + v3_dist2(v[1], centroid) + v3_dist2(v[2], centroid));
}

static void far_field_build(sdm_winding *w, uint32_t index)
{
    const sdm_bvh_node *n = &w->tree->node[index];
    sdm_far_field *c = &w->far_field[index];
    const uint32_t count = n->count ? n->count : 2;
    double centroid[3], normal[3], area, spread, sum[3] = {0, 0, 0};
    for (uint32_t i = n->first; i < n->first + count; i++) {
        if (n->count) {
            triangle_moments(w->mesh, w->tree->order[i], centroid, normal, &area, &spread);
        } else {
            far_field_build(w, i);
            for (int a = 0; a < 3; a++) centroid[a] = w->far_field[i].centroid[a];
            area = w->far_field[i].area;
        }
        c->area += area;
        for (int a = 0; a < 3; a++) sum[a] += area * centroid[a];
    }
    // centroid and bounding sphere
    double far2 = 0;
    for (int a = 0; a < 3; a++) {
        c->centroid[a] = c->area > 0 ? sum[a] / c->area : 0.5 * (n->lo[a] + n->hi[a]);
        const double reach = fmax(c->centroid[a] - n->lo[a], n->hi[a] - c->centroid[a]);
        far2 += reach * reach;
    }
    c->radius = sqrt(far2);
    for (uint32_t i = n->first; i < n->first + count; i++) {
        const sdm_far_field *part = n->count ? NULL : &w->far_field[i];
        if (part) {
            far_field_add(c, part->centroid, part->normal, part->area, part->spread);
            for (int k = 0; k < 6; k++) c->second[k] += part->second[k];
        } else {
            triangle_moments(w->mesh, w->tree->order[i], centroid, normal, &area, &spread);
            // the moment of a triangle about its own centroid is zero: nothing to add to c->second
            far_field_add(c, centroid, normal, area, spread);
        }
    }
}

sdm_status sdm_winding_build(const sdm_mesh *m, const sdm_bvh *tree, const sdm_topology *topo,
                             sdm_winding *w, sdm_error *err)
{
    w->mesh = m;
    w->tree = tree;
    sdm_status s = sdm_boundary_build(m, topo, &w->boundary, err);
    if (s || w->boundary.n <= SHORT_BOUNDARY) return s;
    s = SDM_ALLOC(&w->far_field, tree->n_node, "far fields of triangles", err);
    if (!s) far_field_build(w, 0);
    return s;
}

void sdm_winding_dispose(sdm_winding *w)
{
    sdm_boundary_dispose(&w->boundary);
    sdm_free(w->far_field);
    *w = (sdm_winding){0};
}

double sdm_winding_sum(const sdm_winding *w, const double x[3])
{
    double sum = 0;
    for (size_t t = 0; t < w->mesh->n_tri; t++) sum += triangle_winding(w->mesh, (uint32_t)t, x);
    return sum;
}

double sdm_winding_number(const sdm_winding *w, const double x[3])
{
    if (w->boundary.n >= w->mesh->n_tri / 2) return sdm_winding_sum(w, x);
    const sdm_strips strips = {&w->boundary, w->mesh->vert, {-1, 0, 0}, {{0, 1, 0}, {0, 0, 1}}, 1};
    return sdm_ray_winding(w->mesh, w->tree, x, 0, 1, NULL, 0) +
           sdm_strips_evaluate(&strips, x, &x[1], 0).winding;
}

/* Far-field winding number of a node at a point; r: vector from the point to the node's centroid.
 * Taylor expansion up to second order. */
static double far_field_winding(const sdm_far_field *c, const double r[3], double distance)
{
    const double *m = c->second, d3 = distance * distance * distance;
    const double trace = m[0] + m[1] + m[2];
    const double square = m[0] * r[0] * r[0] + m[1] * r[1] * r[1] + m[2] * r[2] * r[2] +
                          2 * (m[3] * r[0] * r[1] + m[4] * r[1] * r[2] + m[5] * r[2] * r[0]);
    return (v3_dot(r, c->normal) + trace - 3 * square / (distance * distance)) / (4 * pi * d3);
}

/* Winding number by a walk through the tree; a node is replaced by its far field if the error of
 * this is at most `tolerance`. *error = bound on the total error. */
static double winding_estimate(const sdm_winding *w, const double x[3], double tolerance,
                               double *error)
{
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0;
    double sum = 0;
    *error = 0;
    stack[top++] = 0;
    while (top) {
        const uint32_t index = stack[--top];
        const sdm_bvh_node *n = &w->tree->node[index];
        const sdm_far_field *c = &w->far_field[index];
        double r[3];
        v3_sub(c->centroid, x, r);
        const double distance = v3_norm(r), gap = distance - c->radius;
        // Taylor remainder: the third derivatives of 1 / r are at most 6 / r^4
        const double bound = 3 * c->spread / (4 * pi * gap * gap * gap * gap);
        if (gap > 0 && bound <= tolerance) {
            sum += far_field_winding(c, r, distance);
            *error += bound;
        } else if (n->count) {
            for (uint32_t i = n->first; i < n->first + n->count; i++)
                sum += triangle_winding(w->mesh, w->tree->order[i], x);
        } else {
            stack[top++] = n->first;
            stack[top++] = n->first + 1;
        }
    }
    return sum;
}

bool sdm_winding_inside(const sdm_winding *w, const double x[3])
{
    double error;
    for (double tolerance = 2e-3; w->far_field && tolerance > 1e-7; tolerance *= 1e-2) {
        const double guess = winding_estimate(w, x, tolerance, &error);
        if (fabs(guess - 0.5) > error + 1e-9) return guess > 0.5;
    }
    return sdm_winding_number(w, x) > 0.5;
}
