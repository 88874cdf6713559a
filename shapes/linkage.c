/* Linkage: rigid links in a chain, joined by joints that turn (revolute joints), like a robot arm.
 *
 * With all angles 0 the links lie along +x, from joint 1 at the origin. motion = planar: all axes
 * are parallel to z, and the links stay in the plane z = 0. motion = spatial: joint 1 turns about
 * z, all others about axes that are perpendicular to z and parallel to each other; a positive angle
 * raises what follows. An upright base, which does not move, carries joint 1.
 *
 * A link (and the base) is a component of its own: a round cone, the convex hull of two balls, with
 * a larger ball at the joint that it ends in. The next link begins inside this ball, so the mesh
 * overlaps itself, and the shape is the union. All vertices lie on the surface of their
 * component. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lathe.h"
#include "sdm/shape.h"

#define LINKS_MAX 8
#define LINKS_DEFAULT 3
#define LIMIT_DEFAULT 1.2

#define ANGLE(name, joint)                                                                         \
    {                                                                                              \
        name, "rad", -LIMIT_DEFAULT, LIMIT_DEFAULT, 0, "angle of joint " joint                     \
    }

static const sdm_param PARAMS[LINKS_MAX] = {ANGLE("q1", "1"), ANGLE("q2", "2"), ANGLE("q3", "3"),
                                            ANGLE("q4", "4"), ANGLE("q5", "5"), ANGLE("q6", "6"),
                                            ANGLE("q7", "7"), ANGLE("q8", "8")};

enum { EDGE, LINKS, MOTION, LENGTH, RADIUS, TIP, JOINT, BASE, LIMIT, N_OPTIONS };

static const sdm_option OPTIONS[N_OPTIONS] = {
    [EDGE] = {"edge", SDM_OPTION_REAL, "mm", 0.05, 2, 0.3, NULL, "edge length the mesh aims at"},
    [LINKS] = {"links", SDM_OPTION_INT, "", 1, LINKS_MAX, LINKS_DEFAULT, NULL,
               "number of links, and of joints: each has an angle as parameter"},
    [MOTION] = {"motion", SDM_OPTION_CHOICE, "", 0, 0, 0, "planar|spatial",
                "planar: all axes along z; spatial: the first along z, the others perpendicular"},
    [LENGTH] = {"length", SDM_OPTION_REAL, "mm", 0.1, 100, 3, NULL,
                "length of a link, from joint to joint"},
    [RADIUS] = {"radius", SDM_OPTION_REAL, "mm", 0.05, 20, 0.9, NULL,
                "radius of the base, and of the links at joint 1"},
    [TIP] = {"tip", SDM_OPTION_REAL, "mm", 0.05, 20, 0.6, NULL,
             "radius at the end of the last link; the links taper evenly from 'radius' to it"},
    [JOINT] = {"joint", SDM_OPTION_REAL, "", 1, 2, 1.2, NULL,
               "radius of the ball at a joint over the radius of the links there"},
    [BASE] = {"base", SDM_OPTION_REAL, "mm", 0, 100, 3, NULL,
              "height of the base below joint 1; 0: no base"},
    [LIMIT] = {"limit", SDM_OPTION_REAL, "rad", 0.01, 3, LIMIT_DEFAULT, NULL,
               "range of every angle: -limit .. limit"},
};

/* A component: a body of revolution with its first ball at (along, across) = (0, 0) and its second
 * at (length, 0). `normal` and `tangent` belong to the line that is the side of the cone in that
 * half-plane; the balls end where the line meets them. */
typedef struct part {
    double length;
    double cone[2]; /* mm, radius of the cone at the balls */
    double ball[2]; /* mm, radius of the balls, at least that of the cone */
    double normal[2], tangent[2];
    double side[2][2]; /* (along, across) of the two ends of the side */
    double cap[2];     /* rad, angle of the arc from each pole to the side */
    /* pieces of the arcs and the side along the profile; rings without the poles */
    size_t n_cap[2], n_side, n_rings, n_sectors;
} part;

typedef struct linkage {
    size_t n_links, n_parts; /* part 0 is the base, if there is one */
    size_t n_vert, n_tri;
    bool spatial;
    sdm_param params[LINKS_MAX];
    part parts[LINKS_MAX + 1];
} linkage;

/* Computes the profile and the pieces of a part from length, cone and ball. Returns false if its
 * balls leave no side between them. */
static bool part_complete(part *a, double edge)
{
    const double sine = (a->cone[0] - a->cone[1]) / a->length;
    if (!(fabs(sine) < 1)) return false;
    const double cosine = sqrt(1 - sine * sine);
    a->normal[0] = sine, a->normal[1] = cosine;
    a->tangent[0] = cosine, a->tangent[1] = -sine;
    double room = a->length * cosine;
    for (int i = 0; i < 2; i++) {
        // half of the chord that the ball cuts out of the line
        const double chord = sqrt(a->ball[i] * a->ball[i] - a->cone[i] * a->cone[i]);
        room -= chord;
        for (int k = 0; k < 2; k++)
            a->side[i][k] = a->cone[i] * a->normal[k] + (i ? -chord : chord) * a->tangent[k];
        a->cap[i] = atan2(a->side[i][1], i ? a->side[i][0] : -a->side[i][0]);
        a->n_cap[i] = sdm_lathe_pieces(a->ball[i] * a->cap[i], edge, 2);
    }
    a->side[1][0] += a->length;
    a->n_side = sdm_lathe_pieces(room, edge, 1);
    a->n_rings = a->n_cap[0] + a->n_side + a->n_cap[1] - 1;
    a->n_sectors = sdm_lathe_pieces(LATHE_PI * (a->ball[0] + a->ball[1]), edge, 6);
    return room > 1e-3 * a->length;
}

/* The ball of a joint belongs to the part that ends in it, that of joint 1 without a base to
 * link 1. (Two equal balls with different triangles would meet almost everywhere.) */
static void parts_choose(linkage *l, const sdm_option_value *o)
{
    const double radius = o[RADIUS].number, tip = o[TIP].number, joint = o[JOINT].number,
                 n = (double)l->n_links;
    const bool has_base = o[BASE].number > 0;
    part *a = l->parts;
    if (has_base)
        *a++ = (part){
            .length = o[BASE].number, .cone = {radius, radius}, .ball = {radius, joint * radius}};
    for (size_t i = 0; i < l->n_links; i++) {
        const double near = radius + (tip - radius) * (double)i / n,
                     far = radius + (tip - radius) * (double)(i + 1) / n;
        *a++ = (part){.length = o[LENGTH].number,
                      .cone = {near, far},
                      .ball = {i == 0 && !has_base ? joint * near : near,
                               i + 1 < l->n_links ? joint * far : far}};
    }
    l->n_parts = (size_t)(a - l->parts);
}

static int part_fail(const sdm_host *host, const linkage *l, size_t i)
{
    const part *a = &l->parts[i];
    const size_t n_base = l->n_parts - l->n_links;
    char name[24] = "the base", text[240];
    if (i >= n_base) snprintf(name, sizeof name, "link %zu", i - n_base + 1);
    snprintf(text, sizeof text,
             "%s is too short, %g mm between balls of radius %g and %g mm: raise '%s', or lower "
             "'radius'%s or 'joint'",
             name, a->length, a->ball[0], a->ball[1], i < n_base ? "base" : "length",
             i < n_base ? "" : ", 'tip'");
    return host->fail(host, text);
}

static int linkage_create(const sdm_host *host, const sdm_option_value *options, void **self)
{
    linkage *l = calloc(1, sizeof *l);
    if (!l) return host->fail(host, "out of memory");
    l->n_links = (size_t)options[LINKS].number;
    l->spatial = options[MOTION].number > 0;
    parts_choose(l, options);
    for (size_t i = 0; i < l->n_parts; i++) {
        part *a = &l->parts[i];
        if (!part_complete(a, options[EDGE].number)) {
            const int failed = part_fail(host, l, i);
            free(l);
            return failed;
        }
        l->n_vert += sdm_lathe_n_vert(a->n_rings, a->n_sectors);
        l->n_tri += sdm_lathe_n_tri(a->n_rings, a->n_sectors);
    }
    for (size_t i = 0; i < l->n_links; i++) {
        l->params[i] = PARAMS[i];
        l->params[i].min = -options[LIMIT].number;
        l->params[i].max = options[LIMIT].number;
    }
    *self = l;
    return 0;
}

static void linkage_destroy(void *self) { free(self); }

static void linkage_describe(const void *self, const sdm_param **params, uint32_t *n_params)
{
    const linkage *l = self;
    *params = l->params;
    *n_params = (uint32_t)l->n_links;
}

/* Position of a ring in the profile; -1 and n_rings are the poles. */
static void profile_at(const part *a, ptrdiff_t ring, double *along, double *across)
{
    const ptrdiff_t side0 = (ptrdiff_t)a->n_cap[0] - 1, side1 = side0 + (ptrdiff_t)a->n_side,
                    last = (ptrdiff_t)a->n_rings;
    if (ring >= side0 && ring <= side1) {
        const double share = (double)(ring - side0) / (double)a->n_side;
        *along = a->side[0][0] + share * (a->side[1][0] - a->side[0][0]);
        *across = a->side[0][1] + share * (a->side[1][1] - a->side[0][1]);
    } else if (ring < side0) {
        const double angle = a->cap[0] * (double)(ring + 1) / (double)a->n_cap[0];
        *along = -a->ball[0] * cos(angle);
        *across = a->ball[0] * sin(angle);
    } else {
        const double angle = a->cap[1] * (double)(last - ring) / (double)a->n_cap[1];
        *along = a->length + a->ball[1] * cos(angle);
        *across = a->ball[1] * sin(angle);
    }
}

/* Where a part is: the centre of its first ball, and three perpendicular directions of length 1,
 * with along = left x up (a cross product). */
typedef struct place {
    double at[3], along[3], left[3], up[3];
} place;

/* Turns a towards b by an angle, and b away from a. */
static void turn(double a[3], double b[3], double angle)
{
    const double c = cos(angle), s = sin(angle);
    for (int k = 0; k < 3; k++) {
        const double towards = c * a[k] + s * b[k];
        b[k] = c * b[k] - s * a[k];
        a[k] = towards;
    }
}

/* Writes the place of every part and the axis of every joint (axes may be NULL). Joint i is at the
 * first ball of link i. */
static void places_at(const linkage *l, const double *p, place *places, double (*axes)[3])
{
    place now = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    if (l->n_parts > l->n_links)
        *places++ = (place){{0, 0, -l->parts[0].length}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}};
    for (size_t i = 0; i < l->n_links; i++) {
        const bool raises = l->spatial && i > 0;
        for (int k = 0; k < 3 && axes; k++) axes[i][k] = raises ? -now.left[k] : now.up[k];
        turn(now.along, raises ? now.up : now.left, p[i]);
        *places++ = now;
        const double length = l->parts[l->n_parts - 1].length;
        for (int k = 0; k < 3; k++) now.at[k] += length * now.along[k];
    }
}

static double *vertex_write(const place *w, double along, double left, double up, double *vert)
{
    for (int k = 0; k < 3; k++)
        vert[k] = w->at[k] + along * w->along[k] + left * w->left[k] + up * w->up[k];
    return vert + 3;
}

/* Writes the vertices of a part in the order of lathe.h. Returns the address after the last one. */
static double *part_write(const part *a, const place *w, double *vert)
{
    const ptrdiff_t n = (ptrdiff_t)a->n_rings;
    for (ptrdiff_t i = -1; i <= n; i++) {
        double along, across;
        profile_at(a, i, &along, &across);
        if (i < 0 || i == n) {
            vert = vertex_write(w, along, 0, 0, vert);
            continue;
        }
        for (size_t j = 0; j < a->n_sectors; j++) {
            const double angle = sdm_lathe_angle((size_t)i, j, a->n_sectors);
            vert = vertex_write(w, along, across * cos(angle), across * sin(angle), vert);
        }
    }
    return vert;
}

static void vertices_write(const linkage *l, const place *places, double *vert)
{
    for (size_t i = 0; i < l->n_parts; i++) vert = part_write(&l->parts[i], &places[i], vert);
}

static int linkage_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                        const double *p, sdm_mesh_out *out)
{
    (void)options;
    const linkage *l = self;
    const int failed = host->reserve(host, out, l->n_vert, l->n_tri);
    if (failed) return failed;
    place places[LINKS_MAX + 1];
    places_at(l, p, places, NULL);
    vertices_write(l, places, out->vert);
    uint32_t *tri = out->tri, first = 0;
    for (size_t i = 0; i < l->n_parts; i++) {
        const part *a = &l->parts[i];
        const size_t n = 3 * sdm_lathe_n_tri(a->n_rings, a->n_sectors);
        sdm_lathe_triangles(a->n_rings, a->n_sectors, false, tri);
        for (size_t k = 0; k < n; k++) tri[k] += first;
        tri += n;
        first += (uint32_t)sdm_lathe_n_vert(a->n_rings, a->n_sectors);
    }
    return 0;
}

/* Writes the velocity of a point x that turns about an axis (of length 1) through a joint. */
static void turn_velocity(const double axis[3], const double joint[3], const double x[3],
                          double out[3])
{
    const double r[3] = {x[0] - joint[0], x[1] - joint[1], x[2] - joint[2]};
    for (int k = 0; k < 3; k++) {
        const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
        out[k] = axis[k1] * r[k2] - axis[k2] * r[k1];
    }
}

/* A joint turns all vertices of the links behind it, and no others. */
static int linkage_velocity(const void *self, const sdm_host *host, const sdm_option_value *options,
                            const double *p, size_t n_vert, double *out)
{
    (void)options;
    const linkage *l = self;
    if (n_vert != l->n_vert)
        return host->fail(host, "velocity: n_vert is not the number of vertices of the mesh");
    place places[LINKS_MAX + 1];
    double axes[LINKS_MAX][3];
    places_at(l, p, places, axes);
    vertices_write(l, places, out); // the block of joint 1, written last, holds the vertices
    const size_t n_base = l->n_parts - l->n_links;
    for (size_t joint = l->n_links; joint-- > 0;) {
        size_t first = 0; // vertex that moves
        for (size_t i = 0; i < n_base + joint; i++)
            first += sdm_lathe_n_vert(l->parts[i].n_rings, l->parts[i].n_sectors);
        double *to = out + 3 * joint * n_vert;
        for (size_t v = first; v < n_vert; v++)
            turn_velocity(axes[joint], places[n_base + joint].at, out + 3 * v, to + 3 * v);
        memset(to, 0, 3 * first * sizeof *to);
    }
    return 0;
}

/* Signed distance to a part: exact outside, a bound inside where a ball and the cone overlap. */
static double part_distance(const part *a, const place *w, const double x[3])
{
    double along = 0, left = 0, up = 0;
    for (int k = 0; k < 3; k++) {
        const double r = x[k] - w->at[k];
        along += r * w->along[k];
        left += r * w->left[k];
        up += r * w->up[k];
    }
    const double across = hypot(left, up), to_first = hypot(across, along),
                 to_second = hypot(across, along - a->length),
                 at = along * a->tangent[0] + across * a->tangent[1];
    double cone = along * a->normal[0] + across * a->normal[1] - a->cone[0];
    if (at < 0) cone = to_first - a->cone[0];
    if (at > a->length * a->tangent[0]) cone = to_second - a->cone[1];
    return fmin(cone, fmin(to_first - a->ball[0], to_second - a->ball[1]));
}

static int linkage_distance(const void *self, const sdm_host *host, const sdm_option_value *options,
                            const double *p, const double x[3], double *out)
{
    (void)host, (void)options;
    const linkage *l = self;
    place places[LINKS_MAX + 1];
    places_at(l, p, places, NULL);
    *out = INFINITY;
    for (size_t i = 0; i < l->n_parts; i++)
        *out = fmin(*out, part_distance(&l->parts[i], &places[i], x));
    return 0;
}

const sdm_shape sdm_shape_linkage = {
    .abi = SDM_SHAPE_ABI,
    .size = sizeof(sdm_shape),
    .name = "linkage",
    .summary = "chain of rigid links with joints that turn, like a robot arm; distance exact "
               "outside, a bound inside",
    .params = PARAMS,
    .n_params = LINKS_DEFAULT,
    .options = OPTIONS,
    .n_options = N_OPTIONS,
    .create = linkage_create,
    .destroy = linkage_destroy,
    .describe = linkage_describe,
    .mesh = linkage_mesh,
    .velocity = linkage_velocity,
    .distance = linkage_distance,
};
