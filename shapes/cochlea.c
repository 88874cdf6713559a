/* Cochlea: a tube of slowly changing radius around a rising logarithmic spiral. A RECONSTRUCTION:
 * the published model gives the four parameters, their ranges, and a centreline that is a
 * logarithmic spiral with a polynomial start and a longitudinal wave in the basal turn. Rise, wave,
 * tube radius, cross-section and caps are not published in closed form; the formulas below were
 * chosen so that the centreline follows measured cochleae to 0.13 .. 0.29 mm.
 *
 *     r = a exp(-b theta)    z = c theta + alpha exp(-kappa theta) cos(theta - phi)
 *     R = radius - taper theta + flare exp(-theta / flare_angle)
 *
 * Here (r, theta, z) are the cylindrical coordinates of the centreline, with theta = 0 at the basal
 * end, and R is the tube radius.
 *
 * Turns touch and overlap: the mesh intersects itself on purpose, and the shape is the union of the
 * volumes that the tube encloses. Rings of vertices lie at fixed fractions of the apical angle with
 * a fixed number of sectors. The fractions and the number of sectors depend only on the options, so
 * every vertex is a smooth function of the parameters. With the default options the mesh has 3,420
 * triangles; edges are 0.36 +- 0.10 mm long at the default parameters and 0.34 +- 0.11 mm over the
 * parameter ranges.
 *
 * The vertices of the rings lie ON the tube, so the mesh is inscribed: between its vertices it is
 * inside of the tube by up to R (1 - cos(pi / sectors)) = 0.015 R across the tube, and by edge^2 /
 * 8 times the curvature of the wall along the tube (outside on the inner side of the bend). The
 * closed-form distance is that of a ball of radius R swept along the centreline. The zero surface
 * of this distance agrees with the tube where R changes slowly (to 4 micrometres without flare) and
 * is up to 0.013 mm (0.05 mm at a = 2) farther out at the flare.
 *
 * Near the apex the tube radius exceeds the radius of curvature of the centreline, so the inner
 * parts of neighbouring cross-sections would run backwards: the mesh would be inside out there and
 * enclose less than the tube. Each section is therefore cut off at the centre of curvature. The
 * shape loses nothing: a point behind the centre of curvature is nearer to another part of the
 * centreline, whose section or cap encloses it.
 *
 * With the option free = anatomy, anatomical constants that vary between ears become parameters,
 * too, for fits to images. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cochlea_measure.h"
#include "cochlea_ring.h"
#include "lathe.h"
#include "sdm/shape.h"

/* The four published parameters, then the anatomical constants that are parameters with free =
 * anatomy. The ranges of c, theta and p0 follow from the variation between cochleae: the default +-
 * 2 standard deviations of the height (0.4 mm), of the number of turns (2.2 to 2.9) and of the
 * basal diameter (0.4 mm; Erixon, Hogstorp, Wadin and Rask-Andersen 2009). kappa and theta2 have
 * not been measured. */
static const sdm_param PARAMS[COCHLEA_UNKNOWNS] = {
    [COCHLEA_A] = {"a", "mm", 2.0, 5.0, 4.4,
                   "scale of the radial component: radius of the centreline at theta = 0"},
    [COCHLEA_ALPHA] = {"alpha", "mm", 0.0, 1.2, 0.5,
                       "amplitude of the longitudinal wave of the basal turn"},
    [COCHLEA_B] = {"b", "", 0.05, 0.25, 0.145, "decay of the spiral per radian"},
    [COCHLEA_PHI] = {"phi", "rad", -LATHE_PI / 4, LATHE_PI / 4, 0.4,
                     "phase of the longitudinal wave"},
    [COCHLEA_C] = {"c", "mm/rad", 0.14, 0.26, 0.20, "rise of the centreline"},
    [COCHLEA_KAPPA] = {"kappa", "1/rad", 0.0, 0.6, 0.3, "decay of the longitudinal wave"},
    [COCHLEA_THETA] = {"theta", "rad", 12.3, 16.7, 14.5, "angle of the apical end"},
    [COCHLEA_THETA2] = {"theta2", "rad", 0.5, LATHE_PI - 0.5, LATHE_PI / 2,
                        "where the polynomial start joins the spiral"},
    [COCHLEA_P0] = {"p0", "mm", 4.5, 6.1, 5.3,
                    "centreline radius at theta = 0 of the polynomial start"},
};

enum {
    EDGE,
    EAR,
    THETA,
    RISE,
    KAPPA,
    START,
    THETA2,
    P0,
    RADIUS,
    TAPER,
    FLARE,
    FLARE_ANGLE,
    SECTION,
    RATIO,
    FREE,
    N_OPTIONS
};

static const sdm_option OPTIONS[N_OPTIONS] = {
    [EDGE] = {"edge", SDM_OPTION_REAL, "mm", 0.05, 1.0, 0.30, NULL,
              "mean edge length the mesh aims at, over the parameter ranges"},
    [EAR] = {"ear", SDM_OPTION_CHOICE, "", 0, 0, 0, "right|left", "left is the mirror image in y"},
    [THETA] = {"theta", SDM_OPTION_REAL, "rad", 3.0, 25.0, 14.5, NULL,
               "angle of the apical end (14.5: 2.3 turns)"},
    [RISE] = {"c", SDM_OPTION_REAL, "mm/rad", 0.02, 1.0, 0.20, NULL, "rise of the centreline"},
    [KAPPA] = {"kappa", SDM_OPTION_REAL, "1/rad", 0.0, 3.0, 0.3, NULL,
               "decay of the longitudinal wave"},
    [START] = {"start", SDM_OPTION_CHOICE, "", 0, 0, 0, "spiral|cubic",
               "cubic: a polynomial of radius p0 at theta = 0 below theta2"},
    [THETA2] = {"theta2", SDM_OPTION_REAL, "rad", 0.2, 3.0, LATHE_PI / 2, NULL,
                "where the polynomial start joins the spiral (C2)"},
    [P0] = {"p0", SDM_OPTION_REAL, "mm", 1.0, 10.0, 5.3, NULL,
            "centreline radius at theta = 0 of the polynomial start"},
    [RADIUS] = {"radius", SDM_OPTION_REAL, "mm", 0.1, 3.0, 1.11, NULL,
                "tube radius without taper and flare"},
    [TAPER] = {"taper", SDM_OPTION_REAL, "mm/rad", 0.0, 0.2, 0.02, NULL,
               "loss of tube radius per radian"},
    [FLARE] = {"flare", SDM_OPTION_REAL, "mm", 0.0, 1.0, 0.25, NULL,
               "widening of the tube at the basal end"},
    [FLARE_ANGLE] = {"flare_angle", SDM_OPTION_REAL, "rad", 0.05, 5.0, 0.35, NULL,
                     "angle over which the widening decays by e"},
    [SECTION] = {"section", SDM_OPTION_CHOICE, "", 0, 0, 0, "circle|ellipse",
                 "ellipse: lower than wide at the base, round after one turn"},
    [RATIO] = {"ratio", SDM_OPTION_REAL, "", 0.3, 1.0, 0.7, NULL,
               "height over width of the elliptical section at the base"},
    [FREE] = {"free", SDM_OPTION_CHOICE, "", 0, 0, 0, "none|anatomy",
              "anatomy: c, kappa, theta and, with start = cubic, theta2 and p0 are parameters; "
              "their options are the "
              "defaults"},
};

/* Option that sets an anatomical constant; 0: none, for the four published parameters. */
static const int OPTION_OF[COCHLEA_UNKNOWNS] = {[COCHLEA_C] = RISE,
                                                [COCHLEA_KAPPA] = KAPPA,
                                                [COCHLEA_THETA] = THETA,
                                                [COCHLEA_THETA2] = THETA2,
                                                [COCHLEA_P0] = P0};

typedef struct cochlea {
    cochlea_model model;
    sdm_param params[COCHLEA_UNKNOWNS];
    /* [n_params] index of each parameter among the COCHLEA_UNKNOWNS */
    size_t unknown[COCHLEA_UNKNOWNS];
    uint32_t n_params;
    double constant[COCHLEA_UNKNOWNS]; /* values of the unknowns that are not parameters */
    bool left;
    size_t n_rings, n_sectors;
    /* [2][n_sectors][2] cosine and sine of the vertex angles of even and odd rings */
    double *direction;
    cochlea_ring rings[];
} cochlea;

static cochlea_model model_of(const sdm_option_value *o)
{
    return (cochlea_model){.cubic = o[START].number > 0,
                           .radius = o[RADIUS].number,
                           .taper = o[TAPER].number,
                           .flare = o[FLARE].number,
                           .flare_angle = o[FLARE_ANGLE].number,
                           .ellipse = o[SECTION].number > 0,
                           .ratio = o[RATIO].number};
}

static void unknowns_default(const sdm_option_value *o, double *x)
{
    for (int k = 0; k < COCHLEA_UNKNOWNS; k++)
        x[k] = OPTION_OF[k] ? o[OPTION_OF[k]].number : PARAMS[k].def;
}

static void unknowns_at(const cochlea *c, const double *p, double *x)
{
    memcpy(x, c->constant, sizeof c->constant);
    for (size_t i = 0; i < c->n_params; i++) x[c->unknown[i]] = p[i];
}

static bool unknown_is_free(const sdm_option_value *o, int unknown)
{
    if (!OPTION_OF[unknown]) return true;
    const bool of_start = unknown == COCHLEA_THETA2 || unknown == COCHLEA_P0;
    return o[FREE].number > 0 && (o[START].number > 0 || !of_start);
}

/* Root mean square over a ring of abs(d(vertex) / d(theta)), mm/rad, at the default parameters. */
static double ring_speed(const cochlea_model *m, const double *x, double theta)
{
    cochlea_section s;
    sdm_cochlea_section_at(m, x, theta / x[COCHLEA_THETA], &s);
    const double h = 1e-4;
    double before[3], after[3], speed = 0;
    sdm_cochlea_centre_at(m, x, theta - h, before);
    sdm_cochlea_centre_at(m, x, theta + h, after);
    for (int k = 0; k < 3; k++) speed += (after[k] - before[k]) * (after[k] - before[k]);
    const double bend = sdm_cochlea_radius_at(m, theta) * hypot(s.bend[0].v, s.bend[1].v);
    return sqrt(speed) / (2 * h) * sqrt(1 + 0.5 * bend * bend);
}

#define SAMPLES 1024

/* Integrates ring_speed() by the trapezoidal rule: way[i] = length of the way of a ring from 0 to i
   / SAMPLES of the apical angle, mm. Returns the mean circumference of the sections, mm. */
static double way_measure(const cochlea_model *m, const double *x, double way[SAMPLES + 1])
{
    const double step = x[COCHLEA_THETA] / SAMPLES;
    double last = ring_speed(m, x, 0), round = 0;
    way[0] = 0;
    for (int i = 1; i <= SAMPLES; i++) {
        const double now = ring_speed(m, x, step * i);
        way[i] = way[i - 1] + step * (last + now) / 2;
        round += 2 * LATHE_PI * sdm_cochlea_radius_at(m, step * (i - 0.5)) * (way[i] - way[i - 1]);
        last = now;
    }
    return round / way[SAMPLES];
}

/* Writes the n rings of a cap between pole and tube: from pole to tube at the base, from tube to
 * pole at the apex. Returns the address after the last one. */
static cochlea_ring *cap_rings(size_t n, bool apex, cochlea_ring *r)
{
    for (size_t i = 1; i <= n; i++) {
        const double up = LATHE_PI / 2 * (double)(apex ? i : n + 1 - i) / (double)(n + 1);
        *r++ = (cochlea_ring){
            .fraction = apex, .shrink = cos(up), .ahead = (apex ? 1 : -1) * sin(up), .whole = true};
    }
    return r;
}

static void rings_place(cochlea *c, size_t n_base, size_t n_tube, size_t n_apex,
                        const double way[SAMPLES + 1])
{
    cochlea_ring *r = cap_rings(n_base, false, c->rings);
    size_t at = 0;
    for (size_t i = 0; i <= n_tube; i++) {
        const double target = way[SAMPLES] * (double)i / (double)n_tube;
        while (at + 1 < SAMPLES && way[at + 1] < target) at++;
        const double part = (target - way[at]) / (way[at + 1] - way[at]);
        const double fraction = i == n_tube ? 1 : ((double)at + part) / SAMPLES;
        *r++ = (cochlea_ring){.fraction = fraction, .shrink = 1, .whole = i == 0 || i == n_tube};
    }
    cap_rings(n_apex, true, r);
}

static void params_choose(cochlea *c, const sdm_option_value *options)
{
    for (int k = 0; k < COCHLEA_UNKNOWNS; k++) {
        if (!unknown_is_free(options, k)) continue;
        c->params[c->n_params] = PARAMS[k];
        c->params[c->n_params].def = c->constant[k];
        c->unknown[c->n_params++] = (size_t)k;
    }
}

static int cochlea_create(const sdm_host *host, const sdm_option_value *options, void **self)
{
    // values of the unknowns; parameters must lie in their ranges
    const cochlea_model m = model_of(options);
    double x[COCHLEA_UNKNOWNS];
    unknowns_default(options, x);
    for (int k = 0; k < COCHLEA_UNKNOWNS; k++)
        if (unknown_is_free(options, k) && !(x[k] >= PARAMS[k].min && x[k] <= PARAMS[k].max)) {
            char text[160];
            snprintf(text, sizeof text,
                     "%s = %g, but with free = anatomy it is a parameter: need %g to %g",
                     PARAMS[k].name, x[k], PARAMS[k].min, PARAMS[k].max);
            return host->fail(host, text);
        }

    // the tube is thinnest at the largest possible angle
    const double end = x[COCHLEA_THETA],
                 farthest =
                     unknown_is_free(options, COCHLEA_THETA) ? PARAMS[COCHLEA_THETA].max : end,
                 thin = sdm_cochlea_radius_at(&m, farthest);
    if (!(thin >= 0.02)) {
        char text[160];
        snprintf(text, sizeof text,
                 "tube radius %g mm at the apex, need at least 0.02: lower 'taper' or 'theta', or "
                 "raise 'radius'",
                 thin);
        return host->fail(host, text);
    }

    // The numbers of rings and sectors depend only on the options. The factors 1.1 and 1.2 make the
    // mean edge over the parameter ranges about `edge`, with triangles a little longer along the
    // tube, where the curvature is lower.
    double way[SAMPLES + 1];
    const double edge = options[EDGE].number, round = way_measure(&m, x, way),
                 quarter = LATHE_PI / 2;
    const size_t n_sectors = sdm_lathe_pieces(round, 1.1 * edge, 6),
                 n_tube = sdm_lathe_pieces(way[SAMPLES], 1.2 * edge, 8);
    const size_t n_base =
        sdm_lathe_pieces(quarter * sdm_cochlea_radius_at(&m, 0), 1.2 * edge, 2) - 1;
    const size_t n_apex =
        sdm_lathe_pieces(quarter * sdm_cochlea_radius_at(&m, end), 1.2 * edge, 2) - 1;
    const size_t n_rings = n_base + n_tube + 1 + n_apex;

    // the instance
    cochlea *c = malloc(sizeof *c + n_rings * sizeof *c->rings);
    double *direction = malloc(4 * n_sectors * sizeof *direction);
    if (!c || !direction) {
        free(c);
        free(direction);
        return host->fail(host, "out of memory");
    }
    *c = (cochlea){.model = m,
                   .left = options[EAR].number > 0,
                   .n_rings = n_rings,
                   .n_sectors = n_sectors,
                   .direction = direction};
    for (size_t odd = 0; odd < 2; odd++)
        for (size_t j = 0; j < n_sectors; j++) {
            const double angle = sdm_lathe_angle(odd, j, n_sectors);
            *direction++ = cos(angle);
            *direction++ = sin(angle);
        }
    memcpy(c->constant, x, sizeof x);
    params_choose(c, options);
    rings_place(c, n_base, n_tube, n_apex, way);
    *self = c;
    return 0;
}

static void cochlea_destroy(void *self)
{
    cochlea *c = self;
    free(c->direction);
    free(c);
}

/* Calls put() with the number, position and derivatives of every vertex, in the order of
 * lathe.h. */
static void vertices_visit(const cochlea *c, const double *p, cochlea_put *put, void *user)
{
    const cochlea_ring base = {.fraction = 0, .ahead = -1, .whole = true},
                       apex = {.fraction = 1, .ahead = 1, .whole = true};
    const double none[2] = {0, 0};
    double x[COCHLEA_UNKNOWNS];
    unknowns_at(c, p, x);
    sdm_cochlea_ring_at(&c->model, x, &base, 1, none, c->left, 0, put, user);
    for (size_t i = 0; i < c->n_rings; i++)
        sdm_cochlea_ring_at(&c->model, x, &c->rings[i], c->n_sectors,
                            c->direction + (i % 2 ? 2 * c->n_sectors : 0), c->left,
                            1 + i * c->n_sectors, put, user);
    sdm_cochlea_ring_at(&c->model, x, &apex, 1, none, c->left, 1 + c->n_rings * c->n_sectors, put,
                        user);
}

static void position_write(void *user, size_t vertex, const dual at[3])
{
    double *vert = user;
    for (int k = 0; k < 3; k++) vert[3 * vertex + (size_t)k] = at[k].v;
}

static void cochlea_describe(const void *self, const sdm_param **params, uint32_t *n_params)
{
    const cochlea *c = self;
    *params = c->params;
    *n_params = c->n_params;
}

static int cochlea_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                        const double *p, sdm_mesh_out *out)
{
    (void)options;
    const cochlea *c = self;
    const int failed = host->reserve(host, out, sdm_lathe_n_vert(c->n_rings, c->n_sectors),
                                     sdm_lathe_n_tri(c->n_rings, c->n_sectors));
    if (failed) return failed;
    vertices_visit(c, p, position_write, out->vert);
    sdm_lathe_triangles(c->n_rings, c->n_sectors, c->left, out->tri);
    return 0;
}

typedef struct velocity_out {
    const cochlea *shape;
    double *velocity; // [n_params][n_vert][3]
    size_t n_vert;
} velocity_out;

static void velocity_write(void *user, size_t vertex, const dual at[3])
{
    const velocity_out *o = user;
    for (size_t i = 0; i < o->shape->n_params; i++)
        for (size_t k = 0; k < 3; k++)
            o->velocity[3 * (i * o->n_vert + vertex) + k] = at[k].d[o->shape->unknown[i]];
}

static int cochlea_velocity(const void *self, const sdm_host *host, const sdm_option_value *options,
                            const double *p, size_t n_vert, double *velocity_at)
{
    (void)options;
    const cochlea *c = self;
    if (n_vert != sdm_lathe_n_vert(c->n_rings, c->n_sectors))
        return host->fail(host, "velocity: n_vert is not the number of vertices of the mesh");
    velocity_out out = {c, velocity_at, n_vert};
    vertices_visit(c, p, velocity_write, &out);
    return 0;
}

/* Signed distance to the ball of the tube's radius swept along the centreline. */
static int cochlea_distance(const void *self, const sdm_host *host, const sdm_option_value *options,
                            const double *p, const double point[3], double *out)
{
    (void)options;
    const cochlea *c = self;
    if (c->model.ellipse)
        return host->fail(host, "there is no closed form for section = ellipse, only for circle");
    double x[COCHLEA_UNKNOWNS];
    unknowns_at(c, p, x);
    const double at[3] = {point[0], c->left ? -point[1] : point[1], point[2]};
    *out = sdm_cochlea_distance(&c->model, x, at);
    return 0;
}

static int cochlea_measure(const void *self, const sdm_host *host, const sdm_option_value *options,
                           const double *p, uint32_t index, double depth, double *value)
{
    (void)options;
    const cochlea *c = self;
    double x[COCHLEA_UNKNOWNS];
    unknowns_at(c, p, x);
    if (x[COCHLEA_THETA] < COCHLEA_MEASURES_FROM)
        return host->fail(host, "the diameters need three quarters of a turn: theta >= 4.8");
    *value = sdm_cochlea_measure(&c->model, x, index, depth);
    return 0;
}

const sdm_shape sdm_shape_cochlea = {
    .abi = SDM_SHAPE_ABI,
    .size = sizeof(sdm_shape),
    .name = "cochlea",
    .summary = "human cochlea: a tube about a rising logarithmic spiral (a reconstruction); "
               "distance exact outside, a "
               "bound inside",
    .params = PARAMS,
    .n_params = COCHLEA_C,
    .options = OPTIONS,
    .n_options = N_OPTIONS,
    .create = cochlea_create,
    .destroy = cochlea_destroy,
    .describe = cochlea_describe,
    .mesh = cochlea_mesh,
    .velocity = cochlea_velocity,
    .distance = cochlea_distance,
    .mirror = "ear",
    .measures = sdm_cochlea_measures,
    .n_measures = COCHLEA_MEASURES,
    .measure = cochlea_measure,
};
