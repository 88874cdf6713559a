/* Audits the parts of a mesh: orientation, volume, contacts, and what the exact engine makes of
 * them. */
#include "sdm/internal/part_audit.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "part_fold.h"
#include "part_meeting.h"
#include "part_thickness.h"
#include "parts.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"
#include "union_hull.h"

/* Thicknesses are measured of at most so many parts: the debris of a segmentation has many. */
enum { MEASURED = 1000 };

/* The state of an audit. */
typedef struct job {
    const sdm_mesh *given;
    sdm_mesh turned; /* the mesh with the orientation that the engine gives it */
    sdm_arena arena;
    sdm_survey survey; /* of `turned` */
    uint32_t *group;   /* [number of parts] a forest: parts that meet have the same root */
    sdm_part_audit *out;
} job;

static bool same_triangle(const sdm_mesh *a, const sdm_mesh *b, size_t t)
{
    return !memcmp(a->tri + 3 * t, b->tri + 3 * t, 3 * sizeof *a->tri);
}

/* Joins the parts of an edge of more than two triangles that are not closed there by themselves: in
 * which not as many triangles run one way as the other. */
static void join_open_sides(const sdm_topology *topo, const sdm_edge *e, uint32_t *root)
{
    uint32_t open = SDM_NO_PART;
    for (uint32_t h = e->first; h != SDM_NONE; h = topo->next[h]) {
        const uint32_t part = sdm_forest_root(root, h / 3);
        int balance = 0;
        for (uint32_t g = e->first; g != SDM_NONE; g = topo->next[g])
            if (sdm_forest_root(root, g / 3) == part)
                balance += topo->tri[g] == e->lo ? 1 : -1; // the corner at which g begins
        if (!balance) continue;
        if (open != SDM_NO_PART) sdm_forest_join(root, open, part);
        open = part;
    }
}

/* Finds the parts as sdm_topology_parts() does, but separates those that only share edges and are
 * closed by themselves: a box on a plate may be inside out without the plate. */
static void find_shells(const sdm_topology *topo, uint32_t *root)
{
    enum { CROWD = 64 }; // triangles of an edge that are looked at one by one
    for (size_t t = 0; t < topo->n_tri; t++) root[t] = (uint32_t)t;
    for (int shared = 0; shared < 2; shared++)
        for (size_t i = 0; i < topo->n_edges; i++) {
            const sdm_edge *e = &topo->edges[i];
            const uint32_t n = e->n_up + e->n_down;
            if ((n > 2 && n <= CROWD) != shared) continue;
            if (shared) join_open_sides(topo, e, root);
            for (uint32_t h = e->first; !shared && topo->next[h] != SDM_NONE; h = topo->next[h])
                sdm_forest_join(root, h / 3, topo->next[h] / 3);
        }
}

/* Numbers the parts and allocates them. */
static sdm_status number_parts(job *j, sdm_error *err)
{
    const size_t n_tri = j->given->n_tri;
    sdm_part_audit *a = j->out;
    uint32_t *root = NULL;
    sdm_status s = SDM_ALLOC(&root, n_tri, "parts", err);
    if (!s) s = SDM_ALLOC(&a->part_of, n_tri, "parts", err);
    size_t n = 0;
    if (!s) find_shells(&j->survey.topo, root);
    for (size_t t = 0; t < n_tri && !s; t++) n += root[t] == t;
    if (!s) s = SDM_ALLOC(&a->part, n, "parts", err);
    if (!s) {
        // the root is the lowest triangle of its part, so it comes first
        for (uint32_t t = 0; t < n_tri; t++) {
            const uint32_t r = sdm_forest_root(root, t);
            if (r != t) {
                j->out->part_of[t] = j->out->part_of[r];
            } else if (sdm_repeats_vertex(&j->survey.topo.tri[3 * (size_t)t])) {
                j->out->part_of[t] = SDM_NO_PART;
            } else {
                j->out->part_of[t] = (uint32_t)a->n;
                a->part[a->n++] = (sdm_part){.first_tri = t,
                                             .first_vert = SIZE_MAX,
                                             .min = {INFINITY, INFINITY, INFINITY},
                                             .max = {-INFINITY, -INFINITY, -INFINITY},
                                             .thick = NAN};
            }
        }
    }
    sdm_free(root);
    return s;
}

void sdm_triangle_add(const sdm_mesh *m, size_t t, const double apex[3], double *area,
                      double *volume)
{
    const double *a = m->vert + 3 * (size_t)m->tri[3 * t],
                 *b = m->vert + 3 * (size_t)m->tri[3 * t + 1],
                 *c = m->vert + 3 * (size_t)m->tri[3 * t + 2];
    double w[3], n[3];
    v3_sub(a, apex, w);
    v3_triangle_normal(a, b, c, n);
    *area += 0.5 * v3_norm(n);
    *volume += v3_dot(w, n) / 6;
}

void sdm_mesh_sums(const sdm_mesh *m, double *volume, double *area)
{
    const double origin[3] = {0, 0, 0};
    *volume = *area = 0;
    for (size_t t = 0; t < m->n_tri; t++) sdm_triangle_add(m, t, origin, area, volume);
}

/* Boxes, ranges of vertices, areas and volumes of the parts, from the mesh as given. */
static void measure_parts(job *j)
{
    const sdm_mesh *m = j->given;
    for (size_t t = 0; t < m->n_tri; t++) {
        if (j->out->part_of[t] == SDM_NO_PART) continue;
        sdm_part *p = &j->out->part[j->out->part_of[t]];
        p->n_tri++;
        for (size_t k = 0; k < 3; k++) {
            const size_t v = m->tri[3 * t + k];
            if (v < p->first_vert) p->first_vert = v;
            if (v > p->last_vert) p->last_vert = v;
            for (size_t d = 0; d < 3; d++) {
                p->min[d] = fmin(p->min[d], m->vert[3 * v + d]);
                p->max[d] = fmax(p->max[d], m->vert[3 * v + d]);
            }
        }
    }
    // relative to the middle of each part, so that no digits are lost
    for (size_t t = 0; t < m->n_tri; t++) {
        if (j->out->part_of[t] == SDM_NO_PART) continue;
        sdm_part *p = &j->out->part[j->out->part_of[t]];
        double middle[3];
        for (size_t d = 0; d < 3; d++) middle[d] = 0.5 * (p->min[d] + p->max[d]);
        sdm_triangle_add(m, t, middle, &p->area, &p->volume);
    }
}

sdm_status sdm_part_audit_unused(const sdm_mesh *m, sdm_part_audit *out, sdm_error *err)
{
    bool *used = NULL;
    const sdm_status s = SDM_ALLOC(&used, m->n_vert, "vertices in use", err);
    if (s) return s;
    for (size_t i = 0; i < 3 * m->n_tri; i++) used[m->tri[i]] = true;
    for (size_t v = 0; v < m->n_vert; v++) {
        if (used[v]) continue;
        if (!out->unused) out->unused_first = v;
        if (v == out->unused_first + out->unused) out->unused_last = v;
        out->unused++;
    }
    sdm_free(used);
    return SDM_OK;
}

/* Notes that a triangle of part a meets one of part b, another one. */
static void count_meeting(job *j, uint32_t a, uint32_t b)
{
    sdm_part *p = &j->out->part[a];
    p->met++;
    if (b < SDM_PART_MEETS) p->meets |= (uint32_t)1 << b;
    sdm_forest_join(j->group, a, b);
}

/* Counts the triangles of edge e that lie beside those of another part. */
static void count_shared_edge(job *j, const sdm_edge *e)
{
    const uint32_t *next = j->survey.topo.next, part = j->out->part_of[e->first / 3];
    for (uint32_t h = next[e->first]; h != SDM_NONE; h = next[h]) {
        const uint32_t other = j->out->part_of[h / 3];
        if (other == part) continue;
        count_meeting(j, part, other);
        count_meeting(j, other, part);
    }
}

bool sdm_part_is_within(const sdm_part *a, const sdm_part *b)
{
    bool within = true;
    for (int d = 0; d < 3; d++) within = within && a->min[d] >= b->min[d] && a->max[d] <= b->max[d];
    return within;
}

size_t sdm_part_around(const sdm_part_audit *a, size_t index)
{
    size_t around = a->n;
    for (size_t i = 0; i < a->n; i++) {
        const sdm_part *q = &a->part[i];
        if (i != index && q->state == SDM_PART_SOLID && sdm_part_is_within(&a->part[index], q) &&
            (around == a->n || fabs(q->volume) < fabs(a->part[around].volume)))
            around = i;
    }
    return around;
}

/* Finds the groups of parts that meet, and counts the solid ones. */
static sdm_status find_groups(job *j, sdm_error *err)
{
    sdm_part_audit *a = j->out;
    bool *solid = NULL;
    const sdm_status s = SDM_ALLOC(&solid, a->n, "groups of parts", err);
    if (s) return s;
    for (size_t i = 0; i < a->n; i++) {
        const size_t around = a->part[i].state == SDM_PART_CAVITY ? sdm_part_around(a, i) : a->n;
        if (around < a->n) sdm_forest_join(j->group, (uint32_t)i, (uint32_t)around);
    }
    for (size_t i = 0; i < a->n; i++) {
        sdm_part *p = &a->part[i];
        p->group = sdm_forest_root(j->group, (uint32_t)i);
        if (p->state != SDM_PART_SOLID || solid[p->group]) continue;
        solid[p->group] = true;
        a->bodies++;
    }
    sdm_free(solid);
    return SDM_OK;
}

static bool share_vertex(const sdm_topology *topo, uint32_t a, uint32_t b)
{
    for (size_t i = 0; i < 9; i++)
        if (topo->tri[3 * (size_t)a + i / 3] == topo->tri[3 * (size_t)b + i % 3]) return true;
    return false;
}

/* Counts a pair of triangles of one part that meet. */
static void count_own(job *j, uint32_t part, uint32_t a, uint32_t b)
{
    sdm_part *p = &j->out->part[part];
    p->crossed++;
    p->overlaps += !share_vertex(&j->survey.topo, a, b);
}

/* Counts open edges and contacts between parts. */
static void count_edges_and_contacts(job *j)
{
    const sdm_topology *topo = &j->survey.topo;
    const sdm_contacts *contacts = &j->survey.contacts;
    for (size_t i = 0; i < topo->n_edges; i++) {
        const sdm_edge *e = &topo->edges[i];
        if (e->n_up + e->n_down > 2) count_shared_edge(j, e);
        if (e->n_up == e->n_down) continue;
        sdm_part *p = &j->out->part[j->out->part_of[e->first / 3]];
        const double *lo = j->given->vert + 3 * (size_t)e->lo,
                     *hi = j->given->vert + 3 * (size_t)e->hi;
        for (int d = 0; d < 3 && !p->open_edges; d++) p->open_at[d] = 0.5 * (lo[d] + hi[d]);
        p->open_edges++;
    }
    for (size_t i = 0; i < contacts->n; i++) {
        const uint32_t tri = contacts->list[i].tri, other = contacts->list[i].other,
                       a = j->out->part_of[tri], b = j->out->part_of[other];
        if (a == SDM_NO_PART || b == SDM_NO_PART) continue;
        if (a != b)
            count_meeting(j, a, b);
        else if (tri < other) // the list has each pair twice
            count_own(j, a, tri, other);
    }
}

/* Does triangle t pass through another one of its part? */
static bool crosses_own_part(const job *j, uint32_t t)
{
    const sdm_contacts *c = &j->survey.contacts;
    for (size_t i = c->first[t]; i < c->first[t + 1]; i++)
        if (c->list[i].kind == SDM_CONTACT_CROSSING &&
            j->out->part_of[c->list[i].other] == j->out->part_of[t])
            return true;
    return false;
}

/* Measures the share of each part that passes through the part itself. */
static void measure_crossings(job *j)
{
    for (uint32_t t = 0; t < j->given->n_tri; t++) {
        double area = 0, volume = 0;
        if (j->out->part_of[t] == SDM_NO_PART || !crosses_own_part(j, t)) continue;
        sdm_part *p = &j->out->part[j->out->part_of[t]];
        sdm_triangle_add(j->given, t, p->min, &area, &volume);
        if (p->area > 0) p->crossing += area / p->area;
    }
}

/* Does part p lie in the box of another closed part? */
static bool is_in_a_box(const sdm_part_audit *a, const sdm_part *p)
{
    for (size_t i = 0; i < a->n; i++) {
        const sdm_part *q = &a->part[i];
        bool inside = q != p && !q->open_edges;
        for (int d = 0; d < 3; d++)
            inside = inside && q->min[d] < p->min[d] && q->max[d] > p->max[d];
        if (inside) return true;
    }
    return false;
}

static sdm_part_state state_of(const job *j, const sdm_part *p)
{
    if (p->open_edges) return SDM_PART_OPEN;
    double largest = 0;
    for (int d = 0; d < 3; d++) largest = fmax(largest, fmax(fabs(p->min[d]), fabs(p->max[d])));
    if (fabs(p->volume) <= 64 * DBL_EPSILON * p->area * largest) return SDM_PART_FLAT;
    if ((p->turned ? -p->volume : p->volume) > 0) return SDM_PART_SOLID;
    if (p->met) return SDM_PART_INSIDE_OUT;
    // a part of a closed mesh that meets nothing and has not been turned is a cavity
    return j->out->mesh.closed || is_in_a_box(j->out, p) ? SDM_PART_CAVITY : SDM_PART_INSIDE_OUT;
}

static void judge_parts(job *j)
{
    sdm_part_audit *a = j->out;
    for (size_t i = 0; i < a->n; i++)
        a->part[i].turned = !same_triangle(j->given, &j->turned, a->part[i].first_tri);
    for (size_t i = 0; i < a->n; i++) {
        a->part[i].state = state_of(j, &a->part[i]);
        a->inside_out += a->part[i].state == SDM_PART_INSIDE_OUT;
    }
}

/* Volume and area of the union. */
static sdm_status measure_union(job *j, sdm_error *err)
{
    sdm_part_audit *a = j->out;
    sdm_mesh hull = {0};
    uint32_t *source = NULL;
    bool changed = false;
    double error_mm;
    if (!a->mesh.closed) return SDM_OK;
    const sdm_status s =
        sdm_union_hull(&j->turned, &j->survey, &j->arena, &hull, &source, &changed, &error_mm, err);
    const sdm_mesh *m = changed ? &hull : &j->turned;
    double middle[3];
    for (int d = 0; d < 3; d++) middle[d] = 0.5 * (a->mesh.min[d] + a->mesh.max[d]);
    a->union_volume = a->union_area = s ? NAN : 0;
    for (size_t t = 0; t < m->n_tri && !s; t++)
        sdm_triangle_add(m, t, middle, &a->union_area, &a->union_volume);
    sdm_mesh_dispose(&hull);
    sdm_free(source);
    return s;
}

/* The audit without the union. */
static sdm_status find_parts(job *j, sdm_error *err)
{
    size_t n_turned = 0;
    sdm_status s = sdm_mesh_copy(j->given, &j->turned, err);
    if (!s)
        s = sdm_parts_survey(&j->turned, &j->arena, &j->survey, &j->out->mesh, &j->out->turned,
                             &n_turned, err);
    if (!s) s = number_parts(j, err);
    if (!s) s = SDM_ALLOC(&j->group, j->out->n, "groups of parts", err);
    if (s) return s;
    for (size_t i = 0; i < j->out->n; i++) j->group[i] = (uint32_t)i;
    measure_parts(j);
    count_edges_and_contacts(j);
    measure_crossings(j);
    judge_parts(j);
    return find_groups(j, err);
}

/* Thickness and folds of the parts. */
static sdm_status measure_thickness(job *j, sdm_error *err)
{
    sdm_part_audit *a = j->out;
    const size_t n = a->n < MEASURED ? a->n : MEASURED;
    if (!a->mesh.closed) return SDM_OK;
    const sdm_status s =
        sdm_part_folds(&j->turned, &j->survey.tree, j->out->part_of, a->part, n, err);
    if (s) return s;
    return sdm_part_thickness(&j->turned, &j->survey.tree, j->out->part_of, a->part, n, err);
}

static void job_dispose(job *j)
{
    sdm_arena_dispose(&j->arena);
    sdm_mesh_dispose(&j->turned);
    sdm_free(j->group);
}

sdm_status sdm_part_audit_make(const sdm_mesh *m, unsigned what, const sdm_exact_opts *stop,
                               sdm_part_audit *out, sdm_error *err)
{
    if (!m || !out)
        return sdm_fail(err, SDM_E_ARG, "audit without a mesh or a place for the result");
    *out = (sdm_part_audit){.union_volume = NAN, .union_area = NAN};
    job j = {.given = m, .out = out, .arena = {.opts = stop}};
    sdm_status s = find_parts(&j, err);
    if (!s) s = sdm_part_audit_unused(m, out, err);
    if (!s && (what & SDM_AUDIT_WALLS)) s = measure_thickness(&j, err);
    if (!s && (what & SDM_AUDIT_MEETINGS) && out->mesh.closed)
        s = sdm_part_meetings(&j.turned, &j.survey, out->part_of, stop, out->part, out->n, err);
    if (!s && (what & SDM_AUDIT_UNION)) s = measure_union(&j, err);
    job_dispose(&j);
    if (s) sdm_part_audit_dispose(out);
    return s;
}

void sdm_part_audit_dispose(sdm_part_audit *a)
{
    sdm_free(a->part);
    sdm_free(a->part_of);
    *a = (sdm_part_audit){0};
}

double sdm_part_filled(const sdm_mesh *m, const sdm_part_audit *a, size_t index,
                       const sdm_exact_opts *stop)
{
    if (a->n == 1) return a->union_volume;
    sdm_mesh alone = {.vert = m->vert, .n_vert = m->n_vert};
    sdm_part_audit audit = {.union_volume = NAN};
    job j = {.given = &alone, .out = &audit, .arena = {.opts = stop}};
    sdm_status s = SDM_ALLOC(&alone.tri, 3 * a->part[index].n_tri, "triangles of a part", NULL);
    for (size_t t = 0; t < m->n_tri && !s; t++)
        if (a->part_of[t] == index)
            memcpy(alone.tri + 3 * alone.n_tri++, m->tri + 3 * t, 3 * sizeof *m->tri);
    if (!s) s = find_parts(&j, NULL);
    if (!s) s = measure_union(&j, NULL);
    const double volume = s ? NAN : audit.union_volume;
    job_dispose(&j);
    sdm_part_audit_dispose(&audit);
    sdm_free(alone.tri);
    return volume;
}

size_t sdm_part_audit_thinnest(const sdm_part_audit *a)
{
    size_t thinnest = a->n;
    for (size_t i = 0; i < a->n; i++)
        if (isfinite(a->part[i].thick) &&
            (thinnest == a->n || a->part[i].thick < a->part[thinnest].thick))
            thinnest = i;
    return thinnest;
}

double sdm_part_audit_thickness(const sdm_part_audit *a)
{
    const size_t thinnest = sdm_part_audit_thinnest(a);
    return thinnest < a->n ? a->part[thinnest].thick : NAN;
}

sdm_status sdm_mesh_turn_parts(sdm_mesh *m, size_t *n, sdm_error *err)
{
    if (!m || !n)
        return sdm_fail(err, SDM_E_ARG, "parts to turn, but no mesh or no place for their number");
    sdm_part_audit audit = {0};
    job j = {.given = m, .out = &audit};
    *n = 0;
    const sdm_status s = find_parts(&j, err);
    for (size_t t = 0; t < m->n_tri && !s; t++) {
        if (audit.part_of[t] == SDM_NO_PART) continue;
        sdm_part *p = &audit.part[audit.part_of[t]];
        // an inside-out part that the engine turns with the whole mesh is right as it is given
        if (p->turned == (p->state == SDM_PART_INSIDE_OUT)) continue;
        sdm_triangle_turn(m, t);
        *n += p->first_tri == t;
    }
    job_dispose(&j);
    sdm_part_audit_dispose(&audit);
    return s;
}
