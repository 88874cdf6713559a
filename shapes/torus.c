/* Torus around the z axis. All vertices lie on the surface. */
#include <math.h>

#include "lathe.h"
#include "sdm/shape.h"

enum { MAJOR, MINOR, N_PARAMS };

static const sdm_param PARAMS[N_PARAMS] = {
    [MAJOR] = {"major", "mm", 2.0, 4.0, 3.0, "radius of the circle in the middle of the tube"},
    [MINOR] = {"minor", "mm", 0.5, 1.5, 1.0, "radius of the tube"},
};

static const sdm_option OPTIONS[] = {
    {"edge", SDM_OPTION_REAL, "mm", 0.02, 1.0, 0.30, NULL,
     "edge length the mesh aims at, at the default parameters"},
};

/* Numbers of sectors: n_long around the axis, n_round around the tube. */
static void sector_counts(const sdm_option_value *options, size_t *n_long, size_t *n_round)
{
    *n_long = sdm_lathe_pieces(2 * LATHE_PI * PARAMS[MAJOR].def, options[0].number, 8);
    *n_round = sdm_lathe_pieces(2 * LATHE_PI * PARAMS[MINOR].def, options[0].number, 6);
}

static int torus_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                      const double *p, sdm_mesh_out *out)
{
    (void)self;
    size_t n_long, n_round;
    sector_counts(options, &n_long, &n_round);
    const int failed = host->reserve(host, out, n_long * n_round, 2 * n_long * n_round);
    if (failed) return failed;

    double *vert = out->vert;
    uint32_t *tri = out->tri;
    for (size_t i = 0; i < n_long; i++) {
        const double u = 2 * LATHE_PI * (double)i / (double)n_long;
        for (size_t j = 0; j < n_round; j++) {
            const double v = 2 * LATHE_PI * (double)j / (double)n_round,
                         away = p[MAJOR] + p[MINOR] * cos(v);
            *vert++ = away * cos(u);
            *vert++ = away * sin(u);
            *vert++ = p[MINOR] * sin(v);
            const size_t i1 = (i + 1) % n_long, j1 = (j + 1) % n_round;
            const uint32_t a = (uint32_t)(i * n_round + j), b = (uint32_t)(i1 * n_round + j);
            const uint32_t c = (uint32_t)(i1 * n_round + j1), d = (uint32_t)(i * n_round + j1);
            const uint32_t both[6] = {a, b, c, a, c, d};
            for (int k = 0; k < 6; k++) *tri++ = both[k];
        }
    }
    return 0;
}

static int torus_velocity(const void *self, const sdm_host *host, const sdm_option_value *options,
                          const double *p, size_t n_vert, double *out)
{
    (void)self, (void)p;
    size_t n_long, n_round;
    sector_counts(options, &n_long, &n_round);
    if (n_vert != n_long * n_round)
        return host->fail(host, "velocity: n_vert is not the number of vertices of the mesh");
    double *major = out, *minor = out + 3 * n_vert;
    for (size_t i = 0; i < n_long; i++)
        for (size_t j = 0; j < n_round; j++) {
            const double u = 2 * LATHE_PI * (double)i / (double)n_long,
                         v = 2 * LATHE_PI * (double)j / (double)n_round;
            *major++ = cos(u), *minor++ = cos(v) * cos(u);
            *major++ = sin(u), *minor++ = cos(v) * sin(u);
            *major++ = 0, *minor++ = sin(v);
        }
    return 0;
}

/* Exact everywhere, because the parameter ranges keep minor < major. */
static int torus_distance(const void *self, const sdm_host *host, const sdm_option_value *options,
                          const double *p, const double x[3], double *out)
{
    (void)self, (void)host, (void)options;
    *out = hypot(hypot(x[0], x[1]) - p[MAJOR], x[2]) - p[MINOR];
    return 0;
}

const sdm_shape sdm_shape_torus = {
    .abi = SDM_SHAPE_ABI,
    .size = sizeof(sdm_shape),
    .name = "torus",
    .summary = "torus about the z axis; distance exact",
    .params = PARAMS,
    .n_params = N_PARAMS,
    .options = OPTIONS,
    .n_options = 1,
    .mesh = torus_mesh,
    .velocity = torus_velocity,
    .distance = torus_distance,
};
