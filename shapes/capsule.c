/* Capsule: all points within a radius of a segment on the z axis. All vertices lie on the
 * surface. */
#include <math.h>

#include "lathe.h"
#include "sdm/shape.h"

enum { RADIUS, LENGTH, N_PARAMS };

static const sdm_param PARAMS[N_PARAMS] = {
    [RADIUS] = {"radius", "mm", 0.5, 3.0, 1.5, "radius of the capsule"},
    [LENGTH] = {"length", "mm", 0.5, 8.0, 4.0, "length of the segment, without the caps"},
};

static const sdm_option OPTIONS[] = {
    {"edge", SDM_OPTION_REAL, "mm", 0.02, 1.0, 0.30, NULL,
     "edge length the mesh aims at, at the default parameters"},
};

/* Numbers: n_cap: rings of one cap, without pole and rim; n_side: intervals along the straight
   part; n_rings: rings in total; n_sectors: vertices of a ring. */
typedef struct layout {
    size_t n_cap, n_side, n_rings, n_sectors;
} layout;

static layout layout_of(const sdm_option_value *options)
{
    const double edge = options[0].number;
    layout l = {.n_cap = sdm_lathe_pieces(LATHE_PI / 2 * PARAMS[RADIUS].def, edge, 2) - 1,
                .n_side = sdm_lathe_pieces(PARAMS[LENGTH].def, edge, 1),
                .n_sectors = sdm_lathe_pieces(2 * LATHE_PI * PARAMS[RADIUS].def, edge, 6)};
    l.n_rings = 2 * l.n_cap + l.n_side + 1;
    return l;
}

/* Position of ring i (-1 and n_rings are the poles): distance from the axis = radius * across, z =
 * radius * up + length * along. */
typedef struct ring_place {
    double across, up, along;
} ring_place;

static ring_place ring_place_of(const layout *l, ptrdiff_t i)
{
    const ptrdiff_t n_cap = (ptrdiff_t)l->n_cap, rim0 = n_cap, rim1 = n_cap + (ptrdiff_t)l->n_side;
    if (i >= rim0 && i <= rim1)
        return (ring_place){1, 0, (double)(i - rim0) / (double)l->n_side - 0.5};
    // number of steps from the rim of the cap to ring i
    const ptrdiff_t steps = i < rim0 ? rim0 - i : i - rim1;
    const double angle = LATHE_PI / 2 * (double)steps / (double)(n_cap + 1);
    return (ring_place){steps > n_cap ? 0 : cos(angle), i < rim0 ? -sin(angle) : sin(angle),
                        i < rim0 ? -0.5 : 0.5};
}

static double *vertex_write(double *at, double x, double y, double z)
{
    at[0] = x, at[1] = y, at[2] = z;
    return at + 3;
}

/* Writes vert[n_vert][3]. The vertices are linear in radius and length, so (radius, length) = (1,
   0) and (0, 1) give the derivatives. */
static void capsule_write(const layout *l, double radius, double length, double *vert)
{
    const ptrdiff_t n = (ptrdiff_t)l->n_rings;
    for (ptrdiff_t i = -1; i <= n; i++) {
        const ring_place at = ring_place_of(l, i);
        const double across = radius * at.across, z = radius * at.up + length * at.along;
        if (i < 0 || i == n) {
            vert = vertex_write(vert, 0, 0, z);
            continue;
        }
        for (size_t j = 0; j < l->n_sectors; j++) {
            const double angle = sdm_lathe_angle((size_t)i, j, l->n_sectors);
            vert = vertex_write(vert, across * cos(angle), across * sin(angle), z);
        }
    }
}

static int capsule_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                        const double *p, sdm_mesh_out *out)
{
    (void)self;
    const layout l = layout_of(options);
    const int failed = host->reserve(host, out, sdm_lathe_n_vert(l.n_rings, l.n_sectors),
                                     sdm_lathe_n_tri(l.n_rings, l.n_sectors));
    if (failed) return failed;
    capsule_write(&l, p[RADIUS], p[LENGTH], out->vert);
    sdm_lathe_triangles(l.n_rings, l.n_sectors, false, out->tri);
    return 0;
}

static int capsule_velocity(const void *self, const sdm_host *host, const sdm_option_value *options,
                            const double *p, size_t n_vert, double *out)
{
    (void)self, (void)p;
    const layout l = layout_of(options);
    if (n_vert != sdm_lathe_n_vert(l.n_rings, l.n_sectors))
        return host->fail(host, "velocity: n_vert is not the number of vertices of the mesh");
    capsule_write(&l, 1, 0, out);
    capsule_write(&l, 0, 1, out + 3 * n_vert);
    return 0;
}

static int capsule_distance(const void *self, const sdm_host *host, const sdm_option_value *options,
                            const double *p, const double x[3], double *out)
{
    (void)self, (void)host, (void)options;
    *out = hypot(hypot(x[0], x[1]), fmax(fabs(x[2]) - p[LENGTH] / 2, 0)) - p[RADIUS];
    return 0;
}

const sdm_shape sdm_shape_capsule = {
    .abi = SDM_SHAPE_ABI,
    .size = sizeof(sdm_shape),
    .name = "capsule",
    .summary = "cylinder with round ends along the z axis; distance exact",
    .params = PARAMS,
    .n_params = N_PARAMS,
    .options = OPTIONS,
    .n_options = 1,
    .mesh = capsule_mesh,
    .velocity = capsule_velocity,
    .distance = capsule_distance,
};
