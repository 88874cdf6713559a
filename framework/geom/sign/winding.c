/* Generalised winding numbers of points: boundary and one ray where the boundary is short, else
 * clusters of triangles. */
#include "winding.h"

#include <math.h>

#include "mesh/crossings.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

#define SHORT 100 // boundary edges that cost less than the clusters

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
    const double den = len[0] * len[1] * len[2] + v3_dot(r[0], r[1]) * len[2] +
                       v3_dot(r[1], r[2]) * len[0] + v3_dot(r[2], r[0]) * len[1];
    return det == 0 && den <= 0 ? 0 : atan2(det, den) / (2 * pi);
}

/* Adds a part of the given area to a cluster whose middle is known. */
static void add_part(sdm_cluster *c, const double middle[3], const double normal[3], double area,
                     double spread)
{
    double r[3];
    v3_sub(middle, c->middle, r);
    c->spread += spread + area * v3_dot(r, r);
    for (int i = 0; i < 3; i++) {
        c->normal[i] += normal[i];
        c->second[i] += normal[i] * r[i];
        c->second[3 + i] += 0.5 * (normal[i] * r[(i + 1) % 3] + normal[(i + 1) % 3] * r[i]);
    }
}

static void triangle_part(const sdm_mesh *m, uint32_t t, double middle[3], double normal[3],
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
        middle[i] = v[0][i] + (ab[i] + ac[i]) / 3;
    }
    *area = v3_norm(normal);
    *spread =
        *area / 12 * (v3_dist2(v[0], middle) + v3_dist2(v[1], middle) + v3_dist2(v[2], middle));
}

static void build_cluster(sdm_winding *w, uint32_t index)
{
    const sdm_bvh_node *n = &w->tree->node[index];
    sdm_cluster *c = &w->cluster[index];
    const uint32_t count = n->count ? n->count : 2;
    double middle[3], normal[3], area, spread, sum[3] = {0, 0, 0};
    for (uint32_t i = n->first; i < n->first + count; i++) {
        if (n->count) {
            triangle_part(w->mesh, w->tree->order[i], middle, normal, &area, &spread);
        } else {
            build_cluster(w, i);
            for (int a = 0; a < 3; a++) middle[a] = w->cluster[i].middle[a];
            area = w->cluster[i].area;
        }
        c->area += area;
        for (int a = 0; a < 3; a++) sum[a] += area * middle[a];
    }
    double far2 = 0;
    for (int a = 0; a < 3; a++) {
        c->middle[a] = c->area > 0 ? sum[a] / c->area : 0.5 * (n->lo[a] + n->hi[a]);
        const double reach = fmax(c->middle[a] - n->lo[a], n->hi[a] - c->middle[a]);
        far2 += reach * reach;
    }
    c->radius = sqrt(far2);
    for (uint32_t i = n->first; i < n->first + count; i++) {
        const sdm_cluster *part = n->count ? NULL : &w->cluster[i];
        if (part) {
            add_part(c, part->middle, part->normal, part->area, part->spread);
            for (int k = 0; k < 6; k++) c->second[k] += part->second[k];
        } else {
            triangle_part(w->mesh, w->tree->order[i], middle, normal, &area, &spread);
            add_part(c, middle, normal, area,
                     spread); // a triangle has no second moment with its own normal
        }
    }
}

sdm_status sdm_winding_build(const sdm_mesh *m, const sdm_bvh *tree, const sdm_topology *topo,
                             sdm_winding *w, sdm_error *err)
{
    w->mesh = m;
    w->tree = tree;
    sdm_status s = sdm_boundary_build(m, topo, &w->boundary, err);
    if (s || w->boundary.n <= SHORT) return s;
    s = SDM_ALLOC(&w->cluster, tree->n_node, "clusters of triangles", err);
    if (!s) build_cluster(w, 0);
    return s;
}

void sdm_winding_dispose(sdm_winding *w)
{
    sdm_boundary_dispose(&w->boundary);
    sdm_free(w->cluster);
    *w = (sdm_winding){0};
}

double sdm_winding_sum(const sdm_winding *w, const double x[3])
{
    double sum = 0;
    for (size_t t = 0; t < w->mesh->n_tri; t++) sum += share_of_sphere(w->mesh, (uint32_t)t, x);
    return sum;
}

double sdm_winding_number(const sdm_winding *w, const double x[3])
{
    if (w->boundary.n >= w->mesh->n_tri / 2) return sdm_winding_sum(w, x);
    const sdm_strips strips = {&w->boundary, w->mesh->vert, {-1, 0, 0}, {{0, 1, 0}, {0, 0, 1}}, 1};
    return sdm_ray_winding(w->mesh, w->tree, x, 0, 1, NULL, 0) +
           sdm_strips_find(&strips, x, &x[1], 0).share;
}

/* Expansion about the middle of a cluster at r from the point, over 4 pi. */
static double expansion(const sdm_cluster *c, const double r[3], double distance)
{
    const double *m = c->second, d3 = distance * distance * distance;
    const double trace = m[0] + m[1] + m[2];
    const double square = m[0] * r[0] * r[0] + m[1] * r[1] * r[1] + m[2] * r[2] * r[2] +
                          2 * (m[3] * r[0] * r[1] + m[4] * r[1] * r[2] + m[5] * r[2] * r[0]);
    return (v3_dot(r, c->normal) + trace - 3 * square / (distance * distance)) / (4 * pi * d3);
}

/* Winding number with clusters whose error is below `tolerance` each; *error: bound on the sum. */
static double estimate(const sdm_winding *w, const double x[3], double tolerance, double *error)
{
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0;
    double sum = 0;
    *error = 0;
    stack[top++] = 0;
    while (top) {
        const uint32_t index = stack[--top];
        const sdm_bvh_node *n = &w->tree->node[index];
        const sdm_cluster *c = &w->cluster[index];
        double r[3];
        v3_sub(c->middle, x, r);
        const double distance = v3_norm(r), gap = distance - c->radius;
        // the third derivatives of 1 / r are at most 6 / r^4
        const double bound = 3 * c->spread / (4 * pi * gap * gap * gap * gap);
        if (gap > 0 && bound <= tolerance) {
            sum += expansion(c, r, distance);
            *error += bound;
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
    double error;
    for (double tolerance = 2e-3; w->cluster && tolerance > 1e-7; tolerance *= 1e-2) {
        const double guess = estimate(w, x, tolerance, &error);
        if (fabs(guess - 0.5) > error + 1e-9) return guess > 0.5;
    }
    return sdm_winding_number(w, x) > 0.5;
}
