/* The cochlea: a tube of slowly changing radius about a rising logarithmic spiral.

   A RECONSTRUCTION. The published model names the four parameters and their ranges; its centreline is a logarithmic spiral
   with a polynomial start and a wave of the basal turn along the modiolus. Rise, wave, tube radius, section and caps are not
   published in closed form: the formulas here were chosen so that the centreline follows measured cochleae to 0.13 to 0.29 mm.

       r = a exp(-b theta)    z = c theta + alpha exp(-kappa theta) cos(theta - phi)    R = radius - taper theta + flare exp(-theta / flare_angle)

   Turns touch and overlap: the mesh intersects itself on purpose, and the shape is the union of what the tube encloses.

   Rings sit at fixed angles theta with a fixed number of sectors, both chosen from the options at the default parameters, so
   that every vertex is a smooth function of the parameters. With the default options the mesh has 3,420 triangles; its edges
   are 0.36 +- 0.10 mm at the default parameters and 0.34 +- 0.11 mm over the parameter ranges. Ring vertices lie ON the tube,
   its polygons are inscribed: between them the mesh is inside of the tube by up to R (1 - cos(pi / sectors)), 0.015 R, and, along
   the tube, by edge^2 / 8 times the curvature of its wall (outside on the inner side of the bend). The distance is that of a ball of radius R swept along the centreline: the same surface
   where R changes slowly (to 4 micrometres without flare), and up to 0.013 mm (0.05 mm at a = 2) farther out at the flare.

   Near the apex the tube is wider than the bend of its centreline, and the inner parts of neighbouring sections would run
   backwards: the mesh would be inside out there, and enclose less than the tube does. Each section is therefore cut off where
   the centreline's centre of curvature lies. Nothing of the shape is lost by it: a point behind that centre is nearer to
   another part of the centreline, whose section or cap encloses it. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include "cochlea_curve.h"
#include "lathe.h"
#include "sdm/shape.h"

static const sdm_param PARAMS[COCHLEA_PARAMS] = {
    [COCHLEA_A] = {"a", "mm", 2.0, 5.0, 4.4, "scale of the radial component: radius of the centreline at theta = 0"},
    [COCHLEA_ALPHA] = {"alpha", "mm", 0.0, 1.2, 0.5, "amplitude of the longitudinal wave of the basal turn"},
    [COCHLEA_B] = {"b", "", 0.05, 0.25, 0.145, "decay of the spiral per radian"},
    [COCHLEA_PHI] = {"phi", "rad", -LATHE_PI / 4, LATHE_PI / 4, 0.4, "phase of the longitudinal wave"},
};

enum { EDGE, EAR, THETA, RISE, KAPPA, START, THETA2, P0, RADIUS, TAPER, FLARE, FLARE_ANGLE, SECTION, RATIO, N_OPTIONS };

static const sdm_option OPTIONS[N_OPTIONS] = {
    [EDGE] = {"edge", SDM_OPTION_REAL, "mm", 0.05, 1.0, 0.30, NULL,
              "mean edge length the mesh aims at, over the parameter ranges"},
    [EAR] = {"ear", SDM_OPTION_CHOICE, "", 0, 0, 0, "right|left", "left is the mirror image in y"},
    [THETA] = {"theta", SDM_OPTION_REAL, "rad", 3.0, 25.0, 14.5, NULL, "angle of the apical end (14.5: 2.3 turns)"},
    [RISE] = {"c", SDM_OPTION_REAL, "mm/rad", 0.02, 1.0, 0.20, NULL, "rise of the centreline"},
    [KAPPA] = {"kappa", SDM_OPTION_REAL, "1/rad", 0.0, 3.0, 0.3, NULL, "decay of the longitudinal wave"},
    [START] = {"start", SDM_OPTION_CHOICE, "", 0, 0, 0, "spiral|cubic",
               "cubic: a polynomial of radius p0 at theta = 0 below theta2"},
    [THETA2] = {"theta2", SDM_OPTION_REAL, "rad", 0.2, 3.0, LATHE_PI / 2, NULL,
                "where the polynomial start joins the spiral (C2)"},
    [P0] = {"p0", SDM_OPTION_REAL, "mm", 1.0, 10.0, 5.3, NULL,
            "centreline radius at theta = 0 of the polynomial start"},
    [RADIUS] = {"radius", SDM_OPTION_REAL, "mm", 0.1, 3.0, 1.11, NULL, "tube radius without taper and flare"},
    [TAPER] = {"taper", SDM_OPTION_REAL, "mm/rad", 0.0, 0.2, 0.02, NULL, "loss of tube radius per radian"},
    [FLARE] = {"flare", SDM_OPTION_REAL, "mm", 0.0, 1.0, 0.25, NULL, "widening of the tube at the basal end"},
    [FLARE_ANGLE] = {"flare_angle", SDM_OPTION_REAL, "rad", 0.05, 5.0, 0.35, NULL,
                     "angle over which the widening decays by e"},
    [SECTION] = {"section", SDM_OPTION_CHOICE, "", 0, 0, 0, "circle|ellipse",
                 "ellipse: lower than wide at the base, round after one turn"},
    [RATIO] = {"ratio", SDM_OPTION_REAL, "", 0.3, 1.0, 0.7, NULL,
               "height over width of the elliptical section at the base"},
};

/* A ring of vertices: section at theta, moved by `ahead` along the tangent and shrunk by `shrink` on a cap. */
typedef struct ring {
    double theta, wide, high, ahead;
    bool whole; /* not cut off: rings of the caps, and the two they start from */
} ring;

typedef struct cochlea {
    cochlea_model model;
    bool left;
    size_t n_rings, n_sectors;
    double *direction; /* [2][n_sectors][2]: cosine and sine of the angles of even and odd rings */
    ring rings[];
} cochlea;

/* Share of the distance to the centre of curvature from which a section is bent, and width of the bend: C2. */
#define CUT_FROM 0.90
#define CUT_OVER 0.16

static cochlea_model model_of(const sdm_option_value *o)
{
    return (cochlea_model){.theta = o[THETA].number,
                           .c = o[RISE].number,
                           .kappa = o[KAPPA].number,
                           .cubic = o[START].number > 0,
                           .theta2 = o[THETA2].number,
                           .p0 = o[P0].number,
                           .radius = o[RADIUS].number,
                           .taper = o[TAPER].number,
                           .flare = o[FLARE].number,
                           .flare_angle = o[FLARE_ANGLE].number,
                           .ellipse = o[SECTION].number > 0,
                           .ratio = o[RATIO].number};
}

// how far the vertices of a ring move per radian, root mean square over the ring, at the default parameters
static double ring_speed(const cochlea_model *m, double theta)
{
    double p[COCHLEA_PARAMS];
    for (int i = 0; i < COCHLEA_PARAMS; i++) p[i] = PARAMS[i].def;
    cochlea_section s;
    sdm_cochlea_section_at(m, p, theta, &s);
    const double h = 1e-4;
    double before[3], after[3], speed = 0;
    sdm_cochlea_centre_at(m, p, theta - h, before);
    sdm_cochlea_centre_at(m, p, theta + h, after);
    for (int k = 0; k < 3; k++) speed += (after[k] - before[k]) * (after[k] - before[k]);
    const double bend = sdm_cochlea_radius_at(m, theta) * hypot(s.bend[0].v, s.bend[1].v);
    return sqrt(speed) / (2 * h) * sqrt(1 + 0.5 * bend * bend);
}

#define SAMPLES 1024

// way[i]: length travelled up to theta * i / SAMPLES (trapezoidal rule); returns the mean circumference of the sections
static double measure(const cochlea_model *m, double way[SAMPLES + 1])
{
    const double step = m->theta / SAMPLES;
    double last = ring_speed(m, 0), round = 0;
    way[0] = 0;
    for (int i = 1; i <= SAMPLES; i++) {
        const double now = ring_speed(m, step * i);
        way[i] = way[i - 1] + step * (last + now) / 2;
        round += 2 * LATHE_PI * sdm_cochlea_radius_at(m, step * (i - 0.5)) * (way[i] - way[i - 1]);
        last = now;
    }
    return round / way[SAMPLES];
}

// one cap: rings between pole and tube, from the pole on at the base, towards it at the apex
static ring *cap(const cochlea_model *m, double theta, size_t n, bool apex, ring *r)
{
    const double wide = sdm_cochlea_radius_at(m, theta), high = wide * sdm_cochlea_ratio_at(m, theta);
    for (size_t i = 1; i <= n; i++) {
        const double up = LATHE_PI / 2 * (double)(apex ? i : n + 1 - i) / (double)(n + 1);
        *r++ = (ring){.theta = theta,
                      .wide = wide * cos(up),
                      .high = high * cos(up),
                      .ahead = (apex ? 1 : -1) * wide * sin(up),
                      .whole = true};
    }
    return r;
}

static void place_rings(cochlea *c, size_t n_base, size_t n_tube, size_t n_apex, const double way[SAMPLES + 1])
{
    const cochlea_model *m = &c->model;
    ring *r = cap(m, 0, n_base, false, c->rings);
    size_t at = 0;
    for (size_t i = 0; i <= n_tube; i++) {
        const double target = way[SAMPLES] * (double)i / (double)n_tube;
        while (at + 1 < SAMPLES && way[at + 1] < target) at++;
        const double part = (target - way[at]) / (way[at + 1] - way[at]);
        const double theta = i == n_tube ? m->theta : m->theta / SAMPLES * ((double)at + part);
        const double wide = sdm_cochlea_radius_at(m, theta);
        *r++ = (ring){.theta = theta,
                      .wide = wide,
                      .high = wide * sdm_cochlea_ratio_at(m, theta),
                      .whole = i == 0 || i == n_tube};
    }
    cap(m, m->theta, n_apex, true, r);
}

static int create(const sdm_host *host, const sdm_option_value *options, void **self)
{
    const cochlea_model m = model_of(options);
    const double thin = sdm_cochlea_radius_at(&m, m.theta);
    if (!(thin >= 0.02)) {
        char text[160];
        snprintf(text, sizeof text,
                 "tube radius %g mm at the apex, need at least 0.02: lower 'taper' or 'theta', or raise 'radius'",
                 thin);
        return host->fail(host, text);
    }

    // counts depend on the options alone; the factors make the mean over the parameter ranges about `edge`, and triangles a
    // little longer along the tube, where it is less curved
    double way[SAMPLES + 1];
    const double edge = options[EDGE].number, round = measure(&m, way), quarter = LATHE_PI / 2;
    const size_t n_sectors = sdm_lathe_pieces(round, 1.1 * edge, 6),
                 n_tube = sdm_lathe_pieces(way[SAMPLES], 1.2 * edge, 8);
    const size_t n_base = sdm_lathe_pieces(quarter * sdm_cochlea_radius_at(&m, 0), 1.2 * edge, 2) - 1;
    const size_t n_apex = sdm_lathe_pieces(quarter * thin, 1.2 * edge, 2) - 1;
    const size_t n_rings = n_base + n_tube + 1 + n_apex;

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
    place_rings(c, n_base, n_tube, n_apex, way);
    *self = c;
    return 0;
}

static void destroy(void *self)
{
    cochlea *c = self;
    free(c->direction);
    free(c);
}

// moves a vertex (x along e1, y along e2) that lies at or behind the centre of curvature back to it
static void cut_off(const dual bend[2], dual *x, dual *y)
{
    const dual u = sdm_dual_add(sdm_dual_mul(*x, bend[0]), sdm_dual_mul(*y, bend[1])); // 1: at the centre of curvature
    if (u.v <= CUT_FROM) return;
    const double w = (u.v - CUT_FROM) / CUT_OVER, end = CUT_FROM + CUT_OVER / 2;
    const dual kept =
        w < 1 ? sdm_dual_apply(u, CUT_FROM + CUT_OVER * w * (1 + w * w * (0.5 * w - 1)), 1 - w * w * (3 - 2 * w))
              : sdm_dual_of(end);
    const dual bend2 = sdm_dual_add(sdm_dual_mul(bend[0], bend[0]), sdm_dual_mul(bend[1], bend[1]));
    const dual back = sdm_dual_div(sdm_dual_sub(u, kept), bend2);
    *x = sdm_dual_sub(*x, sdm_dual_mul(back, bend[0]));
    *y = sdm_dual_sub(*y, sdm_dual_mul(back, bend[1]));
}

static dual vertex_coordinate(const cochlea_section *s, int k, dual x, dual y, double ahead)
{
    const dual across = sdm_dual_add(sdm_dual_mul(x, s->e1[k]), sdm_dual_mul(y, s->e2[k]));
    return sdm_dual_add(sdm_dual_add(s->centre[k], sdm_dual_scale(ahead, s->tangent[k])), across);
}

// calls put(user, vertex, position with derivatives) for every vertex, in the order of the lathe
typedef void put_vertex(void *user, size_t vertex, const dual at[3]);

static void pole(const cochlea *c, const double *p, bool apex, put_vertex *put, void *user)
{
    const double theta = apex ? c->model.theta : 0, ahead = (apex ? 1 : -1) * sdm_cochlea_radius_at(&c->model, theta);
    cochlea_section s;
    sdm_cochlea_section_at(&c->model, p, theta, &s);
    dual at[3];
    for (int k = 0; k < 3; k++) at[k] = vertex_coordinate(&s, k, sdm_dual_of(0), sdm_dual_of(0), ahead);
    if (c->left) at[1] = sdm_dual_scale(-1, at[1]);
    put(user, apex ? sdm_lathe_n_vert(c->n_rings, c->n_sectors) - 1 : 0, at);
}

static void vertices(const cochlea *c, const double *p, put_vertex *put, void *user)
{
    pole(c, p, false, put, user);
    for (size_t i = 0; i < c->n_rings; i++) {
        const ring *r = &c->rings[i];
        const double *direction = c->direction + (i % 2 ? 2 * c->n_sectors : 0);
        cochlea_section s;
        sdm_cochlea_section_at(&c->model, p, r->theta, &s);
        for (size_t j = 0; j < c->n_sectors; j++) {
            dual x = sdm_dual_of(r->wide * direction[2 * j]), y = sdm_dual_of(r->high * direction[2 * j + 1]), at[3];
            if (!r->whole) cut_off(s.bend, &x, &y);
            for (int k = 0; k < 3; k++) at[k] = vertex_coordinate(&s, k, x, y, r->ahead);
            if (c->left) at[1] = sdm_dual_scale(-1, at[1]);
            put(user, 1 + i * c->n_sectors + j, at);
        }
    }
    pole(c, p, true, put, user);
}

static void put_position(void *user, size_t vertex, const dual at[3])
{
    double *vert = user;
    for (int k = 0; k < 3; k++) vert[3 * vertex + (size_t)k] = at[k].v;
}

static int mesh(const void *self, const sdm_host *host, const sdm_option_value *options, const double *p,
                sdm_mesh_out *out)
{
    (void)options;
    const cochlea *c = self;
    const int failed =
        host->reserve(host, out, sdm_lathe_n_vert(c->n_rings, c->n_sectors), sdm_lathe_n_tri(c->n_rings, c->n_sectors));
    if (failed) return failed;
    vertices(c, p, put_position, out->vert);
    sdm_lathe_triangles(c->n_rings, c->n_sectors, c->left, out->tri);
    return 0;
}

typedef struct velocity_out {
    double *velocity; // [COCHLEA_PARAMS][n_vert][3]
    size_t n_vert;
} velocity_out;

static void put_velocity(void *user, size_t vertex, const dual at[3])
{
    const velocity_out *o = user;
    for (size_t i = 0; i < COCHLEA_PARAMS; i++)
        for (size_t k = 0; k < 3; k++) o->velocity[3 * (i * o->n_vert + vertex) + k] = at[k].d[i];
}

static int velocity(const void *self, const sdm_host *host, const sdm_option_value *options, const double *p,
                    size_t n_vert, double *velocity_at)
{
    (void)options;
    const cochlea *c = self;
    if (n_vert != sdm_lathe_n_vert(c->n_rings, c->n_sectors))
        return host->fail(host, "velocity of another number of vertices");
    velocity_out out = {velocity_at, n_vert};
    vertices(c, p, put_velocity, &out);
    return 0;
}

static double to_ball(const cochlea_model *m, const double *p, const double x[3], double theta)
{
    double c[3];
    sdm_cochlea_centre_at(m, p, theta, c);
    return sqrt((x[0] - c[0]) * (x[0] - c[0]) + (x[1] - c[1]) * (x[1] - c[1]) + (x[2] - c[2]) * (x[2] - c[2])) -
           sdm_cochlea_radius_at(m, theta);
}

// golden section search (Kiefer 1953) in [lo, hi], which holds one minimum
static double lowest(const cochlea_model *m, const double *p, const double x[3], double lo, double hi)
{
    const double golden = 0.61803398874989484820;
    double t1 = hi - golden * (hi - lo), t2 = lo + golden * (hi - lo);
    double f1 = to_ball(m, p, x, t1), f2 = to_ball(m, p, x, t2);
    while (hi - lo > 1e-8) {
        if (f1 < f2) {
            hi = t2, t2 = t1, f2 = f1;
            t1 = hi - golden * (hi - lo), f1 = to_ball(m, p, x, t1);
        } else {
            lo = t1, t1 = t2, f1 = f2;
            t2 = lo + golden * (hi - lo), f2 = to_ball(m, p, x, t2);
        }
    }
    return f1 < f2 ? f1 : f2;
}

// the ball of radius R swept along the centreline: min over theta of |x - c(theta)| - R(theta)
static int distance(const void *self, const sdm_host *host, const sdm_option_value *options, const double *p,
                    const double x[3], double *out)
{
    (void)options;
    const cochlea *c = self;
    const cochlea_model *m = &c->model;
    if (m->ellipse) return host->fail(host, "there is no closed form for section = ellipse, only for circle");
    const double at[3] = {x[0], c->left ? -x[1] : x[1], x[2]}, step = m->theta / 512;

    // every dip between samples is searched: a step is a fraction of the tube radius
    double last = to_ball(m, p, at, 0), now = to_ball(m, p, at, step), best = last;
    for (int i = 1; i <= 512; i++) {
        const double next = i < 512 ? to_ball(m, p, at, step * (i + 1)) : INFINITY;
        if (now <= last && now <= next) {
            const double hi = i < 512 ? step * (i + 1) : m->theta, dip = lowest(m, p, at, step * (i - 1), hi);
            if (dip < best) best = dip;
        }
        if (i == 1 && last <= now) {
            const double dip = lowest(m, p, at, 0, step);
            if (dip < best) best = dip;
        }
        last = now, now = next;
    }
    const double end = to_ball(m, p, at, m->theta);
    *out = end < best ? end : best;
    return 0;
}

const sdm_shape sdm_shape_cochlea = {
    .abi = SDM_SHAPE_ABI,
    .size = sizeof(sdm_shape),
    .name = "cochlea",
    .summary = "human cochlea: a tube about a rising logarithmic spiral (a reconstruction); distance exact outside, a "
               "bound inside",
    .params = PARAMS,
    .n_params = COCHLEA_PARAMS,
    .options = OPTIONS,
    .n_options = N_OPTIONS,
    .create = create,
    .destroy = destroy,
    .mesh = mesh,
    .velocity = velocity,
    .distance = distance,
};
