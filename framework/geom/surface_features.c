/* The features of a surface and their regions. */
#include "surface_features.h"

#include <math.h>
#include <string.h>

#include "lanes.h"
#include "vec3.h"

// a face lower than this share of its length has no reliable direction into it from an edge
#define LOWEST 1e-6
// a face lower than this share of its length is thin: its angles are too small for float
#define THIN 0.02f
#define NO_SIDES 3
#define CORNER_EDGES 6

/* A face or edge as in its group: [coordinate][k], [k]. */
typedef struct feature_row {
    _Alignas(16) float g[3][4], offset[4], most[2];
} feature_row;

/* A corner and unit vectors along up to six edges away from it (fewer are repeated). */
typedef struct corner_row {
    _Alignas(32) float along[3][8]; /* [coordinate][edge] */
    float at[3];
    uint32_t n; /* edges so far */
} corner_row;

typedef struct builder {
    const sdm_mesh *m;
    const sdm_topology *topo;
    const sdm_frame *frames;
    const sdm_bvh *tree;
    sdm_arena *arena;
    sdm_features *f;
    uint32_t *slot_of;   /* [n_tri] slot of a triangle */
    uint32_t *edge;      /* [n_edges] number of an edge of the topology */
    uint32_t *corner;    /* [n_vert] number of a corner */
    corner_row *along;   /* [end - corner_base] */
    feature_row *row;    /* [corner_base] */
    uint8_t *first_side; /* [n_tri] edge of the frame that the first edge of the triangle is, NO_SIDES: has none */
    double middle[3];    /* of the cluster at hand, mm */
    uint32_t n_edge, n_corner, n_group; /* so far */
} builder;

static const double *vertex(const builder *b, size_t v) { return &b->m->vert[3 * v]; }

/* Four linear functions at once: of lane k the gradient, and a point where it is 0. */
typedef struct functions {
    v4d g[3], through[3];
} functions;

/* The offsets of a row whose gradients are set; through: as in `functions`. */
static inline void set_offsets(const builder *b, feature_row *row, const v4d through[3])
{
    v4d sum = v4_all(0);
    for (int i = 0; i < 3; i++) sum += v4_from(f4_load(row->g[i])) * (v4_all(b->middle[i]) - through[i]);
    f4_store(row->offset, f4_round(sum * v4_all(b->f->scale)));
}

static inline void set_functions(const builder *b, feature_row *row, const functions *f)
{
    for (int i = 0; i < 3; i++) f4_store(row->g[i], f4_round(f->g[i]));
    set_offsets(b, row, f->through);
}

static void add_face(const builder *b, uint32_t slot, sdm_cluster_node *node)
{
    const sdm_frame *t = &b->frames[slot];
    sdm_feature *x = &b->f->exact[slot];
    feature_row *row = &b->row[slot];
    const double length = 2 * t->half[0];
    double end[3];
    b->f->owner[slot] = slot;
    memcpy(x->a, t->a, sizeof x->a);
    memcpy(x->u, t->n, sizeof x->u);
    x->length = 0;
    x->face = -1;
    row->most[0] = row->most[1] = 0;
    b->first_side[slot] = NO_SIDES;
    v3_along(t->a, length, t->u, end);
    if (t->flat != 0) {
        *row = (feature_row){.offset = {INFINITY}};
        return;
    }
    const double height = sdm_frame_height(t);
    if (height < (double)THIN * length) {
        node->thin |= 1u << (slot - node->first);
        b->f->any_thin = true;
    }
    if (height > LOWEST * length) b->first_side[slot] = (uint8_t)((3 - (uint32_t)t->rotation) % 3);
    // outward across the edges; edges 0 and 2 pass through a, edge 1 through the end of edge 0
    functions f;
    for (int i = 0; i < 3; i++) {
        const double u = t->u[i], v = t->v[i];
        f.g[i] = (v4d){-v, t->e1y * u - t->e1x * v, t->e2y * u - t->e2x * v, t->n[i]};
        f.through[i] = (v4d){t->a[i], end[i], t->a[i], t->a[i]};
    }
    set_functions(b, row, &f);
}

/* Gradients 1 to 3 of an edge, which two of its faces have with the other sign; 0 where there is none. Returns how many. */
static int find_sides(const builder *b, const sdm_edge *e, feature_row *row)
{
    int n = 0;
    for (uint32_t h = e->first; h != SDM_NONE && n < 2; h = b->topo->next[h]) {
        const uint32_t slot = b->slot_of[h / 3], first = b->first_side[slot];
        if (first == NO_SIDES) continue;
        const feature_row *face = &b->row[slot];
        for (int i = 0; i < 3; i++) row->g[i][1 + n] = -face->g[i][(h + first) % 3];
        for (int i = 0; i < 3 && !n; i++) row->g[i][3] = face->g[i][3];
        n++;
    }
    return n;
}

/* The edge from x to y; e: of the topology, NULL for that of a triangle with a repeated vertex. */
static void add_segment(const builder *b, uint32_t number, const double x[3], const double y[3], const sdm_edge *e)
{
    sdm_features *f = b->f;
    sdm_feature *exact = &f->exact[number];
    feature_row *row = &b->row[number];
    double w[3];
    v4d through[3];
    for (int i = 0; i < 3; i++) w[i] = (y[i] - x[i]) * f->scale;
    const double length = v3_norm(w);
    for (int i = 0; i < 3; i++) {
        exact->a[i] = x[i];
        exact->u[i] = length > 0 ? w[i] / length : 0;
        through[i] = v4_all(0.5 * x[i] + 0.5 * y[i]);
        f4_store(row->g[i], (v4f){(float)exact->u[i], 0, 0, 0});
    }
    exact->length = length / f->scale;
    exact->face = 0;
    row->most[0] = (float)(0.5 * length);
    row->most[1] = 0;
    if (length > 0 && (!e || !find_sides(b, e, row))) {
        double v[3], n[3];
        row->most[1] = INFINITY;
        v3_perpendicular(exact->u, v);
        v3_cross(exact->u, v, n);
        for (int i = 0; i < 3; i++) {
            row->g[i][1] = (float)v[i];
            row->g[i][3] = (float)n[i];
        }
    }
    set_offsets(b, row, through);
    if (!(length > 0)) row->offset[0] = INFINITY; // its corners are there
}

static void add_direction(const builder *b, uint32_t corner, const double u[3], double sign)
{
    corner_row *c = &b->along[corner - b->f->corner_base];
    const uint32_t k = c->n;
    if (k == CORNER_EDGES) return;
    c->n++;
    for (int i = 0; i < 3; i++) {
        const float g = (float)(sign * u[i]);
        // the first one fills all
        if (!k) v8_store(c->along[i], v8_all(g));
        c->along[i][k] = g;
    }
}

static void add_corner(const builder *b, uint32_t number, const double x[3])
{
    b->f->exact[number] = (sdm_feature){.a = {x[0], x[1], x[2]}};
    corner_row *c = &b->along[number - b->f->corner_base];
    *c = (corner_row){.n = 0}; // without edges it is in nobody's way
    for (int i = 0; i < 3; i++) c->at[i] = (float)((x[i] - b->middle[i]) * b->f->scale);
}

/* Edges and corners of a triangle that no triangle before it has; a triangle with a repeated vertex is a segment of its own.
   node: its cluster. */
static void add_edges_and_corners(const builder *b, uint32_t slot, sdm_cluster_node *node)
{
    sdm_features *f = b->f;
    const size_t t = b->tree->order[slot];
    const uint32_t *v = &b->topo->tri[3 * t];
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
        add_segment(b, number, x->a, end, NULL);
        return;
    }
    for (int k = 0; k < 3; k++) {
        const uint32_t i = b->topo->edge[3 * t + (size_t)k];
        if (b->edge[i] == SDM_NONE) {
            const sdm_edge *e = &b->topo->edges[i];
            const uint32_t number = b->edge[i] = node->edge_end++;
            add_segment(b, number, vertex(b, e->lo), vertex(b, e->hi), e);
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

static void fill_faces(builder *b, sdm_cluster_node *node)
{
    sdm_features *f = b->f;
    for (uint32_t slot = node->first; slot < node->first + node->count; slot++) {
        const uint32_t *t = &b->m->tri[3 * (size_t)b->tree->order[slot]];
        for (int a = 0; a < 3; a++) {
            const double sum = (vertex(b, t[0])[a] - f->centre[a]) + (vertex(b, t[1])[a] - f->centre[a]) +
                               (vertex(b, t[2])[a] - f->centre[a]);
            f->centroid[slot][a] = (float)(sum * f->scale) / 3;
        }
        add_face(b, slot, node);
    }
}

/* Asks the rows of faces of other clusters. */
static void fill_edges_and_corners(builder *b, sdm_cluster_node *node)
{
    node->edge = node->edge_end = b->n_edge;
    node->corner = node->corner_end = b->n_corner;
    for (uint32_t slot = node->first; slot < node->first + node->count; slot++) add_edges_and_corners(b, slot, node);
    b->n_edge = node->edge_end;
    b->n_corner = node->corner_end;
    node->group = b->n_group;
    b->n_group += 1 + (node->edge_end - node->edge + 7) / 8;
    b->n_group += (node->corner_end - node->corner + SDM_CORNER_LANES - 1) / SDM_CORNER_LANES;
}

/* The distances outward from a rectangle around each thin face, in its plane, in the place of those across its edges. */
static void fill_thin_faces(builder *b, sdm_cluster_node *node)
{
    for (uint32_t slot = node->first; slot < node->first + node->count; slot++) {
        if (!(node->thin >> (slot - node->first) & 1)) continue;
        const sdm_frame *t = &b->frames[slot];
        const double height = sdm_frame_height(t);
        functions f;
        for (int i = 0; i < 3; i++) {
            f.g[i] = (v4d){t->u[i], -t->u[i], -t->v[i], t->v[i]};
            f.through[i] = (v4d){t->a[i] + 2 * t->half[0] * t->u[i], t->a[i], t->a[i], t->a[i] + height * t->v[i]};
        }
        set_functions(b, &b->row[slot], &f);
    }
}

/* The clusters in the order of the tree. */
static void visit_clusters(builder *b, void (*visit)(builder *b, sdm_cluster_node *node))
{
    sdm_features *f = b->f;
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0;
    stack[top++] = 0;
    while (top) {
        sdm_cluster_node *node = &f->node[stack[--top]];
        if (!node->count) {
            stack[top++] = node->first + 1;
            stack[top++] = node->first;
            continue;
        }
        for (int a = 0; a < 3; a++) b->middle[a] = f->centre[a] + (double)sdm_cluster_middle(node, a) / f->scale;
        visit(b, node);
    }
}

static void fill_sums(sdm_feature_group *out, bool edges)
{
    for (int k = 0; k < 4; k++) {
        v8f sum = v8_all(0);
        for (int a = 0; a < 3; a++)
            sum += v8_abs(edges && k == 3 ? (v8_load(out->g[1][a]) + v8_load(out->g[2][a])) / 2 : v8_load(out->g[k][a]));
        v8_store(out->sum[k], sum);
    }
}

/* Rows from .. to side by side. */
static void fill_groups(const builder *b, uint32_t from, uint32_t to, bool edges, sdm_feature_group *out)
{
    for (; from < to; from += 8, out++) {
        const uint32_t last = to - 1; // stands in empty lanes
        for (uint32_t lane = 0; lane < 8; lane += 4) {
            const feature_row *row[4];
            for (uint32_t i = 0; i < 4; i++) row[i] = &b->row[from + lane + i < to ? from + lane + i : last];
            for (int a = 0; a < 4; a++) {
                v4f x[4];
                for (int i = 0; i < 4; i++) x[i] = f4_load(a < 3 ? row[i]->g[a] : row[i]->offset);
                f4_transpose(x);
                for (int k = 0; k < 4; k++) f4_store(a < 3 ? &out->g[k][a][lane] : &out->offset[k][lane], x[k]);
            }
        }
        for (uint32_t lane = 0; lane < 8; lane++)
            for (int k = 0; k < 2; k++) out->most[k][lane] = b->row[from + lane < to ? from + lane : last].most[k];
        for (uint32_t lane = to - from; lane < 8; lane++) out->offset[0][lane] = INFINITY;
        fill_sums(out, edges);
    }
}

/* The same of corners. */
static void fill_corner_groups(const builder *b, uint32_t from, uint32_t to, sdm_feature_group *out)
{
    for (; from < to; from += SDM_CORNER_LANES, out++) {
        memset(out, 0, sizeof *out);
        for (uint32_t lane = 0; lane < SDM_CORNER_LANES; lane++) {
            if (from + lane >= to) {
                out->offset[0][lane] = INFINITY;
                continue;
            }
            const corner_row *c = &b->along[from + lane - b->f->corner_base];
            for (uint32_t k = 0; k < CORNER_EDGES; k++) {
                const uint32_t i = k % 3, at = lane + k / 3 * SDM_CORNER_LANES;
                for (int a = 0; a < 3; a++) {
                    out->g[i][a][at] = c->along[a][k];
                    out->offset[i][at] -= c->along[a][k] * c->at[a];
                    out->g[3][a][at] = c->at[a];
                }
            }
        }
        fill_sums(out, false);
    }
}

static sdm_status add_groups(const builder *b, sdm_error *err)
{
    sdm_features *f = b->f;
    const sdm_status s = SDM_TAKE_UNSET(b->arena, SDM_LOW, &f->group, b->n_group, "features", err);
    for (size_t i = 0; i < b->tree->n_node && !s; i++) {
        const sdm_cluster_node *node = &f->node[i];
        // others are below a cluster
        if (!node->count || node->edge_end + node->corner_end == 0) continue;
        fill_groups(b, node->first, node->first + node->count, false, &f->group[node->group]);
        sdm_feature_group *edges = &f->group[node->group + 1];
        fill_groups(b, node->edge, node->edge_end, true, edges);
        fill_corner_groups(b, node->corner, node->corner_end, edges + (node->edge_end - node->edge + 7) / 8);
    }
    return s;
}

static sdm_status allocate(builder *b, sdm_error *err)
{
    sdm_features *f = b->f;
    const size_t n = b->m->n_tri, n_vert = b->m->n_vert;
    sdm_status s = SDM_TAKE_UNSET(b->arena, SDM_HIGH, &b->slot_of, n, "features", err);
    if (!s) s = SDM_TAKE_UNSET(b->arena, SDM_HIGH, &b->edge, b->topo->n_edges, "features", err);
    if (!s) s = SDM_TAKE_UNSET(b->arena, SDM_HIGH, &b->corner, n_vert, "features", err);
    if (!s) s = SDM_TAKE_UNSET(b->arena, SDM_HIGH, &b->first_side, n, "features", err);
    if (!s) s = SDM_TAKE_UNSET(b->arena, SDM_HIGH, &b->along, n_vert, "features", err);
    if (!s) s = SDM_TAKE_UNSET(b->arena, SDM_HIGH, &b->row, f->corner_base, "features", err);
    if (!s) s = SDM_TAKE(b->arena, SDM_LOW, &f->node, b->tree->n_node, "features", err);
    if (!s) s = SDM_TAKE_UNSET(b->arena, SDM_LOW, &f->centroid, n, "features", err);
    if (!s) s = SDM_TAKE_UNSET(b->arena, SDM_LOW, &f->exact, f->corner_base + n_vert, "features", err);
    if (!s) s = SDM_TAKE_UNSET(b->arena, SDM_LOW, &f->of_slot, n, "features", err);
    if (!s) s = SDM_TAKE_UNSET(b->arena, SDM_LOW, &f->owner, f->corner_base + n_vert, "features", err);
    if (s) return s;
    memset(b->edge, 0xff, b->topo->n_edges * sizeof *b->edge);
    memset(b->corner, 0xff, n_vert * sizeof *b->corner);
    return SDM_OK;
}

size_t sdm_features_bytes(size_t n_tri, size_t n_vert, size_t *scratch)
{
    // edges: every triangle may have three of its own, or be one
    const size_t rows = 4 * n_tri;
    *scratch += rows * sizeof(feature_row) + n_tri * (4 * sizeof(uint32_t) + 1) +
                n_vert * (sizeof(uint32_t) + sizeof(corner_row));
    // every triangle may be a cluster, whose edges and corners end with a group
    const size_t groups = 3 * n_tri + rows / 8 + n_vert / SDM_CORNER_LANES;
    return groups * sizeof(sdm_feature_group) +
           n_tri * (2 * sizeof(sdm_cluster_node) + sizeof(float[3]) + sizeof(uint32_t[6])) +
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
        b.n_edge = f->edge_base;
        b.n_corner = f->corner_base;
        visit_clusters(&b, fill_faces);
        visit_clusters(&b, fill_edges_and_corners);
        if (f->any_thin) visit_clusters(&b, fill_thin_faces);
        f->end = b.n_corner;
        s = add_groups(&b, err);
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}
