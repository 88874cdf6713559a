/* Nearest point of a surface: search of the tree for single points. */
#include "nearest.h"

#include <float.h>
#include <math.h>

#include "feature_build.h"
#include "feature_distance.h"

sdm_status sdm_nearest_build(const sdm_mesh *m, const sdm_topology *topo, sdm_arena *arena,
                             sdm_nearest *n, sdm_error *err)
{
    const sdm_status s =
        SDM_TAKE_UNSET(arena, SDM_LOW, &n->frames, m->n_tri, "frames of triangles", err);
    return s ? s : sdm_features_build(m, topo, &n->tree, arena, n->frames, &n->features, err);
}

double sdm_nearest_find(const sdm_nearest *n, const double x[3], double bound, uint32_t *slot,
                        double q[3], int *feature)
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
        // push the children closer than the bound, the nearer one last, so that it is visited first
        const uint32_t c = node->first;
        const double d0 = sdm_bvh_box_distance2(&nodes[c], x),
                     d1 = sdm_bvh_box_distance2(&nodes[c + 1], x);
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

/* Compares x with the seven features of the triangle in this slot. */
static void features_compare(const sdm_nearest *n, const double x[3], uint32_t slot,
                             uint32_t *number, double *d2)
{
    const sdm_features *f = &n->features;
    for (int i = -1; i < 6; i++) {
        const uint32_t other = i < 0 ? slot : f->of_slot[slot][i];
        const double d = sdm_feature_distance2(f, n->frames, other, x, *d2);
        if (!sdm_is_nearer(d, other, *d2, *number)) continue;
        *d2 = d;
        *number = other;
    }
}

double sdm_nearest_feature(const sdm_nearest *n, const double x[3], uint32_t *slot)
{
    uint32_t number = *slot;
    double least = INFINITY;
    features_compare(n, x, *slot, &number, &least);
    *slot = n->features.owner[number];
    return least;
}

uint32_t sdm_nearest_least(const sdm_nearest *n, const double x[3], double *d2)
{
    // boxes and triangles within the rounding errors of the nearest one are looked at, too
    double largest = 0;
    for (int a = 0; a < 3; a++)
        largest =
            fmax(largest,
                 fmax(fabs(x[a]), fmax(fabs(n->tree.node[0].lo[a]), fabs(n->tree.node[0].hi[a]))));
    const double slack = 64 * DBL_EPSILON * largest;
    uint32_t stack[SDM_BVH_DEPTH], number = UINT32_MAX;
    int top = 0;
    double limit = INFINITY;
    *d2 = INFINITY;
    stack[top++] = 0;
    while (top) {
        const sdm_bvh_node *node = &n->tree.node[stack[--top]];
        if (sdm_bvh_box_distance2(node, x) > limit) continue;
        for (uint32_t i = node->first; node->count && i < node->first + node->count; i++) {
            if (sdm_frame_distance2(&n->frames[i], x) > limit) continue;
            features_compare(n, x, i, &number, d2);
            const double far = sqrt(*d2) + slack;
            limit = far * far;
        }
        if (node->count) continue;
        // the nearer child is visited first
        const uint32_t c = node->first;
        const uint32_t near = sdm_bvh_box_distance2(&n->tree.node[c + 1], x) <
                              sdm_bvh_box_distance2(&n->tree.node[c], x);
        stack[top++] = c + !near;
        stack[top++] = c + near;
    }
    return number;
}
