/* Integer winding numbers by signed crossings: exact decisions on which triangles a ray or row meets (predicates.h). */
#include "crossings.h"

#include <math.h>
#include <string.h>

#include "predicates.h"
#include "sdm/memory.h"

/* Does the line through p across the plane of a, b, c (two coordinates each) meet the triangle? 0, or +-1 for its orientation as
   seen along the line; weight: shares of the corners at the meeting point. */
static int meets(const double a[2], const double b[2], const double c[2], const double p[2], double weight[3])
{
    const int sa = sdm_side(b, c, p, &weight[0]);
    const int sb = sdm_side(c, a, p, &weight[1]);
    if (sa != sb) return 0;
    const int sc = sdm_side(a, b, p, &weight[2]);
    if (sa != sc) return 0;
    double sum = 0;
    for (int i = 0; i < 3; i++) sum += weight[i] = fabs(weight[i]);
    for (int i = 0; i < 3; i++) weight[i] = sum > 0 ? weight[i] / sum : 1.0 / 3;
    return sa;
}

typedef struct ray {
    double p[3], across[2];
    int axis, direction;
} ray;

static int crossing(const sdm_mesh *m, uint32_t t, const ray *r)
{
    double xy[3][2], depth[3], weight[3];
    for (int k = 0; k < 3; k++) {
        const double *v = &m->vert[3 * (size_t)m->tri[3 * (size_t)t + (size_t)k]];
        xy[k][0] = v[(r->axis + 1) % 3];
        xy[k][1] = v[(r->axis + 2) % 3];
        depth[k] = v[r->axis] - r->p[r->axis];
    }
    const int orientation = meets(xy[0], xy[1], xy[2], r->across, weight);
    if (!orientation) return 0;
    const double at = weight[0] * depth[0] + weight[1] * depth[1] + weight[2] * depth[2];
    return at * r->direction > 0 ? orientation * r->direction : 0;
}

static int reaches(const sdm_bvh_node *n, const ray *r)
{
    const int i = (r->axis + 1) % 3, j = (r->axis + 2) % 3;
    if (r->across[0] < n->lo[i] || r->across[0] > n->hi[i] || r->across[1] < n->lo[j] || r->across[1] > n->hi[j])
        return 0;
    return r->direction > 0 ? n->hi[r->axis] >= r->p[r->axis] : n->lo[r->axis] <= r->p[r->axis];
}

static int skipped(uint32_t t, const uint32_t *skip, size_t n_skip)
{
    for (size_t i = 0; i < n_skip; i++)
        if (skip[i] == t) return 1;
    return 0;
}

int sdm_ray_winding(const sdm_mesh *m, const sdm_bvh *tree, const double p[3], int axis, int direction,
                    const uint32_t *skip, size_t n_skip)
{
    const ray r = {{p[0], p[1], p[2]}, {p[(axis + 1) % 3], p[(axis + 2) % 3]}, axis, direction};
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0, winding = 0;
    if (reaches(&tree->node[0], &r)) stack[top++] = 0;
    while (top) {
        const sdm_bvh_node *n = &tree->node[stack[--top]];
        for (uint32_t i = n->first; n->count && i < n->first + n->count; i++)
            if (!skipped(tree->order[i], skip, n_skip)) winding += crossing(m, tree->order[i], &r);
        for (uint32_t c = n->first; !n->count && c < n->first + 2; c++)
            if (reaches(&tree->node[c], &r)) stack[top++] = c;
    }
    return winding;
}

/* Crossings while they are collected: row of each beside the crossing. */
typedef struct collector {
    sdm_row_crossing *list;
    uint32_t *row;
    size_t n, cap;
} collector;

static sdm_status push(collector *c, size_t row, sdm_row_crossing x, sdm_error *err)
{
    if (c->n == c->cap) {
        const size_t cap = c->cap ? 2 * c->cap : 4096;
        if (cap > UINT32_MAX)
            return sdm_fail(err, SDM_E_NOMEM, "more than %zu crossings of grid rows with the mesh", c->n);
        sdm_status s = sdm_grow((void **)&c->list, c->n, cap, sizeof *c->list, "row crossings", err);
        if (!s) s = sdm_grow((void **)&c->row, c->n, cap, sizeof *c->row, "row crossings", err);
        if (s) return s;
        c->cap = cap;
    }
    c->list[c->n] = x;
    c->row[c->n++] = (uint32_t)row;
    return SDM_OK;
}

/* Range of whole numbers in [lo, hi], cut to 0 .. n - 1. */
static void whole_range(double lo, double hi, int64_t n, int64_t *from, int64_t *to)
{
    *from = lo > 0 ? lo > (double)n ? n : (int64_t)ceil(lo) : 0;
    *to = hi < (double)(n - 1) ? hi < 0 ? -1 : (int64_t)floor(hi) : n - 1;
}

/* Range of y that the triangle v (index space) takes at height z, a little enlarged. */
static void span_at(const double v[3][3], double z, double *lo, double *hi)
{
    *lo = INFINITY;
    *hi = -INFINITY;
    for (int k = 0; k < 3; k++) {
        const double *a = v[k], *b = v[(k + 1) % 3];
        if ((a[2] < z && b[2] < z) || (a[2] > z && b[2] > z)) continue;
        const double low = fmin(a[1], b[1]), high = fmax(a[1], b[1]);
        const double t = b[2] != a[2] ? (z - a[2]) / (b[2] - a[2]) : 0;
        const double y = a[1] + t * (b[1] - a[1]), margin = 1e-9 * (fabs(low) + fabs(high));
        *lo = fmin(*lo, b[2] != a[2] ? fmax(y - margin, low) : low);
        *hi = fmax(*hi, b[2] != a[2] ? fmin(y + margin, high) : high);
    }
}

static sdm_status add_triangle(const double v[3][3], const sdm_grid *g, collector *c, sdm_error *err)
{
    double yz[3][2];
    double zmin = INFINITY, zmax = -INFINITY;
    for (int k = 0; k < 3; k++) {
        yz[k][0] = v[k][1];
        yz[k][1] = v[k][2];
        zmin = fmin(zmin, v[k][2]);
        zmax = fmax(zmax, v[k][2]);
    }
    int64_t k0, k1;
    whole_range(zmin, zmax, g->n[2], &k0, &k1);
    for (int64_t k = k0; k <= k1; k++) {
        double ymin, ymax;
        int64_t j0, j1;
        span_at(v, (double)k, &ymin, &ymax);
        if (!(ymin <= ymax)) continue;
        whole_range(ymin, ymax, g->n[1], &j0, &j1);
        for (int64_t j = j0; j <= j1; j++) {
            const double p[2] = {(double)j, (double)k};
            double weight[3];
            const int sign = meets(yz[0], yz[1], yz[2], p, weight);
            if (!sign) continue;
            const double x = weight[0] * v[0][0] + weight[1] * v[1][0] + weight[2] * v[2][0];
            // voxels i < x lie before the crossing
            if (!(x > 0)) continue;
            const double last = fmin(ceil(x) - 1, (double)(g->n[0] - 1));
            const sdm_status s = push(c, (size_t)(k * g->n[1] + j), (sdm_row_crossing){(int32_t)last, sign}, err);
            if (s) return s;
        }
    }
    return SDM_OK;
}

static sdm_status sort_rows(const collector *c, size_t n_rows, sdm_rows *r, sdm_error *err)
{
    sdm_status s = SDM_ALLOC(&r->first, n_rows + 1, "row crossings", err);
    if (!s) s = SDM_ALLOC(&r->list, c->n, "row crossings", err);
    if (s) return s;
    for (size_t i = 0; i < c->n; i++) r->first[c->row[i] + 1]++;
    for (size_t i = 0; i < n_rows; i++) r->first[i + 1] += r->first[i];
    for (size_t i = 0; i < c->n; i++) r->list[r->first[c->row[i]]++] = c->list[i];
    for (size_t i = n_rows; i > 0; i--) r->first[i] = r->first[i - 1];
    r->first[0] = 0;
    return SDM_OK;
}

sdm_status sdm_rows_build(const sdm_mesh *m, const sdm_grid *g, sdm_rows *r, sdm_error *err)
{
    const size_t n_rows = (size_t)g->n[1] * (size_t)g->n[2];
    if (n_rows >= UINT32_MAX) return sdm_fail(err, SDM_E_NOMEM, "grid of %zu rows, at most %u", n_rows, UINT32_MAX - 1);
    double *index;
    collector c = {0};
    sdm_status s = SDM_ALLOC(&index, 3 * m->n_vert, "vertices in the grid", err);
    if (s) return s;
    for (size_t v = 0; v < m->n_vert; v++) sdm_grid_index(g, &m->vert[3 * v], &index[3 * v]);
    // a reflected grid sees every triangle from the other side
    const double *d = g->dir;
    const double det =
        d[0] * (d[4] * d[8] - d[5] * d[7]) - d[1] * (d[3] * d[8] - d[5] * d[6]) + d[2] * (d[3] * d[7] - d[4] * d[6]);
    for (size_t t = 0; t < m->n_tri && !s; t++) {
        double v[3][3];
        for (size_t k = 0; k < 3; k++)
            memcpy(v[k], &index[3 * (size_t)m->tri[3 * t + (det < 0 ? 2 - k : k)]], sizeof v[k]);
        s = add_triangle((const double(*)[3])v, g, &c, err);
    }
    if (!s) s = sort_rows(&c, n_rows, r, err);
    sdm_free(index);
    sdm_free(c.list);
    sdm_free(c.row);
    return s;
}

void sdm_rows_dispose(sdm_rows *r)
{
    sdm_free(r->list);
    sdm_free(r->first);
    *r = (sdm_rows){0};
}

void sdm_rows_apply(const sdm_rows *r, size_t row, int64_t nx, int32_t *change, float *values)
{
    if (r->first[row] == r->first[row + 1]) return;
    for (uint32_t i = r->first[row]; i < r->first[row + 1]; i++) change[r->list[i].last] += r->list[i].sign;
    int32_t winding = 0;
    for (int64_t i = nx - 1; i >= 0; i--) {
        winding += change[i];
        change[i] = 0;
        if (winding >= 1) values[i] = -values[i];
    }
}
