/* Example of a shape plug-in with options, parameters that depend on them, and velocities: a gear
 * wheel about the z axis, with sharp teeth and a bore.
 *
 * The mesh is a grid that closes in both directions: columns of four vertices at the angles of the
 * profile, which has four corners for each tooth. */
#include <math.h>
#include <stdlib.h>

#include <sdm/shape.h>

#define PI 3.14159265358979323846
#define TEETH_DEFAULT 10

enum { ANGLE, RADIUS, DEPTH, THICKNESS, N_PARAMS };

/* With the default number of teeth. */
static const sdm_param PARAMS[N_PARAMS] = {
    [ANGLE] = {"angle", "rad", -PI / TEETH_DEFAULT, PI / TEETH_DEFAULT, 0,
               "turn of the wheel, over one pitch"},
    [RADIUS] = {"radius", "mm", 3, 5, 4, "distance of the tips of the teeth from the axis"},
    [DEPTH] = {"depth", "mm", 0.3, 1.2, 0.8, "height of the teeth"},
    [THICKNESS] = {"thickness", "mm", 0.8, 3, 1.6, "thickness of the wheel, along z"},
};

enum { TEETH, BORE, N_OPTIONS };

static const sdm_option OPTIONS[N_OPTIONS] = {
    [TEETH] = {"teeth", SDM_OPTION_INT, "", 6, 100, TEETH_DEFAULT, NULL, "number of teeth"},
    [BORE] = {"bore", SDM_OPTION_REAL, "mm", 0.2, 1.6, 1.0, NULL, "radius of the bore"},
};

/* A corner of the profile of a tooth: its angle in pitches from the middle of the tooth, and
 * whether it is at the root. */
static const struct corner {
    double angle;
    int root;
} CORNERS[4] = {{-0.32, 1}, {-0.14, 0}, {0.14, 0}, {0.32, 1}};

/* Vertices of a column, around its section: outer wall, upper face, bore, lower face lie between
 * them. */
static const struct end {
    int outer, sign;
} ENDS[4] = {{1, -1}, {1, 1}, {0, 1}, {0, -1}};

/* The data of an instance: its parameters, with the range of the angle for its number of teeth. A
 * turn by a whole pitch gives the same wheel. */
typedef struct gear {
    sdm_param params[N_PARAMS];
} gear;

static int gear_create(const sdm_host *host, const sdm_option_value *options, void **self)
{
    gear *g = malloc(sizeof *g);
    if (!g) return host->fail(host, "out of memory");
    for (int i = 0; i < N_PARAMS; i++) g->params[i] = PARAMS[i];
    g->params[ANGLE].max = PI / options[TEETH].number;
    g->params[ANGLE].min = -g->params[ANGLE].max;
    *self = g;
    return 0;
}

static void gear_destroy(void *self) { free(self); }

static void gear_describe(const void *self, const sdm_param **params, uint32_t *n_params)
{
    const gear *g = self;
    *params = g->params;
    *n_params = N_PARAMS;
}

static size_t count_columns(const sdm_option_value *options)
{
    return 4 * (size_t)options[TEETH].number;
}

/* Writes cosine and sine of a column's angle. */
static void direction_of(const sdm_option_value *options, const double *p, size_t column,
                         double direction[2])
{
    const double pitch = 2 * PI / options[TEETH].number,
                 angle = p[ANGLE] + pitch * ((double)(column / 4) + CORNERS[column % 4].angle);
    direction[0] = cos(angle);
    direction[1] = sin(angle);
}

/* Distance of a vertex from the axis. */
static double radius_of(const sdm_option_value *options, const double *p, size_t vertex)
{
    if (!ENDS[vertex % 4].outer) return options[BORE].number;
    return p[RADIUS] - CORNERS[vertex / 4 % 4].root * p[DEPTH];
}

static int gear_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                     const double *p, sdm_mesh_out *out)
{
    (void)self;
    const size_t n = count_columns(options);
    const int failed = host->reserve(host, out, 4 * n, 8 * n);
    if (failed) return failed;
    double *vert = out->vert;
    uint32_t *tri = out->tri;
    for (size_t i = 0; i < n; i++) {
        double direction[2];
        direction_of(options, p, i, direction);
        for (size_t k = 0; k < 4; k++) {
            const double radius = radius_of(options, p, 4 * i + k);
            *vert++ = radius * direction[0];
            *vert++ = radius * direction[1];
            *vert++ = ENDS[k].sign * p[THICKNESS] / 2;

            // the two triangles between this vertex, the next column and the next vertex
            const size_t next = (i + 1) % n, k1 = (k + 1) % 4;
            const size_t quad[6] = {4 * i + k, 4 * next + k,  4 * next + k1,
                                    4 * i + k, 4 * next + k1, 4 * i + k1};
            for (int j = 0; j < 6; j++) *tri++ = (uint32_t)quad[j];
        }
    }
    return 0;
}

/* Optional: derivatives of the vertices by the parameters, velocity[n_params][n_vert][3]. */
static int gear_velocity(const void *self, const sdm_host *host, const sdm_option_value *options,
                         const double *p, size_t n_vert, double *velocity)
{
    (void)self;
    const size_t n = count_columns(options);
    if (n_vert != 4 * n)
        return host->fail(host, "velocity: n_vert is not the number of vertices of the mesh");
    for (size_t i = 0; i < n_vert; i++) {
        const struct corner *corner = &CORNERS[i / 4 % 4];
        const struct end *end = &ENDS[i % 4];
        const double radius = radius_of(options, p, i);
        double direction[2];
        direction_of(options, p, i / 4, direction);
        double *by[N_PARAMS]; // velocity of the vertex by each parameter
        for (size_t j = 0; j < N_PARAMS; j++) {
            by[j] = velocity + 3 * (j * n_vert + i);
            by[j][0] = by[j][1] = by[j][2] = 0;
        }
        by[ANGLE][0] = -radius * direction[1];
        by[ANGLE][1] = radius * direction[0];
        for (int k = 0; k < 2; k++) {
            by[RADIUS][k] = end->outer * direction[k];
            by[DEPTH][k] = -end->outer * corner->root * direction[k];
        }
        by[THICKNESS][2] = end->sign / 2.0;
    }
    return 0;
}

static const sdm_shape GEAR = {
    .abi = SDM_SHAPE_ABI,
    .size = sizeof(sdm_shape),
    .name = "gear",
    .summary = "gear wheel about the z axis, with sharp teeth and a bore",
    SDM_PARAMS(PARAMS),
    SDM_OPTIONS(OPTIONS),
    .create = gear_create,
    .destroy = gear_destroy,
    .describe = gear_describe,
    .mesh = gear_mesh,
    .velocity = gear_velocity,
};

/* The only exported symbol: returns shape 0, 1, ... of this file, NULL after the last. */
const sdm_shape *sdm_plugin_shape(uint32_t index) { return index == 0 ? &GEAR : NULL; }
