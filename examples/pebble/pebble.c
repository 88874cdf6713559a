/* The shape `pebble`: an egg-shaped pebble along the z axis, a plug-in of sdmgen in one file.
 *
 * The program calls pebble_mesh() with values of the parameters and gets a closed triangle mesh.
 * The program does everything else: distances, training, fits, files. To make a shape of your own,
 * change three things: the table of parameters, the numbers of vertices and triangles, and the mesh
 * that pebble_mesh() writes.
 *
 * Rules:
 * - triangles run counter-clockwise seen from outside;
 * - vertices are continuous functions of the parameters, without jumps;
 * - the numbers of vertices and triangles do not depend on the parameters;
 * - the mesh depends on the arguments alone, because many threads call at once: no static
 *   variables. */
#include <math.h>

#include <sdm/shape.h> // the only header that a shape needs

/* ---- the parameters ---- */

// A new parameter: a name here, a row in PARAMS, and its use in pebble_mesh() as p[NAME].
enum { LENGTH, WIDTH, TAPER };

static const sdm_param PARAMS[] = {
    [LENGTH] = {.name = "length",
                .unit = "mm",
                .min = 6,
                .max = 10,
                .def = 8,
                .help = "from end to end, along z"},
    [WIDTH] = {.name = "width",
               .unit = "mm",
               .min = 4,
               .max = 7,
               .def = 5,
               .help = "diameter half-way between the ends"},
    [TAPER] = {.name = "taper",
               .unit = "",
               .min = 0,
               .max = 0.3,
               .def = 0.15,
               .help = "how much the lower end is blunter than the upper one"},
};

/* ---- the mesh ---- */

#define PI 3.14159265358979323846

/* A closed tube: a vertex at its lower end, rings of AROUND vertices, a vertex at its upper end.
 * More rings and more vertices in a ring follow the smooth surface more closely. */
enum { RINGS = 23, AROUND = 32 };
#define TUBE_VERTICES(rings) ((rings)*AROUND + 2)
#define TUBE_TRIANGLES(rings) (2 * (rings)*AROUND)

/* Writes a vertex and returns the place of the next one. */
static double *put(double *vert, double x, double y, double z)
{
    vert[0] = x, vert[1] = y, vert[2] = z;
    return vert + 3;
}

/* Writes three indices and returns the place of the next ones. */
static uint32_t *face(uint32_t *tri, uint32_t a, uint32_t b, uint32_t c)
{
    tri[0] = a, tri[1] = b, tri[2] = c;
    return tri + 3;
}

/* Writes the TUBE_TRIANGLES(rings) triangles of a closed tube. `first` is the number of its first
 * vertex. Each ring must turn right-handed about the direction of the tube (from x to y where the
 * tube runs along z): then the triangles are counter-clockwise seen from outside. Returns the place
 * of the next triangle. */
static uint32_t *tube_faces(uint32_t *tri, uint32_t first, uint32_t rings)
{
    const uint32_t ring0 = first + 1, top = ring0 + (rings - 1) * AROUND, end = top + AROUND;
    for (uint32_t j = 0; j < AROUND; j++) {
        const uint32_t next = (j + 1) % AROUND;
        tri = face(tri, first, ring0 + next, ring0 + j);
        for (uint32_t ring = ring0; ring < top; ring += AROUND) {
            tri = face(tri, ring + j, ring + next, ring + AROUND + next);
            tri = face(tri, ring + j, ring + AROUND + next, ring + AROUND + j);
        }
        tri = face(tri, top + j, top + next, end);
    }
    return tri;
}

/* Computes the mesh at parameters p, which the program has checked against their ranges. */
static int pebble_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                       const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options; // this shape has neither shared data nor options
    // memory for the arrays out->vert[n_vert][3] (mm) and out->tri[n_tri][3]
    const int failed = host->reserve(host, out, TUBE_VERTICES(RINGS), TUBE_TRIANGLES(RINGS));
    if (failed) return failed;

    // the vertices: an ellipse turned about z, wider below than above
    double *vert = put(out->vert, 0, 0, -0.5 * p[LENGTH]);
    for (int i = 1; i <= RINGS; i++) {
        const double angle = PI * i / (RINGS + 1);
        const double radius = 0.5 * p[WIDTH] * sin(angle) * (1 + p[TAPER] * cos(angle));
        for (int j = 0; j < AROUND; j++) {
            const double turn = 2 * PI * j / AROUND;
            vert = put(vert, radius * cos(turn), radius * sin(turn), -0.5 * p[LENGTH] * cos(angle));
        }
    }
    put(vert, 0, 0, 0.5 * p[LENGTH]);

    // the triangles
    tube_faces(out->tri, 0, RINGS);
    return 0;
}

/* ---- the table of the shape ---- */

static const sdm_shape SHAPE = {
    .abi = SDM_SHAPE_ABI,
    .size = sizeof(sdm_shape),
    .name = "pebble",
    .summary = "an egg along the z axis",
    SDM_PARAMS(PARAMS), // .params, and .n_params = the number of rows
    .mesh = pebble_mesh,
};

/* The only function that the program looks for. Returns shape 0, 1, ... of this file, NULL after
 * the last. */
const sdm_shape *sdm_plugin_shape(uint32_t index) { return index == 0 ? &SHAPE : NULL; }
