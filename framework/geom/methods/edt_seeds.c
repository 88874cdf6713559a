/* Crossings of the grid lines with the surface, and a bound on the distance from the surface to the
 * nearest crossing. */
#include "edt_seeds.h"

#include <math.h>
#include <string.h>

#include "sdm/memory.h"

/* Sets *from .. *to to the integers in [lo, hi] that lie within 0 .. n - 1 (none when *from > *to).
 * A margin for rounding may add an integer just outside. */
static void whole_range(double lo, double hi, int64_t n, int64_t *from, int64_t *to)
{
    const double margin = 1e-12 * (fabs(lo) + fabs(hi));
    lo = ceil(lo - margin);
    hi = floor(hi + margin);
    *from = lo > 0 ? lo > (double)n ? n : (int64_t)lo : 0;
    *to = hi < (double)(n - 1) ? hi < 0 ? -1 : (int64_t)hi : n - 1;
}

/* Point of a triangle in index coordinates, in a plane of constant `up`: depth is along the grid
 * lines, `across` is the second axis of the plane. */
typedef struct slice_end {
    double depth, across;
} slice_end;

static void slice_widen(slice_end p, slice_end *lo, slice_end *hi)
{
    if (p.across < lo->across) *lo = p;
    if (p.across > hi->across) *hi = p;
}

/* Intersection of the triangle with the plane up = k: the segment *lo .. *hi, sorted by `across`.
 * v[corner] = (depth, across, up). Returns false when triangle and plane do not meet. */
static bool slice_at(const double v[3][3], double k, slice_end *lo, slice_end *hi)
{
    *lo = (slice_end){0, INFINITY};
    *hi = (slice_end){0, -INFINITY};
    for (int c = 0; c < 3; c++) {
        const double *a = v[c], *b = v[(c + 1) % 3];
        if ((a[2] < k && b[2] < k) || (a[2] > k && b[2] > k)) continue;
        if (a[2] == b[2]) {
            slice_widen((slice_end){a[0], a[1]}, lo, hi);
            slice_widen((slice_end){b[0], b[1]}, lo, hi);
        } else {
            const double t = (k - a[2]) / (b[2] - a[2]);
            slice_widen((slice_end){a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])}, lo, hi);
        }
    }
    return lo->across <= hi->across;
}

/* Adds a crossing at index coordinate `at` to a line. While s->at is NULL crossings are only
 * counted. */
static void seeds_add(sdm_seeds *s, size_t line, double at)
{
    const uint32_t i = s->first[line]++;
    if (s->at) s->at[i] = at;
}

/* Adds the crossings of one triangle with all lines. v as in slice_at(); n: grid sizes along
 * `across` and `up`. */
static void seeds_cross_triangle(const double v[3][3], const int64_t n[2], sdm_seeds *s)
{
    const double least = sdm_lesser(v[0][2], sdm_lesser(v[1][2], v[2][2])),
                 most = sdm_greater(v[0][2], sdm_greater(v[1][2], v[2][2]));
    int64_t k, k1;
    whole_range(least, most, n[1], &k, &k1);
    for (; k <= k1; k++) {
        slice_end lo, hi;
        int64_t j, j1;
        // clamp k to the triangle's range: whole_range() may exceed it by rounding, and a slice
        // through a corner must not be lost
        if (!slice_at(v, sdm_greater(least, sdm_lesser((double)k, most)), &lo, &hi)) continue;
        whole_range(lo.across, hi.across, n[0], &j, &j1);
        for (; j <= j1; j++) {
            const double width = hi.across - lo.across,
                         t = width > 0 ? ((double)j - lo.across) / width : 0;
            seeds_add(s, (size_t)(k * n[0] + j),
                      lo.depth + sdm_greater(0, sdm_lesser(t, 1)) * (hi.depth - lo.depth));
            if (!(width > 0)) seeds_add(s, (size_t)(k * n[0] + j), hi.depth);
        }
    }
}

static void seeds_cross_surface(const sdm_run *run, const double *index, int axis, sdm_seeds *s)
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
        seeds_cross_triangle((const double(*)[3])v, n, s);
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
    seeds_cross_surface(run, index, axis, s);
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
    seeds_cross_surface(run, index, axis, s);
    // the fill has advanced every start to the start of the next line: shift them back
    memmove(s->first + 1, s->first, lines * sizeof *s->first);
    s->first[0] = 0;
    return SDM_OK;
}

void sdm_seeds_dispose(sdm_seeds *s)
{
    sdm_free(s->first);
    sdm_free(s->at);
    *s = (sdm_seeds){0};
}

/* ---- error bound ----
 *
 * A seed lies on the surface, so the distance to the nearest seed is >= the true distance. The
 * difference is at most the distance from q, the true nearest surface point, to the seed nearest
 * to q. The triangles are cut into pieces smaller than a voxel; the largest distance from a point
 * of any piece to its nearest seed bounds the error. Pieces farther from the grid than the largest
 * map value cannot contain q and are skipped. The search starts with a lower limit of the bound
 * (half a voxel diagonal, and the value at the centroid of every triangle), so most triangles are
 * accepted with few cuts. */

/* Input and result of the search for the error bound. */
typedef struct bound_job {
    const sdm_run *run;
    const double *index;
    const sdm_seeds *seeds;
    const float *map;
    double piece;    /* pieces up to this radius are not cut further, mm */
    double farthest; /* largest value of the map, mm */
    double least;    /* initial value of the search for the maximum, mm */
    double *found;   /* [part] largest distance to a seed, mm */
} bound_job;

enum { PART_TRIANGLES = 64 };

static double length2(const double spacing[3], const double d[3])
{
    double sum = 0;
    for (int a = 0; a < 3; a++) sum += spacing[a] * d[a] * spacing[a] * d[a];
    return sum;
}

/* Squared distance (mm^2) from p (index coordinates) to the nearest seed on the grid lines through
 * the 8 voxel centres around p; INFINITY when they have no seed. */
static double near_seed_distance2(const bound_job *b, const double p[3])
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

/* Upper bound (mm) on the distance from p (index coordinates) to the nearest seed: the smaller of
 * the distance to the nearest seed on the lines around p and (distance to the nearest voxel + map
 * value of this voxel). */
static double seed_distance_bound(const bound_job *b, const double p[3])
{
    const sdm_grid *g = b->run->grid;
    const double near2 = near_seed_distance2(b, p);
    int64_t voxel[3];
    double d[3];
    for (int a = 0; a < 3; a++) {
        voxel[a] = (int64_t)sdm_greater(0, sdm_lesser(floor(p[a] + 0.5), (double)(g->n[a] - 1)));
        d[a] = p[a] - (double)voxel[a];
    }
    const double by = b->map[(voxel[2] * g->n[1] + voxel[1]) * g->n[0] + voxel[0]];
    return sdm_lesser(sqrt(near2), sqrt(length2(g->spacing, d)) + by);
}

/* Distance (mm) from p (index coordinates) to the box spanned by the voxel centres; 0 inside. */
static double outside_distance(const bound_job *b, const double p[3])
{
    const sdm_grid *g = b->run->grid;
    double d[3];
    for (int a = 0; a < 3; a++)
        d[a] = sdm_greater(0, sdm_greater(-p[a], p[a] - (double)(g->n[a] - 1)));
    return sqrt(length2(g->spacing, d));
}

static void bound_piece(const bound_job *b, const double v[3][3], double *found)
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
    // skip pieces that are too far from the grid or cannot raise the maximum
    const double radius = sqrt(radius2);
    if (outside_distance(b, middle) - radius > b->farthest) return;
    const double largest = seed_distance_bound(b, middle) + radius;
    if (largest <= *found) return;
    if (radius <= b->piece) {
        *found = largest;
        return;
    }
    // bisect the longest side
    const double *p = v[longest], *q = v[(longest + 1) % 3], *r = v[(longest + 2) % 3];
    double half[2][3][3];
    for (int a = 0; a < 3; a++) {
        const double cut = 0.5 * (p[a] + q[a]);
        half[0][0][a] = p[a];
        half[0][1][a] = half[1][0][a] = cut;
        half[1][1][a] = q[a];
        half[0][2][a] = half[1][2][a] = r[a];
    }
    bound_piece(b, (const double(*)[3])half[0], found);
    bound_piece(b, (const double(*)[3])half[1], found);
}

static void triangle_corners(const bound_job *b, size_t t, double v[3][3])
{
    const uint32_t *tri = &b->run->surface->tri[3 * t];
    for (int c = 0; c < 3; c++) memcpy(v[c], &b->index[3 * (size_t)tri[c]], sizeof v[c]);
}

static void bound_triangles(void *job, int64_t part, int thread)
{
    const bound_job *b = job;
    const size_t from = (size_t)part * PART_TRIANGLES, to = from + PART_TRIANGLES;
    (void)thread;
    b->found[part] = b->least;
    for (size_t t = from; t < to && t < b->run->surface->n_tri; t++) {
        double v[3][3];
        triangle_corners(b, t, v);
        bound_piece(b, (const double(*)[3])v, &b->found[part]);
    }
}

/* Initial value of the search: pieces with a smaller distance to a seed need no further cuts. */
static double bound_start(const bound_job *b)
{
    double least = 0.5 * sqrt(length2(b->run->grid->spacing, (const double[3]){1, 1, 1}));
    for (size_t t = 0; t < b->run->surface->n_tri; t++) {
        double v[3][3], middle[3];
        triangle_corners(b, t, v);
        for (int a = 0; a < 3; a++) middle[a] = (v[0][a] + v[1][a] + v[2][a]) / 3;
        if (outside_distance(b, middle) <= b->farthest)
            least = sdm_greater(least, seed_distance_bound(b, middle));
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
    b.least = bound_start(&b);
    // largest distance over all triangles, in parallel
    const int64_t parts = (int64_t)((run->surface->n_tri + PART_TRIANGLES - 1) / PART_TRIANGLES);
    sdm_status s = SDM_ALLOC(&b.found, (size_t)parts, "error bounds", err);
    if (!s) s = sdm_run_parts(run, parts, bound_triangles, &b, 9, 10, err);
    if (!s) *bound = 0;
    for (int64_t i = 0; i < parts && !s; i++) *bound = sdm_greater(*bound, b.found[i]);
    sdm_free(b.found);
    // margin: the map is rounded to float (relative error 1.2e-7), and the grid axes are
    // orthonormal only up to `skew`
    double skew = 0;
    for (int i = 0; i < 9; i++) {
        const double *d = g->dir;
        const int r = i / 3, c = i % 3;
        skew += fabs(d[r] * d[c] + d[3 + r] * d[3 + c] + d[6 + r] * d[6 + c] - (r == c));
    }
    *bound += (4 * 1.2e-7 + skew) * (b.farthest + *bound);
    return s;
}
