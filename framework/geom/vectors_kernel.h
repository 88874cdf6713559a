/* From the features of a tile to the candidates of its vectors. Part of the map kernels. */
#ifndef SDM_GEOM_VECTORS_KERNEL_H
#define SDM_GEOM_VECTORS_KERNEL_H

#include "tiles_kernel.h"

typedef struct tile {
    const sdm_grid_job *job;
    sdm_grid_scratch *s;
    const sdm_candidates *in;
    int number;       /* in the block */
    int64_t first[3]; /* voxel */
    double corner[3]; /* mm: its first voxel */
    int wanted;       /* vectors that begin inside the grid */
    float error;      /* bound on the error of a linear function */
} tile;

/* Nearest features to the middles of the vectors. */
typedef struct nearest8 {
    v8f d;
    point8 g;
} nearest8;

/* sure: lanes in which a point of the surface is at that distance. */
static inline void offer(nearest8 *best, sight8 s, v8i sure)
{
    const v8i m = sure & (s.d < best->d);
    best->d = v8_select(m, s.d, best->d);
    best->g = (point8){v8_select(m, s.g.x, best->g.x), v8_select(m, s.g.y, best->g.y), v8_select(m, s.g.z, best->g.z)};
}

static inline void put_sight(sdm_sight *to, sight8 s)
{
    v8_store(to->d, s.d);
    p8_store(to->g, s.g);
}

static inline float most_of(v4f reach)
{
    const float two = reach[0] > reach[1] ? reach[0] : reach[1];
    return two > reach[2] ? two : reach[2];
}

/* Distances and regions of the features at the vectors. */
static void measure_features(const tile *t, point8 p, nearest8 *best)
{
    const sdm_grid_job *job = t->job;
    const sdm_grid_parts *q = &job->part[SDM_TO_VECTORS];
    const sdm_candidates *in = t->in;
    sdm_grid_scratch *s = t->s;
    const v8f zero = v8_all(0);
    for (size_t i = in->begin[SDM_FACES]; i < in->end[SDM_FACES]; i++) {
        const sdm_feature_row *r = &s->row[in->list[i]];
        const row4 x = load_row(r);
        const v4f reach = reach_of(q, job->aligned, &x, t->error);
        const float4 low = lowered(&x, reach);
        const v8f beyond = beyond_face(r, &low, p);
        const sight8 sight = see_face(r, p);
        s->hit[i] = (uint8_t)~v8_greater(beyond, zero);
        put_sight(&s->sight[i], sight);
        const float most = most_of(reach) + t->error;
        // surely above the face itself: the distance to the surface must not be taken too low
        offer(best, sight, beyond < v8_all(-most));
    }
    for (size_t i = in->begin[SDM_THIN_FACES]; i < in->end[SDM_THIN_FACES]; i++) {
        const sdm_feature_row *r = &s->row[in->list[i]];
        const row4 x = load_row(r);
        const float4 low = lowered(&x, reach_of(q, job->aligned, &x, t->error));
        s->hit[i] = (uint8_t)~v8_greater(beyond_thin_face(r, &low, p), zero);
        // never too far
        put_sight(&s->sight[i], (sight8){zero, {zero, zero, zero}});
    }
    for (size_t i = in->begin[SDM_EDGES]; i < in->end[SDM_EDGES]; i++) {
        const sdm_feature_row *r = &s->row[in->list[i]];
        const row4 x = load_row(r);
        const v4f reach = reach_of(q, job->aligned, &x, t->error);
        const float4 low = lowered(&x, reach);
        const v8f along = function8(r, 0, r->offset[0], p);
        const sight8 sight = see_edge(r, along, p);
        s->hit[i] = (uint8_t)~v8_greater(beyond_edge(r, &low, along, r->offset[3] + reach[0], p), zero);
        put_sight(&s->sight[i], sight);
        offer(best, sight, v8_abs(along) < v8_all(r->offset[3]));
    }
    for (size_t i = in->begin[SDM_CORNERS]; i < in->end[SDM_CORNERS]; i++) {
        const point8 at = point_of(&s->row[in->list[i]]);
        const sdm_corner_row *k = &job->features->corner[s->number[in->list[i]] - job->features->corner_base];
        const sight8 sight = see_point(at, p);
        s->hit[i] = (uint8_t)~v8_greater(beyond_corner_part(q, job->aligned, k, t->error, p8_sub(p, at)), zero);
        put_sight(&s->sight[i], sight);
        offer(best, sight, v8_all_i(-1));
    }
}

/* Candidates of the vectors among the features of the tile. */
static void choose_candidates(const tile *t)
{
    const sdm_grid_job *job = t->job;
    const sdm_grid_parts *q = &job->part[SDM_TO_VECTORS];
    sdm_grid_scratch *s = t->s;
    const point8 p = p8_load((const float(*)[8])job->vector[t->number].x);
    const v8f zero = v8_all(0);
    nearest8 best = {v8_all(INFINITY), {zero, zero, zero}};
    measure_features(t, p, &best);
    const view8 v = view_from(job, q, p, best.d, best.g);
    for (int kind = 0; kind < SDM_FEATURE_KINDS; kind++) {
        const size_t from = t->in->begin[kind], to = t->in->end[kind];
        for (size_t i = from; i < to; i++) {
            const sight8 sight = {v8_load(s->sight[i].d), p8_load((const float(*)[8])s->sight[i].g)};
            s->hit[i] &= (uint8_t)near_parts(q, job->aligned, &v, sight);
        }
        list_hits(job, s->hit, t->in->list, from, to, s->vector, kind);
    }
}

#endif
