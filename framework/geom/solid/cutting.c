/* Binary space partition of a convex polygon by segments. Pieces wait on a stack whose corners and
   segments lie behind each other in two arrays, so that memory is reused as soon as a piece is
   taken. */
#include "cutting.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/heap.h"

static sdm_status make_room(void **block, size_t used, size_t *cap, size_t need, size_t size,
                            sdm_error *err)
{
    if (need <= *cap) return SDM_OK;
    const size_t bigger = 2 * need + 64;
    const sdm_status s = sdm_grow(block, used, bigger, size, "cut triangles", err);
    if (!s) *cap = bigger;
    return s;
}

/* Signed distance of x from the line through the segment, and the position along it. */
typedef struct line {
    double p[2], d[2], length;
} line;

static line line_of(const double s[4])
{
    const double dx = s[2] - s[0], dy = s[3] - s[1], length = sqrt(dx * dx + dy * dy);
    return (line){{s[0], s[1]}, {dx / length, dy / length}, length};
}

static double across(const line *l, const double x[2])
{
    return l->d[0] * (x[1] - l->p[1]) - l->d[1] * (x[0] - l->p[0]);
}
static double along(const line *l, const double x[2])
{
    return l->d[0] * (x[0] - l->p[0]) + l->d[1] * (x[1] - l->p[1]);
}

static void meeting(const sdm_corner *a, double ha, const sdm_corner *b, double hb, sdm_corner *out)
{
    const double t = ha / (ha - hb);
    out->vertex = SDM_NONE;
    for (int i = 0; i < 2; i++) out->x[i] = a->x[i] + t * (b->x[i] - a->x[i]);
}

/* Does the segment run through the interior of the polygon? */
static bool enters(const double segment[4], const sdm_corner *c, size_t n, double tolerance)
{
    const line l = line_of(segment);
    double low = 0, high = 0, from = INFINITY, to = -INFINITY;
    double h = across(&l, c[n - 1].x);
    for (size_t i = 0; i < n; i++) {
        const double before = h;
        h = across(&l, c[i].x);
        low = fmin(low, h);
        high = fmax(high, h);
        if ((before < 0) == (h < 0) && h != 0) continue;
        sdm_corner x = c[i];
        if (h != 0 && before != 0)
            meeting(&c[i ? i - 1 : n - 1], before, &c[i], h, &x);
        else if (h != 0)
            x = c[i ? i - 1 : n - 1];
        const double s = along(&l, x.x);
        from = fmin(from, s);
        to = fmax(to, s);
    }
    if (!(low < -tolerance && high > tolerance)) return false;
    return fmin(to, l.length) - fmax(from, 0) > tolerance;
}

/* The part of a polygon on one side of a line (side +1: left). Returns its number of corners. */
static size_t half_polygon(const line *l, double side, const sdm_corner *c, size_t n,
                           sdm_corner *out)
{
    size_t m = 0;
    double h = side * across(l, c[n - 1].x);
    for (size_t i = 0; i < n; i++) {
        const double before = h;
        h = side * across(l, c[i].x);
        if ((before > 0 && h < 0) || (before < 0 && h > 0))
            meeting(&c[i ? i - 1 : n - 1], before, &c[i], h, &out[m++]);
        if (h >= 0) out[m++] = c[i];
    }
    return m;
}

/* The part of a segment on one side of a line; false when nothing is left. */
static bool half_segment(const line *l, double side, const double s[4], double tolerance,
                         double out[4])
{
    const double hp = side * across(l, s), hq = side * across(l, s + 2);
    if (!(hp > tolerance || hq > tolerance)) return false;
    memcpy(out, s, 4 * sizeof *out);
    if (hp >= 0 && hq >= 0) return true;
    const double t = hp / (hp - hq);
    double *end = hp < 0 ? out : out + 2;
    for (int i = 0; i < 2; i++) end[i] = s[i] + t * (s[2 + i] - s[i]);
    return true;
}

static bool narrow(const sdm_corner *c, size_t n, double tolerance)
{
    double area = 0, perimeter = 0;
    for (size_t i = 0; i < n; i++) {
        const double *a = c[i].x, *b = c[(i + 1) % n].x;
        const double dx = b[0] - a[0], dy = b[1] - a[1];
        area += 0.5 * (dx * (a[1] - c[0].x[1]) - dy * (a[0] - c[0].x[0]));
        perimeter += sqrt(dx * dx + dy * dy);
    }
    return !(fabs(area) > tolerance * perimeter);
}

/* Puts one half of the piece in the work arrays on the stack. */
static sdm_status push_half(sdm_cutter *w, size_t *n_piece, sdm_cut_piece at, sdm_cut_piece from,
                            const line *l, double side, double tolerance, sdm_cut_piece *made,
                            sdm_error *err)
{
    sdm_status s = make_room((void **)&w->corner, at.first_corner, &w->cap_corner,
                             at.first_corner + 2 * from.n_corner + 2, sizeof *w->corner, err);
    if (!s)
        s = make_room((void **)&w->segment, at.first_segment, &w->cap_segment,
                      at.first_segment + from.n_segment, sizeof *w->segment, err);
    if (!s)
        s = make_room((void **)&w->piece, *n_piece, &w->cap_piece, *n_piece + 1, sizeof *w->piece,
                      err);
    if (s) return s;
    at.n_corner = half_polygon(l, side, w->work_corner, from.n_corner, w->corner + at.first_corner);
    at.n_segment = 0;
    for (size_t i = 0; i < from.n_segment; i++)
        at.n_segment += half_segment(l, side, w->work_segment[i], tolerance,
                                     w->segment[at.first_segment + at.n_segment]);
    if (at.n_corner < 3)
        at.n_corner = at.n_segment = 0;
    else
        w->piece[(*n_piece)++] = at;
    *made = at;
    return SDM_OK;
}

/* Copies a piece off the stack, so that its place can be overwritten. */
static sdm_status take(sdm_cutter *w, sdm_cut_piece p, sdm_error *err)
{
    sdm_status s = make_room((void **)&w->work_corner, 0, &w->cap_work_corner, p.n_corner,
                             sizeof *w->work_corner, err);
    if (!s)
        s = make_room((void **)&w->work_segment, 0, &w->cap_work_segment, p.n_segment,
                      sizeof *w->work_segment, err);
    if (s) return s;
    memcpy(w->work_corner, w->corner + p.first_corner, p.n_corner * sizeof *w->corner);
    if (p.n_segment)
        memcpy(w->work_segment, w->segment + p.first_segment, p.n_segment * sizeof *w->segment);
    return SDM_OK;
}

static sdm_status start(sdm_cutter *w, const sdm_corner corner[3], const sdm_contact *contacts,
                        size_t n, sdm_error *err)
{
    sdm_status s = make_room((void **)&w->corner, 0, &w->cap_corner, 3, sizeof *w->corner, err);
    if (!s) s = make_room((void **)&w->segment, 0, &w->cap_segment, n, sizeof *w->segment, err);
    if (!s) s = make_room((void **)&w->piece, 0, &w->cap_piece, 1, sizeof *w->piece, err);
    if (s) return s;
    memcpy(w->corner, corner, 3 * sizeof *corner);
    size_t m = 0;
    for (size_t i = 0; i < n; i++) {
        if (contacts[i].kind == SDM_CONTACT_COPLANAR) continue;
        memcpy(w->segment[m], contacts[i].p, 2 * sizeof(double));
        memcpy(w->segment[m++] + 2, contacts[i].q, 2 * sizeof(double));
    }
    w->piece[0] = (sdm_cut_piece){0, 3, 0, m};
    return SDM_OK;
}

sdm_status sdm_cut_triangle(sdm_cutter *w, const sdm_corner corner[3], const sdm_contact *contacts,
                            size_t n, double tolerance,
                            sdm_status (*visit)(void *user, const sdm_corner *corner, size_t n),
                            void *user, sdm_error *err)
{
    sdm_status s = start(w, corner, contacts, n, err);
    size_t n_piece = 1;
    while (!s && n_piece) {
        const sdm_cut_piece p = w->piece[--n_piece];
        s = take(w, p, err);
        if (s) return s;
        // the middle of those that cut: a fair choice where they run along a curve
        size_t cutters = 0, chosen = 0;
        for (size_t i = 0; i < p.n_segment; i++) {
            if (!enters(w->work_segment[i], w->work_corner, p.n_corner, tolerance)) continue;
            if (cutters != i)
                memcpy(w->work_segment[cutters], w->work_segment[i], sizeof *w->work_segment);
            cutters++;
        }
        if (!cutters) {
            if (!narrow(w->work_corner, p.n_corner, tolerance))
                s = visit(user, w->work_corner, p.n_corner);
            continue;
        }
        chosen = cutters / 2;
        const line l = line_of(w->work_segment[chosen]);
        sdm_cut_piece from = p, left;
        from.n_segment = cutters;
        s = push_half(w, &n_piece, p, from, &l, 1, tolerance, &left, err);
        if (s) return s;
        const sdm_cut_piece behind = {.first_corner = p.first_corner + left.n_corner,
                                      .first_segment = p.first_segment + left.n_segment};
        s = push_half(w, &n_piece, behind, from, &l, -1, tolerance, &left, err);
    }
    return s;
}

void sdm_cutter_dispose(sdm_cutter *c)
{
    sdm_free(c->corner);
    sdm_free(c->work_corner);
    sdm_free(c->segment);
    sdm_free(c->work_segment);
    sdm_free(c->piece);
    *c = (sdm_cutter){0};
}
