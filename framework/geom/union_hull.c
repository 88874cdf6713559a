/* The union hull. Where two triangles meet, both are cut along the segment they share, so the winding number just outside a piece is
   the same all over it and one ray decides the piece. Triangles that meet nothing are decided by patches: the winding number outside
   does not change across an edge between two of them.

   Outside the solid the nearest point of the whole mesh lies on the boundary already (the way to it crosses nothing), so the
   removal changes distances inside only. */
#include "union_hull.h"

#include <string.h>

#include "crossings.h"
#include "cutting.h"
#include "sdm/memory.h"
#include "vec3.h"

typedef enum fate { FATE_UNKNOWN, FATE_KEPT, FATE_DROPPED } fate;

typedef struct hull {
    const sdm_mesh *mesh;
    const sdm_survey *survey;
    sdm_mesh *out;
    sdm_error *err;
    uint32_t tri; // the triangle being cut
    size_t pieces, kept;
    size_t n_vert, n_tri; // used in out
    uint32_t *skip;       // the triangle and what lies on it
    size_t cap_skip;
} hull;

static bool is_flat(const hull *w, uint32_t t)
{
    return !(sdm_frame_height(&w->survey->frames[t]) > w->survey->contacts.tolerance);
}

static bool on_triangle(const sdm_frame *f, const double x[3])
{
    double p[2];
    sdm_frame_flatten(f, x, p);
    return p[1] > 0 && f->e1y * p[0] - f->e1x * p[1] - f->kh1 < 0 && f->e2y * p[0] - f->e2x * p[1] < 0;
}

/* Is the surface at x, inside triangle t or a piece of it, boundary of the solid, and is t the one that stands for it? */
static sdm_status decide(hull *w, uint32_t t, const double x[3], fate *out)
{
    const sdm_contacts *c = &w->survey->contacts;
    const sdm_frame *f = &w->survey->frames[t];
    const size_t n = c->first[t + 1] - c->first[t];
    if (n + 1 > w->cap_skip) {
        const sdm_status s = sdm_grow((void **)&w->skip, 0, 2 * n + 16, sizeof *w->skip, "coplanar triangles", w->err);
        if (s) return s;
        w->cap_skip = 2 * n + 16;
    }
    size_t n_skip = 0;
    int jump = 1; // of the winding number on the way in, with all that lies on the triangle here
    bool first = true;
    w->skip[n_skip++] = t;
    for (uint32_t i = c->first[t]; i < c->first[t + 1]; i++) {
        if (c->list[i].kind != SDM_CONTACT_COPLANAR) continue;
        const uint32_t o = c->list[i].other;
        w->skip[n_skip++] = o;
        if (!on_triangle(&w->survey->frames[o], x)) continue;
        const bool same = v3_dot(f->n, w->survey->frames[o].n) > 0;
        jump += same ? 1 : -1;
        if (same && o < t) first = false;
    }
    int axis = 0;
    for (int i = 1; i < 3; i++)
        if (fabs(f->n[i]) > fabs(f->n[axis])) axis = i;
    const int outside = sdm_ray_winding(w->mesh, &w->survey->tree, x, axis, f->n[axis] > 0 ? 1 : -1, w->skip, n_skip);
    *out = first && outside <= 0 && outside + jump >= 1 ? FATE_KEPT : FATE_DROPPED;
    return SDM_OK;
}

static void centre(const hull *w, uint32_t t, double x[3])
{
    const uint32_t *v = &w->mesh->tri[3 * (size_t)t];
    for (size_t i = 0; i < 3; i++)
        x[i] = (w->mesh->vert[3 * (size_t)v[0] + i] + w->mesh->vert[3 * (size_t)v[1] + i] +
                w->mesh->vert[3 * (size_t)v[2] + i]) /
               3;
}

/* Fate of all triangles that meet nothing, one ray a patch, through its largest triangle. */
static sdm_status decide_patches(hull *w, fate *fates)
{
    const sdm_survey *s = w->survey;
    const size_t n = w->mesh->n_tri;
    uint32_t *parent, *largest;
    sdm_status st = SDM_ALLOC(&parent, n, "patches", w->err);
    if (!st)
        st = SDM_ALLOC(&largest, n, "patches", w->err);
    else
        largest = NULL;
    if (st) goto done;
    for (uint32_t t = 0; t < n; t++) parent[t] = largest[t] = t;
    for (uint32_t h = 0; h < 3 * n; h++) {
        const uint32_t t = h / 3, o = sdm_topology_neighbour(&s->topo, h);
        if (o == SDM_NONE || o < t || is_flat(w, t) || is_flat(w, o)) continue;
        if (s->contacts.first[t] == s->contacts.first[t + 1] && s->contacts.first[o] == s->contacts.first[o + 1])
            sdm_forest_join(parent, t, o);
    }
    for (uint32_t t = 0; t < n; t++) {
        const uint32_t r = sdm_forest_root(parent, t), l = largest[r];
        if (s->frames[t].half[0] * sdm_frame_height(&s->frames[t]) >
            s->frames[l].half[0] * sdm_frame_height(&s->frames[l]))
            largest[r] = t;
    }
    for (uint32_t t = 0; t < n && !st; t++) {
        if (s->contacts.first[t] != s->contacts.first[t + 1] || is_flat(w, t)) continue;
        const uint32_t r = sdm_forest_root(parent, t);
        if (fates[r] == FATE_UNKNOWN) {
            double x[3];
            centre(w, largest[r], x);
            st = decide(w, largest[r], x, &fates[r]);
        }
        fates[t] = fates[r];
    }
done:
    sdm_free(parent);
    sdm_free(largest);
    return st;
}

static sdm_status add_piece(void *user, const sdm_corner *c, size_t n)
{
    hull *w = user;
    const sdm_frame *f = &w->survey->frames[w->tri];
    double mean[2] = {0, 0}, x[3];
    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 2; a++) mean[a] += c[i].x[a] / (double)n;
    sdm_frame_lift(f, mean, x);
    fate verdict;
    sdm_status s = decide(w, w->tri, x, &verdict);
    w->pieces++;
    if (s || verdict == FATE_DROPPED) return s;
    w->kept++;
    // a fan; corners that are vertices of the mesh keep them
    sdm_mesh *out = w->out;
    if (w->n_vert + n > out->cap_vert || w->n_tri + n > out->cap_tri) {
        out->n_vert = w->n_vert;
        out->n_tri = w->n_tri;
        s = sdm_mesh_reserve(out, 2 * (w->n_vert + n), 2 * (w->n_tri + n), w->err);
        if (s) return s;
    }
    uint32_t first = 0, before = 0;
    for (size_t i = 0; i < n; i++) {
        uint32_t v = c[i].vertex;
        if (v == SDM_NONE) {
            v = (uint32_t)w->n_vert++;
            sdm_frame_lift(f, c[i].x, &out->vert[3 * (size_t)v]);
        }
        if (i == 0) first = v;
        if (i >= 2) memcpy(&out->tri[3 * w->n_tri++], (const uint32_t[3]){first, before, v}, 3 * sizeof(uint32_t));
        before = v;
    }
    return SDM_OK;
}

/* Cuts triangle t and adds the pieces that stay; whole again when all of them do. */
static sdm_status cut(hull *w, sdm_cutter *cutter, uint32_t t, fate *whole)
{
    const sdm_contacts *c = &w->survey->contacts;
    const size_t n_vert = w->n_vert, n_tri = w->n_tri;
    sdm_corner corner[3];
    for (int i = 0; i < 3; i++) {
        corner[i].vertex = w->mesh->tri[3 * (size_t)t + (size_t)i];
        sdm_frame_flatten(&w->survey->frames[t], &w->mesh->vert[3 * (size_t)corner[i].vertex], corner[i].x);
    }
    w->tri = t;
    w->pieces = w->kept = 0;
    const sdm_status s = sdm_cut_triangle(cutter, corner, c->list + c->first[t], c->first[t + 1] - c->first[t],
                                          c->tolerance, add_piece, w, w->err);
    *whole = w->kept == w->pieces && w->pieces ? FATE_KEPT : FATE_DROPPED;
    if (!s && *whole == FATE_KEPT) {
        w->n_vert = n_vert;
        w->n_tri = n_tri;
    }
    return s;
}

static sdm_status add_whole(hull *w, uint32_t t)
{
    if (w->n_tri + 1 > w->out->cap_tri) {
        w->out->n_vert = w->n_vert;
        w->out->n_tri = w->n_tri;
        const sdm_status s = sdm_mesh_reserve(w->out, w->n_vert, 2 * w->n_tri + 1, w->err);
        if (s) return s;
    }
    memcpy(&w->out->tri[3 * w->n_tri++], &w->mesh->tri[3 * (size_t)t], 3 * sizeof(uint32_t));
    return SDM_OK;
}

/* Removes vertices that no triangle uses. */
static sdm_status drop_unused(sdm_mesh *m, sdm_error *err)
{
    uint32_t *place;
    const sdm_status s = SDM_ALLOC(&place, m->n_vert, "vertices in use", err);
    if (s) return s;
    for (size_t i = 0; i < 3 * m->n_tri; i++) place[m->tri[i]] = 1;
    size_t n = 0;
    for (size_t v = 0; v < m->n_vert; v++) {
        if (!place[v]) continue;
        place[v] = (uint32_t)n;
        memmove(&m->vert[3 * n++], &m->vert[3 * v], 3 * sizeof *m->vert);
    }
    for (size_t i = 0; i < 3 * m->n_tri; i++) m->tri[i] = place[m->tri[i]];
    m->n_vert = n;
    sdm_free(place);
    return SDM_OK;
}

static sdm_status build(hull *w, fate *fates, bool *changed)
{
    const sdm_survey *s = w->survey;
    sdm_cutter cutter = {0};
    sdm_status st = decide_patches(w, fates);
    *changed = false;
    for (uint32_t t = 0; t < w->mesh->n_tri && !st; t++) {
        if (is_flat(w, t)) continue;
        if (s->contacts.first[t] != s->contacts.first[t + 1]) st = cut(w, &cutter, t, &fates[t]);
        if (!st && fates[t] == FATE_KEPT) st = add_whole(w, t);
        if (fates[t] != FATE_KEPT) *changed = true;
    }
    sdm_cutter_dispose(&cutter);
    return st;
}

sdm_status sdm_union_hull(const sdm_mesh *m, const sdm_survey *s, sdm_mesh *out, bool *changed, double *error_mm,
                          sdm_error *err)
{
    fate *fates;
    sdm_status st = SDM_ALLOC(&fates, m->n_tri, "fates of triangles", err);
    if (st) return st;
    hull w = {.mesh = m, .survey = s, .out = out, .err = err, .n_vert = m->n_vert};
    st = sdm_mesh_reserve(out, m->n_vert, m->n_tri, err);
    if (!st) memcpy(out->vert, m->vert, 3 * m->n_vert * sizeof *m->vert);
    if (!st) st = build(&w, fates, changed);
    sdm_free(fates);
    sdm_free(w.skip);
    *error_mm = 0;
    if (st) return st;
    out->n_vert = w.n_vert;
    out->n_tri = w.n_tri;
    if (!*changed) return sdm_mesh_copy(m, out, err);
    // narrow pieces and seams up to the tolerance, vertices moved onto planes, rounding of the new vertices
    *error_mm = 8 * s->contacts.tolerance + 2 * s->contacts.error;
    return drop_unused(out, err);
}
