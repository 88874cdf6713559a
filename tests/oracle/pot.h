/* A pot, an ellipsoid with a straight spout in the plane y = 0, and points of its lower part, where
 * it is nearly round. Include after fit_tools.h. */
#ifndef SDM_TEST_POT_H
#define SDM_TEST_POT_H

#include "oracle/exact_meshes.h"
#include "oracle/give_mesh.h"

enum { POT_RADIUS, POT_SPOUT, POT_TILT, POT_PARAMS, POT_POINTS = 600 };
static const sdm_param pot_params[POT_PARAMS] = {
    {"radius", "mm", 6, 8, 7, "of the body"},
    {"spout", "mm", 7.5, 10.5, 9, "length of its axis"},
    {"tilt", "rad", 0.5, 0.9, 0.7, "of the spout above the horizontal"}};
static const double POT_TRUTH[POT_PARAMS] = {7.2, 9.7, 0.59};

static int pot_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    const double c = cos(p[POT_TILT]), s = sin(p[POT_TILT]), low[3] = {0, -1.2, -1.2},
                 high[3] = {p[POT_SPOUT], 1.2, 1.2};
    sdm_mesh m = {0}, spout = {0};
    mesh_sphere(&m, (const double[3]){0, 0, 0}, 1, 24);
    for (size_t v = 0; v < m.n_vert; v++) {
        double *x = m.vert + 3 * v;
        x[0] *= p[POT_RADIUS], x[1] *= p[POT_RADIUS], x[2] *= 5.6;
    }
    mesh_box(&spout, low, high);
    for (size_t v = 0; v < spout.n_vert; v++) {
        double *x = spout.vert + 3 * v;
        const double along = x[0], up = x[2];
        x[0] = 0.55 * p[POT_RADIUS] + along * c - up * s, x[2] = along * s + up * c - 1.1;
    }
    mesh_append(&m, &spout);
    sdm_mesh_dispose(&spout);
    return give_mesh(host, out, &m);
}

static const sdm_shape pot = {.abi = SDM_SHAPE_ABI,
                              .size = sizeof(sdm_shape),
                              .name = "pot",
                              .summary = "an ellipsoid with a spout",
                              .params = pot_params,
                              .n_params = POT_PARAMS,
                              .mesh = pot_mesh};

/* points[POT_POINTS][3]: those of POT_POINTS on the surface of the pot `shape` with z < top mm
 * (and, where `back`, x < 0), with normal errors of 0.05 mm; returns their number. The spout begins
 * above z = -3 mm. */
static inline size_t pot_points(sdm_instance *shape, double top, bool back, double *points)
{
    enum { ALL = POT_POINTS };
    static double x[3 * ALL];
    sdm_mesh m = {0};
    size_t n = 0;
    if (sdm_instance_mesh(shape, POT_TRUTH, &m, NULL) ||
        sdm_fit_surface_points(&m, ALL, 2, x, NULL))
        abort();
    for (size_t i = 0; i < ALL; i++) {
        if (x[3 * i + 2] > top || (back && x[3 * i] > 0)) continue;
        for (size_t k = 0; k < 3; k++)
            points[3 * n + k] = x[3 * i + k] + 0.05 * sdm_rng_normal(1, k, i);
        n++;
    }
    sdm_mesh_dispose(&m);
    return n;
}

static inline sdm_fit_source pot_source(sdm_instance *shape)
{
    return (sdm_fit_source){
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){52, 40, 36}, 0.5, (double[3]){2, 0, 0})};
}

#endif
