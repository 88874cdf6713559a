/* From the features of a tile to the candidates of its vectors. Part of the map kernels. */
#ifndef SDM_GEOM_VECTORS_KERNEL_H
#define SDM_GEOM_VECTORS_KERNEL_H

#include "clusters_kernel.h"

typedef struct tile {
    const sdm_grid_job *job;
    sdm_grid_scratch *s;
    int64_t first[3];                /* voxel */
    double middle[3], corner[3];     /* mm: of the tile, of its first voxel */
    int wanted;                      /* vectors that begin inside the grid */
    size_t begin[SDM_FEATURE_KINDS]; /* groups of each kind */
    size_t end[SDM_FEATURE_KINDS];
    float error; /* bound on the error of a linear function */
} tile;

/* Anchors of eight features relative to the middle of the tile. */
static inline point8 anchors(const tile *t, const uint32_t number[8])
{
    const sdm_features *f = t->job->features;
    v4d x[2][4];
    for (int h = 0; h < 2; h++) {
        for (int i = 0; i < 4; i++) x[h][i] = v4_load(f->exact[number[4 * h + i]].a);
        v4_transpose(x[h]);
        for (int a = 0; a < 3; a++) x[h][a] = (x[h][a] - v4_all(t->middle[a])) * v4_all(f->scale);
    }
    return (point8){v8_narrow(x[0][0], x[1][0]), v8_narrow(x[0][1], x[1][1]), v8_narrow(x[0][2], x[1][2])};
}

static inline void put_function(sdm_feature_group *k, int j, point8 g, v8f offset)
{
    p8_store(k->g[j], g);
    v8_store(k->offset[j], offset);
}

/* The functions of eight features relative to the middle of the tile. */
static inline void localise_group(const tile *t, int kind, const uint32_t number[8], sdm_feature_group *out)
{
    const point8 a = anchors(t, number);
    if (kind == SDM_CORNERS) {
        p8_store(out->g[0], a);
        return;
    }
    v8f r[16];
    for (int i = 0; i < 8; i++) {
        const float *row = (const float *)(const void *)&t->job->features->row[number[i]];
        r[i] = v8_load(row);
        r[8 + i] = v8_load(row + 8);
    }
    v8_transpose(r);
    v8_transpose(r + 8);
    const point8 g[4] = {{r[0], r[1], r[2]}, {r[3], r[4], r[5]}, {r[6], r[7], r[8]}, {r[9], r[10], r[11]}};
    const v8f zero = v8_all(0);
    if (kind == SDM_FACES) {
        put_function(out, 0, g[0], r[12] - p8_dot(g[0], a));
        put_function(out, 1, g[1], r[13] - p8_dot(g[1], a));
        put_function(out, 2, g[2], zero - p8_dot(g[2], a));
        put_function(out, 3, g[3], r[14] - p8_dot(g[3], a));
        return;
    }
    const point8 m = p8_add(a, p8_scale(g[0], r[12]));
    for (int j = 0; j < 3; j++) put_function(out, j, g[j], zero - p8_dot(g[j], m));
    put_function(out, 3, m, r[12]);
}

static void localise(tile *t, const sdm_candidates *in)
{
    sdm_grid_scratch *s = t->s;
    const uint8_t *thin = t->job->features->thin;
    size_t group = 0;
    for (int kind = 0; kind < SDM_FEATURE_KINDS; kind++) {
        t->begin[kind] = group;
        for (size_t i = 0; i < in->n[kind]; i += 8, group++) {
            uint32_t *number = &s->number[8 * group];
            sdm_feature_group *k = &s->local[group];
            const size_t n = in->n[kind] - i < 8 ? in->n[kind] - i : 8;
            for (size_t j = 0; j < 8; j++) number[j] = in->list[kind][i + (j < n ? j : 0)];
            localise_group(t, kind, number, k);
            s->thin[group] = 0;
            for (size_t j = 0; j < n && kind == SDM_FACES; j++)
                s->thin[group] = (uint8_t)(s->thin[group] | (thin[number[j] / 8] >> number[j] % 8 & 1) << j);
            // the same feature twice would be a tie
            for (size_t j = n; j < 8; j++)
                if (kind == SDM_CORNERS)
                    k->g[0][0][j] = SDM_NOWHERE;
                else
                    k->offset[0][j] = INFINITY;
        }
        t->end[kind] = group;
    }
}

/* Nearest features to the middles of the vectors: lanes of the groups, -1 for none. */
typedef struct nearest8 {
    v8f d[8]; /* [vector], lane by lane */
    v8i lane[8];
} nearest8;

static inline void offer_group(nearest8 *best, int v, v8i valid, v8f d, size_t group)
{
    const v8i nearer = valid & (d < best->d[v]);
    best->d[v] = v8_select(nearer, d, best->d[v]);
    best->lane[v] = v8_select_i(nearer, v8_from_i((int32_t)(8 * group)), best->lane[v]);
}

static void measure_faces(const tile *t, nearest8 *best)
{
    const sdm_grid_parts *q = &t->job->part[SDM_TO_VECTORS];
    sdm_grid_scratch *s = t->s;
    const v8f error = v8_all(t->error), zero = v8_all(0);
    for (size_t i = t->begin[SDM_FACES]; i < t->end[SDM_FACES]; i++) {
        const sdm_feature_group *k = &s->local[i];
        const v8i sound = v8_lanes(0xffu & ~(unsigned)s->thin[i]);
        v8f reach[3];
        for (int j = 0; j < 3; j++) reach[j] = extent(q, t->job->aligned, gradient(k, j)) + error;
        for (int v = 0; v < 8; v++) {
            const point8 p = p8_all(q->middle.x[0][v], q->middle.x[1][v], q->middle.x[2][v]);
            v8f h[3];
            for (int j = 0; j < 3; j++) h[j] = value(k, j, v8_load(k->offset[j]), p);
            const v8f over = v8_max(h[0] - reach[0], v8_max(h[1] - reach[1], h[2] - reach[2]));
            const v8f d = v8_abs(value(k, 3, v8_load(k->offset[3]), p));
            s->hit[i][v] = (uint8_t)(0xff & ~v8_greater(over, zero));
            v8_store(s->distance[i][v], d);
            // surely above the face itself: the distance to the surface must not be taken too low
            offer_group(best, v, sound & (v8_max(h[0], v8_max(h[1], h[2])) + error < zero), d, i);
        }
    }
}

static void measure_edges(const tile *t, nearest8 *best)
{
    const sdm_grid_parts *q = &t->job->part[SDM_TO_VECTORS];
    sdm_grid_scratch *s = t->s;
    const v8f error = v8_all(t->error), zero = v8_all(0);
    for (size_t i = t->begin[SDM_EDGES]; i < t->end[SDM_EDGES]; i++) {
        const sdm_feature_group *k = &s->local[i];
        v8f reach[3];
        for (int j = 0; j < 3; j++) reach[j] = extent(q, t->job->aligned, gradient(k, j)) + error;
        for (int v = 0; v < 8; v++) {
            const point8 p = p8_all(q->middle.x[0][v], q->middle.x[1][v], q->middle.x[2][v]);
            v8f h[3];
            for (int j = 0; j < 3; j++) h[j] = value(k, j, v8_load(k->offset[j]), p);
            const v8f beyond = v8_abs(h[0]) - v8_load(k->offset[3]);
            const v8f over = v8_max(beyond - reach[0], v8_max(h[1] - reach[1], h[2] - reach[2]));
            point8 g;
            const v8f d = length8(p8_sub(p8_sub(p, gradient(k, 3)), p8_scale(gradient(k, 0), h[0])), &g);
            s->hit[i][v] = (uint8_t)(0xff & ~v8_greater(over, zero));
            v8_store(s->distance[i][v], d);
            offer_group(best, v, beyond < zero, d, i);
        }
    }
}

static void measure_corners(const tile *t, nearest8 *best)
{
    const sdm_grid_parts *q = &t->job->part[SDM_TO_VECTORS];
    sdm_grid_scratch *s = t->s;
    for (size_t i = t->begin[SDM_CORNERS]; i < t->end[SDM_CORNERS]; i++)
        for (int v = 0; v < 8; v++) {
            point8 g;
            const point8 p = p8_all(q->middle.x[0][v], q->middle.x[1][v], q->middle.x[2][v]);
            const v8f d = length8(p8_sub(p, gradient(&s->local[i], 0)), &g);
            v8_store(s->distance[i][v], d);
            offer_group(best, v, v8_all_i(-1), d, i);
        }
}

/* Unit vector from a feature of the tile to p, at distance d. */
static inline void direction_from(const tile *t, int32_t lane_of, const float p[3], float d, float g[3])
{
    const size_t group = (size_t)lane_of / 8, lane = (size_t)lane_of % 8;
    const sdm_feature_group *k = &t->s->local[group];
    if (group < t->end[SDM_FACES]) {
        float z = k->offset[3][lane];
        for (int a = 0; a < 3; a++) z += k->g[3][a][lane] * p[a];
        for (int a = 0; a < 3; a++) g[a] = z < 0 ? -k->g[3][a][lane] : k->g[3][a][lane];
        return;
    }
    const bool edge = group < t->end[SDM_EDGES];
    float along = 0;
    for (int a = 0; a < 3; a++) g[a] = p[a] - k->g[edge ? 3 : 0][a][lane];
    for (int a = 0; a < 3 && edge; a++) along += g[a] * k->g[0][a][lane];
    for (int a = 0; a < 3; a++) g[a] = d > 0 ? (g[a] - (edge ? along * k->g[0][a][lane] : 0)) / d : 0;
}

static void refer_vectors(const tile *t, const nearest8 *best, reference8 *n)
{
    const sdm_grid_parts *q = &t->job->part[SDM_TO_VECTORS];
    for (int v = 0; v < 8; v++) {
        int lane = 0;
        for (int i = 1; i < 8; i++) lane = best->d[v][i] < best->d[v][lane] ? i : lane;
        const float p[3] = {q->middle.x[0][v], q->middle.x[1][v], q->middle.x[2][v]};
        float g[3] = {0, 0, 0};
        n->d[v] = best->d[v][lane];
        if (best->lane[v][lane] >= 0) direction_from(t, best->lane[v][lane], p, n->d[v], g);
        for (int a = 0; a < 3; a++) n->g[a][v] = g[a];
    }
    set_limits(t->job, q, n);
}

/* Candidates of the vectors among the features of the tile. */
static void choose_candidates(const tile *t)
{
    const sdm_grid_job *job = t->job;
    const sdm_grid_parts *q = &job->part[SDM_TO_VECTORS];
    sdm_grid_scratch *s = t->s;
    nearest8 best;
    reference8 n;
    for (int v = 0; v < 8; v++) {
        best.d[v] = v8_all(INFINITY);
        best.lane[v] = v8_all_i(-1);
    }
    measure_faces(t, &best);
    measure_edges(t, &best);
    measure_corners(t, &best);
    refer_vectors(t, &best, &n);
    for (int v = 0; v < 8; v++) {
        sdm_candidates *out = &s->vector[v];
        for (int k = 0; k < SDM_FEATURE_KINDS; k++) out->n[k] = 0;
        if (!(t->wanted >> v & 1)) continue;
        const view8 w = view_one(&n, &q->middle, v);
        size_t i = 0;
        for (; i < t->end[SDM_FACES]; i++) {
            const sdm_feature_group *k = &s->local[i];
            const v8f z = value(k, 3, v8_load(k->offset[3]), w.p);
            const point8 u = gradient(k, 3), g = {v8_turn(u.x, z), v8_turn(u.y, z), v8_turn(u.z, z)};
            const int far = v8_greater(v8_load(s->distance[i][v]), limit8(q, job->aligned, &w, g));
            append(job, out, SDM_FACES, (uint32_t)(8 * i), s->hit[i][v] & (s->thin[i] | ~far));
        }
        for (; i < t->end[SDM_CORNERS]; i++) {
            const bool edge = i < t->end[SDM_EDGES];
            const v8f d = v8_load(s->distance[i][v]), inverse = 1 / (d + v8_all(SDM_TINY));
            point8 g = p8_sub(w.p, gradient(&s->local[i], edge ? 3 : 0));
            if (edge) g = p8_sub(g, p8_scale(gradient(&s->local[i], 0), p8_dot(gradient(&s->local[i], 0), g)));
            const int near = ~v8_greater(d, limit8(q, job->aligned, &w, p8_scale(g, inverse)));
            append(job, out, edge ? SDM_EDGES : SDM_CORNERS, (uint32_t)(8 * i), (edge ? s->hit[i][v] : 0xff) & near);
        }
    }
}

#endif
