/* Crossings of grid rows with a mesh: every triangle is rasterised onto the plane across the rows.
 * Where floating point is not accurate enough, exact predicates decide (line_triangle.h). */
#include "rows.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "exactly/line_triangle.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"

#define SLICE 1024 // triangles per part of the parallel loop

typedef struct hit {
    uint32_t row;
    sdm_row_crossing at;
} hit;

typedef struct collector {
    hit *list;
    size_t n, cap, limit;
} collector;

static sdm_status collector_push(collector *c, size_t row, int64_t last, int sign, sdm_error *err)
{
    if (c->n == c->cap) {
        const size_t cap = c->cap ? 2 * c->cap : 4096;
        if (c->limit && cap > c->limit)
            return sdm_fail(err, SDM_E_NOMEM,
                            "more than %zu crossings of grid rows with the mesh, no room for more "
                            "in memory_limit",
                            c->n);
        const sdm_status s =
            sdm_grow((void **)&c->list, c->n, cap, sizeof *c->list, "row crossings", err);
        if (s) return s;
        c->cap = cap;
    }
    c->list[c->n++] = (hit){(uint32_t)row, {(int32_t)last, sign}};
    return SDM_OK;
}

/* ceil(x) limited to 0 .. n, and floor(x) limited to -1 .. n - 1. */
static int64_t ceil_clamped(double x, int64_t n)
{
    if (!(x > 0)) return 0;
    if (!(x < (double)n)) return n;
    const int64_t i = (int64_t)x;
    return i + ((double)i < x);
}

static int64_t floor_clamped(double x, int64_t n)
{
    if (!(x >= 0)) return -1;
    return x < (double)n ? (int64_t)x : n - 1;
}

static void triangle_range(const double v[3][3], int a, double *lo, double *hi)
{
    *lo = *hi = v[0][a];
    for (int k = 1; k < 3; k++) {
        if (v[k][a] < *lo) *lo = v[k][a];
        if (v[k][a] > *hi) *hi = v[k][a];
    }
}

/* Adds the crossing of row (j, k) with triangle v, if any, by exact predicates. */
static sdm_status triangle_cross_exactly(const double v[3][3], int64_t j, int64_t k,
                                         const sdm_rows *r, collector *c, sdm_error *err)
{
    double p[3] = {0, (double)j, (double)k}, area[3], lo, hi;
    const int sign = sdm_line_meets(v, &p[1], area);
    if (!sign) return SDM_OK;
    // bisection: voxels <= low lie before the crossing, voxels >= high behind it
    triangle_range(v, 0, &lo, &hi);
    int64_t low = ceil_clamped(lo, r->n[0]) - 1, high = ceil_clamped(hi, r->n[0]);
    while (high - low > 1) {
        const int64_t middle = (low + high) / 2;
        p[0] = (double)middle;
        if (sdm_line_meets_after(v, p, sign, area) > 0)
            low = middle;
        else
            high = middle;
    }
    return low < 0 ? SDM_OK : collector_push(c, (size_t)(k * r->n[1] + j), low, sign, err);
}

/* A side of a triangle projected along the rows. Its edge function at row (y, k) is at - dz * (y -
 * this->y) with at = dy * (k - z): twice the signed area of the triangle (side, row), positive
 * inside. */
typedef struct side {
    double y, z, dy, dz, at;
} side;

/* Narrows the range of j to rows where the edge function may be positive, with a margin of one
 * row. */
static void side_narrow(const side *s, double error, int64_t n, int64_t *from, int64_t *to)
{
    // infinite or NaN for a side parallel to y, where dz == 0 skips both tests
    const double y = s->y + (s->at + error) / s->dz;
    if (s->dz > 0 && y < (double)*to) *to = floor_clamped(y + 1, n);
    if (s->dz < 0 && y > (double)*from) *from = ceil_clamped(y - 1, n);
}

static sdm_status triangle_rasterise(const double v[3][3], const sdm_rows *r, collector *c,
                                     sdm_error *err)
{
    // rows (j, k) within the bounding box
    double ylo, yhi, zlo, zhi, xlo, xhi;
    triangle_range(v, 2, &zlo, &zhi);
    const int64_t k0 = ceil_clamped(zlo, r->n[2]), k1 = floor_clamped(zhi, r->n[2]);
    if (k0 > k1) return SDM_OK;
    triangle_range(v, 1, &ylo, &yhi);
    const int64_t j0 = ceil_clamped(ylo, r->n[1]), j1 = floor_clamped(yhi, r->n[1]);
    if (j0 > j1) return SDM_OK;
    triangle_range(v, 0, &xlo, &xhi);
    if (!(xhi > 0)) return SDM_OK;
    // bound on the rounding error of an edge function at rows within the bounding box
    const double error = 8 * DBL_EPSILON * (yhi - ylo) * (zhi - zlo) + DBL_MIN;
    const double area =
        (v[1][1] - v[0][1]) * (v[2][2] - v[0][2]) - (v[1][2] - v[0][2]) * (v[2][1] - v[0][1]);
    const int sign = area > 0 ? 1 : -1;
    const bool edge_on = !(fabs(area) > 64 * error);
    // edge functions of the sides, and the plane x(y, z) of the triangle
    const double *a = v[0], *b = v[area > 0 ? 1 : 2], *d = v[area > 0 ? 2 : 1];
    side s[3] = {{b[1], b[2], d[1] - b[1], d[2] - b[2], 0},
                 {d[1], d[2], a[1] - d[1], a[2] - d[2], 0},
                 {a[1], a[2], b[1] - a[1], b[2] - a[2], 0}};
    const double slope_b = (b[0] - a[0]) / fabs(area), slope_d = (d[0] - a[0]) / fabs(area);
    const double blur =
        8 * error * (xhi - xlo) / fabs(area) + 8 * DBL_EPSILON * (fabs(a[0]) + (xhi - xlo));
    // rasterise; only doubtful rows use exact predicates
    for (int64_t k = k0; k <= k1; k++) {
        int64_t from = j0, to = j1;
        for (int i = 0; i < 3; i++) s[i].at = s[i].dy * ((double)k - s[i].z);
        if (j1 - j0 > 8 && !edge_on)
            for (int i = 0; i < 3; i++) side_narrow(&s[i], error, r->n[1], &from, &to);
        for (int64_t j = from; j <= to; j++) {
            const double y = (double)j;
            const double ea = s[0].at - s[0].dz * (y - s[0].y),
                         eb = s[1].at - s[1].dz * (y - s[1].y);
            const double ed = s[2].at - s[2].dz * (y - s[2].y);
            double least = ea < eb ? ea : eb;
            if (ed < least) least = ed;
            if (least < -error && !edge_on) continue;
            const double x = a[0] + eb * slope_b + ed * slope_d;
            const int64_t last = ceil_clamped(x, r->n[0]) - 1;
            // is the crossing clearly between voxels `last` and last + 1?
            const bool clear = x - (double)last > blur && (double)(last + 1) - x > blur;
            sdm_status st = SDM_OK;
            if (least > error && !edge_on && (clear || x < -blur || x > (double)r->n[0] + blur)) {
                if (last >= 0) st = collector_push(c, (size_t)(k * r->n[1] + j), last, sign, err);
            } else {
                st = triangle_cross_exactly(v, j, k, r, c, err);
            }
            if (st) return st;
        }
    }
    return SDM_OK;
}

/* Computes the inverse of the 3 x 3 matrix d of grid directions; returns the determinant of d. The
 * transpose is not accurate enough as an inverse: sdm_grid_check() accepts directions that are
 * orthonormal to only 1e-6. */
static double matrix_invert(const double d[9], double inverse[9])
{
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            const int a = (i + 1) % 3, b = (i + 2) % 3, e = (k + 1) % 3, f = (k + 2) % 3;
            inverse[3 * i + k] = d[3 * e + a] * d[3 * f + b] - d[3 * f + a] * d[3 * e + b];
        }
    }
    const double det = d[0] * inverse[0] + d[3] * inverse[1] + d[6] * inverse[2];
    for (int i = 0; i < 9; i++) inverse[i] /= det;
    return det;
}

static sdm_status rows_collect(const sdm_mesh *m, const sdm_rows *r, int n_threads, collector *c,
                               sdm_error *err)
{
    const int64_t n_slice = (int64_t)((m->n_tri + SLICE - 1) / SLICE);
    sdm_status status = SDM_OK;
    (void)n_threads; // unused without OpenMP
#pragma omp parallel for schedule(dynamic) num_threads(n_threads) if (n_slice > 1)
    for (int64_t slice = 0; slice < n_slice; slice++) {
        collector *own = &c[sdm_thread()];
        sdm_error local = {0};
        sdm_status s = SDM_OK;
        const size_t end = ((size_t)slice + 1) * SLICE;
        for (size_t t = (size_t)slice * SLICE; t < end && t < m->n_tri && !s; t++) {
            double v[3][3];
            for (size_t k = 0; k < 3; k++)
                memcpy(v[k],
                       &r->across[3 * (size_t)m->tri[3 * t + (r->orientation < 0 ? 2 - k : k)]],
                       sizeof v[k]);
            s = triangle_rasterise((const double(*)[3])v, r, own, &local);
        }
        if (!s) continue;
#pragma omp critical(sdm_rows_failed)
        status = sdm_fail(err, s, "%s", local.text);
    }
    return status;
}

/* Sorts by decreasing `last`. Crossings with equal `last` may be in any order: only their sum
 * matters. */
static void row_sort(sdm_row_crossing *list, size_t n)
{
    for (size_t i = 1; i < n; i++) {
        const sdm_row_crossing x = list[i];
        size_t k = i;
        for (; k > 0 && list[k - 1].last < x.last; k--) list[k] = list[k - 1];
        list[k] = x;
    }
}

static sdm_status rows_sort(const collector *c, int n_collector, size_t n_row, int n_threads,
                            sdm_rows *r, sdm_error *err)
{
    size_t n = 0;
    for (int i = 0; i < n_collector; i++) n += c[i].n;
    if (n >= UINT32_MAX)
        return sdm_fail(err, SDM_E_NOMEM, "%zu crossings of grid rows with the mesh, too many", n);
    sdm_status s = SDM_ALLOC(&r->first, n_row + 2, "row crossings", err);
    if (!s) s = SDM_ALLOC(&r->list, n, "row crossings", err);
    if (s) return s;
    // counting sort: first[row + 2] counts the crossings of a row; then first[row + 1] is the
    // position of the row's next crossing
    for (int i = 0; i < n_collector; i++)
        for (size_t k = 0; k < c[i].n; k++) r->first[c[i].list[k].row + 2]++;
    for (size_t i = 0; i < n_row; i++) r->first[i + 2] += r->first[i + 1];
    for (int i = 0; i < n_collector; i++)
        for (size_t k = 0; k < c[i].n; k++)
            r->list[r->first[c[i].list[k].row + 1]++] = c[i].list[k].at;
    (void)n_threads;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n > SLICE)
    for (size_t i = 0; i < n_row; i++)
        row_sort(r->list + r->first[i], r->first[i + 1] - r->first[i]);
    return SDM_OK;
}

sdm_status sdm_rows_build(const sdm_mesh *m, const sdm_grid *g, const int axis[3], int n_threads,
                          size_t memory_limit, sdm_rows *r, sdm_error *err)
{
    n_threads = sdm_threads(n_threads);
    double inverse[9];
    const double det = matrix_invert(g->dir, inverse);
    const bool even = (axis[0] + 1) % 3 == axis[1];
    r->orientation = (det > 0) == even ? 1 : -1;
    for (int a = 0; a < 3; a++) {
        r->axis[a] = axis[a];
        r->n[a] = g->n[axis[a]];
    }
    // memory that does not depend on the crossings
    const size_t n_row = (size_t)r->n[1] * (size_t)r->n[2];
    const size_t fixed = (n_row + 2) * sizeof *r->first + 3 * m->n_vert * sizeof *r->across;
    if (n_row >= UINT32_MAX - 1 || (memory_limit && fixed > memory_limit))
        return sdm_fail(err, SDM_E_NOMEM,
                        "the signs of %zu rows need %zu bytes, memory_limit leaves %zu", n_row,
                        fixed, memory_limit);
    collector *c = NULL;
    sdm_status s = SDM_ALLOC(&c, (size_t)n_threads, "row crossings", err);
    if (!s) s = SDM_ALLOC(&r->across, 3 * m->n_vert, "vertices in voxels", err);
    if (!s) {
        // memory per crossing: a hit and its entry in r->list; times 3, because a growing list
        // holds the old block and one of twice the size
        const size_t bytes = 3 * (sizeof(hit) + sizeof *r->list);
        for (int i = 0; i < n_threads && memory_limit; i++)
            c[i].limit = (memory_limit - fixed) / bytes / (size_t)n_threads + 1;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (m->n_vert > SLICE)
        for (size_t v = 0; v < m->n_vert; v++) {
            // vertex in index coordinates
            const double *x = &m->vert[3 * v],
                         d[3] = {x[0] - g->origin[0], x[1] - g->origin[1], x[2] - g->origin[2]};
            for (int a = 0; a < 3; a++) {
                const double *row = &inverse[3 * axis[a]];
                r->across[3 * v + (size_t)a] =
                    (row[0] * d[0] + row[1] * d[1] + row[2] * d[2]) / g->spacing[axis[a]];
            }
        }
        s = rows_collect(m, r, n_threads, c, err);
    }
    if (!s) s = rows_sort(c, n_threads, n_row, n_threads, r, err);
    for (int i = 0; c && i < n_threads; i++) sdm_free(c[i].list);
    sdm_free(c);
    return s;
}

void sdm_rows_dispose(sdm_rows *r)
{
    sdm_free(r->list);
    sdm_free(r->first);
    sdm_free(r->across);
    *r = (sdm_rows){0};
}

void sdm_rows_apply(const sdm_rows *r, size_t row, int64_t i0, int64_t i1, const int32_t *base,
                    float *values)
{
    for (sdm_row_span u = sdm_row_spans(r, row); sdm_row_span_next(&u);) {
        int64_t begin, end;
        sdm_row_span_clip(&u, i0, i1, &begin, &end);
        if (base) {
            for (int64_t i = begin; i < end; i++)
                values[i] = u.winding + base[i - i0] >= 1 ? -values[i] : values[i];
        } else if (u.winding >= 1) {
            for (int64_t i = begin; i < end; i++) values[i] = -values[i];
        }
    }
}
