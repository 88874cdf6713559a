/* Measures the thickness of the parts of a mesh by chords: rays from points of the surface, against
 * the normal, to the wall of the union on the other side. The thickness is the length that a
 * fiftieth of the surface does not reach, among chords between walls that are nearly parallel: at a
 * neck they are, at edges and tips, where chords of every solid shrink to nothing, they are not.
 * Where hardly any walls are parallel (a cone), it is the median of all chords. Where the other
 * wall lies in the same place, there is no part to measure. */
#include "part_thickness.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "part_places.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

enum { CHORDS = 256, CHORDS_MIN = 32, THIN_RANK = CHORDS / 50, CROSSINGS_MAX = 128 };

/* Walls that enclose a smaller angle, 10 degrees, count as parallel: its cosine. */
static const double PARALLEL = 0.9848;

/* A place where a ray crosses the surface. */
typedef struct crossing {
    double at;         /* along the ray, mm */
    int step;          /* of the winding number: -1 where the ray leaves, 1 where it enters */
    uint32_t triangle; /* that it crosses */
} crossing;

typedef struct ray {
    double from[3], dir[3]; /* dir: a unit vector */
    uint32_t triangle;      /* on which it begins */
    double touch;           /* triangles no farther from `from` go through it: rounding, mm */
    crossing found[CROSSINGS_MAX];
    size_t n;      /* of all crossings, also of those without a place in found[] */
    int64_t inner; /* winding number just behind `from` */
} ray;

/* The chords of one part. */
typedef struct chords {
    part_places begin;
    size_t n, n_parallel;
    size_t n_none;           /* of length 0: they do not count for the thickness */
    double length[CHORDS];   /* [n] mm */
    double parallel[CHORDS]; /* [n_parallel] mm, of those between parallel walls */
} chords;

static bool meets_box(const ray *r, const sdm_bvh_node *node)
{
    double first = -r->touch, last = INFINITY;
    for (int d = 0; d < 3; d++) {
        const double a = (node->lo[d] - r->from[d]) / r->dir[d],
                     b = (node->hi[d] - r->from[d]) / r->dir[d];
        first = fmax(first, fmin(a, b)); // fmin() and fmax() ignore NaN
        last = fmin(last, fmax(a, b));
    }
    return first <= last;
}

static const double *corner(const sdm_mesh *m, size_t t, size_t c)
{
    return m->vert + 3 * (size_t)m->tri[3 * t + c];
}

static void normal_of(const sdm_mesh *m, size_t t, double n[3])
{
    v3_triangle_normal(corner(m, t, 0), corner(m, t, 1), corner(m, t, 2), n);
}

/* Adds the crossing with triangle t, if there is one (Moeller and Trumbore 1997). */
static void cross(ray *r, const sdm_mesh *m, uint32_t t)
{
    double u[3], v[3], w[3], p[3], q[3];
    v3_sub(corner(m, t, 1), corner(m, t, 0), u);
    v3_sub(corner(m, t, 2), corner(m, t, 0), v);
    v3_sub(r->from, corner(m, t, 0), w);
    v3_cross(r->dir, v, p);
    v3_cross(w, u, q);
    const double det = v3_dot(u, p), a = v3_dot(w, p) / det, b = v3_dot(r->dir, q) / det,
                 at = v3_dot(v, q) / det;
    if (t == r->triangle || !(det != 0 && a >= 0 && b >= 0 && a + b <= 1 && at >= -r->touch))
        return;
    // det > 0: the triangle faces the origin of the ray
    const int step = det > 0 ? 1 : -1;
    // far away the winding number is 0: that at the origin is minus the sum of all steps
    r->inner -= step;
    if (r->n < CROSSINGS_MAX) r->found[r->n] = (crossing){at > r->touch ? at : 0, step, t};
    r->n++;
}

static void follow(ray *r, const sdm_mesh *m, const sdm_bvh *tree)
{
    uint32_t stack[SDM_BVH_DEPTH + 2];
    size_t n = 0;
    stack[n++] = 0;
    while (n) {
        const sdm_bvh_node *node = &tree->node[stack[--n]];
        if (!meets_box(r, node)) continue;
        for (uint32_t i = 0; i < node->count; i++) cross(r, m, tree->order[node->first + i]);
        if (node->count) continue;
        stack[n++] = node->first;
        stack[n++] = node->first + 1;
    }
}

/* In one place the ray enters a solid before it leaves another one: solids that touch are one. */
static int by_place(const void *a, const void *b)
{
    const crossing *x = a, *y = b;
    return x->at != y->at ? (x->at > y->at) - (x->at < y->at) : y->step - x->step;
}

/* The first place outside the union; NULL: the origin does not lie on the surface of the union. */
static const crossing *way_out(ray *r)
{
    int64_t winding = r->inner;
    if (winding != 1 || r->n > CROSSINGS_MAX) return NULL;
    qsort(r->found, r->n, sizeof *r->found, by_place);
    for (size_t i = 0; i < r->n; i++) {
        winding += r->found[i].step;
        if (winding <= 0) return &r->found[i];
    }
    return NULL;
}

/* Adds the chord that begins at `from` in triangle t, whose normal is n[3]. */
static void add_chord(const sdm_mesh *m, const sdm_bvh *tree, uint32_t t, const double from[3],
                      const double n[3], chords *c)
{
    ray r = {.triangle = t};
    const double length = v3_norm(n);
    for (int d = 0; d < 3; d++) {
        r.from[d] = from[d];
        r.dir[d] = -n[d] / length;
        r.touch = fmax(r.touch, 64 * DBL_EPSILON *
                                    fmax(fabs(tree->node[0].lo[d]), fabs(tree->node[0].hi[d])));
    }
    follow(&r, m, tree);
    const crossing *end = way_out(&r);
    if (!end) return;
    c->n_none += end->at == 0;
    if (end->at == 0) return;
    double wall[3];
    normal_of(m, end->triangle, wall);
    c->length[c->n++] = end->at;
    if (v3_dot(wall, r.dir) > PARALLEL * v3_norm(wall)) c->parallel[c->n_parallel++] = end->at;
}

static int by_length(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double thickness(chords *c)
{
    qsort(c->length, c->n, sizeof *c->length, by_length);
    const double median = c->length[c->n / 2];
    if (c->n_parallel <= THIN_RANK) return median;
    qsort(c->parallel, c->n_parallel, sizeof *c->parallel, by_length);
    return fmin(median, c->parallel[THIN_RANK]);
}

sdm_status sdm_part_thickness(const sdm_mesh *m, const sdm_bvh *tree, const uint32_t *part_of,
                              sdm_part *parts, size_t n, sdm_error *err)
{
    chords *of = NULL;
    const sdm_status s = SDM_ALLOC(&of, n, "thicknesses of parts", err);
    if (s) return s;
    for (uint32_t t = 0; t < m->n_tri; t++) {
        const uint32_t i = part_of[t];
        if (i >= n || parts[i].state != SDM_PART_SOLID) continue;
        double normal[3], from[3];
        normal_of(m, t, normal);
        of[i].begin.area += 0.5 * v3_norm(normal);
        while (part_places_next(&of[i].begin, CHORDS, parts[i].area, m, t, from))
            add_chord(m, tree, t, from, normal, &of[i]);
    }
    for (size_t i = 0; i < n; i++) {
        parts[i].doubled = of[i].n_none > THIN_RANK;
        if (of[i].n >= CHORDS_MIN) parts[i].thick = thickness(&of[i]);
    }
    sdm_free(of);
    return SDM_OK;
}
