/* From the clusters of a block to the features whose region it meets. Part of the map kernels. */
#ifndef SDM_GEOM_GROUPS_KERNEL_H
#define SDM_GEOM_GROUPS_KERNEL_H

#include "regions.h"
#include "stage2_clusters.h"

/* The block at hand. */
typedef struct block {
    const sdm_grid_job *job;
    sdm_grid_scratch *s;
    uint8_t wanted[8];             /* vectors of a tile that begin inside the grid */
    unsigned met;                  /* tiles that meet the region of some feature */
    float error;                   /* bound on the error of a function */
    _Alignas(32) float far2[8][8]; /* [tile][vector]: what is farther from its middle, squared, is
                                      the nearest of none of its voxels */
    float half[SDM_GRID_STEPS];    /* half extents of it, its tiles and its vectors, as if they were
                                      cubes along x, y, z, see own_sums() */
} block;

static inline bool is_cube(const sdm_grid_job *job)
{
    const float *half = job->part[SDM_TO_BLOCKS].half;
    return job->aligned && half[0] == half[1] && half[0] == half[2];
}

/* How far functions change within the block, instead of sdm_feature_group.sum, with half extents of
 * 1: where it is not a cube along x, y, z. */
static void own_sums(const block *b, int kind, const sdm_feature_group *k, float out[4][8])
{
    const sdm_grid_parts *q = &b->job->part[SDM_TO_BLOCKS];
    for (int j = 0; j < 4; j++) {
        point8 g = p8_load(k->g[j]);
        if (kind == SDM_EDGES && j == 3)
            g = p8_scale(p8_add(p8_load(k->g[1]), p8_load(k->g[2])), v8_all(0.5f));
        v8_store(out[j], extent(q, b->job->aligned, g));
    }
}

/* Numbers of the block in all lanes, in a copy, so that no store can change them. */
typedef struct meeting {
    const block *b;
    v8f less, error; /* its half extents with the other sign */
} meeting;

static inline meeting meeting_of(const block *b)
{
    return (meeting){b, v8_all(-b->half[SDM_TO_BLOCKS]), v8_all(b->error)};
}

/* The features of a group whose regions meet the block: fills in x, and returns their lanes. */
SDM_FOR_KIND unsigned meet_group(const meeting *w, bool cube, int kind, const sdm_feature_group *k,
                                 const sdm_cluster_ref *c, sdm_met_group *x)
{
    const point8 shift = p8_all(c->shift[0], c->shift[1], c->shift[2]);
    v8f at[4], beyond = v8_all(-INFINITY);
    x->group = k;
    x->cluster = c;
    const float(*sum)[8] = x->sum = cube ? k->sum : (const float(*)[8])x->own_sum;
    if (!cube) own_sums(w->b, kind, k, x->own_sum);
    for (int j = 0; j < (kind == SDM_CORNERS ? 3 : 4); j++) {
        at[j] = p8_linear(p8_load(k->g[j]), shift, v8_load(k->offset[j]));
        v8_store(x->at_block[j], at[j]);
        if (j == 3 && kind != SDM_THIN_FACES) break;
        v8f f = kind == SDM_EDGES && j == 0 ? v8_abs(at[j]) : at[j];
        if (kind == SDM_EDGES && j < 2) f = v8_sub(f, v8_load(k->most[j]));
        beyond = v8_max(beyond, v8_fma(w->less, v8_load(sum[j]), f));
    }
    if (kind == SDM_EDGES) {
        const v8f mean = v8_sub(v8_mul(v8_add(at[1], at[2]), v8_all(0.5f)), v8_load(k->most[1]));
        beyond = v8_max(beyond, v8_fma(w->less, v8_load(sum[3]), mean));
    }
    const unsigned lanes = 0xff & ~(unsigned)v8_greater(beyond, w->error);
    return kind == SDM_CORNERS ? lanes & lanes >> SDM_CORNER_LANES : lanes;
}

/* Keeps the features in some lanes of the group behind the last one. Without branches: who meets
 * the block cannot be foreseen. */
static inline void keep_group(const block *b, sdm_pending *p, uint32_t number, unsigned lanes)
{
    p->met[p->groups].number = number;
    p->n = put_lanes(b->job, p->feature, p->n, (uint32_t)(p->groups * SDM_FLOATS(sdm_met_group)),
                     lanes);
    p->groups += lanes != 0;
}

#endif
