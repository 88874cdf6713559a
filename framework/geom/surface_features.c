/* The features of a surface and their regions. */
#include "surface_features.h"

#include <math.h>
#include <string.h>

#include "clusters.h"
#include "sdm/memory.h"
#include "vec3.h"

// a face lower than this share of its length has no reliable direction into it from an edge
#define LOWEST 1e-6
// a face lower than this share of its length is thin: its angles are too small for float
#define THIN 0.02f

typedef struct builder {
    const sdm_mesh *m;
    const sdm_topology *topo;
    const sdm_frame *frames;
    sdm_features *f;
    const uint32_t *tri_of; /* [n_tri] triangle of a slot: the order */
    uint32_t *slot_of;      /* [n_tri] */
    uint32_t *sorted;       /* [n_tri] slots by cluster */
    uint32_t *edge;         /* [n_edges] number of an edge of the topology */
    uint32_t *corner;       /* [n_vert] number of a corner */
    uint8_t *count;         /* directions of a corner so far */
    float (*mid)[4], (*box)[6];
} builder;

static const double *vertex(const builder *b, size_t v) { return &b->m->vert[3 * v]; }

/* Function k of a face or edge: the distance in direction g from `through`. */
static void set_function(sdm_features *f, sdm_feature_group *group, uint32_t number, int k, const double g[3],
                         const double through[3])
{
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        const float x = (float)g[i];
        f->row[number].g[k][i] = group->g[k][i][number % 8] = x;
        sum += (double)x * (f->centre[i] - through[i]);
    }
    group->offset[k][number % 8] = (float)(sum * f->scale);
}

/* Outward across edge k of the frame, in the plane. */
static void across(const sdm_frame *t, int k, double g[3])
{
    const double ex[3] = {1, t->e1x, t->e2x}, ey[3] = {0, t->e1y, t->e2y};
    for (int i = 0; i < 3; i++) g[i] = ey[k] * t->u[i] - ex[k] * t->v[i];
}

static void set_thin(sdm_features *f, uint32_t number, const sdm_frame *t, const double end[3])
{
    sdm_feature_group *group = &f->face[number / 8];
    const double low = sdm_frame_height(t);
    double g[3], above[3];
    f->thin[number / 8] = (uint8_t)(f->thin[number / 8] | 1u << number % 8);
    set_function(f, group, number, 0, t->u, end);
    for (int i = 0; i < 3; i++) g[i] = -t->u[i];
    set_function(f, group, number, 1, g, t->a);
    for (int i = 0; i < 3; i++) g[i] = -t->v[i];
    set_function(f, group, number, 2, g, t->a);
    v3_along(t->a, low, t->v, above);
    set_function(f, group, number, 3, t->v, above);
    f->row[number].at_anchor[0] = (float)(-2 * t->half[0] * f->scale);
    f->row[number].at_anchor[2] = (float)(-low * f->scale);
}

static void add_face(sdm_features *f, uint32_t number, uint32_t slot, const sdm_frame *t)
{
    sdm_feature_group *group = &f->face[number / 8];
    sdm_feature *x = &f->exact[number];
    const double length = 2 * t->half[0];
    double g[3], end[3];
    f->slot[number] = f->owner[number] = slot;
    memcpy(x->a, t->a, sizeof x->a);
    memcpy(x->u, t->n, sizeof x->u);
    x->face = -1;
    v3_along(t->a, length, t->u, end);
    if (t->flat != 0) return;
    if (sdm_frame_height(t) < (double)THIN * length) {
        set_thin(f, number, t, end);
        return;
    }
    for (int k = 0; k < 3; k++) {
        across(t, k, g);
        // edges 0 and 2 pass through a, edge 1 through the end of edge 0
        set_function(f, group, number, k, g, k == 1 ? end : t->a);
        if (k == 1) f->row[number].at_anchor[1] = (float)(-v3_dot(g, t->u) * length * f->scale);
    }
    set_function(f, group, number, 3, t->n, t->a);
}

/* The edge from a to b; returns its middle. */
static void add_segment(sdm_features *f, uint32_t number, const double a[3], const double b[3], double middle[3])
{
    sdm_feature *x = &f->exact[number];
    sdm_feature_group *group = &f->edge[(number - f->edge_base) / 8];
    double w[3];
    for (int i = 0; i < 3; i++) {
        x->a[i] = a[i];
        w[i] = (b[i] - a[i]) * f->scale;
        middle[i] = 0.5 * a[i] + 0.5 * b[i];
    }
    const double length = v3_norm(w);
    for (int i = 0; i < 3; i++) {
        x->u[i] = length > 0 ? w[i] / length : 0;
        group->g[3][i][number % 8] = (float)((middle[i] - f->centre[i]) * f->scale);
    }
    x->length = length / f->scale;
    set_function(f, group, number, 0, x->u, middle);
    group->offset[3][number % 8] = f->row[number].at_anchor[0] = (float)(0.5 * length);
}

/* The conditions of up to two of the faces of an edge; missing ones stay 0 <= 0. */
static void add_sides(const builder *w, const sdm_edge *e, uint32_t number, const double middle[3])
{
    sdm_features *f = w->f;
    int k = 1;
    for (uint32_t h = e->first; h != SDM_NONE && k < 3; h = w->topo->next[h]) {
        const sdm_frame *t = &w->frames[w->slot_of[h / 3]];
        const int i = (int)((h % 3 + 3 - (uint32_t)t->rotation) % 3);
        if (t->flat != 0 || !(sdm_frame_height(t) > LOWEST * 2 * t->half[0])) continue;
        double g[3];
        across(t, i, g);
        for (int c = 0; c < 3; c++) g[c] = -g[c];
        set_function(f, &f->edge[(number - f->edge_base) / 8], number, k++, g, middle);
    }
}

static void add_direction(const builder *w, uint32_t corner, const double u[3], float sign)
{
    const uint32_t at = corner - w->f->corner_base;
    sdm_corner_group *c = &w->f->corner[at / 8];
    if (w->count[at] == SDM_CORNER_EDGES) return;
    // the first one fills all
    const int end = w->count[at] ? w->count[at] + 1 : SDM_CORNER_EDGES;
    for (int k = w->count[at]; k < end; k++)
        for (int i = 0; i < 3; i++) c->along[k][i][at % 8] = sign * (float)u[i];
    w->count[at]++;
}

static void measure(builder *b)
{
    sdm_features *f = b->f;
    double lo[3] = {INFINITY, INFINITY, INFINITY}, hi[3] = {-INFINITY, -INFINITY, -INFINITY}, d[3], longest = 0;
    for (size_t i = 0; i < 3 * b->m->n_tri; i++) {
        const double *v = vertex(b, b->m->tri[i]);
        for (int a = 0; a < 3; a++) {
            lo[a] = v[a] < lo[a] ? v[a] : lo[a];
            hi[a] = v[a] > hi[a] ? v[a] : hi[a];
        }
    }
    for (int a = 0; a < 3; a++) {
        d[a] = hi[a] - lo[a];
        f->centre[a] = lo[a] + 0.5 * d[a];
    }
    f->radius = 0.5 * v3_norm(d);
    for (size_t i = 0; i < b->m->n_tri; i++) longest = b->frames[i].half[0] > longest ? b->frames[i].half[0] : longest;
    int exponent = 0;
    // without any edge the whole surface is the measure
    const double size = longest > 0 ? 2 * longest : f->radius;
    if (size > 0) (void)frexp(size, &exponent);
    f->scale = ldexp(1, -exponent);
    for (uint32_t slot = 0; slot < b->m->n_tri; slot++) {
        const uint32_t *t = &b->m->tri[3 * (size_t)b->tri_of[slot]];
        float x[3][3];
        for (int k = 0; k < 3; k++)
            for (int a = 0; a < 3; a++) x[k][a] = (float)((vertex(b, t[k])[a] - f->centre[a]) * f->scale);
        for (int a = 0; a < 3; a++) {
            const float p = x[0][a], q = x[1][a], r = x[2][a];
            b->mid[slot][a] = (p + q + r) / 3;
            b->box[slot][a] = p < q ? (p < r ? p : r) : (q < r ? q : r);
            b->box[slot][3 + a] = p > q ? (p > r ? p : r) : (q > r ? q : r);
        }
        b->sorted[slot] = slot;
        b->slot_of[b->tri_of[slot]] = slot;
    }
}

/* Numbers edges and corners as the clusters meet them; a triangle with a repeated vertex is a segment of its own. */
static void number_features(builder *b)
{
    sdm_features *f = b->f;
    uint32_t e = 0, c = 0;
    memset(b->edge, 0xff, b->topo->n_edges * sizeof *b->edge);
    memset(b->corner, 0xff, b->m->n_vert * sizeof *b->corner);
    f->edge_base = (uint32_t)(8 * f->n_cluster);
    for (size_t i = 0; i < f->n_cluster; i++) {
        f->edge_first[i] = (e + 7) / 8;
        f->corner_first[i] = (c + 7) / 8;
        e = 8 * f->edge_first[i];
        c = 8 * f->corner_first[i];
        for (size_t at = 8 * i; at < 8 * i + 8 && at < b->m->n_tri; at++) {
            const size_t t = b->tri_of[b->sorted[at]];
            e += b->topo->edge[3 * t] == SDM_NONE;
            for (size_t k = 3 * t; k < 3 * t + 3; k++) {
                const uint32_t x = b->topo->edge[k], v = b->topo->tri[k];
                if (x != SDM_NONE && b->edge[x] == SDM_NONE) b->edge[x] = f->edge_base + e++;
                if (b->corner[v] == SDM_NONE) b->corner[v] = c++;
            }
        }
    }
    f->edge_first[f->n_cluster] = (e + 7) / 8;
    f->corner_first[f->n_cluster] = (c + 7) / 8;
    f->corner_base = f->edge_base + 8 * f->edge_first[f->n_cluster];
    f->end = f->corner_base + 8 * f->corner_first[f->n_cluster];
    for (size_t v = 0; v < b->m->n_vert; v++)
        if (b->corner[v] != SDM_NONE) b->corner[v] += f->corner_base;
}

static sdm_status allocate(sdm_features *f, size_t n_tri, sdm_error *err)
{
    const size_t n_edge = f->edge_first[f->n_cluster], n_corner = f->corner_first[f->n_cluster];
    sdm_status s = SDM_ALLOC(&f->slot, 8 * f->n_cluster, "features", err);
    if (!s) s = SDM_ALLOC(&f->face, f->n_cluster, "features", err);
    if (!s) s = SDM_ALLOC(&f->centroid, f->n_cluster, "features", err);
    if (!s) s = SDM_ALLOC(&f->thin, f->n_cluster, "features", err);
    if (!s) s = SDM_ALLOC(&f->edge, n_edge, "features", err);
    if (!s) s = SDM_ALLOC(&f->corner, n_corner, "features", err);
    if (!s) s = SDM_ALLOC(&f->exact, f->end, "features", err);
    if (!s) s = SDM_ALLOC(&f->row, f->corner_base, "features", err);
    if (!s) s = SDM_ALLOC(&f->of_slot, n_tri, "features", err);
    if (!s) s = SDM_ALLOC(&f->owner, f->end, "features", err);
    if (s) return s;
    // lanes are empty until they are filled
    memset(f->slot, 0xff, 8 * f->n_cluster * sizeof *f->slot);
    for (size_t i = 0; i < 8 * f->n_cluster; i++) f->face[i / 8].offset[0][i % 8] = INFINITY;
    for (size_t i = 0; i < 8 * n_edge; i++) f->edge[i / 8].offset[0][i % 8] = INFINITY;
    for (size_t i = 0; i < 8 * n_corner; i++) f->corner[i / 8].at[0][i % 8] = SDM_NOWHERE;
    return SDM_OK;
}

/* Faces, segments of triangles with a repeated vertex, and who owns what. */
static void fill_clusters(builder *b)
{
    sdm_features *f = b->f;
    for (size_t i = 0; i < f->n_cluster; i++) {
        uint32_t next = f->edge_base + 8 * f->edge_first[i];
        for (uint32_t number = (uint32_t)(8 * i); number < 8 * i + 8; number++) {
            const bool empty = number >= b->m->n_tri;
            const uint32_t slot = b->sorted[empty ? 8 * i : number];
            for (int a = 0; a < 3; a++) f->centroid[i][a][number % 8] = b->mid[slot][a];
            if (empty) continue;
            const size_t t = b->tri_of[slot];
            const sdm_frame *x = &b->frames[slot];
            add_face(f, number, slot, x);
            f->of_slot[slot][0] = number;
            if (b->topo->edge[3 * t] == SDM_NONE) {
                double end[3], middle[3];
                v3_along(x->a, 2 * x->half[0], x->u, end);
                f->owner[next] = slot;
                for (int k = 1; k < 4; k++) f->of_slot[slot][k] = next;
                add_segment(f, next++, x->a, end, middle);
            }
            for (size_t k = 3 * t; k < 3 * t + 3; k++) {
                const uint32_t e = b->topo->edge[k], corner = b->corner[b->topo->tri[k]];
                f->owner[corner] = slot;
                f->of_slot[slot][4 + k - 3 * t] = corner;
                if (e == SDM_NONE) continue;
                f->of_slot[slot][1 + k - 3 * t] = b->edge[e];
                f->owner[b->edge[e]] = slot;
                // numbers of this cluster are given in the same order as above
                if (b->edge[e] >= next && b->edge[e] < f->edge_base + 8 * f->edge_first[i + 1]) next = b->edge[e] + 1;
            }
        }
    }
}

static void fill_edges_and_corners(builder *b)
{
    sdm_features *f = b->f;
    for (size_t v = 0; v < b->m->n_vert; v++) {
        if (b->corner[v] == SDM_NONE) continue;
        const uint32_t at = b->corner[v] - f->corner_base;
        memcpy(f->exact[b->corner[v]].a, vertex(b, v), 3 * sizeof(double));
        for (int i = 0; i < 3; i++)
            f->corner[at / 8].at[i][at % 8] = (float)((vertex(b, v)[i] - f->centre[i]) * f->scale);
    }
    for (size_t i = 0; i < b->topo->n_edges; i++) {
        if (b->edge[i] == SDM_NONE) continue;
        const sdm_edge *e = &b->topo->edges[i];
        double middle[3];
        add_segment(f, b->edge[i], vertex(b, e->lo), vertex(b, e->hi), middle);
        add_sides(b, e, b->edge[i], middle);
        const double *u = f->exact[b->edge[i]].u;
        add_direction(b, b->corner[e->lo], u, 1);
        add_direction(b, b->corner[e->hi], u, -1);
    }
}

size_t sdm_features_bytes(size_t n_tri, size_t n_vert, size_t *scratch)
{
    // a cluster that meets few new edges still takes a group of eight
    const size_t clusters = (n_tri + 7) / 8, edges = 3 * n_tri + 8 * clusters, corners = n_vert + 8 * clusters;
    *scratch += n_tri * (2 * sizeof(uint32_t) + 10 * sizeof(float)) + 3 * n_tri * sizeof(uint32_t) +
                n_vert * sizeof(uint32_t) + corners;
    return clusters * (sizeof(sdm_feature_group) + 2 * sizeof(sdm_cluster_node) + sizeof(float[3][8]) + 48) +
           edges / 8 * sizeof(sdm_feature_group) + corners / 8 * sizeof(sdm_corner_group) +
           (8 * clusters + edges + corners) * (sizeof(sdm_feature) + sizeof(uint32_t)) +
           (8 * clusters + edges) * sizeof(sdm_feature_row) + n_tri * sizeof(uint32_t[7]);
}

sdm_status sdm_features_build(const sdm_mesh *m, const sdm_topology *topo, const sdm_frame *frames,
                              const uint32_t *order, sdm_features *f, sdm_error *err)
{
    const size_t n = m->n_tri;
    builder b = {.m = m, .topo = topo, .frames = frames, .f = f, .tri_of = order};
    f->n_cluster = (n + 7) / 8;
    // every group ends with its cluster
    if (32 * f->n_cluster + topo->n_edges + m->n_vert + n >= SDM_NONE)
        return sdm_fail(err, SDM_E_NOMEM, "surface of %zu triangles: too many to number their edges and vertices", n);
    sdm_status s = SDM_ALLOC(&b.slot_of, n, "features", err);
    if (!s) s = SDM_ALLOC(&b.sorted, n, "features", err);
    if (!s) s = SDM_ALLOC(&b.edge, topo->n_edges, "features", err);
    if (!s) s = SDM_ALLOC(&b.corner, m->n_vert, "features", err);
    if (!s) s = SDM_ALLOC(&b.mid, n, "features", err);
    if (!s) s = SDM_ALLOC(&b.box, n, "features", err);
    if (!s) s = SDM_ALLOC(&f->node, 2 * f->n_cluster, "features", err);
    if (!s) s = SDM_ALLOC(&f->edge_first, f->n_cluster + 1, "features", err);
    if (!s) s = SDM_ALLOC(&f->corner_first, f->n_cluster + 1, "features", err);
    if (s) goto done;
    measure(&b);
    f->n_node = sdm_clusters_build(b.mid, b.box, b.sorted, n, f->node);
    number_features(&b);
    s = allocate(f, n, err);
    if (!s) s = SDM_ALLOC(&b.count, f->end - f->corner_base, "features", err);
    if (s) goto done;
    fill_clusters(&b);
    fill_edges_and_corners(&b);
done:
    sdm_free(b.slot_of);
    sdm_free(b.sorted);
    sdm_free(b.edge);
    sdm_free(b.corner);
    sdm_free(b.count);
    sdm_free(b.mid);
    sdm_free(b.box);
    return s;
}

void sdm_features_dispose(sdm_features *f)
{
    sdm_free(f->node);
    sdm_free(f->slot);
    sdm_free(f->face);
    sdm_free(f->centroid);
    sdm_free(f->thin);
    sdm_free(f->edge_first);
    sdm_free(f->corner_first);
    sdm_free(f->edge);
    sdm_free(f->corner);
    sdm_free(f->exact);
    sdm_free(f->row);
    sdm_free(f->of_slot);
    sdm_free(f->owner);
    *f = (sdm_features){0};
}
