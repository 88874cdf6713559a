/* Derivative of the distance with respect to mesh vertices. The distance is the minimum of abs(x -
 * q) over all surface points q, so its derivative depends only on the motion of the nearest point
 * along the normal (Danskin 1967): d(distance) / d(vertex) = -(barycentric coordinate of q) *
 * normal.
 *
 * Inside a union the nearest point may lie where two or three sheets cross. It slides along all of
 * them as they move, and each sheet contributes its own motion along its own normal. The normal is
 * therefore split into a linear combination of the normals of the sheets, with factors >= 0,
 * because the outer normals span a convex cone. */
#include "vertex_gradient.h"

#include "mesh/facet.h"
#include "sdm/internal/vec3.h"

// largest number of sheets through one point; in general position only three cross
#define SHEETS_MAX 16
// largest accepted length of the remainder when the unit normal is split; the remainder is assigned
// to the nearest triangle
#define SPLIT_ERROR 1e-6

/* The sheets through one point, the nearest triangle first. */
typedef struct crossing {
    int n;
    uint32_t tri[SHEETS_MAX]; // numbers in the mesh
    const double *normal[SHEETS_MAX];
} crossing;

/* normal = sum over i of factor[i] * (normal of sheet[i]) + remainder of length `error`. */
typedef struct split {
    int n, sheet[3];
    double factor[3], error;
} split;

void sdm_sheets_frames(const sdm_mesh *m, int n_threads, sdm_frame *frames)
{
    (void)n_threads; // unused without OpenMP
#pragma omp parallel for num_threads(n_threads)
    for (size_t t = 0; t < m->n_tri; t++) sdm_facet_frame(m, t, &frames[t]);
}

static double clamp(double x, double most) { return x > 0 ? fmin(x, most) : 0; }

/* Barycentric coordinates of q in triangle t, clamped to >= 0. Computed along the longest edge
 * first, so they stay accurate for needles. */
static void barycentric(const sdm_frame *f, const double q[3], double w[3])
{
    double r[3];
    v3_sub(q, f->a, r);
    const double base = 2 * f->half[0], cx = base + 2 * f->half[1] * f->e1x,
                 cy = 2 * f->half[1] * f->e1y;
    const double third = f->flat == 0 && cy > 0 ? clamp(v3_dot(r, f->v) / cy, 1) : 0;
    const double second = base > 0 ? clamp((v3_dot(r, f->u) - third * cx) / base, 1 - third) : 0;
    const int turn = (int)f->rotation;
    w[turn] = 1 - second - third;
    w[(turn + 1) % 3] = second;
    w[(turn + 2) % 3] = third;
}

/* Adds the derivatives with respect to the three vertices of triangle t, on which q lies. The
 * vector `part` is the part of the normal that is assigned to triangle t. */
static void gradient_add(const sdm_sheets *s, uint32_t t, const double q[3], const double part[3],
                         sdm_vertex_gradient *out)
{
    double w[3];
    barycentric(&s->frames[t], q, w);
    for (size_t i = 0; i < 3; i++) {
        out->vertex[out->n] = s->mesh->tri[3 * (size_t)t + i];
        for (int k = 0; k < 3; k++) out->d[out->n][k] = -w[i] * part[k];
        out->n++;
    }
}

static void crossing_add(const sdm_sheets *s, uint32_t t, crossing *c)
{
    for (int i = 0; i < c->n; i++)
        if (c->tri[i] == t) return;
    c->tri[c->n] = t;
    c->normal[c->n++] = s->frames[t].n;
}

/* Collects the mesh triangles with a piece of surface within `seam` of q; `first` becomes the first
 * entry. */
static void crossing_find(const sdm_sheets *s, uint32_t first, const double q[3], crossing *c)
{
    const sdm_bvh *tree = &s->surface->tree;
    const double reach2 = s->seam * s->seam;
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0;
    c->n = 0;
    crossing_add(s, first, c);
    stack[top++] = 0;
    while (top && c->n < SHEETS_MAX) {
        const sdm_bvh_node *node = &tree->node[stack[--top]];
        if (!(sdm_bvh_box_distance2(node, q) <= reach2)) continue;
        for (uint32_t i = node->first; i < node->first + node->count && c->n < SHEETS_MAX; i++)
            if (sdm_frame_distance2(&s->surface->frames[i], q) <= reach2)
                crossing_add(s, s->source[tree->order[i]], c);
        if (node->count) continue;
        stack[top++] = node->first + 1;
        stack[top++] = node->first;
    }
}

/* Computes the remainder of split p and copies p to *best if all its factors are >= 0 (up to
 * SPLIT_ERROR) and its remainder is smaller than that of *best. */
static void split_try(const crossing *c, const double normal[3], split p, split *best)
{
    double rest[3] = {normal[0], normal[1], normal[2]};
    for (int i = 0; i < p.n; i++) {
        if (!(p.factor[i] >= -SPLIT_ERROR)) return;
        v3_along(rest, -p.factor[i], c->normal[p.sheet[i]], rest);
    }
    p.error = v3_norm(rest);
    if (p.error < best->error) *best = p;
}

static void split_try_two(const crossing *c, const double normal[3], int i, int j, split *best)
{
    const double *a = c->normal[i], *b = c->normal[j];
    const double na = v3_dot(normal, a), nb = v3_dot(normal, b), ab = v3_dot(a, b),
                 det = 1 - ab * ab;
    if (det > 0)
        split_try(c, normal, (split){2, {i, j}, {(na - ab * nb) / det, (nb - ab * na) / det}, 0},
                  best);
}

static void split_try_three(const crossing *c, const double normal[3], int i, int j, int k,
                            split *best)
{
    double bc[3], ca[3], ab[3];
    v3_cross(c->normal[j], c->normal[k], bc);
    v3_cross(c->normal[k], c->normal[i], ca);
    v3_cross(c->normal[i], c->normal[j], ab);
    const double det = v3_dot(c->normal[i], bc);
    if (det != 0)
        split_try(
            c, normal,
            (split){3,
                    {i, j, k},
                    {v3_dot(normal, bc) / det, v3_dot(normal, ca) / det, v3_dot(normal, ab) / det},
                    0},
            best);
}

/* Finds the smallest number of sheets (1, 2 or 3) whose normals combine to `normal` with factors
 * >= 0. */
static split split_find(const crossing *c, const double normal[3])
{
    split best = {.error = INFINITY};
    split_try(c, normal, (split){1, {0}, {v3_dot(normal, c->normal[0])}, 0}, &best);
    for (int i = 0; i < c->n && best.error > SPLIT_ERROR; i++)
        for (int j = i + 1; j < c->n; j++) split_try_two(c, normal, i, j, &best);
    for (int i = 0; i < c->n && best.error > SPLIT_ERROR; i++)
        for (int j = i + 1; j < c->n; j++)
            for (int k = j + 1; k < c->n; k++) split_try_three(c, normal, i, j, k, &best);
    return best;
}

void sdm_vertex_gradient_find(const sdm_sheets *s, uint32_t triangle, int feature,
                              const double q[3], const double normal[3], bool inside,
                              sdm_vertex_gradient *out)
{
    const uint32_t t = s->source[triangle];
    double rest[3] = {normal[0], normal[1], normal[2]};
    out->n = 0;
    // only inside: seen from outside, crossing sheets form a concave corner, which is never the
    // nearest point
    if (s->seam > 0 && inside && feature != SDM_FACE) {
        crossing c;
        crossing_find(s, t, q, &c);
        const split p = c.n > 1 ? split_find(&c, normal) : (split){0};
        for (int i = 0; i < p.n; i++) {
            double part[3];
            for (int k = 0; k < 3; k++) part[k] = p.factor[i] * c.normal[p.sheet[i]][k];
            v3_sub(rest, part, rest);
            gradient_add(s, c.tri[p.sheet[i]], q, part, out);
        }
    }
    gradient_add(s, t, q, rest, out);
}

double sdm_vertex_gradient_along(const sdm_vertex_gradient *g, const double *velocity)
{
    double sum = 0;
    for (int i = 0; i < g->n; i++) sum += v3_dot(g->d[i], velocity + 3 * (size_t)g->vertex[i]);
    return sum;
}
