/* Points on the surface of a mesh, for a fit to the mesh, and for a fit that is judged by its
   surface. */
#include "surface_points.h"

#include <math.h>

#include "sdm/exact.h"
#include "sdm/fit.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

// the middle of each share; across triangles the golden ratio less 1: its multiples fill 0 .. 1
// evenly (Weyl 1916)
static const double MIDDLE[2] = {0, 0.61803398874989485};

static double triangle_area(const sdm_mesh *m, size_t t)
{
    const double *a = m->vert + 3 * (size_t)m->tri[3 * t],
                 *b = m->vert + 3 * (size_t)m->tri[3 * t + 1],
                 *c = m->vert + 3 * (size_t)m->tri[3 * t + 2];
    double normal[3];
    v3_triangle_normal(a, b, c, normal);
    return 0.5 * v3_norm(normal);
}

// x = the point of triangle t that (u, v) in the unit square stand for; evenly distributed pairs
// give evenly distributed points (Turk 1990)
static void triangle_point(const sdm_mesh *m, size_t t, double u, double v, double x[3])
{
    const double *a = m->vert + 3 * (size_t)m->tri[3 * t],
                 *b = m->vert + 3 * (size_t)m->tri[3 * t + 1],
                 *c = m->vert + 3 * (size_t)m->tri[3 * t + 2];
    const double root = sqrt(u), wb = root * (1 - v), wc = root * v, wa = 1 - root;
    for (int k = 0; k < 3; k++) x[k] = wa * a[k] + wb * b[k] + wc * c[k];
}

static double fraction(double x) { return x - floor(x); }

// Point i lies within the i-th of n equal shares of the area, counted over the triangles in their
// order: each triangle has its share of the points to within one. Its place within the triangle
// comes from what is left of this share and from a multiple of turn[1].
static void points_spread(const sdm_mesh *m, double area, size_t n, const double turn[2],
                          double *points, uint32_t *triangle)
{
    double before = 0, own = triangle_area(m, 0);
    size_t t = 0;
    for (size_t i = 0; i < n; i++) {
        const double at = area * ((double)i + fraction(0.5 + turn[0] * (double)i)) / (double)n;
        while (at > before + own && t + 1 < m->n_tri) {
            before += own;
            own = triangle_area(m, ++t);
        }
        const double u = own > 0 ? fmin(fmax((at - before) / own, 0), 1) : 0;
        triangle_point(m, t, u, fraction(turn[1] * (double)i), points + 3 * i);
        if (triangle) triangle[i] = (uint32_t)t;
    }
}

double sdm_fit_spread_over(const sdm_mesh *m, size_t n, const double turn[2], double *points,
                           uint32_t *triangle)
{
    double area = 0;
    for (size_t t = 0; t < m->n_tri; t++) area += triangle_area(m, t);
    if (area > 0 && isfinite(area)) points_spread(m, area, n, turn, points, triangle);
    return area;
}

sdm_status sdm_fit_surface_points(const sdm_mesh *mesh, size_t n, int n_threads, double *points,
                                  sdm_error *err)
{
    const sdm_exact_opts opts = {.n_threads = n_threads};
    sdm_exact *engine = NULL;
    const sdm_status s = sdm_exact_create(mesh, &opts, &engine, err);
    if (s) return s;
    const double area = sdm_fit_spread_over(sdm_exact_surface(engine), n, MIDDLE, points, NULL);
    sdm_exact_free(engine);
    if (area > 0 && isfinite(area)) return SDM_OK;
    return sdm_fail(err, SDM_E_MESH, "the surface of the mesh has the area %g mm^2", area);
}
