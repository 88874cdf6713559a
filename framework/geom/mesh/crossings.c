/* Integer winding numbers by signed ray crossings; whether a ray crosses a triangle is decided
 * exactly (line_triangle.h). */
#include "crossings.h"

#include <math.h>

#include "exactly/line_triangle.h"

/* An axis-parallel ray. axis[0] is the ray's own axis, axis[1] and axis[2] are the other two; p[i]
 * is the coordinate of its start along axis[i]. */
typedef struct ray {
    double p[3];
    int axis[3], direction;
} ray;

/* +1: the ray leaves through triangle t; -1: it enters; 0: it does not cross t. */
static int ray_crossing(const sdm_mesh *m, uint32_t t, const ray *r)
{
    double v[3][3], area[3];
    for (int k = 0; k < 3; k++) {
        const double *x = &m->vert[3 * (size_t)m->tri[3 * (size_t)t + (size_t)k]];
        for (int a = 0; a < 3; a++) v[k][a] = x[r->axis[a]];
    }
    const int orientation = sdm_line_meets((const double(*)[3])v, &r->p[1], area);
    if (!orientation) return 0;
    const int after = sdm_line_meets_after((const double(*)[3])v, r->p, orientation, area);
    return after == r->direction ? orientation * r->direction : 0;
}

/* Does the ray meet the box of node n? */
static int ray_meets_box(const sdm_bvh_node *n, const ray *r)
{
    const int x = r->axis[0], y = r->axis[1], z = r->axis[2];
    if (r->p[1] < n->lo[y] || r->p[1] > n->hi[y] || r->p[2] < n->lo[z] || r->p[2] > n->hi[z])
        return 0;
    return r->direction > 0 ? n->hi[x] >= r->p[0] : n->lo[x] <= r->p[0];
}

/* The triangles that do not count: skip[n_skip], and those of two parts unless part_of is NULL. */
typedef struct left_out {
    const uint32_t *skip, *part_of;
    size_t n_skip;
    uint32_t part[2];
} left_out;

static int is_left_out(uint32_t t, const left_out *l)
{
    for (size_t i = 0; i < l->n_skip; i++)
        if (l->skip[i] == t) return 1;
    return l->part_of && (l->part_of[t] == l->part[0] || l->part_of[t] == l->part[1]);
}

static int count_crossings(const sdm_mesh *m, const sdm_bvh *tree, const ray *r, const left_out *l)
{
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0, winding = 0;
    if (ray_meets_box(&tree->node[0], r)) stack[top++] = 0;
    while (top) {
        const sdm_bvh_node *n = &tree->node[stack[--top]];
        for (uint32_t i = n->first; n->count && i < n->first + n->count; i++)
            if (!is_left_out(tree->order[i], l)) winding += ray_crossing(m, tree->order[i], r);
        for (uint32_t c = n->first; !n->count && c < n->first + 2; c++)
            if (ray_meets_box(&tree->node[c], r)) stack[top++] = c;
    }
    return winding;
}

int sdm_ray_winding(const sdm_mesh *m, const sdm_bvh *tree, const double p[3], int axis,
                    int direction, const uint32_t *skip, size_t n_skip)
{
    const int y = (axis + 1) % 3, z = (axis + 2) % 3;
    const ray r = {{p[axis], p[y], p[z]}, {axis, y, z}, direction};
    return count_crossings(m, tree, &r, &(left_out){.skip = skip, .n_skip = n_skip});
}

int sdm_ray_winding_along(const sdm_mesh *m, const sdm_bvh *tree, const double p[3],
                          const double n[3], const uint32_t *skip, size_t n_skip)
{
    int axis = 0;
    for (int i = 1; i < 3; i++)
        if (fabs(n[i]) > fabs(n[axis])) axis = i;
    return sdm_ray_winding(m, tree, p, axis, n[axis] > 0 ? 1 : -1, skip, n_skip);
}

int sdm_ray_winding_of_others(const sdm_mesh *m, const sdm_bvh *tree, const double p[3],
                              const uint32_t *part_of, uint32_t a, uint32_t b)
{
    const ray r = {{p[0], p[1], p[2]}, {0, 1, 2}, 1};
    return count_crossings(m, tree, &r, &(left_out){.part_of = part_of, .part = {a, b}});
}
