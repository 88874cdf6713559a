/* Builds the features of a surface (terms: surface_features.h): computes their scale, forms the
   clusters, and numbers edges and corners; feature_groups.inc then fills the groups. */
#include "feature_build.h"

#include <math.h>
#include <string.h>

#include "feature_groups.h"
#include "sdm/internal/processor.h"
#include "sdm/internal/vec3.h"

static const double *vertex(const sdm_feature_builder *b, size_t v) { return &b->m->vert[3 * v]; }

/* Sets centre, radius and scale of the features. */
static void surface_measure(const sdm_feature_builder *b)
{
    sdm_features *f = b->f;
    const sdm_bvh_node *root = b->tree->node;
    double d[3], longest = 0;
    // bounding box
    for (int a = 0; a < 3; a++) {
        d[a] = root->hi[a] - root->lo[a];
        f->centre[a] = root->lo[a] + 0.5 * d[a];
    }
    f->radius = 0.5 * v3_norm(d);
    // squared length of the longest edge
    for (size_t t = 0; t < b->m->n_tri; t++) {
        const uint32_t *v = &b->m->tri[3 * t];
        for (int k = 0; k < 3; k++) {
            const double l = v3_dist2(vertex(b, v[k]), vertex(b, v[(k + 1) % 3]));
            longest = l > longest ? l : longest;
        }
    }
    int exponent = 0;
    // all triangles are points: use the size of the whole surface
    const double size = longest > 0 ? sqrt(longest) : f->radius;
    if (size > 0) (void)frexp(size, &exponent);
    f->scale = ldexp(1, -exponent);
}

/* Sets the boxes of all nodes, and marks as clusters the leaves and the nodes whose two children
   are clusters with at most SDM_CLUSTER faces together. Runs backwards, because children come after
   their parent in the array. */
static void nodes_set(const sdm_feature_builder *b)
{
    sdm_features *f = b->f;
    for (size_t i = b->tree->n_node; i-- > 0;) {
        const sdm_bvh_node *from = &b->tree->node[i];
        sdm_cluster_node *node = &f->node[i];
        *node = (sdm_cluster_node){.first = from->first, .count = from->count};
        for (int a = 0; a < 3; a++) {
            node->lo[a] = (float)((from->lo[a] - f->centre[a]) * f->scale);
            node->hi[a] = (float)((from->hi[a] - f->centre[a]) * f->scale);
        }
        // merge the children, if both are clusters and small enough
        if (from->count) continue;
        const sdm_cluster_node *child = &f->node[from->first];
        if (!child[0].count || !child[1].count || child[0].count + child[1].count > SDM_CLUSTER)
            continue;
        node->first = child[0].first;
        node->count = child[0].count + child[1].count;
    }
}

/* Lists the clusters in the order of their faces; returns their number. */
static size_t clusters_list(const sdm_features *f, sdm_cluster_node **list)
{
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0;
    size_t n = 0;
    stack[top++] = 0;
    while (top) {
        sdm_cluster_node *node = &f->node[stack[--top]];
        if (node->count) {
            list[n++] = node;
            continue;
        }
        stack[top++] = node->first + 1;
        stack[top++] = node->first;
    }
    return n;
}

/* Sets the places of the edges and corners of a cluster. */
static void cluster_set_places(const sdm_features *f, const sdm_cluster_node *node)
{
    uint32_t group = node->group + 1;
    for (uint32_t i = node->edge; i < node->edge_end; i++)
        f->place[i - f->edge_base] = 8 * group + (i - node->edge);
    group += (node->edge_end - node->edge + 7) / 8;
    for (uint32_t i = node->corner; i < node->corner_end; i++) {
        const uint32_t at = i - node->corner;
        f->place[i - f->edge_base] = 8 * (group + at / SDM_CORNER_LANES) + at % SDM_CORNER_LANES;
    }
}

/* Next free number of an edge, a corner and a group. */
typedef struct next_numbers {
    uint32_t edge, corner, group;
} next_numbers;

/* Returns the feature number *own of an edge or corner; where it is SDM_NONE, takes the number
   *next and stores the edge or vertex in source[number]. Free of branches, because first
   occurrences are unpredictable: source[*next] is always written. */
static inline uint32_t number_take(uint32_t *own, uint32_t *next, uint32_t *source, uint32_t item)
{
    const bool is_new = *own == SDM_NONE;
    const uint32_t number = is_new ? *next : *own;
    source[*next] = item;
    *next += is_new;
    return *own = number;
}

/* Numbers the edges and corners of a cluster that no earlier cluster contains, and the cluster's
   groups of features. A triangle with a repeated vertex has no edge in the topology: it becomes one
   edge feature, the segment between its different vertices. */
static void cluster_number(const sdm_feature_builder *b, sdm_cluster_node *node, next_numbers *n)
{
    sdm_features *f = b->f;
    // both pointers are shifted, so that feature numbers index them
    uint32_t *source = b->edge_source - f->edge_base, *vertices = b->vertex - f->corner_base;
    node->edge = n->edge;
    node->corner = n->corner;
    for (uint32_t slot = node->first; slot < node->first + node->count; slot++) {
        const size_t t = b->tree->order[slot];
        const uint32_t *v = &b->topo->tri[3 * t], *edge = &b->topo->edge[3 * t];
        uint32_t *of = f->of_slot[slot];
        f->owner[slot] = slot;
        // corners
        for (int k = 0; k < 3; k++) {
            of[3 + k] = number_take(&b->corner[v[k]], &n->corner, vertices, v[k]);
            f->owner[of[3 + k]] = slot;
        }
        // edges
        const bool is_segment = edge[0] == SDM_NONE;
        if (is_segment) source[n->edge] = (uint32_t)(b->topo->n_edges + t);
        for (int k = 0; k < 3; k++) {
            of[k] =
                is_segment ? n->edge : number_take(&b->edge[edge[k]], &n->edge, source, edge[k]);
            f->owner[of[k]] = slot;
        }
        n->edge += is_segment;
    }
    // ends of the numbers; then the groups: one group of faces, the groups of edges, those of
    // corners
    node->edge_end = n->edge;
    node->corner_end = n->corner;
    node->group = n->group;
    n->group += 1 + (n->edge - node->edge + 7) / 8;
    n->group += (n->corner - node->corner + SDM_CORNER_LANES - 1) / SDM_CORNER_LANES;
}

static sdm_feature_groups *groups_choose(void)
{
#if defined(__x86_64__) && defined(__GNUC__)
    if (sdm_processor_level() >= SDM_PROCESSOR_AVX2) return sdm_feature_groups_avx2;
#endif
    return sdm_feature_groups_generic;
}

/* Numbers the features of all clusters, then allocates and fills their groups. */
static sdm_status clusters_fill(const sdm_feature_builder *b, sdm_arena *arena, sdm_error *err)
{
    sdm_features *f = b->f;
    sdm_cluster_node **list;
    sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &list, b->m->n_tri, "features", err);
    if (s) return s;
    const size_t n = clusters_list(f, list);
    next_numbers next = {f->edge_base, f->corner_base, 0};
    for (size_t i = 0; i < n; i++) cluster_number(b, list[i], &next);
    f->end = next.corner;
    s = SDM_TAKE_UNSET(arena, SDM_LOW, &f->group, next.group, "features", err);
    if (s) return s;
    for (size_t i = 0; i < n; i++) cluster_set_places(f, list[i]);
    groups_choose()(b, list, n);
    return SDM_OK;
}

/* Allocates all arrays except the groups and the list of clusters. */
static sdm_status builder_allocate(sdm_feature_builder *b, sdm_arena *arena, sdm_error *err)
{
    sdm_features *f = b->f;
    const size_t n = b->m->n_tri, n_vert = b->m->n_vert, n_edge = f->corner_base - f->edge_base;
    // one extra element: number_take() always writes to source[*next]
    sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &b->edge_source, n_edge + 1, "features", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &b->segment, n_edge, "features", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &b->vertex, n_vert + 1, "features", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &b->edge, b->topo->n_edges, "features", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &b->corner, n_vert, "features", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &b->narrow, n, "features", err);
    if (!s) s = SDM_TAKE(arena, SDM_HIGH, &b->along, n_vert, "features", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_LOW, &f->node, b->tree->n_node, "features", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_LOW, &f->centroid, n, "features", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_LOW, &f->exact, f->corner_base + n_vert, "features", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_LOW, &f->place, n_edge + n_vert, "features", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_LOW, &f->of_slot, n, "features", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_LOW, &f->owner, f->corner_base + n_vert, "features", err);
    if (s) return s;
    memset(b->edge, 0xff, b->topo->n_edges * sizeof *b->edge);
    memset(b->corner, 0xff, n_vert * sizeof *b->corner);
    return SDM_OK;
}

sdm_status sdm_features_build(const sdm_mesh *m, const sdm_topology *topo, const sdm_bvh *tree,
                              sdm_arena *arena, sdm_frame *frames, sdm_features *f, sdm_error *err)
{
    const size_t n = m->n_tri;
    sdm_feature_builder b = {.m = m, .topo = topo, .tree = tree, .frames = frames, .f = f};
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    size_t segments = 0;
    for (size_t t = 0; t < n; t++) segments += topo->edge[3 * t] == SDM_NONE;
    if (n + segments + topo->n_edges + m->n_vert >=
        SDM_NONE / 2) // the map kernels hold feature numbers as int32_t
        return sdm_fail(err, SDM_E_NOMEM,
                        "surface of %zu triangles: too many to number their edges and vertices", n);
    f->edge_base = (uint32_t)n;
    f->corner_base = (uint32_t)(n + segments + topo->n_edges);
    sdm_status s = builder_allocate(&b, arena, err);
    if (!s) {
        surface_measure(&b);
        nodes_set(&b);
        s = clusters_fill(&b, arena, err);
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}
