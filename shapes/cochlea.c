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
    cochlea_rings rings;
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

    // the instance
    cochlea *c = malloc(sizeof *c);
    cochlea_rings rings;
    if (!c || sdm_cochlea_rings_make(&m, x, options[EDGE].number, &rings)) {
        free(c);
        return host->fail(host, "out of memory");
    }
    *c = (cochlea){.model = m, .left = options[EAR].number > 0, .rings = rings};
    memcpy(c->constant, x, sizeof x);
    params_choose(c, options);
    *self = c;
    return 0;
}

static void cochlea_destroy(void *self)
{
    cochlea *c = self;
    sdm_cochlea_rings_free(&c->rings);
    free(c);
}

/* Calls put() with the number, position and derivatives of every vertex, in the order of
 * lathe.h. */
static void vertices_visit(const cochlea *c, const double *p, cochlea_put *put, void *user)
{
    const cochlea_ring base = {.fraction = 0, .ahead = -1, .whole = true},
                       apex = {.fraction = 1, .ahead = 1, .whole = true};
    const double none[2] = {0, 0};
    const size_t n = c->rings.n_sectors;
    double x[COCHLEA_UNKNOWNS];
    unknowns_at(c, p, x);
    sdm_cochlea_ring_at(&c->model, x, &base, 1, none, c->left, 0, put, user);
    for (size_t i = 0; i < c->rings.n; i++)
        sdm_cochlea_ring_at(&c->model, x, &c->rings.at[i], n,
                            c->rings.direction + (i % 2 ? 2 * n : 0), c->left, 1 + i * n, put,
                            user);
    sdm_cochlea_ring_at(&c->model, x, &apex, 1, none, c->left, 1 + c->rings.n * n, put, user);
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
    const int failed = host->reserve(host, out, sdm_lathe_n_vert(c->rings.n, c->rings.n_sectors),
                                     sdm_lathe_n_tri(c->rings.n, c->rings.n_sectors));
    if (failed) return failed;
    vertices_visit(c, p, position_write, out->vert);
    sdm_lathe_triangles(c->rings.n, c->rings.n_sectors, c->left, out->tri);
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
    if (n_vert != sdm_lathe_n_vert(c->rings.n, c->rings.n_sectors))
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

/* The basal section: the cochlea opens into the vestibule there. */
static int cochlea_open_end(const void *self, const sdm_host *host, const sdm_option_value *options,
                            const double *p, sdm_open_end *out)
{
    (void)host, (void)options;
    const cochlea *c = self;
    double x[COCHLEA_UNKNOWNS];
    cochlea_section s;
    unknowns_at(c, p, x);
    sdm_cochlea_section_at(&c->model, x, 0, &s);
    for (int k = 0; k < 3; k++) out->centre[k] = s.centre[k].v, out->outward[k] = -s.tangent[k].v;
    if (c->left) out->centre[1] = -out->centre[1], out->outward[1] = -out->outward[1];
    out->radius = fmax(s.wide.v, s.high.v);
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
    .open_end = cochlea_open_end,
};
