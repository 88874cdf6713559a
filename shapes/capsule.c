/* The capsule: all points within a radius of a segment of the z axis. Vertices lie on the surface.
 */
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

/* Rings of one cap (its pole and the rim not counted), steps of the straight part, sectors. */
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

/* A ring (or pole: i = -1 or n_rings) is at radius * across from the axis and at radius * up +
 * length * along. */
typedef struct place {
    double across, up, along;
} place;

static place place_of(const layout *l, ptrdiff_t i)
{
    const ptrdiff_t n_cap = (ptrdiff_t)l->n_cap, rim0 = n_cap, rim1 = n_cap + (ptrdiff_t)l->n_side;
    if (i >= rim0 && i <= rim1) return (place){1, 0, (double)(i - rim0) / (double)l->n_side - 0.5};
    const ptrdiff_t steps = i < rim0 ? rim0 - i : i - rim1; // from the rim
    const double angle = LATHE_PI / 2 * (double)steps / (double)(n_cap + 1);
    return (place){steps > n_cap ? 0 : cos(angle), i < rim0 ? -sin(angle) : sin(angle),
                   i < rim0 ? -0.5 : 0.5};
}

static double *put(double *at, double x, double y, double z)
{
    at[0] = x, at[1] = y, at[2] = z;
    return at + 3;
}

// vert[n_vert][3] = radius * (across, up) + length * along: linear in the parameters, so this gives
// the derivatives too
static void write(const layout *l, double radius, double length, double *vert)
{
    const ptrdiff_t n = (ptrdiff_t)l->n_rings;
    for (ptrdiff_t i = -1; i <= n; i++) {
        const place at = place_of(l, i);
        const double across = radius * at.across, z = radius * at.up + length * at.along;
        if (i < 0 || i == n) {
            vert = put(vert, 0, 0, z);
            continue;
        }
        for (size_t j = 0; j < l->n_sectors; j++) {
            const double angle = sdm_lathe_angle((size_t)i, j, l->n_sectors);
            vert = put(vert, across * cos(angle), across * sin(angle), z);
        }
    }
}

static int mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                const double *p, sdm_mesh_out *out)
{
    (void)self;
    const layout l = layout_of(options);
    const int failed = host->reserve(host, out, sdm_lathe_n_vert(l.n_rings, l.n_sectors),
                                     sdm_lathe_n_tri(l.n_rings, l.n_sectors));
    if (failed) return failed;
    write(&l, p[RADIUS], p[LENGTH], out->vert);
    sdm_lathe_triangles(l.n_rings, l.n_sectors, false, out->tri);
    return 0;
}

static int velocity(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, size_t n_vert, double *out)
{
    (void)self, (void)p;
    const layout l = layout_of(options);
    if (n_vert != sdm_lathe_n_vert(l.n_rings, l.n_sectors))
        return host->fail(host, "velocity of another number of vertices");
    write(&l, 1, 0, out);
    write(&l, 0, 1, out + 3 * n_vert);
    return 0;
}

static int distance(const void *self, const sdm_host *host, const sdm_option_value *options,
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
    .mesh = mesh,
    .velocity = velocity,
    .distance = distance,
};
