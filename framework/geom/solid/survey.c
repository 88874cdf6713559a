/* Surveys a mesh: the audit, and the data structures that it needs. */
#include "survey.h"

#include <float.h>
#include <string.h>

#include "sdm/internal/vec3.h"

static sdm_status check_content(const sdm_mesh *m, sdm_error *err)
{
    if (!m->n_tri) return sdm_fail(err, SDM_E_MESH, "the mesh has no triangle");
    // bounds: products of four coordinates must not overflow, products of three not underflow
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
            "the largest coordinate of the mesh is %g, need at least 1e-70: use another unit",
            largest);
    for (size_t i = 0; i < 3 * m->n_tri; i++)
        if (m->tri[i] >= m->n_vert)
            return sdm_fail(err, SDM_E_MESH, "triangle %zu names vertex %u of %zu", i / 3,
                            (unsigned)m->tri[i], m->n_vert);
    return SDM_OK;
}

/* Computes the facets, area and volume, and counts the degenerate triangles. */
static void measure_facets(const sdm_mesh *m, sdm_survey *survey)
{
    sdm_audit *a = &survey->audit;
    // the volume is summed relative to the centre of the mesh, so that no digits are lost far from
    // the origin
    const double mid[3] = {0.5 * (a->min[0] + a->max[0]), 0.5 * (a->min[1] + a->max[1]),
                           0.5 * (a->min[2] + a->max[2])};
    sdm_facets_build(m, mid, survey->facets, &a->area, &a->volume);
    for (size_t t = 0; t < m->n_tri; t++)
        a->degenerate += sdm_repeats_vertex(&survey->topo.tri[3 * t]) ||
                         !(survey->facets[t].height > 4 * DBL_EPSILON * survey->facets[t].longest);
}

/* The vertex opposite to half-edge h in its triangle. */
static uint32_t vertex_across(const sdm_topology *topo, uint32_t h)
{
    return topo->tri[h % 3 ? h - 1 : h + 2];
}

/* Counts duplicate triangles: those that share an edge and the vertex opposite to this edge with a
 * triangle of lower index. Each triangle is counted at its half-edge 0 only. */
static sdm_status count_duplicates(const sdm_topology *topo, sdm_arena *arena, sdm_audit *a,
                                   sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    // [n_vert] for the current edge: lowest triangle in which the vertex is opposite to the edge
    uint32_t *first;
    const sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &first, topo->n_vert, "vertices", err);
    if (s) return s;
    for (size_t i = 0; i < topo->n_edges; i++) {
        const uint32_t begin = topo->edges[i].first, second = topo->next[begin];
        if (second == SDM_NONE) continue;
        // shortcut: most edges have two triangles with different opposite vertices
        if (topo->next[second] == SDM_NONE &&
            vertex_across(topo, begin) != vertex_across(topo, second))
            continue;
        // the list is in descending order, so the last write is the lowest triangle
        for (uint32_t h = begin; h != SDM_NONE; h = topo->next[h])
            first[vertex_across(topo, h)] = h / 3;
        for (uint32_t h = begin; h != SDM_NONE; h = topo->next[h])
            a->duplicate += h % 3 == 0 && first[vertex_across(topo, h)] < h / 3;
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return SDM_OK;
}

/* Is the volume negative by more than its error from rounded coordinates? */
static bool is_inside_out(const sdm_audit *a)
{
    double largest = 0;
    for (int c = 0; c < 3; c++) largest = fmax(largest, fmax(fabs(a->min[c]), fabs(a->max[c])));
    return a->volume < -64 * DBL_EPSILON * a->area * largest;
}

/* Counts the kinds of edges and derives closed, manifold and inverted. */
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

/* Counts the connected components, without triangles that repeat a vertex. */
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

sdm_status sdm_survey_build(const sdm_mesh *m, sdm_arena *arena, sdm_survey *survey, sdm_error *err)
{
    sdm_audit *a = &survey->audit;
    sdm_status s = check_content(m, err);
    survey->start = arena->end[SDM_HIGH];
    if (!s) s = sdm_topology_build(m, arena, &survey->topo, err);
    survey->with_topology = arena->end[SDM_HIGH];
    if (!s) s = sdm_bvh_build(m, arena, &survey->tree, err);
    if (!s)
        s = SDM_TAKE_UNSET(arena, SDM_HIGH, &survey->facets, m->n_tri, "normals of triangles", err);
    if (s) return s;
    a->n_vert = m->n_vert;
    a->n_tri = m->n_tri;
    memcpy(a->min, survey->tree.node->lo, sizeof a->min);
    memcpy(a->max, survey->tree.node->hi, sizeof a->max);
    measure_facets(m, survey);
    count_edges(&survey->topo, a);
    s = count_duplicates(&survey->topo, arena, a, err);
    if (!s) s = count_components(&survey->topo, arena, a, err);
    if (!s)
        s = sdm_contacts_find(m, &survey->topo, &survey->tree, survey->facets, arena,
                              &survey->contacts, err);
    a->self_intersections = survey->contacts.crossing_pairs;
    return s;
}

void sdm_survey_shrink(sdm_survey *survey, sdm_arena *arena, bool keep_topology)
{
    sdm_arena_release(arena, SDM_HIGH, keep_topology ? survey->with_topology : survey->start);
    if (!keep_topology) survey->topo = (sdm_topology){0};
    survey->contacts = (sdm_contacts){0};
    survey->facets = NULL;
}

sdm_status sdm_mesh_audit(const sdm_mesh *m, sdm_audit *out, sdm_error *err)
{
    if (!m || !out)
        return sdm_fail(err, SDM_E_ARG, "audit without a mesh or a place for the result");
    sdm_survey survey = {0};
    sdm_arena arena = {0};
    // number of bytes that a closed mesh with few contacts needs
    sdm_status s = sdm_arena_reserve(&arena, 320 * m->n_tri + 16 * m->n_vert, err);
    if (!s) s = sdm_survey_build(m, &arena, &survey, err);
    if (!s) *out = survey.audit;
    sdm_arena_dispose(&arena);
    return s;
}
