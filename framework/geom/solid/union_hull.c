/* The union hull: the boundary of the points with winding number >= 1. Triangles with contacts are
 * cut along the contact segments. The winding number just outside is then constant on each piece,
 * and one test decides whether the piece stays. Triangles without contacts are decided in patches
 * (surface_side.h).
 *
 * If the winding number is nowhere negative and no sheets cancel, the removal changes distances
 * inside the solid only: for a point outside, the straight path to the nearest point of the mesh
 * crosses no surface, so that point is on the boundary. Surface with winding numbers <= 0 on both
 * sides belongs to a part that is inside out; it bounds no solid and is removed, too. */
#include "union_hull.h"

#include <string.h>

#include "cutting.h"
#include "memory/cancel.h"
#include "sdm/internal/heap.h"
#include "surface_side.h"
#include "vertex_table.h"

// Vertices made by cuts are merged within this distance, in tolerances. The merge is necessary
// because each point of the seam is computed on each of the two or three triangles that meet there.
#define MERGE 4

typedef struct hull {
    const sdm_mesh *mesh;
    const sdm_survey *survey;
    sdm_arena *arena;
    sdm_mesh *out;
    uint32_t *source; // [out->cap_tri]
    sdm_error *err;
    sdm_sides sides;
    sdm_vertex_table seam; // vertices made by cuts
    size_t pieces, kept;   // number of pieces of the current triangle
    size_t n_vert, n_tri;  // vertices and triangles filled in `out`
} hull;

static size_t bytes_for(size_t n_vert, size_t n_tri)
{
    return n_vert * 3 * sizeof(double) + n_tri * 4 * sizeof(uint32_t);
}

/* Makes room for more vertices and triangles; an array that is too small grows by half. */
static sdm_status hull_reserve(hull *w, size_t more_vert, size_t more_tri)
{
    sdm_mesh *out = w->out;
    const size_t need_vert = w->n_vert + more_vert, need_tri = w->n_tri + more_tri;
    if (need_vert <= out->cap_vert && need_tri <= out->cap_tri) return SDM_OK;
    const size_t n_vert = need_vert <= out->cap_vert ? out->cap_vert : need_vert + need_vert / 2;
    const size_t n_tri = need_tri <= out->cap_tri ? out->cap_tri : need_tri + need_tri / 2;
    sdm_status s = sdm_arena_charge(w->arena, bytes_for(n_vert, n_tri), w->err);
    if (s) return s;
    w->arena->used -= bytes_for(out->cap_vert, out->cap_tri);
    out->n_vert = w->n_vert;
    out->n_tri = w->n_tri;
    s = sdm_mesh_reserve(out, n_vert, n_tri, w->err);
    if (!s)
        s = sdm_grow((void **)&w->source, w->n_tri, out->cap_tri, sizeof *w->source,
                     "sources of triangles", w->err);
    return s;
}

static void add_triangle(hull *w, uint32_t a, uint32_t b, uint32_t c, uint32_t source)
{
    memcpy(&w->out->tri[3 * w->n_tri], (const uint32_t[3]){a, b, c}, 3 * sizeof(uint32_t));
    w->source[w->n_tri++] = source;
}

/* *v = index of the vertex at xy of the current triangle: an earlier vertex within the tolerance,
 * or a new one. */
static sdm_status seam_vertex(hull *w, const double xy[2], uint32_t *v)
{
    double x[3];
    sdm_frame_lift(&w->sides.frame, xy, x);
    sdm_vertex_table_find(&w->seam, w->out->vert, (uint32_t)w->n_vert, x, v);
    if (*v < w->n_vert) return SDM_OK;
    memcpy(&w->out->vert[3 * w->n_vert++], x, sizeof x);
    return sdm_vertex_table_add(&w->seam, w->out->vert, *v, w->err);
}

/* Callback of sdm_cut_triangle(): adds a piece of the current triangle to the hull if the piece
 * bounds the solid. */
static sdm_status add_piece(void *user, const sdm_corner *c, size_t n)
{
    hull *w = user;
    double mean[2] = {0, 0};
    bool keep;
    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 2; a++) mean[a] += c[i].x[a] / (double)n;
    sdm_status s = sdm_sides_keep(&w->sides, mean, &keep, w->err);
    w->pieces++;
    if (s || !keep) return s;
    w->kept++;
    // triangulate the piece as a fan; corners that are vertices of the mesh stay the same vertices,
    // and triangles with two merged corners are left out
    s = hull_reserve(w, n, n);
    if (s) return s;
    uint32_t first = 0, before = 0;
    for (size_t i = 0; i < n; i++) {
        uint32_t v = c[i].vertex;
        if (v == SDM_NONE) s = seam_vertex(w, c[i].x, &v);
        if (i == 0) first = v;
        if (i >= 2 && first != before && before != v && v != first)
            add_triangle(w, first, before, v, w->sides.tri);
        before = v;
    }
    return s;
}

/* Cuts triangle t and adds the pieces that stay. If all pieces stay, sets *whole to true and adds
 * none of them. */
static sdm_status cut_triangle(hull *w, sdm_cutter *cutter, uint32_t t, bool *whole)
{
    const sdm_contacts *c = &w->survey->contacts;
    const size_t n_vert = w->n_vert, n_tri = w->n_tri;
    sdm_corner corner[3];
    sdm_sides_turn_to(&w->sides, t);
    for (int i = 0; i < 3; i++) {
        corner[i].vertex = w->mesh->tri[3 * (size_t)t + (size_t)i];
        sdm_frame_flatten(&w->sides.frame, &w->mesh->vert[3 * (size_t)corner[i].vertex],
                          corner[i].x);
    }
    w->pieces = w->kept = 0;
    const sdm_status s =
        sdm_cut_triangle(cutter, corner, c->list + c->first[t], c->first[t + 1] - c->first[t],
                         c->tolerance, add_piece, w, w->err);
    *whole = w->kept == w->pieces && w->pieces;
    // remove the vertices and triangles of the pieces again
    if (!s && *whole) {
        w->n_vert = n_vert;
        w->n_tri = n_tri;
    }
    return s;
}

static sdm_status add_whole(hull *w, uint32_t t)
{
    const uint32_t *v = &w->mesh->tri[3 * (size_t)t];
    const sdm_status s = hull_reserve(w, 0, 1);
    if (!s) add_triangle(w, v[0], v[1], v[2], t);
    return s;
}

/* Removes vertices that no triangle uses. */
static sdm_status drop_unused(sdm_mesh *m, sdm_arena *arena, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    // [n_vert] at first 1 for used vertices and 0 for others, then the new index of used vertices
    uint32_t *index;
    const sdm_status s = SDM_TAKE(arena, SDM_HIGH, &index, m->n_vert, "vertices in use", err);
    if (s) return s;
    for (size_t i = 0; i < 3 * m->n_tri; i++) index[m->tri[i]] = 1;
    size_t n = 0;
    for (size_t v = 0; v < m->n_vert; v++) {
        if (!index[v]) continue;
        index[v] = (uint32_t)n;
        memmove(&m->vert[3 * n++], &m->vert[3 * v], 3 * sizeof *m->vert);
    }
    for (size_t i = 0; i < 3 * m->n_tri; i++) m->tri[i] = index[m->tri[i]];
    m->n_vert = n;
    sdm_arena_release(arena, SDM_HIGH, before);
    return SDM_OK;
}

/* Adds the triangles and pieces that stay. *changed = true if some triangle that is not a sliver
 * was left out, wholly or in part. */
static sdm_status hull_build(hull *w, bool *changed)
{
    const sdm_contacts *c = &w->survey->contacts;
    const sdm_arena_mark before = w->arena->end[SDM_HIGH];
    sdm_cutter cutter = {0};
    sdm_status s = sdm_sides_build(w->mesh, w->survey, w->arena, &w->sides, w->err);
    w->seam.tolerance = MERGE * c->tolerance;
    *changed = false;
    for (uint32_t t = 0; t < w->mesh->n_tri && !s; t++) {
        if (sdm_sides_is_sliver(w->survey, t)) continue;
        bool whole = false;
        if (c->first[t] != c->first[t + 1]) {
            s = sdm_cancel_check(w->arena->opts, w->err);
            if (!s) s = cut_triangle(w, &cutter, t, &whole);
        } else {
            whole = sdm_sides_keep_whole(&w->sides, t);
        }
        if (!s && whole) s = add_whole(w, t);
        if (!whole) *changed = true;
    }
    sdm_cutter_dispose(&cutter);
    sdm_vertex_table_dispose(&w->seam);
    sdm_sides_dispose(&w->sides);
    sdm_arena_release(w->arena, SDM_HIGH, before);
    return s;
}

sdm_status sdm_union_hull(const sdm_mesh *m, const sdm_survey *survey, sdm_arena *arena,
                          sdm_mesh *out, uint32_t **source, bool *changed, double *error_mm,
                          sdm_error *err)
{
    hull w = {
        .mesh = m, .survey = survey, .arena = arena, .out = out, .err = err, .n_vert = m->n_vert};
    // all vertices of m come first, at the same index; unused ones are dropped at the end
    sdm_status s = sdm_arena_charge(arena, bytes_for(m->n_vert, m->n_tri), err);
    if (!s) s = sdm_mesh_reserve(out, m->n_vert, m->n_tri, err);
    if (!s) s = SDM_ALLOC(&w.source, out->cap_tri, "sources of triangles", err);
    if (!s) memcpy(out->vert, m->vert, 3 * m->n_vert * sizeof *m->vert);
    if (!s) s = hull_build(&w, changed);
    *source = w.source;
    *error_mm = 0;
    if (s) return s;
    out->n_vert = w.n_vert;
    out->n_tri = w.n_tri;
    if (!*changed) return SDM_OK;
    // sum of the errors from narrow pieces that were left out, from rounding of new vertices, from
    // vertices that were taken to lie on planes, and from merged vertices
    *error_mm = (8 + 2 * MERGE) * survey->contacts.tolerance + 2 * survey->contacts.error;
    return drop_unused(out, arena, err);
}
