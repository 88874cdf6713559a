/* Signed distances at points: sorts them, computes them in blocks, finds their signs. */
#include "at_points.h"

#include <float.h>
#include <math.h>
#include <stdatomic.h>
#include <string.h>

#include "features/feature_side.h"
#include "memory/cancel.h"
#include "point_job.h"
#include "point_order.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/processor.h"
#include "sdm/internal/threads.h"
#include "simd/lanes_two.h"

#define CHUNK ((size_t)1 << 22) // points that are sorted together; bounds the memory
#define BLOCKS 8                // blocks of points that a thread takes at a time
// With at least so many points for each triangle, two registers of points that are searched
// together take less time than one.
#define WIDE 5

/* Is x a usable point? False for NaN and for coordinates whose squares could overflow. */
static bool is_point(const double x[3])
{
    return fabs(x[0]) <= 1e150 && fabs(x[1]) <= 1e150 && fabs(x[2]) <= 1e150;
}

/* The functions of one instruction set. */
typedef struct kernels {
    sdm_point_kernel *block;
    sdm_point_search *search;
} kernels;

static kernels kernels_choose(void)
{
#if defined(__x86_64__) && defined(__GNUC__)
    const int level = sdm_processor_level();
    if (level >= SDM_PROCESSOR_AVX512)
        return (kernels){sdm_point_kernel_avx512, sdm_point_search_avx512};
    if (level >= SDM_PROCESSOR_AVX2) return (kernels){sdm_point_kernel_avx2, sdm_point_search_avx2};
#endif
    return (kernels){sdm_point_kernel_generic, sdm_point_search_generic};
}

/* Sets q to the point of the triangle in this slot that is the closest to x, and *feature to where
   it lies. d: distance. From so far away that rounding would exceed the size of the surface, x is
   moved towards the surface first. */
static void closest_point(const sdm_nearest *s, uint32_t slot, const double x[3], double d,
                          double q[3], int *feature)
{
    const sdm_bvh_node *box = &s->tree.node[0];
    double size = 0, nearer[3];
    for (int a = 0; a < 3; a++) size = fmax(size, box->hi[a] - box->lo[a]);
    const double scale = d > 1e10 * size ? 1e10 * size / d : 1;
    for (int a = 0; a < 3; a++) {
        const double middle = 0.5 * (box->lo[a] + box->hi[a]);
        nearer[a] = scale < 1 ? middle + (x[a] - middle) * scale : x[a];
    }
    (void)sdm_frame_closest(&s->frames[slot], nearer, q, feature);
}

/* Distance from the surface, mm, up to which rounding may decide on which side of its nearest
   feature a point with coordinates of at most `largest` lies. */
static inline double side_margin(const sdm_points_job *job, double largest)
{
    return job->seam + 16 * DBL_EPSILON * largest;
}

/* Stores the answer for x in element `index`: its nearest feature, the squared distance, and the
   side by this feature. */
static void point_finish(const sdm_points_job *job, const double x[3], uint32_t number, double d2,
                         int side, const sdm_exact_at *out, size_t index)
{
    const sdm_nearest *s = job->surface;
    const uint32_t slot = s->features.owner[number];
    double d = sqrt(d2), q[3];
    int feature;
    const bool wants_point = out->closest || out->gradient;
    // near the surface rounding decides on which side of the feature the point lies
    const double largest = fmax(fabs(x[0]), fmax(fabs(x[1]), fabs(x[2])));
    if (!(d > side_margin(job, largest))) side = SDM_SIDE_UNKNOWN;
    if (wants_point || side == SDM_SIDE_UNKNOWN) closest_point(s, slot, x, d, q, &feature);
    if (side == SDM_SIDE_UNKNOWN ? sdm_sign_inside(job->sign, x, slot, q, feature)
                                 : side == SDM_SIDE_INSIDE)
        d = -d;
    if (out->distance) out->distance[index] = d;
    if (out->triangle) out->triangle[index] = s->tree.order[slot];
    if (out->closest) memcpy(out->closest + 3 * index, q, sizeof q);
    if (out->gradient)
        sdm_distance_gradient(s, job->rounding, slot, x, q, d, out->gradient + 3 * index);
}

/* Stores the answer for a point that is not usable. */
static void point_refuse(const sdm_exact_at *out, size_t index)
{
    if (out->distance) out->distance[index] = NAN;
    if (out->triangle) out->triangle[index] = UINT32_MAX;
    for (size_t a = 0; a < 3; a++) {
        if (out->closest) out->closest[3 * index + a] = NAN;
        if (out->gradient) out->gradient[3 * index + a] = NAN;
    }
}

void sdm_point_find(const sdm_points_job *job, const double x[3], const sdm_exact_at *out,
                    size_t index)
{
    if (!is_point(x)) {
        point_refuse(out, index);
        return;
    }
    double d2;
    int side;
    const uint32_t number = kernels_choose().search(job->surface, x, &d2, &side);
    point_finish(job, x, number, d2, side, out, index);
}

double sdm_point_distance(const sdm_nearest *surface, const double x[3])
{
    double d2 = NAN;
    int side;
    if (is_point(x)) (void)kernels_choose().search(surface, x, &d2, &side);
    return sqrt(d2);
}

static sdm_point_keys *keys_choose(void)
{
#if defined(__x86_64__) && defined(__GNUC__)
    if (sdm_processor_level() >= SDM_PROCESSOR_AVX2) return sdm_point_keys_avx2;
#endif
    return sdm_point_keys_generic;
}

static void scratch_free(sdm_point_scratch *s)
{
    if (!s) return;
    sdm_free(s->candidate);
    sdm_free(s);
}

/* Bytes of a thread's scratch memory. */
static size_t scratch_bytes(const sdm_features *f)
{
    return sizeof(sdm_point_scratch) + (f->end + 1) * sizeof(sdm_point_candidate);
}

static sdm_status scratch_start(const sdm_features *f, sdm_point_scratch **out, sdm_error *err)
{
    sdm_status st = SDM_ALLOC(out, 1, "points of a block", err);
    if (st) return st;
    sdm_point_scratch *s = *out;
    // every feature is a candidate at most once
    st = sdm_alloc_unset((void **)&s->candidate, (size_t)f->end + 1, sizeof *s->candidate,
                         "candidates", err);
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 8; i++) s->reference.x[a][i] = f->centroid[0][a];
    return st;
}

/* Points that are sorted together. */
typedef struct chunk {
    const double *x;
    // their box, not much larger than that of the surface, over which they are sorted
    double lo[3], hi[3];
    // all points are usable
    bool usable;
    // so they are, and distances are wanted and nothing else
    bool plain;
    // vectors of two registers are tried first
    bool wide;
    // a point farther from the surface than this, mm, lies on the side that its feature tells
    double certain;
    const sdm_exact_at *out;
} chunk;

/* The side of point i of a block, whose nearest feature does not tell it. d: its distance, mm. No
   surface lies within the distance of a point from it, so all points there are on one side: this is
   the side of a point of the block that is close enough; SDM_SIDE_UNKNOWN: there is none. */
static int8_t side_by_neighbour(const chunk *c, const sdm_point_scratch *s, size_t i, double d)
{
    for (size_t k = 0; k < SDM_POINT_BLOCK; k++) {
        // those of the same register first
        const size_t other = i ^ k;
        if (s->side[other] == SDM_SIDE_UNKNOWN) continue;
        const double free = fmax(d, sqrt(s->d2[other])) - c->certain;
        double away2 = 0;
        for (int a = 0; a < 3; a++) {
            const double t = s->x[i / 8][a][i % 8] - s->x[other / 8][a][other % 8];
            away2 += t * t;
        }
        if (s->d2[other] > c->certain * c->certain && free > 0 && away2 < free * free)
            return s->side[other];
    }
    return SDM_SIDE_UNKNOWN;
}

/* Stores the answers for the block of sorted points key[n] that are in the scratch memory. */
static void block_finish(const sdm_points_job *job, const chunk *c, const sdm_point_scratch *s,
                         const sdm_point_key *key, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const size_t index = key[i].index;
        const double *p = c->x + 3 * index, d = sqrt(s->d2[i]);
        int8_t side = s->side[i];
        if (side == SDM_SIDE_UNKNOWN && job->surface->features.side && d > c->certain)
            side = side_by_neighbour(c, s, i, d);
        if (c->plain && side != SDM_SIDE_UNKNOWN && d > c->certain)
            c->out->distance[index] = (double)side * d;
        else if (c->usable || is_point(p))
            point_finish(job, p, s->number[i], s->d2[i], (int)side, c->out, index);
        else
            point_refuse(c->out, index);
    }
}

/* Answers for the block of sorted points key[n], 0 < n <= SDM_POINT_BLOCK. The first `ahead` of the
   keys are those of this block and the next one: sorted points and their distances lie anywhere in
   memory, and the processor fetches those of the next block while it works on this one. */
static void block_find(const sdm_points_job *job, const chunk *c, sdm_point_kernel *kernel,
                       sdm_point_scratch *s, const sdm_point_key *key, size_t n, size_t ahead)
{
    s->wide = c->wide;
    s->next = (sdm_points_next){key + n, (int)(ahead - n), c->x, c->out->distance};
    for (size_t i = 0; i < SDM_POINT_BLOCK; i++) {
        const double *p = c->x + 3 * (size_t)key[i < n ? i : n - 1].index;
        // a point that is not usable is replaced by any other
        if (!c->usable && !is_point(p)) p = job->surface->features.centre;
        for (int a = 0; a < 3; a++) s->x[i / 8][a][i % 8] = p[a];
    }
    kernel(job->surface, s);
    block_finish(job, c, s, key, n);
}

/* Sets lo and hi to the box of the points x[n][3], without coordinates that are NaN; *usable: all
   points are usable. Two points at a time. */
static void points_box(const double *x, size_t n, double lo[3], double hi[3], bool *usable)
{
    // (x, y), (z, x), (y, z)
    v2d low[3], high[3], sum = d2_all(0);
    for (int k = 0; k < 3; k++) {
        low[k] = d2_all(INFINITY);
        high[k] = d2_all(-INFINITY);
    }
    double last[6];
    for (size_t k = 0; k < 6; k++) last[k] = x[3 * (n - 1) + k % 3];
    for (size_t i = 0; i < n; i += 2) {
        const double *p = i + 1 < n ? x + 3 * i : last;
        for (int k = 0; k < 3; k++) {
            const v2d v = d2_load(p + 2 * k);
            low[k] = d2_lesser(v, low[k]);
            high[k] = d2_greater(v, high[k]);
            sum += v * 0; // NaN from the first coordinate on that is not finite
        }
    }
    *usable = sum[0] == 0 && sum[1] == 0;
    for (int a = 0; a < 3; a++) {
        lo[a] = fmin(low[a / 2][a % 2], low[(a + 3) / 2][(a + 3) % 2]);
        hi[a] = fmax(high[a / 2][a % 2], high[(a + 3) / 2][(a + 3) % 2]);
    }
    *usable = *usable && is_point(lo) && is_point(hi);
}

/* Describes the points x[n][3]. */
static chunk chunk_start(const sdm_points_job *job, const double *x, size_t n,
                         const sdm_exact_at *out)
{
    const sdm_features *f = &job->surface->features;
    chunk c = {.x = x, .out = out};
    points_box(x, n, c.lo, c.hi, &c.usable);
    double largest = 0;
    for (size_t a = 0; a < 3; a++) {
        largest = fmax(largest, fmax(fabs(c.lo[a]), fabs(c.hi[a])));
        c.lo[a] = fmax(c.lo[a], f->centre[a] - 4 * f->radius);
        c.hi[a] = fmin(c.hi[a], f->centre[a] + 4 * f->radius);
    }
    c.plain = c.usable && out->distance && !out->triangle && !out->closest && !out->gradient;
    c.certain = side_margin(job, largest);
    c.wide = n / WIDE >= job->surface->tree.n_tri;
    return c;
}

/* Answers for up to CHUNK points. */
static sdm_status chunk_find(const sdm_points_job *job, const double *x, size_t n,
                             sdm_point_key *key, int n_threads, const sdm_exact_at *out,
                             sdm_error *err)
{
    const chunk c = chunk_start(job, x, n, out);
    sdm_point_order(x, n, c.lo, c.hi, keys_choose(), n_threads, key, key + n);
    sdm_point_kernel *kernel = kernels_choose().block;
    const size_t n_block = (n + SDM_POINT_BLOCK - 1) / SDM_POINT_BLOCK;
    const size_t n_job = (n_block + BLOCKS - 1) / BLOCKS;
    atomic_int stop = SDM_OK;
    sdm_status status = SDM_OK;
#pragma omp parallel num_threads(n_threads) if (n_job > 1)
    {
        sdm_point_scratch *scratch = NULL;
        sdm_error local = {0};
        const sdm_status ready = scratch_start(&job->surface->features, &scratch, &local);
#pragma omp for schedule(dynamic)
        for (size_t part = 0; part < n_job; part++) {
            if (atomic_load(&stop)) continue;
            sdm_status s = ready;
            for (size_t b = part * BLOCKS; b < (part + 1) * BLOCKS && b < n_block && !s; b++) {
                const size_t first = b * SDM_POINT_BLOCK, left = n - first;
                block_find(job, &c, kernel, scratch, key + first,
                           left < SDM_POINT_BLOCK ? left : SDM_POINT_BLOCK,
                           left < 2 * SDM_POINT_BLOCK ? left : 2 * SDM_POINT_BLOCK);
            }
            if (!s && sdm_cancelled(job->opts))
                s = sdm_fail(&local, SDM_E_CANCELLED, "points stopped on request");
            if (!s || atomic_exchange(&stop, 1)) continue;
            status = sdm_fail(err, s, "%s", local.text);
        }
        scratch_free(scratch);
    }
    return status;
}

sdm_status sdm_points_find(const sdm_points_job *job, const double *x, size_t n,
                           const sdm_exact_at *out, sdm_error *err)
{
    const int n_threads = sdm_threads(job->opts->n_threads);
    const size_t most = n < CHUNK ? n : CHUNK, limit = job->opts->memory_limit;
    const size_t need = 2 * most * sizeof(sdm_point_key) +
                        (size_t)n_threads * scratch_bytes(&job->surface->features);
    if (limit && need > limit)
        return sdm_fail(err, SDM_E_NOMEM, "%zu points need %zu bytes, memory_limit leaves %zu", n,
                        need, limit);
    sdm_point_key *key;
    sdm_status s =
        sdm_alloc_unset((void **)&key, 2 * most, sizeof *key, "order of the points", err);
    for (size_t first = 0; first < n && !s; first += CHUNK) {
        const size_t left = n - first;
        const sdm_exact_at at = {out->distance ? out->distance + first : NULL,
                                 out->gradient ? out->gradient + 3 * first : NULL,
                                 out->closest ? out->closest + 3 * first : NULL,
                                 out->triangle ? out->triangle + first : NULL};
        s = chunk_find(job, x + 3 * first, left < CHUNK ? left : CHUNK, key, n_threads, &at, err);
    }
    sdm_free(key);
    return s;
}
