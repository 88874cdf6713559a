/* Binary space partition of a convex polygon by segments: a piece is cut along the line of a
 * segment that enters its interior, until no segment enters any piece. The pieces are on a stack;
 * their corners and segments are consecutive in two arrays, so that popping a piece frees its
 * memory. */
#include "cutting.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/heap.h"

/* Enlarges an array with capacity *cap to at least `need` elements; keeps the first `used`
 * elements. */
static sdm_status array_reserve(void **block, size_t used, size_t *cap, size_t need, size_t size,
                                sdm_error *err)
{
    if (need <= *cap) return SDM_OK;
    const size_t bigger = 2 * need + 64;
    const sdm_status s = sdm_grow(block, used, bigger, size, "cut triangles", err);
    if (!s) *cap = bigger;
    return s;
}

/* A directed line through a segment: its start p, unit direction d and the segment's length. */
typedef struct line {
    double p[2], d[2], length;
} line;

static line line_of(const double s[4])
{
    const double dx = s[2] - s[0], dy = s[3] - s[1], length = sqrt(dx * dx + dy * dy);
    return (line){{s[0], s[1]}, {dx / length, dy / length}, length};
}

/* Signed distance of x from the line, positive to its left. */
static double line_distance(const line *l, const double x[2])
{
    return l->d[0] * (x[1] - l->p[1]) - l->d[1] * (x[0] - l->p[0]);
}

/* Position of the projection of x along the line; 0 at the segment's start. */
static double line_position(const line *l, const double x[2])
{
    return l->d[0] * (x[0] - l->p[0]) + l->d[1] * (x[1] - l->p[1]);
}

/* *out = intersection of the edge a b with the line; ha and hb are the distances of a and b from
 * the line, of opposite sign. */
static void edge_cross(const sdm_corner *a, double ha, const sdm_corner *b, double hb,
                       sdm_corner *out)
{
    const double t = ha / (ha - hb);
    out->vertex = SDM_NONE;
    for (int i = 0; i < 2; i++) out->x[i] = a->x[i] + t * (b->x[i] - a->x[i]);
}

/* Does the segment run through the interior of the polygon, by more than the tolerance? */
static bool segment_enters(const double segment[4], const sdm_corner *c, size_t n, double tolerance)
{
    const line l = line_of(segment);
    // low, high: extent of the polygon across the line; from, to: where the line enters and leaves
    // the polygon
    double low = 0, high = 0, from = INFINITY, to = -INFINITY;
    double h = line_distance(&l, c[n - 1].x);
    for (size_t i = 0; i < n; i++) {
        const double before = h;
        h = line_distance(&l, c[i].x);
        low = fmin(low, h);
        high = fmax(high, h);
        if ((before < 0) == (h < 0) && h != 0) continue;
        sdm_corner x = c[i];
        if (h != 0 && before != 0)
            edge_cross(&c[i ? i - 1 : n - 1], before, &c[i], h, &x);
        else if (h != 0)
            x = c[i ? i - 1 : n - 1];
        const double s = line_position(&l, x.x);
        from = fmin(from, s);
        to = fmax(to, s);
    }
    if (!(low < -tolerance && high > tolerance)) return false;
    return fmin(to, l.length) - fmax(from, 0) > tolerance;
}

/* out = the part of a convex polygon on one side of a line (side +1: left, -1: right). Returns the
 * number of its corners. */
static size_t polygon_half(const line *l, double side, const sdm_corner *c, size_t n,
                           sdm_corner *out)
{
    size_t m = 0;
    double h = side * line_distance(l, c[n - 1].x);
    for (size_t i = 0; i < n; i++) {
        const double before = h;
        h = side * line_distance(l, c[i].x);
        if ((before > 0 && h < 0) || (before < 0 && h > 0))
            edge_cross(&c[i ? i - 1 : n - 1], before, &c[i], h, &out[m++]);
        if (h >= 0) out[m++] = c[i];
    }
    return m;
}

/* out = the part of a segment on one side of a line; false when none of it is farther than the
 * tolerance from the line. */
static bool segment_half(const line *l, double side, const double s[4], double tolerance,
                         double out[4])
{
    const double hp = side * line_distance(l, s), hq = side * line_distance(l, s + 2);
    if (!(hp > tolerance || hq > tolerance)) return false;
    memcpy(out, s, 4 * sizeof *out);
    if (hp >= 0 && hq >= 0) return true;
    const double t = hp / (hp - hq);
    double *end = hp < 0 ? out : out + 2;
    for (int i = 0; i < 2; i++) end[i] = s[i] + t * (s[2 + i] - s[i]);
    return true;
}

/* Is the polygon at most about the tolerance wide: area <= tolerance * perimeter? */
static bool polygon_is_narrow(const sdm_corner *c, size_t n, double tolerance)
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

/* Pushes one half of a piece, on one side of a line, on the stack. from: the whole piece, whose
 * corners and segments are in the work arrays; at: where in the arrays of the stack the corners and
 * segments of the half begin. *made = the pushed piece, or one without corners when the half is
 * empty. */
static sdm_status piece_push_half(sdm_cutter *w, size_t *n_piece, sdm_cut_piece at,
                                  sdm_cut_piece from, const line *l, double side, double tolerance,
                                  sdm_cut_piece *made, sdm_error *err)
{
    sdm_status s = array_reserve((void **)&w->corner, at.first_corner, &w->cap_corner,
                                 at.first_corner + 2 * from.n_corner + 2, sizeof *w->corner, err);
    if (!s)
        s = array_reserve((void **)&w->segment, at.first_segment, &w->cap_segment,
                          at.first_segment + from.n_segment, sizeof *w->segment, err);
    if (!s)
        s = array_reserve((void **)&w->piece, *n_piece, &w->cap_piece, *n_piece + 1,
                          sizeof *w->piece, err);
    if (s) return s;
    at.n_corner = polygon_half(l, side, w->work_corner, from.n_corner, w->corner + at.first_corner);
    at.n_segment = 0;
    for (size_t i = 0; i < from.n_segment; i++)
        at.n_segment += segment_half(l, side, w->work_segment[i], tolerance,
                                     w->segment[at.first_segment + at.n_segment]);
    if (at.n_corner < 3)
        at.n_corner = at.n_segment = 0;
    else
        w->piece[(*n_piece)++] = at;
    *made = at;
    return SDM_OK;
}

/* Copies a piece from the stack to the work arrays, so that its memory can be overwritten. */
static sdm_status piece_pop(sdm_cutter *w, sdm_cut_piece p, sdm_error *err)
{
    sdm_status s = array_reserve((void **)&w->work_corner, 0, &w->cap_work_corner, p.n_corner,
                                 sizeof *w->work_corner, err);
    if (!s)
        s = array_reserve((void **)&w->work_segment, 0, &w->cap_work_segment, p.n_segment,
                          sizeof *w->work_segment, err);
    if (s) return s;
    memcpy(w->work_corner, w->corner + p.first_corner, p.n_corner * sizeof *w->corner);
    if (p.n_segment)
        memcpy(w->work_segment, w->segment + p.first_segment, p.n_segment * sizeof *w->segment);
    return SDM_OK;
}

/* Makes the triangle, with the segments of its contacts, the only piece on the stack. */
static sdm_status cutter_start(sdm_cutter *w, const sdm_corner corner[3],
                               const sdm_contact *contacts, size_t n, sdm_error *err)
{
    sdm_status s = array_reserve((void **)&w->corner, 0, &w->cap_corner, 3, sizeof *w->corner, err);
    if (!s) s = array_reserve((void **)&w->segment, 0, &w->cap_segment, n, sizeof *w->segment, err);
    if (!s) s = array_reserve((void **)&w->piece, 0, &w->cap_piece, 1, sizeof *w->piece, err);
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
    sdm_status s = cutter_start(w, corner, contacts, n, err);
    size_t n_piece = 1;
    while (!s && n_piece) {
        const sdm_cut_piece p = w->piece[--n_piece];
        s = piece_pop(w, p, err);
        if (s) return s;
        // keep the segments that enter the piece
        size_t cutters = 0;
        for (size_t i = 0; i < p.n_segment; i++) {
            if (!segment_enters(w->work_segment[i], w->work_corner, p.n_corner, tolerance))
                continue;
            if (cutters != i)
                memcpy(w->work_segment[cutters], w->work_segment[i], sizeof *w->work_segment);
            cutters++;
        }
        if (!cutters) {
            if (!polygon_is_narrow(w->work_corner, p.n_corner, tolerance))
                s = visit(user, w->work_corner, p.n_corner);
            continue;
        }
        // cut along the middle segment: if the segments follow a curve, the halves are balanced
        const line l = line_of(w->work_segment[cutters / 2]);
        sdm_cut_piece from = p, left;
        from.n_segment = cutters;
        s = piece_push_half(w, &n_piece, p, from, &l, 1, tolerance, &left, err);
        if (s) return s;
        const sdm_cut_piece behind = {.first_corner = p.first_corner + left.n_corner,
                                      .first_segment = p.first_segment + left.n_segment};
        s = piece_push_half(w, &n_piece, behind, from, &l, -1, tolerance, &left, err);
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
