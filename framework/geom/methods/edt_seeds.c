/* Where the lines of the grid cross the surface, and how far the surface can be from these points.
 */
#include "edt_seeds.h"

#include <math.h>
#include <string.h>

#include "sdm/memory.h"

/* Whole numbers in [lo, hi], made larger by rounding, cut to 0 .. n - 1. */
static void whole_range(double lo, double hi, int64_t n, int64_t *from, int64_t *to)
{
    const double margin = 1e-12 * (fabs(lo) + fabs(hi));
    lo = ceil(lo - margin);
    hi = floor(hi + margin);
    *from = lo > 0 ? lo > (double)n ? n : (int64_t)lo : 0;
    *to = hi < (double)(n - 1) ? hi < 0 ? -1 : (int64_t)hi : n - 1;
}

/* Point (depth along the axis, across the line) of a triangle's slice. */
typedef struct end {
    double depth, across;
} end;

static void widen(end p, end *lo, end *hi)
{
    if (p.across < lo->across) *lo = p;
    if (p.across > hi->across) *hi = p;
}

/* The segment in which the triangle meets the plane up = k; false: it does not. v[corner]: depth,
 * across, up. */
static bool slice_at(const double v[3][3], double k, end *lo, end *hi)
{
    *lo = (end){0, INFINITY};
    *hi = (end){0, -INFINITY};
    for (int c = 0; c < 3; c++) {
        const double *a = v[c], *b = v[(c + 1) % 3];
        if ((a[2] < k && b[2] < k) || (a[2] > k && b[2] > k)) continue;
        if (a[2] == b[2]) {
            widen((end){a[0], a[1]}, lo, hi);
            widen((end){b[0], b[1]}, lo, hi);
        } else {
            const double t = (k - a[2]) / (b[2] - a[2]);
            widen((end){a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])}, lo, hi);
        }
    }
    return lo->across <= hi->across;
}

/* A crossing: counted while the lists have no place, stored afterwards. */
static void put(sdm_seeds *s, size_t line, double at)
{
    const uint32_t i = s->first[line]++;
    if (s->at) s->at[i] = at;
}

static void cross(const double v[3][3], const int64_t n[2], sdm_seeds *s)
{
    const double least = sdm_lesser(v[0][2], sdm_lesser(v[1][2], v[2][2])),
                 most = sdm_greater(v[0][2], sdm_greater(v[1][2], v[2][2]));
    int64_t k, k1;
    whole_range(least, most, n[1], &k, &k1);
    for (; k <= k1; k++) {
        end lo, hi;
        int64_t j, j1;
        // rounding of the range must not lose a slice through a corner
        if (!slice_at(v, sdm_greater(least, sdm_lesser((double)k, most)), &lo, &hi)) continue;
        whole_range(lo.across, hi.across, n[0], &j, &j1);
        for (; j <= j1; j++) {
            const double width = hi.across - lo.across,
                         t = width > 0 ? ((double)j - lo.across) / width : 0;
            put(s, (size_t)(k * n[0] + j),
                lo.depth + sdm_greater(0, sdm_lesser(t, 1)) * (hi.depth - lo.depth));
            if (!(width > 0)) put(s, (size_t)(k * n[0] + j), hi.depth);
        }
    }
}

static void cross_all(const sdm_run *run, const double *index, int axis, sdm_seeds *s)
{
    const int across = axis == 0, up = axis == 2 ? 1 : 2;
    const int64_t n[2] = {run->grid->n[across], run->grid->n[up]};
    for (size_t t = 0; t < run->surface->n_tri; t++) {
        double v[3][3];
        for (size_t c = 0; c < 3; c++) {
            const double *x = &index[3 * (size_t)run->surface->tri[3 * t + c]];
            v[c][0] = x[axis];
            v[c][1] = x[across];
            v[c][2] = x[up];
        }
        cross((const double(*)[3])v, n, s);
    }
}

sdm_status sdm_seeds_build(sdm_run *run, const double *index, int axis, sdm_seeds *s,
                           sdm_error *err)
{
    const int64_t *n = run->grid->n;
    const size_t lines = (size_t)(n[0] * n[1] * n[2] / n[axis]);
    sdm_status st = sdm_run_reserve(run, lines + 1, sizeof *s->first, err);
    if (!st) st = SDM_ALLOC(&s->first, lines + 1, "crossings of grid lines", err);
    if (st) return st;
    cross_all(run, index, axis, s);
    size_t sum = 0;
    for (size_t i = 0; i <= lines; i++) {
        const uint32_t count = s->first[i];
        s->first[i] = (uint32_t)sum;
        sum += count;
        if (sum > UINT32_MAX)
            return sdm_fail(err, SDM_E_NOMEM, "more than %u crossings of grid lines", UINT32_MAX);
    }
    s->n = sum;
    st = sdm_run_reserve(run, sum, sizeof *s->at, err);
    if (!st) st = SDM_ALLOC(&s->at, sum, "crossings of grid lines", err);
    if (st) return st;
    cross_all(run, index, axis, s);
    memmove(s->first + 1, s->first,
            lines * sizeof *s->first); // filling has moved every start to the next one
    s->first[0] = 0;
    return SDM_OK;
}

void sdm_seeds_dispose(sdm_seeds *s)
{
    sdm_free(s->first);
    sdm_free(s->at);
    *s = (sdm_seeds){0};
}

/* ---- the bound ----
   Seeds lie on the surface, so the distance to the nearest one is never below the true one, and
   above it by at most the distance from the true nearest point q to a seed. The surface is cut into
   pieces smaller than a voxel; the largest distance from a point of a piece to a seed bounds the
   error. Pieces farther from every voxel than the map's largest value hold no q. The search starts
   from half a voxel's diagonal and what the middles of the triangles need, so most triangles need
   few pieces. */

typedef struct bound_job {
    const sdm_run *run;
    const double *index;
    const sdm_seeds *seeds;
    const float *map;
    double piece;    /* largest radius of a piece, mm */
    double farthest; /* largest value of the map */
    double least;    /* where the search starts, mm */
    double *found;   /* [part] */
} bound_job;

enum { TRIANGLES_A_PART = 64 };

static double length2(const double spacing[3], const double d[3])
{
    double sum = 0;
    for (int a = 0; a < 3; a++) sum += spacing[a] * d[a] * spacing[a] * d[a];
    return sum;
}

/* Squared distance from p to the nearest seed on the lines around it. */
static double near_seed2(const bound_job *b, const double p[3])
{
    const sdm_grid *g = b->run->grid;
    int64_t lo[3], hi[3];
    double best = INFINITY;
    for (int a = 0; a < 3; a++) {
        const double cut = sdm_greater(0, sdm_lesser(floor(p[a]), (double)(g->n[a] - 1)));
        lo[a] = (int64_t)cut;
        hi[a] = lo[a] + 1 < g->n[a] ? lo[a] + 1 : lo[a];
    }
    for (int a = 0; a < 3; a++) {
        const int u = a == 0, w = a == 2 ? 1 : 2;
        for (int64_t k = lo[w]; k <= hi[w]; k++) {
            for (int64_t j = lo[u]; j <= hi[u]; j++) {
                const size_t line = (size_t)(k * g->n[u] + j);
                double d[3];
                d[u] = p[u] - (double)j;
                d[w] = p[w] - (double)k;
                for (uint32_t i = b->seeds[a].first[line]; i < b->seeds[a].first[line + 1]; i++) {
                    d[a] = p[a] - b->seeds[a].at[i];
                    best = sdm_lesser(best, length2(g->spacing, d));
                }
            }
        }
    }
    return best;
}

/* Distance from p to a seed, from above: by the lines around p, else by way of the voxel next to p.
 */
static double seed_distance(const bound_job *b, const double p[3])
{
    const sdm_grid *g = b->run->grid;
    const double near2 = near_seed2(b, p);
    int64_t voxel[3];
    double d[3];
    for (int a = 0; a < 3; a++) {
        voxel[a] = (int64_t)sdm_greater(0, sdm_lesser(floor(p[a] + 0.5), (double)(g->n[a] - 1)));
        d[a] = p[a] - (double)voxel[a];
    }
    const double by = b->map[(voxel[2] * g->n[1] + voxel[1]) * g->n[0] + voxel[0]];
    return sdm_lesser(sqrt(near2), sqrt(length2(g->spacing, d)) + by);
}

/* Distance from p to the box of the voxel centres. */
static double outside(const bound_job *b, const double p[3])
{
    const sdm_grid *g = b->run->grid;
    double d[3];
    for (int a = 0; a < 3; a++)
        d[a] = sdm_greater(0, sdm_greater(-p[a], p[a] - (double)(g->n[a] - 1)));
    return sqrt(length2(g->spacing, d));
}

static void measure_piece(const bound_job *b, const double v[3][3], double *found)
{
    const sdm_grid *g = b->run->grid;
    double middle[3], side2[3], radius2 = 0;
    int longest = 0;
    for (int a = 0; a < 3; a++) middle[a] = (v[0][a] + v[1][a] + v[2][a]) / 3;
    for (int c = 0; c < 3; c++) {
        const double *p = v[c], *q = v[(c + 1) % 3];
        radius2 = sdm_greater(
            radius2, length2(g->spacing, (const double[3]){p[0] - middle[0], p[1] - middle[1],
                                                           p[2] - middle[2]}));
        side2[c] = length2(g->spacing, (const double[3]){p[0] - q[0], p[1] - q[1], p[2] - q[2]});
        if (side2[c] > side2[longest]) longest = c;
    }
    const double radius = sqrt(radius2);
    if (outside(b, middle) - radius > b->farthest) return;
    const double largest = seed_distance(b, middle) + radius;
    if (largest <= *found) return;
    if (radius <= b->piece) {
        *found = largest;
        return;
    }
    // in two across the longest side
    const double *p = v[longest], *q = v[(longest + 1) % 3], *r = v[(longest + 2) % 3];
    double half[2][3][3];
    for (int a = 0; a < 3; a++) {
        const double cut = 0.5 * (p[a] + q[a]);
        half[0][0][a] = p[a];
        half[0][1][a] = half[1][0][a] = cut;
        half[1][1][a] = q[a];
        half[0][2][a] = half[1][2][a] = r[a];
    }
    measure_piece(b, (const double(*)[3])half[0], found);
    measure_piece(b, (const double(*)[3])half[1], found);
}

static void corners(const bound_job *b, size_t t, double v[3][3])
{
    const uint32_t *tri = &b->run->surface->tri[3 * t];
    for (int c = 0; c < 3; c++) memcpy(v[c], &b->index[3 * (size_t)tri[c]], sizeof v[c]);
}

static void measure_triangles(void *job, int64_t part, int thread)
{
    const bound_job *b = job;
    const size_t from = (size_t)part * TRIANGLES_A_PART, to = from + TRIANGLES_A_PART;
    (void)thread;
    b->found[part] = b->least;
    for (size_t t = from; t < to && t < b->run->surface->n_tri; t++) {
        double v[3][3];
        corners(b, t, v);
        measure_piece(b, (const double(*)[3])v, &b->found[part]);
    }
}

/* Where the search starts: what is found below that needs no care. */
static double first_guess(const bound_job *b)
{
    double least = 0.5 * sqrt(length2(b->run->grid->spacing, (const double[3]){1, 1, 1}));
    for (size_t t = 0; t < b->run->surface->n_tri; t++) {
        double v[3][3], middle[3];
        corners(b, t, v);
        for (int a = 0; a < 3; a++) middle[a] = (v[0][a] + v[1][a] + v[2][a]) / 3;
        if (outside(b, middle) <= b->farthest) least = sdm_greater(least, seed_distance(b, middle));
    }
    return least;
}

sdm_status sdm_seeds_bound(const sdm_run *run, const double *index, const sdm_seeds seeds[3],
                           const float *map, double *bound, sdm_error *err)
{
    const sdm_grid *g = run->grid;
    bound_job b = {.run = run, .index = index, .seeds = seeds, .map = map};
    b.piece = 0.25 * sdm_lesser(g->spacing[0], sdm_lesser(g->spacing[1], g->spacing[2]));
    for (size_t i = 0; i < sdm_grid_count(g); i++)
        b.farthest = sdm_greater(b.farthest, (double)map[i]);
    *bound = INFINITY;
    if (b.farthest == INFINITY) return SDM_OK;
    b.least = first_guess(&b);
    const int64_t parts =
        (int64_t)((run->surface->n_tri + TRIANGLES_A_PART - 1) / TRIANGLES_A_PART);
    sdm_status s = SDM_ALLOC(&b.found, (size_t)parts, "error bounds", err);
    if (!s) s = sdm_run_parts(run, parts, measure_triangles, &b, 9, 10, err);
    if (!s) *bound = 0;
    for (int64_t i = 0; i < parts && !s; i++) *bound = sdm_greater(*bound, b.found[i]);
    sdm_free(b.found);
    // the map is in float, the grid's axes are orthonormal to rounding only
    double skew = 0;
    for (int i = 0; i < 9; i++) {
        const double *d = g->dir;
        const int r = i / 3, c = i % 3;
        skew += fabs(d[r] * d[c] + d[3 + r] * d[3 + c] + d[6 + r] * d[6 + c] - (r == c));
    }
    *bound += (4 * 1.2e-7 + skew) * (b.farthest + *bound);
    return s;
}
