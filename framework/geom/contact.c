/* Triangle-triangle intersections of a mesh with itself: pairs from the tree, segments by clipping in the triangle's frame. */
#include "contact.h"

#include <float.h>
#include <string.h>

#include "sdm/memory.h"
#include "vec3.h"

typedef struct finder {
    const sdm_mesh *mesh;
    const sdm_topology *topo;
    const sdm_frame *frames;
    sdm_contacts *out;
    sdm_error *err;
} finder;

double sdm_frame_height(const sdm_frame *f)
{
    // 2 area / base: the third corner is (2 half[0] + 2 half[1] e1) in the frame
    return 2 * f->half[1] * fabs(f->e1y);
}

void sdm_frame_flatten(const sdm_frame *f, const double x[3], double xy[2])
{
    double w[3];
    v3_sub(x, f->a, w);
    xy[0] = v3_dot(w, f->u);
    xy[1] = v3_dot(w, f->v);
}

void sdm_frame_lift(const sdm_frame *f, const double xy[2], double x[3])
{
    for (int i = 0; i < 3; i++) x[i] = f->a[i] + xy[0] * f->u[i] + xy[1] * f->v[i];
}

static const double *corner(const finder *w, uint32_t t, int i)
{
    return &w->mesh->vert[3 * (size_t)w->topo->tri[3 * (size_t)t + (size_t)i]];
}

static sdm_status add(finder *w, sdm_contact c)
{
    sdm_contacts *out = w->out;
    // sheets laid on each other many times over: the number of contacts grows with the square of the layers
    const size_t most = 64 * w->topo->n_tri + ((size_t)1 << 20);
    if (out->n == most)
        return sdm_fail(
            w->err, SDM_E_MESH,
            "triangles of the mesh touch or cross each other more than %zu times: remove its duplicate layers", most);
    if (out->n == out->cap) {
        const size_t cap = out->cap ? 2 * out->cap : 256;
        const sdm_status s = sdm_grow((void **)&out->list, out->n, cap, sizeof *out->list, "contacts", w->err);
        if (s) return s;
        out->cap = cap;
    }
    out->list[out->n++] = c;
    return SDM_OK;
}

/* Distances of the corners of triangle j from the plane of triangle i; what rounding of the coordinates may explain is 0. Returns a
   mask of the signs that occur: 1 negative, 2 zero, 4 positive. */
static int plane_distances(const finder *w, uint32_t i, uint32_t j, double d[3], double *moved)
{
    const sdm_frame *f = &w->frames[i];
    const double height = sdm_frame_height(f);
    int mask = 0;
    *moved = 0;
    for (int k = 0; k < 3; k++) {
        double r[3];
        v3_sub(corner(w, j, k), f->a, r);
        d[k] = v3_dot(r, f->n);
        const double reach = fabs(r[0]) + fabs(r[1]) + fabs(r[2]);
        if (fabs(d[k]) * height <= w->out->tolerance * (height + reach)) {
            if (fabs(d[k]) > *moved) *moved = fabs(d[k]);
            d[k] = 0;
        }
        mask |= d[k] < 0 ? 1 : d[k] > 0 ? 4 : 2;
    }
    return mask;
}

/* The part of the segment p q that lies on the triangle of frame f (made larger by the tolerance); false when it is not longer
   than the tolerance. */
static bool clip_segment(const sdm_frame *f, double tolerance, double p[2], double q[2])
{
    const double hp[3] = {-p[1], f->e1y * p[0] - f->e1x * p[1] - f->kh1, f->e2y * p[0] - f->e2x * p[1]};
    const double hq[3] = {-q[1], f->e1y * q[0] - f->e1x * q[1] - f->kh1, f->e2y * q[0] - f->e2x * q[1]};
    double from = 0, to = 1;
    for (int k = 0; k < 3; k++) {
        const double a = hp[k] - tolerance, b = hq[k] - tolerance;
        if (a > 0 && b > 0) return false;
        if (a > 0) from = fmax(from, a / (a - b));
        if (b > 0) to = fmin(to, a / (a - b));
    }
    const double dx = q[0] - p[0], dy = q[1] - p[1];
    if (!((to - from) * sqrt(dx * dx + dy * dy) > 4 * tolerance)) return false;
    q[0] = p[0] + to * dx;
    q[1] = p[1] + to * dy;
    p[0] += from * dx;
    p[1] += from * dy;
    return true;
}

/* Where triangle j, at distances d from the plane of i, meets that plane: two points; false when it touches in one. */
static bool plane_section(const finder *w, uint32_t j, const double d[3], double p[2][3])
{
    int n = 0;
    for (int k = 0; k < 3 && n < 2; k++)
        if (d[k] == 0) memcpy(p[n++], corner(w, j, k), sizeof p[0]);
    for (int k = 0; k < 3 && n < 2; k++) {
        const int l = (k + 1) % 3;
        if (!((d[k] < 0 && d[l] > 0) || (d[k] > 0 && d[l] < 0))) continue;
        const double *a = corner(w, j, k), *b = corner(w, j, l);
        const double t = d[k] / (d[k] - d[l]);
        for (int c = 0; c < 3; c++) p[n][c] = a[c] + t * (b[c] - a[c]);
        n++;
    }
    return n == 2;
}

static sdm_status add_section(finder *w, uint32_t i, uint32_t j, const double d[3], bool *met)
{
    double p[2][3];
    if (!plane_section(w, j, d, p)) return SDM_OK;
    sdm_contact c = {.tri = i, .other = j, .kind = SDM_CONTACT_SEGMENT};
    sdm_frame_flatten(&w->frames[i], p[0], c.p);
    sdm_frame_flatten(&w->frames[i], p[1], c.q);
    if (!clip_segment(&w->frames[i], w->out->tolerance, c.p, c.q)) return SDM_OK;
    *met = true;
    return add(w, c);
}

/* True when the coplanar triangle j covers more than a seam of i: some edge separates them otherwise. */
static bool covers(const finder *w, uint32_t i, uint32_t j)
{
    for (int side = 0; side < 2; side++) {
        const sdm_frame *f = &w->frames[side ? j : i];
        const uint32_t other = side ? i : j;
        double least[3] = {INFINITY, INFINITY, INFINITY};
        for (int k = 0; k < 3; k++) {
            double x[2];
            sdm_frame_flatten(f, corner(w, other, k), x);
            least[0] = fmin(least[0], -x[1]);
            least[1] = fmin(least[1], f->e1y * x[0] - f->e1x * x[1] - f->kh1);
            least[2] = fmin(least[2], f->e2y * x[0] - f->e2x * x[1]);
        }
        for (int k = 0; k < 3; k++)
            if (!(least[k] < -4 * w->out->tolerance)) return false;
    }
    return true;
}

static sdm_status add_coplanar(finder *w, uint32_t i, uint32_t j)
{
    const sdm_frame *f = &w->frames[i];
    sdm_status s = add(w, (sdm_contact){.tri = i, .other = j, .kind = SDM_CONTACT_COPLANAR});
    for (int k = 0; k < 3 && !s; k++) {
        sdm_contact c = {.tri = i, .other = j, .kind = SDM_CONTACT_SEGMENT};
        sdm_frame_flatten(f, corner(w, j, k), c.p);
        sdm_frame_flatten(f, corner(w, j, (k + 1) % 3), c.q);
        if (clip_segment(f, w->out->tolerance, c.p, c.q)) s = add(w, c);
    }
    return s;
}

static sdm_status visit_pair(void *user, uint32_t i, uint32_t j)
{
    finder *w = user;
    sdm_contacts *out = w->out;
    int shared = 0;
    const uint32_t *a = &w->topo->tri[3 * (size_t)i], *b = &w->topo->tri[3 * (size_t)j];
    for (int k = 0; k < 3; k++) shared += a[k] == b[0] || a[k] == b[1] || a[k] == b[2];
    double di[3], dj[3], moved_i, moved_j;
    const int mask_j = plane_distances(w, i, j, dj, &moved_j);
    if (mask_j == 1 || mask_j == 4) return SDM_OK;
    if (shared && (mask_j == 3 || mask_j == 6)) {
        // the rest of j lies on one side: i and j meet in what they share unless another corner of j is on the plane as well
        if ((dj[0] == 0) + (dj[1] == 0) + (dj[2] == 0) == shared) return SDM_OK;
    }
    if (!(sdm_frame_height(&w->frames[i]) > out->tolerance) || !(sdm_frame_height(&w->frames[j]) > out->tolerance))
        return SDM_OK;
    const int mask_i = plane_distances(w, j, i, di, &moved_i);
    if (mask_i == 1 || mask_i == 4) return SDM_OK;

    sdm_status s = SDM_OK;
    bool met = false;
    if (mask_j == 2 || mask_i == 2) {
        met = covers(w, i, j);
        if (met) s = add_coplanar(w, i, j);
        if (met && !s) s = add_coplanar(w, j, i);
    } else if (shared < 2) {
        s = add_section(w, i, j, dj, &met);
        if (!s) s = add_section(w, j, i, di, &met);
    }
    if (met) {
        out->crossing_pairs += !shared;
        out->error = fmax(out->error, fmax(moved_i, moved_j));
    }
    return s;
}

static sdm_status sort_contacts(sdm_contacts *c, size_t n_tri, sdm_error *err)
{
    sdm_contact *sorted = NULL;
    sdm_status s = SDM_ALLOC(&c->first, n_tri + 1, "contacts", err);
    if (!s) s = SDM_ALLOC(&sorted, c->n, "contacts", err);
    if (s) return s;
    for (size_t i = 0; i < c->n; i++) c->first[c->list[i].tri + 1]++;
    for (size_t t = 0; t < n_tri; t++) c->first[t + 1] += c->first[t];
    for (size_t i = 0; i < c->n; i++) sorted[c->first[c->list[i].tri]++] = c->list[i];
    for (size_t t = n_tri; t > 0; t--) c->first[t] = c->first[t - 1];
    c->first[0] = 0;
    sdm_free(c->list);
    c->list = sorted;
    c->cap = c->n;
    return SDM_OK;
}

sdm_status sdm_contacts_find(const sdm_mesh *m, const sdm_topology *topo, const sdm_bvh *tree, const sdm_frame *frames,
                             sdm_contacts *c, sdm_error *err)
{
    double largest = 0;
    for (size_t i = 0; i < 3 * m->n_vert; i++) largest = fmax(largest, fabs(m->vert[i]));
    c->tolerance = 16 * DBL_EPSILON * largest;
    finder w = {m, topo, frames, c, err};
    const sdm_status s = sdm_bvh_pairs(tree, c->tolerance, visit_pair, &w);
    return s ? s : sort_contacts(c, m->n_tri, err);
}

void sdm_contacts_dispose(sdm_contacts *c)
{
    sdm_free(c->list);
    sdm_free(c->first);
    *c = (sdm_contacts){0};
}
