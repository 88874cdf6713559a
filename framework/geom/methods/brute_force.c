/* Brute force: the distance of every point to every triangle in double, without a tree or other
 * precomputed data. It shares no geometry code with the exact engine on purpose, so that tests can
 * use it as an independent oracle. It is also the method "naive". */
#include <float.h>
#include <math.h>

#include "sdm/exact.h"
#include "sdm/internal/brute_force.h"
#include "sdm/internal/threads.h"

typedef struct vec {
    double x, y, z;
} vec;

static vec minus(vec a, vec b) { return (vec){a.x - b.x, a.y - b.y, a.z - b.z}; }
static double dot(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static vec cross(vec a, vec b)
{
    return (vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* Squared distance from the origin to the segment a b. */
static double segment_distance2(vec a, vec b)
{
    const vec d = minus(b, a);
    const double dd = dot(d, d);
    double t = dd > 0 ? -dot(a, d) / dd : 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    const vec q = {a.x + t * d.x, a.y + t * d.y, a.z + t * d.z};
    return dot(q, q);
}

/* Squared distance from the origin to the triangle: to its plane if the origin projects into the
 * triangle, otherwise to the nearest edge. */
static double triangle_distance2(vec a, vec b, vec c)
{
    const double edges =
        fmin(segment_distance2(a, b), fmin(segment_distance2(b, c), segment_distance2(c, a)));
    const vec ab = minus(b, a), bc = minus(c, b), ca = minus(a, c);
    const vec n = cross(ab, minus(c, a));
    const double nn = dot(n, n);
    const double size = fmax(dot(ab, ab), fmax(dot(bc, bc), dot(ca, ca)));
    // the normal of a needle is mostly rounding error; its edges are equally near up to rounding
    if (!(nn > 1e-18 * size * size)) return edges;
    if (dot(cross(n, ab), a) < 0 && dot(cross(n, bc), b) < 0 && dot(cross(n, ca), c) < 0) {
        const vec middle = {(a.x + b.x + c.x) / 3, (a.y + b.y + c.y) / 3, (a.z + b.z + c.z) / 3};
        const double along = dot(n, middle);
        return along * along / nn;
    }
    return edges;
}

/* Solid angle of the triangle seen from the origin, positive where the normal points away from the
 * origin (Van Oosterom and Strackee 1983). */
static double solid_angle(vec a, vec b, vec c)
{
    const double la = sqrt(dot(a, a)), lb = sqrt(dot(b, b)), lc = sqrt(dot(c, c));
    const double top = dot(a, cross(b, c));
    const double bottom = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
    return 2 * atan2(top, bottom);
}

static vec corner(const sdm_mesh *m, size_t i, vec x)
{
    const double *v = &m->vert[3 * (size_t)m->tri[i]];
    return minus((vec){v[0], v[1], v[2]}, x);
}

double sdm_naive_point(const sdm_mesh *mesh, const double x[3])
{
    const vec p = {x[0], x[1], x[2]};
    double least = INFINITY, angle = 0;
    if (!(isfinite(p.x) && isfinite(p.y) && isfinite(p.z))) return NAN;
    for (size_t t = 0; t < mesh->n_tri; t++) {
        const vec a = corner(mesh, 3 * t, p), b = corner(mesh, 3 * t + 1, p),
                  c = corner(mesh, 3 * t + 2, p);
        least = fmin(least, triangle_distance2(a, b, c));
        angle += solid_angle(a, b, c);
    }
    return angle > 6.28318530717958647692 ? -sqrt(least) : sqrt(least);
}

sdm_status sdm_naive_map(const sdm_mesh *mesh, const sdm_grid *grid, int n_threads, float *values,
                         sdm_error *err)
{
    if (!mesh || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "mesh, grid and values of a map must not be NULL");
    sdm_audit audit;
    sdm_status s = sdm_mesh_audit(mesh, &audit, err);
    if (!s) s = sdm_grid_check(grid, err);
    if (s) return s;
    const int64_t n = (int64_t)sdm_grid_count(grid);
    n_threads = sdm_threads(n_threads);
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (int64_t i = 0; i < n; i++) {
        const double index[3] = {(double)(i % grid->n[0]), (double)(i / grid->n[0] % grid->n[1]),
                                 (double)(i / grid->n[0] / grid->n[1])};
        double x[3];
        sdm_grid_world(grid, index, x);
        values[i] = (float)sdm_naive_point(mesh, x);
    }
    return SDM_OK;
}
