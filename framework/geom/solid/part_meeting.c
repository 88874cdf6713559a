/* Finds parts that meet on the surface of the union: at places that no further part covers.
 *
 * Two parts meet along curves. Triangles of the curves are connected by the pairs that meet, and
 * points of the segments in which they meet are the places that are looked at. A further part
 * covers a place if the winding number of all further parts there is 1 or more. */
#include "part_meeting.h"

#include <math.h>

#include "memory/cancel.h"
#include "mesh/crossings.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

/* Points of a segment that are looked at, from its beginning (0) to its end (1). The ends lie on
 * edges of triangles, where a further part may begin. */
enum { PLACES = 3 };
static const double PLACE[PLACES] = {0.5, 0.01, 0.99};

/* A place on the surface of a further part counts as covered: one of the points around the place,
 * at about this distance over the longest edge of the box of the mesh, lies inside. */
#define AROUND 1e-6
enum { DIRECTIONS = 4 };
static const double DIRECTION[DIRECTIONS][3] = {
    {0.5, 0.6, 0.7}, {0.6, -0.7, -0.5}, {-0.7, 0.5, -0.6}, {-0.4, -0.4, 0.5}};

/* What a curve has: places that no further part covers, and places that one covers. */
enum { OUTSIDE = 1, COVERED = 2 };

/* What is done with the triangles in which the pair meets, one after the other. */
typedef enum step { CLEAR, JOIN, JUDGE, COLLECT, STEPS } step;

typedef struct finder {
    const sdm_mesh *m;
    const sdm_survey *survey;
    const uint32_t *part_of;
    sdm_part *part;
    size_t n;
    uint32_t a, b; /* the pair of parts */
    double around; /* mm */
    /* [n_tri] of the triangles in which the pair meets: a forest, whose trees are the curves, and
     * what the curve has, at its root */
    uint32_t *curve;
    uint8_t *has;
    bool shared; /* some edges have more than two triangles */
    step step;
    bool alone;   /* COLLECT: a curve has no covered place */
    uint8_t some; /* COLLECT: what the curves have */
} finder;

static bool is_in_box(const sdm_part *p, const double x[3], double beyond)
{
    bool in = true;
    for (int d = 0; d < 3; d++) in = in && x[d] >= p->min[d] - beyond && x[d] <= p->max[d] + beyond;
    return in;
}

/* Does a further part cover the place x? */
static bool is_covered(const finder *f, const double x[3])
{
    bool near = false;
    for (size_t i = 0; i < f->n && !near; i++)
        near = i != f->a && i != f->b && is_in_box(&f->part[i], x, f->around);
    for (int i = 0; i < DIRECTIONS && near; i++) {
        double beside[3];
        v3_along(x, f->around, DIRECTION[i], beside);
        if (sdm_ray_winding_of_others(f->m, &f->survey->tree, beside, f->part_of, f->a, f->b) >= 1)
            return true;
    }
    return false;
}

/* Looks at the places on the segment from p to q. */
static void judge(const finder *f, const double p[3], const double q[3], uint8_t *has)
{
    for (int i = 0; i < PLACES && *has != (OUTSIDE | COVERED); i++) {
        double x[3];
        for (int d = 0; d < 3; d++) x[d] = p[d] + PLACE[i] * (q[d] - p[d]);
        *has |= is_covered(f, x) ? COVERED : OUTSIDE;
    }
}

/* Does the step with triangles t and o, which meet on the segment from p to q. */
static void add_segment(finder *f, uint32_t t, uint32_t o, const double p[3], const double q[3])
{
    switch (f->step) {
    case CLEAR:
        f->curve[t] = t, f->curve[o] = o;
        f->has[t] = f->has[o] = 0;
        break;
    case JOIN:
        sdm_forest_join(f->curve, t, o);
        break;
    case JUDGE:
        judge(f, p, q, &f->has[sdm_forest_root(f->curve, t)]);
        break;
    default: {
        const uint8_t has = f->has[sdm_forest_root(f->curve, t)];
        f->alone = f->alone || has == OUTSIDE;
        f->some |= has;
    }
    }
}

/* Adds the segments in which triangle t of part a meets triangles of part b. */
static void add_contacts(finder *f, uint32_t t)
{
    const sdm_contacts *c = &f->survey->contacts;
    sdm_frame frame;
    bool known = false;
    for (uint32_t i = c->first[t]; i < c->first[t + 1]; i++) {
        const sdm_contact *k = &c->list[i];
        // a coplanar triangle has segments for its edges as well
        if (f->part_of[k->other] != f->b || k->kind == SDM_CONTACT_COPLANAR) continue;
        double p[3], q[3];
        if (!known) sdm_facet_frame(f->m, t, &frame);
        known = true;
        sdm_frame_lift(&frame, k->p, p);
        sdm_frame_lift(&frame, k->q, q);
        add_segment(f, t, k->other, p, q);
    }
}

/* Adds edge e if triangles of both parts share it. */
static void add_edge(finder *f, const sdm_edge *e)
{
    const uint32_t *next = f->survey->topo.next;
    uint32_t t = SDM_NONE, o = SDM_NONE;
    for (uint32_t h = e->first; h != SDM_NONE; h = next[h]) {
        if (f->part_of[h / 3] == f->a) t = h / 3;
        if (f->part_of[h / 3] == f->b) o = h / 3;
    }
    if (t != SDM_NONE && o != SDM_NONE)
        add_segment(f, t, o, f->m->vert + 3 * (size_t)e->lo, f->m->vert + 3 * (size_t)e->hi);
}

/* Does the step everywhere. */
static void add_all(finder *f)
{
    const sdm_topology *topo = &f->survey->topo;
    const sdm_part *a = &f->part[f->a];
    size_t left = a->n_tri;
    for (uint32_t t = (uint32_t)a->first_tri; t < f->m->n_tri && left; t++) {
        if (f->part_of[t] != f->a) continue;
        left--;
        add_contacts(f, t);
    }
    for (size_t i = 0; i < topo->n_edges && f->shared; i++)
        if (topo->edges[i].n_up + topo->edges[i].n_down > 2) add_edge(f, &topo->edges[i]);
}

/* Does the box of a further part meet the common part of the boxes of the pair? */
static bool has_others_near(const finder *f)
{
    const sdm_part *a = &f->part[f->a], *b = &f->part[f->b];
    bool any = false;
    for (size_t i = 0; i < f->n && !any; i++) {
        const sdm_part *p = &f->part[i];
        any = i != f->a && i != f->b;
        for (int d = 0; d < 3; d++)
            any = any && p->max[d] + f->around >= fmax(a->min[d], b->min[d]) &&
                  p->min[d] - f->around <= fmin(a->max[d], b->max[d]);
    }
    return any;
}

/* Looks how the pair meets. */
static void look_at_pair(finder *f)
{
    uint32_t *outside[2] = {&f->part[f->a].meets_outside, &f->part[f->b].meets_outside},
             *partly[2] = {&f->part[f->a].meets_partly, &f->part[f->b].meets_partly};
    const uint32_t bit[2] = {(uint32_t)1 << f->b, (uint32_t)1 << f->a};
    f->alone = !has_others_near(f);
    f->some = 0;
    for (f->step = CLEAR; f->step < STEPS && !f->alone; f->step++) add_all(f);
    for (int i = 0; i < 2; i++)
        // where no place is known, nothing covers it
        if (f->alone || !f->some)
            *outside[i] |= bit[i];
        else if (f->some & OUTSIDE)
            *partly[i] |= bit[i];
}

sdm_status sdm_part_meetings(const sdm_mesh *m, const sdm_survey *survey, const uint32_t *part_of,
                             const sdm_exact_opts *stop, sdm_part *part, size_t n, sdm_error *err)
{
    const sdm_bvh_node *box = &survey->tree.node[0];
    finder f = {.m = m, .survey = survey, .part_of = part_of, .part = part, .n = n};
    for (int d = 0; d < 3; d++) f.around = fmax(f.around, AROUND * (box->hi[d] - box->lo[d]));
    sdm_status s = SDM_ALLOC(&f.curve, m->n_tri, "curves of parts that meet", err);
    if (!s) s = SDM_ALLOC(&f.has, m->n_tri, "curves of parts that meet", err);
    for (size_t i = 0; i < survey->topo.n_edges; i++)
        f.shared |= survey->topo.edges[i].n_up + survey->topo.edges[i].n_down > 2;
    for (f.a = 0; f.a < n && f.a < SDM_PART_MEETS && !s; f.a++)
        for (f.b = f.a + 1; f.b < n && f.b < SDM_PART_MEETS && !s; f.b++) {
            if (!(part[f.a].meets >> f.b & 1)) continue;
            s = sdm_cancel_check(stop, err);
            if (!s) look_at_pair(&f);
        }
    sdm_free(f.curve);
    sdm_free(f.has);
    return s;
}
