/* The nearest point of a surface for single points, and the data for many. */
#include "nearest.h"

#include <math.h>

#include "sdm/memory.h"

static void to_lanes(const sdm_frame *f, double scale, sdm_lane_triangle *l)
{
    for (int i = 0; i < 3; i++) {
        const double u = f->u[i], v = f->v[i];
        l->g[i][0] = (float)u;
        l->g[i][1] = (float)-v;
        l->g[i][2] = (float)(f->e1x * u + f->e1y * v);
        l->g[i][3] = (float)(f->e1y * u - f->e1x * v);
        l->g[i][4] = (float)(f->e2x * u + f->e2y * v);
        l->g[i][5] = (float)(f->e2y * u - f->e2x * v);
        l->g[i][6] = (float)f->n[i];
        l->g[i][7] = (float)(f->half[i] * scale);
        l->a[i] = f->a[i];
    }
    const double at_a[8] = {-f->half[0], 0, -f->kt1, -f->kh1, -f->kt2, 0, 0, 0};
    for (int i = 0; i < 8; i++) l->g[3][i] = (float)(at_a[i] * scale);
}

sdm_status sdm_nearest_build(const sdm_mesh *m, const sdm_topology *topo, sdm_nearest *n, sdm_error *err)
{
    sdm_status s = sdm_bvh_build(m, &n->tree, err);
    if (!s) s = SDM_ALLOC(&n->frames, m->n_tri, "frames of triangles", err);
    if (!s) s = SDM_ALLOC(&n->lanes, m->n_tri, "triangles for the kernels", err);
    if (s) return s;
    for (size_t i = 0; i < m->n_tri; i++) {
        const uint32_t *v = &m->tri[3 * (size_t)n->tree.order[i]];
        sdm_frame_build(&m->vert[3 * (size_t)v[0]], &m->vert[3 * (size_t)v[1]], &m->vert[3 * (size_t)v[2]],
                        &n->frames[i]);
        n->longest = fmax(n->longest, 2 * n->frames[i].half[0]);
    }
    int exponent = 0;
    if (n->longest > 0) (void)frexp(n->longest, &exponent);
    n->scale = ldexp(1, -exponent);
    n->n_corner = m->n_vert;
    n->n_edge = topo->n_edges;
    for (size_t i = 0; i < m->n_tri; i++) {
        sdm_lane_triangle *l = &n->lanes[i];
        const size_t t = n->tree.order[i], turn = (size_t)n->frames[i].rotation;
        to_lanes(&n->frames[i], n->scale, l);
        for (size_t k = 0; k < 3; k++) {
            l->corner[k] = topo->tri[3 * t + (k + turn) % 3];
            l->edge[k] = topo->edge[3 * t + (k + turn) % 3];
        }
    }
    return SDM_OK;
}

void sdm_nearest_dispose(sdm_nearest *n)
{
    sdm_bvh_dispose(&n->tree);
    sdm_free(n->frames);
    sdm_free(n->lanes);
    *n = (sdm_nearest){0};
}

double sdm_nearest_find(const sdm_nearest *n, const double x[3], double bound, uint32_t *slot, double q[3],
                        int *feature)
{
    struct {
        uint32_t node;
        double d;
    } stack[SDM_BVH_DEPTH];
    const sdm_bvh_node *nodes = n->tree.node;
    int top = 0;
    uint32_t best = UINT32_MAX;
    stack[top].node = 0;
    stack[top++].d = sdm_bvh_box_distance2(&nodes[0], x);
    while (top) {
        top--;
        if (!(stack[top].d < bound)) continue;
        const sdm_bvh_node *node = &nodes[stack[top].node];
        for (uint32_t i = node->first; node->count && i < node->first + node->count; i++) {
            const double d = sdm_frame_distance2(&n->frames[i], x);
            if (!(d < bound)) continue;
            bound = d;
            best = i;
        }
        if (node->count) continue;
        // the nearer child on top
        const uint32_t c = node->first;
        const double d0 = sdm_bvh_box_distance2(&nodes[c], x), d1 = sdm_bvh_box_distance2(&nodes[c + 1], x);
        const uint32_t near = d1 < d0;
        if ((near ? d0 : d1) < bound) {
            stack[top].node = c + !near;
            stack[top++].d = near ? d0 : d1;
        }
        if ((near ? d1 : d0) < bound) {
            stack[top].node = c + near;
            stack[top++].d = near ? d1 : d0;
        }
    }
    if (best == UINT32_MAX) return bound;
    *slot = best;
    (void)sdm_frame_closest(&n->frames[best], x, q, feature);
    return bound;
}
