/* The audit of a mesh: what it is made of and whether it bounds a solid. */
#include <float.h>
#include <string.h>

#include "sdm/internal/vec3.h"
#include "survey.h"

static sdm_status check_content(const sdm_mesh *m, sdm_error *err)
{
    if (!m->n_tri) return sdm_fail(err, SDM_E_MESH, "the mesh has no triangle");
    // products of four coordinates must be numbers, too, and of three not vanish
    double largest = 0;
    for (size_t i = 0; i < 3 * m->n_vert; i++) {
        const double size = fabs(m->vert[i]);
        if (!(size <= 1e70))
            return sdm_fail(err, SDM_E_MESH,
                            "vertex %zu has the %c coordinate %g, need a finite number up to 1e70",
                            i / 3, "xyz"[i % 3], m -> vert[i]);
        largest = size > largest ? size : largest;
    }
    if (largest > 0 && largest < 1e-70)
        return sdm_fail(
            err, SDM_E_MESH,
            "the largest coordinate of the mesh is %g, need 1e-70 at least: take another unit",
            largest);
    for (size_t i = 0; i < 3 * m->n_tri; i++)
        if (m->tri[i] >= m->n_vert)
            return sdm_fail(err, SDM_E_MESH, "triangle %zu names vertex %u of %zu", i / 3,
                            (unsigned)m->tri[i], m->n_vert);
    return SDM_OK;
}

static void measure(const sdm_mesh *m, sdm_survey *s)
{
    sdm_audit *a = &s->audit;
    // relative to the middle: a far origin must not cost digits
    const double mid[3] = {0.5 * (a->min[0] + a->max[0]), 0.5 * (a->min[1] + a->max[1]),
                           0.5 * (a->min[2] + a->max[2])};
    sdm_facets_build(m, mid, s->facets, &a->area, &a->volume);
    for (size_t t = 0; t < m->n_tri; t++)
        a->degenerate += sdm_repeats_vertex(&s->topo.tri[3 * t]) ||
                         !(s->facets[t].height > 4 * DBL_EPSILON * s->facets[t].longest);
}

/* The vertex across half-edge h. */
static uint32_t vertex_across(const sdm_topology *topo, uint32_t h)
{
    return topo->tri[h % 3 ? h - 1 : h + 2];
}

/* Triangles that share their three vertices share an edge and the vertex across; counted at the
 * first of its edges. */
static sdm_status count_duplicates(const sdm_topology *topo, sdm_arena *arena, sdm_audit *a,
                                   sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    uint32_t *first; // triangle of the edge at hand across which the vertex lies
    const sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &first, topo->n_vert, "vertices", err);
    if (s) return s;
    for (size_t i = 0; i < topo->n_edges; i++) {
        const uint32_t begin = topo->edges[i].first, second = topo->next[begin];
        if (second == SDM_NONE) continue;
        // most edges have two triangles, which differ
        if (topo->next[second] == SDM_NONE &&
            vertex_across(topo, begin) != vertex_across(topo, second))
            continue;
        // half-edges fall along the list
        for (uint32_t h = begin; h != SDM_NONE; h = topo->next[h])
            first[vertex_across(topo, h)] = h / 3;
        for (uint32_t h = begin; h != SDM_NONE; h = topo->next[h])
            a->duplicate += h % 3 == 0 && first[vertex_across(topo, h)] < h / 3;
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return SDM_OK;
}

/* Is the volume negative by more than rounding of the coordinates may move it? */
static bool is_inside_out(const sdm_audit *a)
{
    double largest = 0;
    for (int c = 0; c < 3; c++) largest = fmax(largest, fmax(fabs(a->min[c]), fabs(a->max[c])));
    return a->volume < -64 * DBL_EPSILON * a->area * largest;
}

static void count_edges(const sdm_topology *topo, sdm_audit *a)
{
    bool balanced = true;
    for (size_t i = 0; i < topo->n_edges; i++) {
        const sdm_edge *e = &topo->edges[i];
        const uint32_t n = e->n_up + e->n_down;
        a->boundary_edges += n == 1;
        a->nonmanifold_edges += n >= 3;
        a->misoriented_edges += n == 2 && e->n_up != 1;
        balanced = balanced && e->n_up == e->n_down;
    }
    a->closed = balanced && topo->n_edges > 0;
    a->manifold = a->closed && !a->nonmanifold_edges;
    a->inverted = a->closed && is_inside_out(a);
}

static sdm_status count_components(const sdm_topology *topo, sdm_arena *arena, sdm_audit *a,
                                   sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    uint32_t *parent;
    const sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &parent, topo->n_tri, "components", err);
    if (s) return s;
    sdm_topology_parts(topo, parent);
    for (size_t t = 0; t < topo->n_tri; t++)
        a->components += parent[t] == t && !sdm_repeats_vertex(&topo->tri[3 * t]);
    sdm_arena_release(arena, SDM_HIGH, before);
    return SDM_OK;
}

size_t sdm_survey_usual_bytes(const sdm_mesh *m) { return 320 * m->n_tri + 16 * m->n_vert; }

/* What is made before contacts are looked for, scratch included: boxes and lists of half the size
 * are usual. */
static sdm_status take_memory(const sdm_mesh *m, sdm_budget *budget, size_t *scratch,
                              sdm_error *err)
{
    *scratch = 0;
    size_t bytes = sdm_topology_bytes(m, scratch);
    bytes += sdm_bvh_bytes(m->n_tri, scratch) + m->n_tri * sizeof(sdm_facet);
    return sdm_budget_take(budget, bytes + *scratch, err);
}

sdm_status sdm_survey_build(const sdm_mesh *m, sdm_arena *arena, sdm_survey *s, sdm_budget *budget,
                            sdm_error *err)
{
    size_t scratch = 0;
    sdm_audit *a = &s->audit;
    sdm_status st = check_content(m, err);
    if (!st) st = take_memory(m, budget, &scratch, err);
    s->start = arena->end[SDM_HIGH];
    if (!st) st = sdm_topology_build(m, arena, &s->topo, err);
    s->with_topology = arena->end[SDM_HIGH];
    if (!st) st = sdm_bvh_build(m, arena, &s->tree, err);
    if (!st)
        st = SDM_TAKE_UNSET(arena, SDM_HIGH, &s->facets, m->n_tri, "normals of triangles", err);
    if (st) return st;
    a->n_vert = m->n_vert;
    a->n_tri = m->n_tri;
    memcpy(a->min, s->tree.node->lo, sizeof a->min);
    memcpy(a->max, s->tree.node->hi, sizeof a->max);
    measure(m, s);
    count_edges(&s->topo, a);
    st = count_duplicates(&s->topo, arena, a, err);
    if (!st) st = count_components(&s->topo, arena, a, err);
    if (!st)
        st = sdm_contacts_find(m, &s->topo, &s->tree, s->facets, arena, &s->contacts, budget, err);
    if (budget) budget->used -= scratch;
    a->self_intersections = s->contacts.crossing_pairs;
    return st;
}

void sdm_survey_shrink(sdm_survey *s, sdm_arena *arena, bool keep_topology)
{
    sdm_arena_release(arena, SDM_HIGH, keep_topology ? s->with_topology : s->start);
    if (!keep_topology) s->topo = (sdm_topology){0};
    s->contacts = (sdm_contacts){0};
    s->facets = NULL;
}

sdm_status sdm_mesh_audit(const sdm_mesh *m, sdm_audit *out, sdm_error *err)
{
    if (!m || !out)
        return sdm_fail(err, SDM_E_ARG, "audit without a mesh or a place for the result");
    sdm_survey s = {0};
    sdm_arena arena = {0};
    sdm_status st = sdm_arena_reserve(&arena, sdm_survey_usual_bytes(m), err);
    if (!st) st = sdm_survey_build(m, &arena, &s, NULL, err);
    if (!st) *out = s.audit;
    sdm_arena_dispose(&arena);
    return st;
}
