/* Brute-force reference for the exact engine in long double. It visits every triangle, precomputes
 * nothing and shares no code with the engine. Distance: Ericson, Real-Time Collision Detection,
 * 2005, 5.1.5; winding number: Van Oosterom and Strackee 1983. */
#ifndef SDM_TEST_LONG_DOUBLE_H
#define SDM_TEST_LONG_DOUBLE_H

#include <math.h>
#include <stdbool.h>

#include "sdm/mesh.h"

typedef long double real;
typedef struct point {
    real x, y, z;
} point;

static inline point point_of(const double x[3]) { return (point){x[0], x[1], x[2]}; }
static inline point minus(point a, point b) { return (point){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline point towards(point a, point b, real t)
{
    return (point){a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), a.z + t * (b.z - a.z)};
}
static inline real dot(point a, point b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline point cross(point a, point b)
{
    return (point){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline real length(point a) { return sqrtl(dot(a, a)); }
static inline real distance(point a, point b) { return length(minus(a, b)); }

static inline point corner_of(const sdm_mesh *m, size_t i)
{
    return point_of(&m->vert[3 * (size_t)m->tri[i]]);
}

static inline point closest_on_segment(point p, point a, point b)
{
    const point ab = minus(b, a);
    const real along = dot(minus(p, a), ab), whole = dot(ab, ab);
    if (!(along > 0)) return a;
    if (!(along < whole)) return b;
    return towards(a, b, along / whole);
}

static inline point nearer(point p, point q, point r)
{
    return distance(p, r) < distance(p, q) ? r : q;
}

/* Closest point of a needle a b c whose longest edge is a b. Searches along its height: the
 * distance to the chord at height s is a convex function of s. */
static inline point closest_on_needle(point p, point a, point b, point c)
{
    real lo = 0, hi = 1;
    point best = closest_on_segment(p, a, b);
    for (int i = 0; i < 90; i++) {
        const real s = lo + (hi - lo) * 0.45L, t = lo + (hi - lo) * 0.55L;
        const point q = closest_on_segment(p, towards(a, c, s), towards(b, c, s));
        const point r = closest_on_segment(p, towards(a, c, t), towards(b, c, t));
        best = nearer(p, nearer(p, best, q), r);
        if (distance(p, q) < distance(p, r))
            hi = t;
        else
            lo = s;
    }
    return best;
}

/* Closest point of a triangle of any shape, exact to the rounding of long double. Only if it is
 * farther than `best` may the result be less accurate. */
static inline point closest_within(point p, point a, point b, point c, real best)
{
    point q = nearer(p, nearer(p, closest_on_segment(p, a, b), closest_on_segment(p, b, c)),
                     closest_on_segment(p, c, a));
    const real ab = distance(a, b), bc = distance(b, c), ca = distance(c, a),
               longest = fmaxl(ab, fmaxl(bc, ca));
    const point n = cross(minus(b, a), minus(c, a));
    const real area2 = length(n);
    if (!(longest > 0)) return q;
    if (!(area2 > 1e-3L * longest * longest)) {
        // The normal of a needle is inaccurate. Interior points are nearer than the edges by at
        // most its height: if that cannot beat `best`, the edges suffice.
        if (distance(p, q) - area2 / longest > best) return q;
        if (ab == longest) return nearer(p, q, closest_on_needle(p, a, b, c));
        return nearer(
            p, q, bc == longest ? closest_on_needle(p, b, c, a) : closest_on_needle(p, c, a, b));
    }
    const real u = dot(n, cross(minus(b, p), minus(c, p))),
               v = dot(n, cross(minus(c, p), minus(a, p))),
               w = dot(n, cross(minus(a, p), minus(b, p)));
    if (!(u > 0 && v > 0 && w > 0)) return q;
    const real above = dot(minus(p, a), n) / (area2 * area2);
    return (point){p.x - above * n.x, p.y - above * n.y, p.z - above * n.z};
}

static inline point closest_on_triangle(point p, point a, point b, point c)
{
    return closest_within(p, a, b, c, INFINITY);
}

/* Distance from x to the nearest triangle of the mesh. */
static inline real brute_distance(const sdm_mesh *m, const double x[3])
{
    const point p = point_of(x);
    real best = INFINITY;
    for (size_t t = 0; t < m->n_tri; t++) {
        const point a = corner_of(m, 3 * t), b = corner_of(m, 3 * t + 1),
                    c = corner_of(m, 3 * t + 2);
        // skip: no point of the triangle is farther from a than the longer of the two edges at a
        if (distance(p, a) - fmaxl(distance(a, b), distance(a, c)) > best) continue;
        best = fminl(best, distance(p, closest_within(p, a, b, c, best)));
    }
    return best;
}

/* A floating-point type with more than 100 bits of mantissa where the compiler has one. */
#ifdef __SIZEOF_FLOAT128__
__extension__ typedef __float128 wide;
#else
typedef long double wide;
#endif

static inline wide wide_dot(const wide a[3], const wide b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline wide wide_length(const wide a[3])
{
    const wide square = wide_dot(a, a);
    wide root = sqrtl((long double)square);
    for (int i = 0; i < 2 && root > 0; i++) root = (root + square / root) / 2;
    return root;
}

/* Half the solid angle of a triangle; r: its vertices relative to the eye point. Numerator and
 * denominator of the tangent may cancel almost completely if the eye is close to the triangle or
 * the triangle is a needle; then the type `wide` is used. */
static inline real half_solid_angle(const point r[3])
{
    const real l[3] = {length(r[0]), length(r[1]), length(r[2])};
    const real top = dot(r[0], cross(r[1], r[2]));
    const real low = l[0] * l[1] * l[2] + dot(r[0], r[1]) * l[2] + dot(r[1], r[2]) * l[0] +
                     dot(r[2], r[0]) * l[1];
    if (hypotl(top, low) > 1e-12L * l[0] * l[1] * l[2]) return atan2l(top, low);
    wide v[3][3], len[3];
    for (int k = 0; k < 3; k++) {
        v[k][0] = r[k].x;
        v[k][1] = r[k].y;
        v[k][2] = r[k].z;
        len[k] = wide_length(v[k]);
    }
    const wide c[3] = {v[1][1] * v[2][2] - v[1][2] * v[2][1], v[1][2] * v[2][0] - v[1][0] * v[2][2],
                       v[1][0] * v[2][1] - v[1][1] * v[2][0]};
    const wide det = wide_dot(v[0], c);
    const wide den = len[0] * len[1] * len[2] + wide_dot(v[0], v[1]) * len[2] +
                     wide_dot(v[1], v[2]) * len[0] + wide_dot(v[2], v[0]) * len[1];
    // 0 for an eye in the triangle's plane (on the triangle itself the angle is undefined)
    return det != 0 ? atan2l((long double)det, (long double)den) : 0;
}

/* Winding number of the mesh around p: the sum of the solid angles over 4 pi. */
static inline real brute_winding(const sdm_mesh *m, point p)
{
    real sum = 0;
    for (size_t t = 0; t < m->n_tri; t++) {
        point r[3];
        for (size_t k = 0; k < 3; k++) r[k] = minus(corner_of(m, 3 * t + k), p);
        sum += half_solid_angle(r);
    }
    return sum / (2 * 3.14159265358979323846264338327950288L);
}

#endif
