/* From the candidates of a tile to the distances of its voxels in double. Part of the map kernels.
 */
#ifndef SDM_GEOM_VALUES_KERNEL_H
#define SDM_GEOM_VALUES_KERNEL_H

#include "features/feature_distance.h"
#include "stage5_voxels.h"

typedef struct tile {
    const sdm_grid_job *job;
    const sdm_grid_scratch *s;
    unsigned number;  /* in the block */
    int64_t first[3]; /* voxel */
    double corner[3]; /* mm: its first voxel */
    unsigned wanted;  /* vectors that begin inside the grid */
    float error;      /* bound on the error of a linear function */
} tile;

/* Bounds are meant to leave somebody; should they not, the tree knows. */
static uint32_t ask_tree(const tile *t, const double p[3], double *d2)
{
    const sdm_nearest *n = t->job->surface;
    uint32_t slot = 0;
    double q[3];
    int feature;
    (void)sdm_nearest_find(n, p, INFINITY, &slot, q, &feature);
    *d2 = sdm_nearest_feature(n, p, &slot);
    return slot;
}

/* The nearest of the candidates of a voxel, in double. */
static uint32_t settle(const tile *t, unsigned v, int lane, const double p[3], double *d2)
{
    const sdm_candidates *c = t->s->of_vectors;
    uint32_t best = SDM_NONE;
    *d2 = INFINITY;
    for (uint32_t i = c->last[v]; i != SDM_NONE; i = c->list[i].before) {
        if (!(c->list[i].voxels >> lane & 1)) continue;
        const double d =
            sdm_feature_distance2(t->job->features, t->job->surface->frames, c->list[i].number, p);
        if (!(d < *d2 || (d == *d2 && d < INFINITY))) continue; // of several the first
        *d2 = d;
        best = c->list[i].number;
    }
    if (best == SDM_NONE && !(t->job->band_mm < INFINITY)) best = ask_tree(t, p, d2);
    return best;
}

/* ax bx + ay by + az bz */
static inline v4d v4_sum(v4d ax, v4d bx, v4d ay, v4d by, v4d az, v4d bz)
{
    return v4_add(v4_add(v4_mul(ax, bx), v4_mul(ay, by)), v4_mul(az, bz));
}

/* Squared distances of four points to a feature each; the operations of sdm_feature_distance2(). */
static inline void measure_four(const sdm_feature *x, const uint32_t number[4], v4d px, v4d py,
                                v4d pz, double out[4])
{
    v4d a[4], u[4];
    for (int i = 0; i < 4; i++) {
        a[i] = v4_load(x[number[i]].a);
        u[i] = v4_load(&x[number[i]].u[1]);
    }
    // rows of a: ax ay az ux, of u: uy uz length face
    v4_transpose(a);
    v4_transpose(u);
    const v4d wx = v4_sub(px, a[0]), wy = v4_sub(py, a[1]), wz = v4_sub(pz, a[2]);
    const v4d s = v4_sum(wx, a[3], wy, u[0], wz, u[1]);
    const v4d rx = v4_sub(wx, v4_mul(s, a[3])), ry = v4_sub(wy, v4_mul(s, u[0])),
              rz = v4_sub(wz, v4_mul(s, u[1]));
    v4_store(out, v4_signed(u[3], v4_mul(s, s), v4_sum(rx, rx, ry, ry, rz, rz)));
}

/* The voxels of a tile. */
typedef struct voxels {
    uint32_t number[64]; /* of the nearest feature */
    _Alignas(32) double d2[64];
    int n_settled; /* what had to be settled in double */
    uint8_t settled[64];
    double settled_d2[64];
} voxels;

static void choose_features(const tile *t, voxels *x)
{
    const sdm_grid_job *job = t->job;
    const v8f doubt = v8_all(doubt_of(t->error));
    for (int v = 0; v < 8; v++) {
        const uint8_t *place = job->voxel_in_tile[v];
        if (!(t->wanted >> v & 1)) {
            for (int i = 0; i < 8; i++) x->number[place[i]] = 0;
            continue;
        }
        const unsigned at = 8 * t->number + (unsigned)v;
        const sdm_candidates *c = t->s->of_vectors;
        const v8f first = v8_load(c->first[at]);
        const v8f limit = v8_fma(v8_add(v8_sqrt(first), v8_all(1)), doubt, first);
        const int clear = v8_greater(v8_load(c->second[at]), limit) & (int)~c->open[at];
        for (int i = 0; i < 8; i++) {
            const uint32_t number = x->number[place[i]] = c->number[at][i];
            __builtin_prefetch(&job->features->exact[number]); // for measure_voxels()
        }
        // NaN (INFINITY - INFINITY) is not clear either
        for (int open = 0xff & ~clear; open; open &= open - 1) {
            const int lane = __builtin_ctz((unsigned)open), i = place[lane];
            double p[3];
            for (int a = 0; a < 3; a++) p[a] = t->corner[a] + job->tile_voxel[a][i];
            x->settled[x->n_settled] = (uint8_t)i;
            x->number[i] = settle(t, at, lane, p, &x->settled_d2[x->n_settled]);
            x->n_settled++;
        }
    }
}

/* Squared distances of the voxels in double. */
static void measure_voxels(const tile *t, voxels *x)
{
    const double(*at)[64] = (const double(*)[64])t->job->tile_voxel;
    const double *c = t->corner;
    uint32_t number[64];
    for (int i = 0; i < 64; i++) number[i] = x->number[i] == SDM_NONE ? 0 : x->number[i];
    for (int i = 0; i < 64; i += 4)
        measure_four(t->job->features->exact, &number[i], v4_add(v4_all(c[0]), v4_load(&at[0][i])),
                     v4_add(v4_all(c[1]), v4_load(&at[1][i])),
                     v4_add(v4_all(c[2]), v4_load(&at[2][i])), &x->d2[i]);
    for (int i = 0; i < x->n_settled; i++) x->d2[x->settled[i]] = x->settled_d2[i];
}

static void write_tile(const tile *t, voxels *x)
{
    const sdm_grid_job *job = t->job;
    const int64_t *whole = job->part[SDM_TO_TILES].size;
    float d[64];
    for (int i = 0; i < 64; i++) d[i] = (float)sqrt(x->d2[i]);
    for (int i = 0; i < 64 && job->slot; i++)
        x->number[i] = x->number[i] == SDM_NONE ? SDM_NONE : job->features->owner[x->number[i]];
    if (job->band_mm < INFINITY)
        for (int i = 0; i < 64; i++) {
            if (d[i] < (float)job->band_mm) continue;
            d[i] = (float)job->band_mm;
            x->number[i] = SDM_NONE;
        }
    int64_t size[3];
    for (int a = 0; a < 3; a++)
        size[a] = job->n[a] - t->first[a] < whole[a] ? job->n[a] - t->first[a] : whole[a];
    for (int64_t z = 0; z < size[2]; z++)
        for (int64_t y = 0; y < size[1]; y++) {
            const int64_t to =
                ((t->first[2] + z) * job->n[1] + t->first[1] + y) * job->n[0] + t->first[0];
            const int64_t from = (z * whole[1] + y) * whole[0];
            if (size[0] == 4) // the usual size, so that no function is called
                memcpy(&job->values[to], &d[from], 4 * sizeof *d);
            else
                memcpy(&job->values[to], &d[from], (size_t)size[0] * sizeof *d);
            if (job->slot)
                memcpy(&job->slot[to], &x->number[from], (size_t)size[0] * sizeof *x->number);
        }
}

#endif
