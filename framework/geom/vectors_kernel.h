/* From the features of a tile to the candidates of its vectors: those whose region a vector meets. Part of the map kernels. */
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

/* Vectors that meet the regions of the features. */
static void meet_vectors(const tile *t, point8 p)
{
    const sdm_grid_job *job = t->job;
    const sdm_grid_parts *q = &job->part[SDM_TO_VECTORS];
    const sdm_candidates *in = t->in;
    const sdm_grid_scratch *s = t->s;
    const v8f zero = v8_all(0);
    for (size_t i = in->begin[SDM_FACES]; i < in->end[SDM_FACES]; i++) {
        const sdm_feature_row *r = &s->row[in->list[i]];
        const row4 x = load_row(r);
        const float4 low = lowered(&x, reach_of(q, job->aligned, &x, t->error));
        s->hit[i] = (uint8_t)~v8_greater(beyond_face(r, &low, p), zero);
    }
    for (size_t i = in->begin[SDM_THIN_FACES]; i < in->end[SDM_THIN_FACES]; i++) {
        const sdm_feature_row *r = &s->row[in->list[i]];
        const row4 x = load_row(r);
        const float4 low = lowered(&x, reach_of(q, job->aligned, &x, t->error));
        s->hit[i] = (uint8_t)~v8_greater(beyond_thin_face(r, &low, p), zero);
    }
    for (size_t i = in->begin[SDM_EDGES]; i < in->end[SDM_EDGES]; i++) {
        const sdm_feature_row *r = &s->row[in->list[i]];
        const row4 x = load_row(r);
        const v4f reach = reach_of(q, job->aligned, &x, t->error);
        const float4 low = lowered(&x, reach);
        const v8f along = function8(r, 0, r->offset[0], p);
        s->hit[i] = (uint8_t)~v8_greater(beyond_edge(r, &low, along, r->offset[3] + reach[0], p), zero);
    }
    for (size_t i = in->begin[SDM_CORNERS]; i < in->end[SDM_CORNERS]; i++) {
        const sdm_corner_row *k = &job->features->corner[s->number[in->list[i]] - job->features->corner_base];
        const point8 x = p8_sub(p, point_of(&s->row[in->list[i]]));
        s->hit[i] = (uint8_t)~v8_greater(beyond_corner_part(q, job->aligned, k, t->error, x), zero);
    }
}

/* Candidates of the vectors among the features of the tile. */
static void choose_candidates(const tile *t)
{
    const sdm_grid_job *job = t->job;
    meet_vectors(t, p8_load((const float(*)[8])job->vector[t->number].x));
    for (int kind = 0; kind < SDM_FEATURE_KINDS; kind++)
        list_hits(job, t->s->hit, t->in->list, t->in->begin[kind], t->in->end[kind], t->s->vector, kind);
}

#endif
