/* Shapes for tests of the template network: boxes on joints, and a bent ring. Include cmocka.h
 * first. */
#ifndef SDM_TEST_TEMPLATE_SHAPES_H
#define SDM_TEST_TEMPLATE_SHAPES_H

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "sdm/registry.h"

enum { LINK_PARAMS = 3, BOXES = 5, RING_PARAMS = 4 };

/* What is wrong with a mechanism. COUNT: one more vertex where abs(p[0] - strange) < 1e-9; WINDING:
   there, another order of the triangles; CAVITY: the last box lies within the first one, inside
   out; BEND: the last box bends. */
typedef enum mistake { NONE, COUNT, WINDING, CAVITY, BEND } mistake;
static mistake mistaken;
static double strange;

/* Index of a box in the mesh: a base that lies still, an arm that turns about z, a hand on the arm
   that turns about y, a tool fixed to the hand, and a block that is stretched along x. */
enum { BASE, ARM, HAND, TOOL, BLOCK };
static const double box_low[BOXES][3] = {
    {-5, -1, -4}, {-1, -1, -1}, {3, -1, -1}, {6, -1, -1}, {-4, -1, 3}};
static const double box_high[BOXES][3] = {
    {5, 1, -2}, {2.5, 1, 1}, {5.5, 1, 1}, {8, 1, 1}, {-1, 1, 5}};

static inline void turn(double *a, double *b, double angle)
{
    const double x = *a, y = *b;
    *a = cos(angle) * x - sin(angle) * y;
    *b = sin(angle) * x + cos(angle) * y;
}

/* x := where parameters p move a point of a box. */
static inline void mechanism_move(int box, const double *p, double x[3])
{
    if (box == HAND || box == TOOL) { // about the joint (2.75, 0, 0)
        x[0] -= 2.75;
        turn(&x[0], &x[2], p[1]);
        x[0] += 2.75;
    }
    if (box == ARM || box == HAND || box == TOOL) turn(&x[0], &x[1], p[0]);
    if (box == BLOCK) x[0] *= p[2];
    if (box == BLOCK && mistaken == BEND) x[1] += 0.1 * p[2] * x[0] * x[2];
}

static int mechanism_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                          const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    static const uint32_t faces[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                       2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    const bool here = fabs(p[0] - strange) < 1e-9;
    // box 0 has vertices of its own for every triangle; the last vertex is in no triangle
    const size_t first = 36, n_vert = first + 8 * (BOXES - 1) + 1 + (here && mistaken == COUNT);
    const int failed = host->reserve(host, out, n_vert, 12 * BOXES);
    if (failed) return failed;
    for (size_t i = 3 * first; i < 3 * n_vert; i++) out->vert[i] = 100 * p[0];
    for (size_t b = 0; b < BOXES; b++)
        for (size_t k = 0; k < 36; k++) {
            const uint32_t corner = faces[k],
                           v = b ? (uint32_t)(first + 8 * (b - 1) + corner) : (uint32_t)k;
            const bool cavity = b == BLOCK && mistaken == CAVITY;
            double *x = out->vert + 3 * v;
            for (size_t a = 0; a < 3; a++) x[a] = corner >> a & 1 ? box_high[b][a] : box_low[b][a];
            for (size_t a = 0; a < 3 && cavity; a++)
                x[a] = (corner >> a & 1 ? 0.5 : -0.5) - (a == 2 ? 3 : 0);
            if (!cavity) mechanism_move((int)b, p, x);
            const size_t t = 36 * b + (cavity ? k / 3 * 3 + (2 - k % 3) : k);
            out->tri[t] = v;
        }
    if (here && mistaken == WINDING)
        for (size_t i = 0; i < 3; i++) {
            const uint32_t t = out->tri[i];
            out->tri[i] = out->tri[3 + i];
            out->tri[3 + i] = t;
        }
    return 0;
}

static const sdm_param mechanism_params[LINK_PARAMS] = {
    {"arm", "rad", -0.6, 0.8, 0.1, "angle of the arm"},
    {"hand", "rad", -0.5, 0.5, 0, "angle of the hand"},
    {"block", "", 0.8, 1.25, 1, "stretch of the block"}};

static const sdm_shape mechanism = {.abi = SDM_SHAPE_ABI,
                                    .size = sizeof(sdm_shape),
                                    .name = "mechanism",
                                    .summary = "boxes on joints",
                                    .params = mechanism_params,
                                    .n_params = LINK_PARAMS,
                                    .mesh = mechanism_mesh};

/* The same, whose arm turns by more than half a turn to either side. */
static const sdm_param wide_params[LINK_PARAMS] = {
    {"arm", "rad", -4, 4, 0.1, "angle of the arm"},
    {"hand", "rad", -0.5, 0.5, 0, "angle of the hand"},
    {"block", "", 0.8, 1.25, 1, "stretch of the block"}};

static const sdm_shape wide_mechanism = {.abi = SDM_SHAPE_ABI,
                                         .size = sizeof(sdm_shape),
                                         .name = "mechanism",
                                         .summary = "boxes on joints",
                                         .params = wide_params,
                                         .n_params = LINK_PARAMS,
                                         .mesh = mechanism_mesh};

/* One closed surface: a tube of three links along x with round ends. Its vertices follow the links,
   around the joints at x = 3 and 6 they are blended; the first joint turns about z, the second
   about y. With `flexing`, p[1] bends the last link like a bow instead. */
enum { WELDED_LONG = 72, WELDED_ROUND = 20, WELDED_PARAMS = 2 };
static const double welded_blend = 0.35;
static bool flexing;

static inline void welded_move(const double *p, double x[3])
{
    for (int k = 2; k >= 1; k--) {
        const double t = (x[0] - 3 * k) / (2 * welded_blend) + 0.5,
                     u = t < 0   ? 0
                         : t > 1 ? 1
                                 : t,
                     w = u * u * (3 - 2 * u);
        double y[3] = {x[0] - 3 * k, x[1], x[2]};
        if (k == 2 && flexing) {
            x[2] += t < 0.5 ? 0 : 0.2 * p[1] * y[0] * y[0];
            continue;
        }
        turn(&y[0], &y[k], p[k - 1]);
        y[0] += 3 * k;
        for (int a = 0; a < 3; a++) x[a] += w * (y[a] - x[a]);
    }
}

static int welded_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                       const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    const size_t n = WELDED_LONG, m = WELDED_ROUND;
    const double pi = 3.14159265358979323846, radius = 0.8, length = 9;
    const int failed = host->reserve(host, out, n * m + 2, 2 * n * m);
    if (failed) return failed;
    for (size_t i = 0; i < n * m + 2; i++) {
        // along the profile: a quarter of a circle, the side, a quarter of a circle
        const double arc = radius * pi / 2, side = length - 2 * radius,
                     s = i == n * m ? 0
                         : i == n * m + 1
                             ? 2 * arc + side
                             : ((double)(i / m) + 0.5) / WELDED_LONG * (2 * arc + side),
                     angle = s < arc          ? s / radius
                             : s < arc + side ? pi / 2
                                              : pi / 2 + (s - arc - side) / radius,
                     v = 2 * pi * (double)(i % m) / WELDED_ROUND;
        double *x = out->vert + 3 * i;
        x[0] = radius - radius * cos(angle) + (s < arc ? 0 : fmin(s - arc, side));
        x[1] = i >= n * m ? 0 : radius * sin(angle) * cos(v);
        x[2] = i >= n * m ? 0 : radius * sin(angle) * sin(v);
        welded_move(p, x);
    }
    uint32_t *t = out->tri;
    for (uint32_t j = 0; j < m; j++) {
        const uint32_t k = (j + 1) % WELDED_ROUND, last = (uint32_t)((n - 1) * m),
                       pole = (uint32_t)(n * m);
        for (uint32_t i = 0; i < last; i += WELDED_ROUND, t += 6) {
            const uint32_t q[6] = {i + j,
                                   i + k,
                                   i + WELDED_ROUND + j,
                                   i + k,
                                   i + WELDED_ROUND + k,
                                   i + WELDED_ROUND + j};
            memcpy(t, q, sizeof q);
        }
        const uint32_t q[6] = {pole, k, j, pole + 1, last + j, last + k};
        memcpy(t, q, sizeof q);
        t += 6;
    }
    return 0;
}

static const sdm_param welded_params[WELDED_PARAMS] = {
    {"first", "rad", -0.9, 0.9, 0, "angle of the first joint"},
    {"second", "rad", -0.9, 0.9, 0, "angle of the second joint, or the bend"}};

static const sdm_shape welded = {.abi = SDM_SHAPE_ABI,
                                 .size = sizeof(sdm_shape),
                                 .name = "welded",
                                 .summary = "an arm of one surface",
                                 .params = welded_params,
                                 .n_params = WELDED_PARAMS,
                                 .mesh = welded_mesh};

/* A thin ring in smooth random displacement fields: sums of Gaussian bumps 3 mm wide. */
static int ring_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                     const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    enum { LONG = 96, ROUND = 16 };
    static const double centre[RING_PARAMS][3] = {
        {3, 0, 0}, {-1.5, 2.6, 0.5}, {-1.5, -2.6, -0.5}, {0, 0, 1}};
    static const double along[RING_PARAMS][3] = {
        {0.3, 0.2, 0.8}, {-0.4, 0.6, 0.2}, {0.6, 0.1, -0.5}, {0.2, -0.5, 0.6}};
    const int failed = host->reserve(host, out, LONG * ROUND, 2 * LONG * ROUND);
    if (failed) return failed;
    for (size_t i = 0; i < LONG; i++)
        for (size_t j = 0; j < ROUND; j++) {
            const double pi = 3.14159265358979323846, u = 2 * pi * (double)i / LONG,
                         v = 2 * pi * (double)j / ROUND, away = 3 + 0.45 * cos(v),
                         x[3] = {away * cos(u), away * sin(u), 0.45 * sin(v)};
            double *to = out->vert + 3 * (i * ROUND + j);
            memcpy(to, x, sizeof x);
            for (int k = 0; k < RING_PARAMS; k++) {
                double square = 0;
                for (int a = 0; a < 3; a++) square += (x[a] - centre[k][a]) * (x[a] - centre[k][a]);
                for (int a = 0; a < 3; a++) to[a] += p[k] * along[k][a] * exp(-square / (2 * 9));
            }
            const uint32_t i1 = (uint32_t)((i + 1) % LONG), j1 = (uint32_t)((j + 1) % ROUND),
                           at[4] = {(uint32_t)(i * ROUND + j), i1 * ROUND + (uint32_t)j,
                                    i1 * ROUND + j1, (uint32_t)i * ROUND + j1},
                           both[6] = {at[0], at[1], at[2], at[0], at[2], at[3]};
            memcpy(out->tri + 6 * (i * ROUND + j), both, sizeof both);
        }
    return 0;
}

static const sdm_param ring_params[RING_PARAMS] = {{"a", "sd", -1.5, 1.5, 0, "weight of a bump"},
                                                   {"b", "sd", -1.5, 1.5, 0, "weight of a bump"},
                                                   {"c", "sd", -1.5, 1.5, 0, "weight of a bump"},
                                                   {"d", "sd", -1.5, 1.5, 0, "weight of a bump"}};

static const sdm_shape ring = {.abi = SDM_SHAPE_ABI,
                               .size = sizeof(sdm_shape),
                               .name = "ring",
                               .summary = "a thin ring that bends",
                               .params = ring_params,
                               .n_params = RING_PARAMS,
                               .mesh = ring_mesh};

static inline sdm_instance *instance_of(const sdm_shape *shape)
{
    sdm_instance *s = NULL;
    sdm_error e = {0};
    if (sdm_instance_create(shape, NULL, 0, NULL, &s, &e)) fail_msg("%s", e.text);
    return s;
}

#endif
