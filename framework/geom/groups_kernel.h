/* From the clusters of a block to the features whose region it meets. Part of the map kernels. */
#ifndef SDM_GEOM_GROUPS_KERNEL_H
#define SDM_GEOM_GROUPS_KERNEL_H

#include "clusters_kernel.h"
#include "features_kernel.h"

/* The block at hand. */
typedef struct block {
    const sdm_grid_job *job;
    sdm_grid_scratch *s;
    uint8_t wanted[8]; /* vectors of a tile that begin inside the grid */
    unsigned met;      /* tiles that meet the region of some feature */
    float error;       /* bound on the error of a function */
} block;

/* The same for all groups: numbers in all lanes, in a copy, so that no store can change them. */
typedef struct meeting {
    point8 axis[3]; /* as in sdm_grid_parts */
    v8f half;       /* half extents of a cube along x, y, z */
    v8f error, tile, vector; /* shares of what changes within the block */
} meeting;

static inline meeting meeting_of(const block *b)
{
    const sdm_grid_job *job = b->job;
    const sdm_grid_parts *q = &job->part[SDM_TO_BLOCKS];
    meeting w = {.half = v8_all(q->half[0]),
                 .error = v8_all(b->error),
                 .tile = v8_all(job->share[SDM_TO_TILES]),
                 .vector = v8_all(job->share[SDM_TO_VECTORS])};
    for (int a = 0; a < 3; a++) w.axis[a] = p8_all(q->axis[a][0], q->axis[a][1], q->axis[a][2]);
    return w;
}

/* The largest change of a function with gradient g from the middle of the block to its corners. sum: of the sizes of its coordinates. */
SDM_FOR_KIND v8f reach8(const meeting *w, bool cube, point8 g, const float sum[8])
{
    if (cube) return v8_load(sum) * w->half;
    v8f reach = v8_all(0);
    for (int a = 0; a < 3; a++) reach += v8_abs(p8_dot(g, w->axis[a]));
    return reach;
}

/* Fills in what a function is at most at the middles of parts that meet the region, `most` in it; returns the same for the block. */
static inline v8f set_most(const meeting *w, v8f reach, v8f most, sdm_met_group *x, int row)
{
    v8_store(x->most_at_tile[row], v8_fma(reach, w->tile, most));
    v8_store(x->most_at_vector[row], v8_fma(reach, w->vector, most));
    return reach + most;
}

/* The features of a group whose regions meet the block: fills in x, and returns their lanes. */
SDM_FOR_KIND unsigned meet_group(const meeting *w, bool cube, int kind, const sdm_feature_group *k,
                                 const sdm_cluster_ref *c, sdm_met_group *x)
{
    const point8 shift = p8_all(c->shift[0], c->shift[1], c->shift[2]);
    v8f at[4], beyond = v8_all(-INFINITY);
    x->group = k;
    x->cluster = c;
    for (int j = 0; j < (kind == SDM_CORNERS ? 3 : 4); j++) {
        const point8 g = p8_load(k->g[j]);
        at[j] = p8_linear(g, shift, v8_load(k->offset[j]));
        v8_store(x->at_block[j], at[j]);
        if (j == 3 && kind != SDM_THIN_FACES) break;
        const v8f most = kind == SDM_EDGES && j < 2 ? w->error + v8_load(k->most[j]) : w->error;
        const v8f size = kind == SDM_EDGES && j == 0 ? v8_abs(at[j]) : at[j];
        beyond = v8_max(beyond, size - set_most(w, reach8(w, cube, g, k->sum[j]), most, x, j));
    }
    if (kind == SDM_EDGES) {
        const point8 g = p8_add(p8_load(k->g[1]), p8_load(k->g[2]));
        const v8f most = w->error + w->error + v8_load(k->most[1]);
        beyond = v8_max(beyond, at[1] + at[2] - set_most(w, reach8(w, cube, g, k->sum[3]), most, x, 3));
    }
    const unsigned lanes = 0xff & ~(unsigned)v8_greater(beyond, v8_all(0));
    return kind == SDM_CORNERS ? lanes & lanes >> SDM_CORNER_LANES : lanes;
}

/* Keeps the features in some lanes of the group behind the last one. Without branches: who meets the block cannot be foreseen. */
static inline void keep_group(const block *b, sdm_pending *p, uint32_t number, unsigned lanes)
{
    p->met[p->groups].number = number;
    p->n = put_lanes(b->job, p->feature, p->n, (uint32_t)(p->groups * SDM_FLOATS(sdm_met_group)), lanes);
    p->groups += lanes != 0;
}

#endif
