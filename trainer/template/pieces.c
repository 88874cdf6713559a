/* Finds the pieces of a component by growing regions that move rigidly. */
#include "pieces.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "motion.h"
#include "sdm/memory.h"

enum {
    SAMPLES = 24, /* meshes */
    SEEDS = 128,  /* vertices among which a region starts at the best one */
    START = 16,   /* vertices of a region at its start */
    FAILURES = 12 /* regions that may turn out too small */
};

/* A rigid piece has at least this fraction of the vertices, all together at least the second. */
static const double SMALLEST = 0.02, RIGID = 0.25;

enum { FREE = UINT32_MAX, FLEXIBLE = UINT32_MAX - 1 };

/* The component and its motion. */
typedef struct search {
    const family *f;
    double tolerance;
    double *x;          /* [SAMPLES][n_vert][3] */
    size_t n;           /* vertices of the component */
    uint32_t *vertices; /* [n] */
    size_t *first;      /* [n_vert + 1] neighbours of v: next[first[v] .. first[v + 1] - 1] */
    uint32_t *next;     /* also joins the vertices at the same place */
    uint32_t *piece;    /* [n_vert] rigid piece of each vertex, FREE or FLEXIBLE */
    uint32_t *list;     /* [n_vert] the region */
    uint32_t *seen;     /* [n_vert] number of the last visit */
    uint32_t visit;
    motion m[SAMPLES]; /* of the region */
} search;

static sdm_status sample_positions(search *s, sdm_error *err)
{
    const size_t n = s->f->base.n_vert;
    sdm_mesh mesh = {0};
    double p[SDM_POD_MAX_PARAMS];
    sdm_status status = SDM_ALLOC(&s->x, SAMPLES * 3 * n, "pieces", err);
    for (size_t i = 0; i < SAMPLES && !status; i++) {
        trainer_family_params(s->f, i, p);
        status = trainer_family_mesh(s->f, p, &mesh, err);
        if (!status) memcpy(s->x + 3 * n * i, mesh.vert, 3 * n * sizeof *s->x);
    }
    sdm_mesh_dispose(&mesh);
    return status;
}

// Edges of the mesh, twice each; vertices at the same place are neighbours.
static sdm_status make_graph(search *s, sdm_error *err)
{
    const sdm_mesh *m = &s->f->base;
    sdm_status status = SDM_ALLOC(&s->first, m->n_vert + 2, "pieces", err);
    if (!status) status = SDM_ALLOC(&s->next, 6 * m->n_tri + 2 * m->n_vert, "pieces", err);
    // counts, then places: two passes over the same pairs
    for (int pass = 0; pass < 2 && !status; pass++) {
        for (size_t i = 0; i < 3 * m->n_tri + m->n_vert; i++) {
            const bool edge = i < 3 * m->n_tri;
            const uint32_t a = edge ? m->tri[i] : (uint32_t)(i - 3 * m->n_tri),
                           b = edge ? m->tri[i % 3 == 2 ? i - 2 : i + 1] : s->f->place[a];
            if (a == b) continue;
            if (pass) {
                s->next[s->first[a + 1]++] = b;
                s->next[s->first[b + 1]++] = a;
            } else {
                s->first[a + 2]++, s->first[b + 2]++;
            }
        }
        for (size_t v = 2; v < m->n_vert + 2 && !pass; v++) s->first[v] += s->first[v - 1];
    }
    return status;
}

// Fits a rigid motion to the region list[n] in every sample; returns the largest error of a vertex.
static double fit_region(search *s, size_t n)
{
    const double *from = s->f->base.vert;
    const size_t stride = 3 * s->f->base.n_vert;
    double largest = 0;
    for (size_t i = 0; i < SAMPLES; i++) {
        trainer_motion_rigid(from, s->x + stride * i, s->list, n, &s->m[i]);
        for (size_t k = 0; k < n; k++)
            largest = fmax(largest, trainer_motion_error(&s->m[i], from + 3 * s->list[k],
                                                         s->x + stride * i + 3 * s->list[k]));
    }
    return largest;
}

static double distance(const double a[3], const double b[3])
{
    const double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

// True if vertex v follows the region.
static bool follows(const search *s, uint32_t v)
{
    const size_t stride = 3 * s->f->base.n_vert;
    for (size_t i = 0; i < SAMPLES; i++)
        if (trainer_motion_error(&s->m[i], s->f->base.vert + 3 * v, s->x + stride * i + 3 * v) >
            s->tolerance)
            return false;
    return true;
}

// list = the free vertices around v in the order of their distance in the graph: the first `most`,
// or all that follow the region and are reached through such. Returns their number.
static size_t spread(search *s, uint32_t v, size_t most, bool following)
{
    size_t n = 0;
    s->visit++;
    s->seen[v] = s->visit;
    s->list[n++] = v;
    for (size_t at = 0; at < n; at++) {
        const uint32_t a = s->list[at];
        for (size_t k = s->first[a]; k < s->first[a + 1] && n < most; k++) {
            const uint32_t b = s->next[k];
            if (s->seen[b] == s->visit) continue;
            s->seen[b] = s->visit;
            if (s->piece[b] == FREE && (!following || follows(s, b))) s->list[n++] = b;
        }
    }
    return n;
}

// list = the region that grows from v; returns its size, 0 if the surroundings of v flex.
static size_t grow(search *s, uint32_t v)
{
    enum { STEPS = 12 };
    size_t n = spread(s, v, START, false);
    if (n < START / 2 || !(fit_region(s, n) <= s->tolerance)) return 0;
    for (int step = 0; step < STEPS; step++) {
        const size_t before = n;
        n = spread(s, v, s->n, true);
        if (n == before) break;
        fit_region(s, n);
    }
    return n;
}

// The free vertex whose surroundings move most rigidly, of a few; FREE: none is left.
static uint32_t find_seed(search *s, size_t n_free)
{
    const size_t stride = n_free / SEEDS + 1;
    uint32_t best = FREE;
    double least = INFINITY;
    for (size_t k = 0, at = 0; k < s->n; k++) {
        const uint32_t v = s->vertices[k];
        if (s->piece[v] != FREE || at++ % stride) continue;
        const size_t n = spread(s, v, START, false);
        const double error = n < START / 2 ? INFINITY : fit_region(s, n);
        if (error < least || best == FREE) least = error, best = v;
    }
    return best;
}

// Sets piece[] of all vertices of the component. Returns the number of rigid pieces, 0 if they are
// too small a part of it.
static size_t grow_pieces(search *s)
{
    size_t n_free = s->n, n_rigid = 0, n_pieces = 0;
    for (int failed = 0; failed < FAILURES && n_pieces < PIECES_MAX;) {
        const uint32_t seed = find_seed(s, n_free);
        if (seed == FREE) break;
        size_t n = grow(s, seed);
        const bool rigid = n >= START && (double)n >= SMALLEST * (double)s->n;
        if (n == 0) s->list[n++] = seed;
        for (size_t k = 0; k < n; k++) s->piece[s->list[k]] = rigid ? (uint32_t)n_pieces : FLEXIBLE;
        n_free -= n;
        if (rigid) n_pieces++, n_rigid += n;
        failed += !rigid;
    }
    for (size_t k = 0; k < s->n; k++)
        if (s->piece[s->vertices[k]] == FREE) s->piece[s->vertices[k]] = FLEXIBLE;
    return (double)n_rigid >= RIGID * (double)s->n ? n_pieces : 0;
}

// Makes flexible the corners of triangles that lie in no rigid piece; they stay in their pieces.
static void mark_joints(const search *s, bool *flexes)
{
    const sdm_mesh *m = &s->f->base;
    for (size_t t = 0; t < m->n_tri; t++) {
        const uint32_t *v = m->tri + 3 * t;
        const uint32_t piece = s->piece[v[0]];
        if (piece != FLEXIBLE && piece == s->piece[v[1]] && piece == s->piece[v[2]]) continue;
        for (int i = 0; i < 3; i++) flexes[v[i]] = true;
    }
}

// list = the connected flexible vertices around v, then those within `overlap` of them, and at
// least their neighbours. origin[b] = the flexible vertex from which b was reached. Takes the
// flexible ones out of `flexes`. Returns their number.
static size_t spread_joint(search *s, uint32_t v, bool *flexes, double overlap, uint32_t *origin)
{
    const double *x = s->f->base.vert;
    size_t n = 0;
    s->visit++;
    s->seen[v] = s->visit;
    origin[v] = v;
    s->list[n++] = v;
    for (size_t at = 0; at < n; at++) {
        const uint32_t a = s->list[at];
        for (size_t k = s->first[a]; k < s->first[a + 1]; k++) {
            const uint32_t b = s->next[k];
            if (s->seen[b] == s->visit || !flexes[b]) continue;
            s->seen[b] = s->visit;
            origin[b] = b;
            s->list[n++] = b;
        }
    }
    const size_t n_flexible = n;
    for (size_t at = 0; at < n; at++) {
        const uint32_t a = s->list[at], from = origin[a];
        for (size_t k = s->first[a]; k < s->first[a + 1]; k++) {
            const uint32_t b = s->next[k];
            if (s->seen[b] == s->visit) continue;
            if (at >= n_flexible && !(distance(x + 3 * b, x + 3 * from) <= overlap)) continue;
            s->seen[b] = s->visit;
            origin[b] = from;
            s->list[n++] = b;
        }
    }
    for (size_t k = 0; k < n_flexible; k++) flexes[s->list[k]] = false;
    return n;
}

static int compare_vertices(const void *a, const void *b)
{
    const uint32_t u = *(const uint32_t *)a, v = *(const uint32_t *)b;
    return u < v ? -1 : u > v;
}

// Adds a piece with the vertices list[n].
static void add_piece(const search *s, size_t n, bool flexes, pieces *out)
{
    uint32_t *to = out->vertices + out->first[out->n];
    memcpy(to, s->list, n * sizeof *to);
    qsort(to, n, sizeof *to, compare_vertices);
    out->flexes[out->n] = flexes;
    out->n++;
    out->first[out->n] = out->first[out->n - 1] + n;
}

// The rigid pieces, then the joints.
static sdm_status list_pieces(search *s, size_t n_rigid, double overlap, pieces *out,
                              sdm_error *err)
{
    bool *flexes = NULL;
    uint32_t *origin = NULL;
    sdm_status status = SDM_ALLOC(&flexes, s->f->base.n_vert, "pieces", err);
    if (!status) status = SDM_ALLOC(&origin, s->f->base.n_vert, "pieces", err);
    if (!status) status = SDM_ALLOC(&out->vertices, PIECES_MAX * s->n, "pieces", err);
    for (size_t i = 0; i < n_rigid && !status; i++) {
        size_t n = 0;
        for (size_t k = 0; k < s->n; k++)
            if (s->piece[s->vertices[k]] == i) s->list[n++] = s->vertices[k];
        add_piece(s, n, false, out);
    }
    if (!status) mark_joints(s, flexes);
    for (size_t k = 0; k < s->n && !status && out->n; k++) {
        if (!flexes[s->vertices[k]]) continue;
        const size_t n = spread_joint(s, s->vertices[k], flexes, overlap, origin);
        if (out->n < PIECES_MAX)
            add_piece(s, n, true, out);
        else
            out->n = 0;
    }
    sdm_free(origin);
    sdm_free(flexes);
    return status;
}

sdm_status trainer_pieces_find(const family *f, uint32_t c, double tolerance, double overlap,
                               pieces *out, sdm_error *err)
{
    const size_t n_vert = f->base.n_vert;
    search s = {.f = f, .tolerance = tolerance};
    *out = (pieces){0};
    sdm_status status = SDM_ALLOC(&s.vertices, n_vert, "pieces", err);
    if (!status) status = SDM_ALLOC(&s.piece, n_vert, "pieces", err);
    if (!status) status = SDM_ALLOC(&s.list, n_vert, "pieces", err);
    if (!status) status = SDM_ALLOC(&s.seen, n_vert, "pieces", err);
    if (!status) status = make_graph(&s, err);
    if (!status) status = sample_positions(&s, err);
    for (size_t v = 0; v < n_vert && !status; v++) {
        s.piece[v] = FREE;
        if (f->component[v] == c) s.vertices[s.n++] = (uint32_t)v;
    }
    const size_t n_rigid = status ? 0 : grow_pieces(&s);
    if (n_rigid) status = list_pieces(&s, n_rigid, overlap, out, err);
    sdm_free(s.x);
    sdm_free(s.vertices);
    sdm_free(s.first);
    sdm_free(s.next);
    sdm_free(s.piece);
    sdm_free(s.list);
    sdm_free(s.seen);
    return status;
}

void trainer_pieces_dispose(pieces *p)
{
    sdm_free(p->vertices);
    *p = (pieces){0};
}
