/* Superquadric ellipsoid (Barr 1981):
 *     (|x/rx|^(2/e2) + |y/ry|^(2/e2))^(e2/e1) + |z/rz|^(2/e1) = 1.
 * The exponents e1 = e2 = 1 give an ellipsoid, exponents near 0 a box, exponents of 2 an
 * octahedron. Each vertex is a fixed direction scaled by the half axes, so the mesh is linear in
 * the parameters. All vertices lie on the surface. */
#include <math.h>

#include "lathe.h"
#include "sdm/shape.h"

enum { RX, RY, RZ, N_PARAMS };

static const sdm_param PARAMS[N_PARAMS] = {
    [RX] = {"rx", "mm", 1.0, 5.0, 4.0, "half axis along x"},
    [RY] = {"ry", "mm", 1.0, 4.0, 3.0, "half axis along y"},
    [RZ] = {"rz", "mm", 1.0, 4.0, 2.0, "half axis along z"},
};

enum { EDGE, E1, E2, N_OPTIONS };

static const sdm_option OPTIONS[N_OPTIONS] = {
    [EDGE] = {"edge", SDM_OPTION_REAL, "mm", 0.05, 2.0, 0.40, NULL,
              "edge length the mesh aims at, at the default parameters"},
    [E1] = {"e1", SDM_OPTION_REAL, "", 0.2, 2.0, 1.0, NULL,
            "exponent of the outline along z: 0.2 square, 1 round, 2 pointed"},
    [E2] = {"e2", SDM_OPTION_REAL, "", 0.2, 2.0, 1.0, NULL, "exponent of the outline across z"},
};

static void ring_counts(const sdm_option_value *options, size_t *n_rings, size_t *n_sectors)
{
    const double radius = (PARAMS[RX].def + PARAMS[RY].def + PARAMS[RZ].def) / 3,
                 edge = options[EDGE].number;
    *n_rings = sdm_lathe_pieces(LATHE_PI * radius, edge, 4) - 1;
    *n_sectors = sdm_lathe_pieces(2 * LATHE_PI * radius, edge, 6);
}

/* Scales the direction s to the superquadric with half axes 1. */
static void direction_scale(double e1, double e2, double s[3])
{
    if (e1 == 1 && e2 == 1) return;
    const double root_function =
        pow(pow(fabs(s[0]), 2 / e2) + pow(fabs(s[1]), 2 / e2), e2 / e1) + pow(fabs(s[2]), 2 / e1);
    const double scale = pow(root_function, -e1 / 2);
    for (int k = 0; k < 3; k++) s[k] *= scale;
}

/* Writes vert[n_vert][3] in the order of lathe.h; linear in the radii. */
static void ellipsoid_write(const sdm_option_value *options, const double radii[3], double *vert)
{
    size_t n_rings, n_sectors;
    ring_counts(options, &n_rings, &n_sectors);
    for (size_t i = 0; i <= n_rings + 1; i++) {
        const size_t n = i == 0 || i == n_rings + 1 ? 1 : n_sectors;
        const double down = LATHE_PI * (double)i / (double)(n_rings + 1),
                     across = n == 1 ? 0 : sin(down);
        for (size_t j = 0; j < n; j++) {
            const double angle = sdm_lathe_angle(i + 1, j, n_sectors);
            double s[3] = {across * cos(angle), across * sin(angle), -cos(down)};
            direction_scale(options[E1].number, options[E2].number, s);
            for (int k = 0; k < 3; k++) *vert++ = radii[k] * s[k];
        }
    }
}

static int ellipsoid_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                          const double *p, sdm_mesh_out *out)
{
    (void)self;
    size_t n_rings, n_sectors;
    ring_counts(options, &n_rings, &n_sectors);
    const int failed = host->reserve(host, out, sdm_lathe_n_vert(n_rings, n_sectors),
                                     sdm_lathe_n_tri(n_rings, n_sectors));
    if (failed) return failed;
    ellipsoid_write(options, p, out->vert);
    sdm_lathe_triangles(n_rings, n_sectors, false, out->tri);
    return 0;
}

static int ellipsoid_velocity(const void *self, const sdm_host *host,
                              const sdm_option_value *options, const double *p, size_t n_vert,
                              double *out)
{
    (void)self, (void)p;
    size_t n_rings, n_sectors;
    ring_counts(options, &n_rings, &n_sectors);
    if (n_vert != sdm_lathe_n_vert(n_rings, n_sectors))
        return host->fail(host, "velocity: n_vert is not the number of vertices of the mesh");
    for (size_t k = 0; k < N_PARAMS; k++) {
        double one[3] = {0, 0, 0};
        one[k] = 1;
        ellipsoid_write(options, one, out + 3 * k * n_vert);
    }
    return 0;
}

/* Distance of a point y >= 0 to the ellipsoid with half axes r[0], r[1] >= r[2] (after Eberly,
 * "Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid", 2013). The nearest
 * point has coordinates r[k]^2 y[k] / (s + r[k]^2 - r[2]^2), where s > 0 is the only root of the
 * decreasing function
 *     g(s) = sum over k of (r[k] y[k] / (s + r[k]^2 - r[2]^2))^2 - 1.
 * Bisection ends when no double lies between the bounds, so it cannot fail. Without a root (y[2] =
 * 0 and y near the centre) s = 0, and the nearest point leaves the plane y[2] = 0 along the
 * shortest axis. This function returns g(s). */
static double root_function(const double r[3], const double y[3], double s)
{
    double g = -1;
    for (int k = 0; k < 3; k++) {
        const double top = r[k] * y[k], gap = (r[k] - r[2]) * (r[k] + r[2]);
        if (top > 0) g += (top / (s + gap)) * (top / (s + gap));
    }
    return g;
}

static double ellipsoid_distance_sorted(const double r[3], const double y[3])
{
    double x[3] = {0, 0, 0}, inside = 0, d = 0;
    for (int k = 0; k < 3; k++) inside += (y[k] / r[k]) * (y[k] / r[k]);
    if (root_function(r, y, 0) > 0) {
        double lo = r[2] * y[2], hi = hypot(hypot(r[0] * y[0], r[1] * y[1]), r[2] * y[2]);
        for (double s = (lo + hi) / 2; s > lo && s < hi; s = (lo + hi) / 2) {
            if (root_function(r, y, s) > 0)
                lo = s;
            else
                hi = s;
        }
        for (int k = 0; k < 3; k++)
            if (y[k] > 0) x[k] = r[k] * r[k] * y[k] / (hi + (r[k] - r[2]) * (r[k] + r[2]));
    } else {
        double rest = 1;
        for (int k = 0; k < 2; k++) {
            if (y[k] > 0) x[k] = r[k] * r[k] * y[k] / ((r[k] - r[2]) * (r[k] + r[2]));
            rest -= (x[k] / r[k]) * (x[k] / r[k]);
        }
        x[2] = r[2] * sqrt(fmax(rest, 0));
    }
    for (int k = 0; k < 3; k++) d += (x[k] - y[k]) * (x[k] - y[k]);
    return inside < 1 ? -sqrt(d) : sqrt(d);
}

static int ellipsoid_distance(const void *self, const sdm_host *host,
                              const sdm_option_value *options, const double *p, const double x[3],
                              double *out)
{
    (void)self;
    if (options[E1].number != 1 || options[E2].number != 1)
        return host->fail(host, "there is no closed form for exponents other than e1 = e2 = 1");
    int least = 0;
    for (int k = 1; k < 3; k++)
        if (p[k] < p[least]) least = k;
    double r[3], y[3];
    for (int k = 0; k < 3; k++) r[k] = p[(least + 1 + k) % 3], y[k] = fabs(x[(least + 1 + k) % 3]);
    *out = ellipsoid_distance_sorted(r, y);
    return 0;
}

const sdm_shape sdm_shape_ellipsoid = {
    .abi = SDM_SHAPE_ABI,
    .size = sizeof(sdm_shape),
    .name = "ellipsoid",
    .summary =
        "ellipsoid or superquadric along the axes; distance exact for e1 = e2 = 1, none otherwise",
    .params = PARAMS,
    .n_params = N_PARAMS,
    .options = OPTIONS,
    .n_options = N_OPTIONS,
    .mesh = ellipsoid_mesh,
    .velocity = ellipsoid_velocity,
    .distance = ellipsoid_distance,
};
