/* The features of a surface and their regions. */
#include "surface_features.h"

#include <math.h>
#include <string.h>

#include "vec3.h"

// a face lower than this share of its length has no reliable direction into it from an edge
#define LOWEST 1e-6
// a face lower than this share of its length is thin: its angles are too small for float
#define THIN 0.02f
typedef struct builder {
    const sdm_mesh *m;
    const sdm_topology *topo;
    const sdm_frame *frames;
    const sdm_bvh *tree;
    sdm_arena *arena;
    sdm_features *f;
    uint32_t *slot_of; /* [n_tri] slot of a triangle */
    uint32_t *edge;    /* [n_edges] number of an edge of the topology */
    uint32_t *corner;  /* [n_vert] number of a corner */
    uint8_t *count;    /* [end - corner_base] directions of a corner so far */
    double middle[3];  /* of the cluster at hand */
    uint32_t n_group;
} builder;

static const double *vertex(const builder *b, size_t v) { return &b->m->vert[3 * v]; }

/* Function k of a face or edge: the distance in direction g from `through`. */
static void set_function(const builder *b, uint32_t number, int k, const double g[3], const double through[3])
{
    sdm_feature_row *row = &b->f->row[number];
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        row->g[i][k] = (float)g[i];
        sum += (double)row->g[i][k] * (b->middle[i] - through[i]);
    }
    row->offset[k] = (float)(sum * b->f->scale);
}

/* Outward across edge k of the frame, in the plane. */
static void across(const sdm_frame *t, int k, double g[3])
{
    const double ex[3] = {1, t->e1x, t->e2x}, ey[3] = {0, t->e1y, t->e2y};
    for (int i = 0; i < 3; i++) g[i] = ey[k] * t->u[i] - ex[k] * t->v[i];
}

static void set_thin(const builder *b, uint32_t number, const sdm_frame *t, const double end[3])
{
    double g[3], above[3];
    set_function(b, number, 0, t->u, end);
    for (int i = 0; i < 3; i++) g[i] = -t->u[i];
    set_function(b, number, 1, g, t->a);
    for (int i = 0; i < 3; i++) g[i] = -t->v[i];
    set_function(b, number, 2, g, t->a);
    v3_along(t->a, sdm_frame_height(t), t->v, above);
    set_function(b, number, 3, t->v, above);
}

static void add_face(const builder *b, uint32_t slot, sdm_cluster_node *node)
{
    const sdm_frame *t = &b->frames[slot];
    sdm_feature *x = &b->f->exact[slot];
    const double length = 2 * t->half[0];
    double g[3], end[3];
    b->f->owner[slot] = slot;
    memcpy(x->a, t->a, sizeof x->a);
    memcpy(x->u, t->n, sizeof x->u);
    x->face = -1;
    v3_along(t->a, length, t->u, end);
    if (t->flat != 0) {
        b->f->row[slot].offset[0] = INFINITY;
        return;
    }
    if (sdm_frame_height(t) < (double)THIN * length) {
        set_thin(b, slot, t, end);
        node->thin |= 1u << (slot - node->first);
        b->f->any_thin = true;
        return;
    }
    for (int k = 0; k < 3; k++) {
        across(t, k, g);
        // edges 0 and 2 pass through a, edge 1 through the end of edge 0
        set_function(b, slot, k, g, k == 1 ? end : t->a);
    }
    set_function(b, slot, 3, t->n, t->a);
}

/* The edge from x to y; returns its middle. */
static void add_segment(const builder *b, uint32_t number, const double x[3], const double y[3], double middle[3])
{
    sdm_features *f = b->f;
    sdm_feature *exact = &f->exact[number];
    sdm_feature_row *row = &f->row[number];
    double w[3];
    for (int i = 0; i < 3; i++) {
        exact->a[i] = x[i];
        w[i] = (y[i] - x[i]) * f->scale;
        middle[i] = 0.5 * x[i] + 0.5 * y[i];
    }
    const double length = v3_norm(w);
    for (int i = 0; i < 3; i++) {
        exact->u[i] = length > 0 ? w[i] / length : 0;
        row->g[i][3] = (float)((middle[i] - b->middle[i]) * f->scale);
    }
    exact->length = length / f->scale;
    set_function(b, number, 0, exact->u, middle);
    row->offset[3] = (float)(0.5 * length);
}

/* The conditions of up to two of the faces of an edge; missing ones stay 0 <= 0. */
static void add_sides(const builder *b, const sdm_edge *e, uint32_t number, const double middle[3])
{
    int k = 1;
    for (uint32_t h = e->first; h != SDM_NONE && k < 3; h = b->topo->next[h]) {
        const sdm_frame *t = &b->frames[b->slot_of[h / 3]];
        const int i = (int)((h % 3 + 3 - (uint32_t)t->rotation) % 3);
        if (t->flat != 0 || !(sdm_frame_height(t) > LOWEST * 2 * t->half[0])) continue;
        double g[3];
        across(t, i, g);
        for (int c = 0; c < 3; c++) g[c] = -g[c];
        set_function(b, number, k++, g, middle);
    }
}

static void add_direction(const builder *b, uint32_t corner, const double u[3], float sign)
{
    const uint32_t at = corner - b->f->corner_base;
    sdm_corner_row *c = &b->f->corner[at];
    if (b->count[at] == SDM_CORNER_EDGES) return;
    // the first one fills all
    const int end = b->count[at] ? b->count[at] + 1 : SDM_CORNER_EDGES;
    for (int k = b->count[at]; k < end; k++)
        for (int i = 0; i < 3; i++) c->along[i][k] = sign * (float)u[i];
    b->count[at]++;
}

static void add_corner(const builder *b, uint32_t number, const double x[3])
{
    memcpy(b->f->exact[number].a, x, 3 * sizeof *x);
    for (int i = 0; i < 3; i++)
        b->f->corner[number - b->f->corner_base].at[i] = (float)((x[i] - b->middle[i]) * b->f->scale);
}

/* Edges and corners of a triangle that no triangle before it has; a triangle with a repeated vertex is a segment of its own.
   node: its cluster. */
static void add_edges_and_corners(const builder *b, uint32_t slot, sdm_cluster_node *node)
{
    sdm_features *f = b->f;
    const size_t t = b->tree->order[slot];
    const uint32_t *v = &b->topo->tri[3 * t];
    double middle[3];
    for (int k = 0; k < 3; k++) {
        if (b->corner[v[k]] == SDM_NONE) {
            const uint32_t number = b->corner[v[k]] = node->corner_end++;
            add_corner(b, number, vertex(b, v[k]));
        }
        f->of_slot[slot][3 + k] = b->corner[v[k]];
        f->owner[b->corner[v[k]]] = slot;
    }
    if (b->topo->edge[3 * t] == SDM_NONE) {
        const sdm_frame *x = &b->frames[slot];
        const uint32_t number = node->edge_end++;
        double end[3];
        v3_along(x->a, 2 * x->half[0], x->u, end);
        f->owner[number] = slot;
        for (int k = 0; k < 3; k++) f->of_slot[slot][k] = number;
        add_segment(b, number, x->a, end, middle);
        return;
    }
    for (int k = 0; k < 3; k++) {
        const uint32_t i = b->topo->edge[3 * t + (size_t)k];
        if (b->edge[i] == SDM_NONE) {
            const sdm_edge *e = &b->topo->edges[i];
            const uint32_t number = b->edge[i] = node->edge_end++;
            add_segment(b, number, vertex(b, e->lo), vertex(b, e->hi), middle);
            add_sides(b, e, number, middle);
            add_direction(b, b->corner[e->lo], f->exact[number].u, 1);
            add_direction(b, b->corner[e->hi], f->exact[number].u, -1);
        }
        f->of_slot[slot][k] = b->edge[i];
        f->owner[b->edge[i]] = slot;
    }
}

/* Centre, radius and scale. */
static void measure(const builder *b)
{
    sdm_features *f = b->f;
    const sdm_bvh_node *root = b->tree->node;
    double d[3], longest = 0;
    for (int a = 0; a < 3; a++) {
        d[a] = root->hi[a] - root->lo[a];
        f->centre[a] = root->lo[a] + 0.5 * d[a];
    }
    f->radius = 0.5 * v3_norm(d);
    for (size_t i = 0; i < b->m->n_tri; i++) longest = b->frames[i].half[0] > longest ? b->frames[i].half[0] : longest;
    int exponent = 0;
    // without any edge the whole surface is the measure
    const double size = longest > 0 ? 2 * longest : f->radius;
    if (size > 0) (void)frexp(size, &exponent);
    f->scale = ldexp(1, -exponent);
}

/* Boxes, and which nodes are clusters: children come after their parent. */
static void fill_nodes(const builder *b)
{
    sdm_features *f = b->f;
    for (size_t i = b->tree->n_node; i-- > 0;) {
        const sdm_bvh_node *from = &b->tree->node[i];
        sdm_cluster_node *node = &f->node[i];
        node->first = from->first;
        node->count = from->count;
        for (int a = 0; a < 3; a++) {
            node->lo[a] = (float)((from->lo[a] - f->centre[a]) * f->scale);
            node->hi[a] = (float)((from->hi[a] - f->centre[a]) * f->scale);
        }
        if (from->count) continue;
        const sdm_cluster_node *child = &f->node[from->first];
        if (!child[0].count || !child[1].count || child[0].count + child[1].count > SDM_CLUSTER) continue;
        node->first = child[0].first;
        node->count = child[0].count + child[1].count;
    }
}

static void fill_cluster(builder *b, uint32_t i)
{
    sdm_features *f = b->f;
    sdm_cluster_node *node = &f->node[i];
    sdm_cluster_middle(&b->tree->node[i], b->middle);
    for (uint32_t slot = node->first; slot < node->first + node->count; slot++) {
        const uint32_t *t = &b->m->tri[3 * (size_t)b->tree->order[slot]];
        for (int a = 0; a < 3; a++) {
            const double sum = (vertex(b, t[0])[a] - f->centre[a]) + (vertex(b, t[1])[a] - f->centre[a]) +
                               (vertex(b, t[2])[a] - f->centre[a]);
            f->centroid[slot][a] = (float)(sum * f->scale) / 3;
        }
        add_face(b, slot, node);
        add_edges_and_corners(b, slot, node);
    }
    node->group = b->n_group;
    b->n_group += 1 + (node->edge_end - node->edge + 7) / 8;
}

/* The clusters in the order of the tree. */
static void fill_clusters(builder *b)
{
    sdm_features *f = b->f;
    uint32_t stack[SDM_BVH_DEPTH], edge = f->edge_base, corner = f->corner_base;
    int top = 0;
    stack[top++] = 0;
    while (top) {
        const uint32_t i = stack[--top];
        sdm_cluster_node *node = &f->node[i];
        if (!node->count) {
            stack[top++] = node->first + 1;
            stack[top++] = node->first;
            continue;
        }
        node->edge = node->edge_end = edge;
        node->corner = node->corner_end = corner;
        fill_cluster(b, i);
        edge = node->edge_end;
        corner = node->corner_end;
    }
    f->end = corner;
}

/* Rows from .. to side by side. */
static void fill_groups(const sdm_features *f, uint32_t from, uint32_t to, sdm_feature_group *out)
{
    for (; from < to; from += 8, out++) {
        for (uint32_t lane = 0; lane < 8; lane++) {
            out->offset[0][lane] = INFINITY;
            if (from + lane >= to) continue;
            const sdm_feature_row *row = &f->row[from + lane];
            for (int k = 0; k < 4; k++) {
                for (int a = 0; a < 3; a++) out->g[k][a][lane] = row->g[a][k];
                out->offset[k][lane] = row->offset[k];
            }
        }
    }
}

static sdm_status add_groups(const builder *b, sdm_error *err)
{
    sdm_features *f = b->f;
    const sdm_status s = SDM_TAKE(b->arena, SDM_LOW, &f->group, b->n_group, "features", err);
    for (size_t i = 0; i < b->tree->n_node && !s; i++) {
        const sdm_cluster_node *node = &f->node[i];
        // others are below a cluster
        if (!node->count || node->edge_end + node->corner_end == 0) continue;
        fill_groups(f, node->first, node->first + node->count, &f->group[node->group]);
        fill_groups(f, node->edge, node->edge_end, &f->group[node->group + 1]);
    }
    return s;
}

static sdm_status allocate(builder *b, sdm_error *err)
{
    sdm_features *f = b->f;
    const size_t n = b->m->n_tri, n_vert = b->m->n_vert;
    sdm_status s = SDM_TAKE(b->arena, SDM_HIGH, &b->slot_of, n, "features", err);
    if (!s) s = SDM_TAKE(b->arena, SDM_HIGH, &b->edge, b->topo->n_edges, "features", err);
    if (!s) s = SDM_TAKE(b->arena, SDM_HIGH, &b->corner, n_vert, "features", err);
    if (!s) s = SDM_TAKE(b->arena, SDM_HIGH, &b->count, n_vert, "features", err);
    if (!s) s = SDM_TAKE(b->arena, SDM_LOW, &f->node, b->tree->n_node, "features", err);
    if (!s) s = SDM_TAKE(b->arena, SDM_LOW, &f->centroid, n, "features", err);
    if (!s) s = SDM_TAKE(b->arena, SDM_LOW, &f->row, f->corner_base, "features", err);
    if (!s) s = SDM_TAKE(b->arena, SDM_LOW, &f->corner, n_vert, "features", err);
    if (!s) s = SDM_TAKE(b->arena, SDM_LOW, &f->exact, f->corner_base + n_vert, "features", err);
    if (!s) s = SDM_TAKE(b->arena, SDM_LOW, &f->of_slot, n, "features", err);
    if (!s) s = SDM_TAKE(b->arena, SDM_LOW, &f->owner, f->corner_base + n_vert, "features", err);
    if (s) return s;
    memset(b->edge, 0xff, b->topo->n_edges * sizeof *b->edge);
    memset(b->corner, 0xff, n_vert * sizeof *b->corner);
    return SDM_OK;
}

size_t sdm_features_bytes(size_t n_tri, size_t n_vert, size_t *scratch)
{
    // edges: every triangle may have three of its own, or be one
    const size_t rows = 4 * n_tri;
    *scratch += n_tri * 4 * sizeof(uint32_t) + n_vert * (sizeof(uint32_t) + 1);
    // every triangle may be a cluster, whose edges end with a group
    const size_t groups = 2 * n_tri + rows / 8;
    return groups * sizeof(sdm_feature_group) +
           n_tri * (2 * sizeof(sdm_cluster_node) + sizeof(float[3]) + sizeof(uint32_t[6])) +
           rows * sizeof(sdm_feature_row) + n_vert * sizeof(sdm_corner_row) +
           (rows + n_vert) * (sizeof(sdm_feature) + sizeof(uint32_t));
}

sdm_status sdm_features_build(const sdm_mesh *m, const sdm_topology *topo, const sdm_frame *frames, const sdm_bvh *tree,
                              sdm_arena *arena, sdm_features *f, sdm_error *err)
{
    const size_t n = m->n_tri;
    builder b = {.m = m, .topo = topo, .frames = frames, .tree = tree, .arena = arena, .f = f};
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    size_t segments = 0;
    for (size_t t = 0; t < n; t++) segments += topo->edge[3 * t] == SDM_NONE;
    if (n + segments + topo->n_edges + m->n_vert >= SDM_NONE / 2) // the kernels count in 32 bits with a sign
        return sdm_fail(err, SDM_E_NOMEM, "surface of %zu triangles: too many to number their edges and vertices", n);
    f->edge_base = (uint32_t)n;
    f->corner_base = (uint32_t)(n + segments + topo->n_edges);
    sdm_status s = allocate(&b, err);
    if (!s) {
        for (uint32_t slot = 0; slot < n; slot++) b.slot_of[tree->order[slot]] = slot;
        measure(&b);
        fill_nodes(&b);
        fill_clusters(&b);
        s = add_groups(&b, err);
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}
