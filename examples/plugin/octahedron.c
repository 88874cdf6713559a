/* Example of a shape plug-in in one file: a regular octahedron. */
#include <math.h>

#include <sdm/shape.h>

enum { RADIUS };

static const sdm_param PARAMS[] = {
    [RADIUS] = {.name = "radius",
                .unit = "mm",
                .min = 0.5,
                .max = 5,
                .def = 2,
                .help = "distance of the corners from the centre"},
};

/* Computes the mesh at parameters p: reserve the arrays, then write vertices (mm) and triangles
 * (counter-clockwise seen from outside). */
static int octahedron_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                           const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    const int failed = host->reserve(host, out, 6, 8);
    if (failed) return failed;

    // vertices 0, 1: +x, -x; 2, 3: +y, -y; 4, 5: +z, -z
    for (int i = 0; i < 18; i++) out->vert[i] = 0;
    for (int i = 0; i < 6; i++) out->vert[3 * i + i / 2] = i % 2 ? -p[RADIUS] : p[RADIUS];

    // one triangle per octant; mirrored octants need the opposite order of vertices
    for (unsigned i = 0; i < 8; i++) {
        const unsigned x = i & 1, y = i >> 1 & 1, z = i >> 2 & 1, mirrored = x ^ y ^ z;
        uint32_t *tri = out->tri + 3 * i;
        tri[0] = x;
        tri[1] = mirrored ? 4 + z : 2 + y;
        tri[2] = mirrored ? 2 + y : 4 + z;
    }
    return 0;
}

/* Optional: closed-form signed distance (mm), negative inside. Tests of the mesh compare with
 * it. */
static int octahedron_distance(const void *self, const sdm_host *host,
                               const sdm_option_value *options, const double *p, const double x[3],
                               double *out)
{
    (void)self, (void)host, (void)options;
    double q[3], sum = 0, d2 = 0;
    // symmetry: move the point to the octant x, y, z >= 0
    for (int k = 0; k < 3; k++) sum += q[k] = fabs(x[k]);

    // project onto the plane of the face; if the projection leaves the octant, onto the edge, then
    // the vertex
    double foot[3], rest = sum - p[RADIUS];
    int n = 3, used[3] = {1, 1, 1};
    for (int again = 1; again;) {
        again = 0;
        for (int k = 0; k < 3; k++) foot[k] = used[k] ? q[k] - rest / n : 0;
        for (int k = 0; k < 3 && !again; k++)
            if (foot[k] < 0) {
                used[k] = 0;
                rest -= q[k];
                n--;
                again = 1;
            }
    }
    for (int k = 0; k < 3; k++) d2 += (q[k] - foot[k]) * (q[k] - foot[k]);
    *out = sum < p[RADIUS] ? -sqrt(d2) : sqrt(d2);
    return 0;
}

/* Optional: what users want to know of the shape, printed by --measure. */
static const sdm_measure MEASURES[] = {{.name = "edge", .unit = "mm", .help = "length of an edge"}};

static int octahedron_measure(const void *self, const sdm_host *host,
                              const sdm_option_value *options, const double *p, uint32_t index,
                              double depth, double *value)
{
    (void)self, (void)host, (void)options, (void)index, (void)depth;
    *value = sqrt(2) * p[RADIUS];
    return 0;
}

static const sdm_shape OCTAHEDRON = {
    .abi = SDM_SHAPE_ABI,
    .size = sizeof(sdm_shape),
    .name = "octahedron",
    .summary = "regular octahedron about the origin; distance exact",
    SDM_PARAMS(PARAMS),
    .mesh = octahedron_mesh,
    .distance = octahedron_distance,
    SDM_MEASURES(MEASURES),
    .measure = octahedron_measure,
};

/* The only exported symbol: returns shape 0, 1, ... of this file, NULL after the last. */
const sdm_shape *sdm_plugin_shape(uint32_t index) { return index == 0 ? &OCTAHEDRON : NULL; }
