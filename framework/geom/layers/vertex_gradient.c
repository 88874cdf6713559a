/* The distance is |x - q|, the least over all points q of the surface, so to first order only the
   motion of the nearest one along the normal counts (Danskin 1967): the derivative for a vertex is
   -(barycentric coordinate of q) * normal. A point inside a union may have its nearest point where
   two or three sheets cross. That point slides on all of them as they move, each sheet giving it
   its own motion along its own normal: the normal is split into those of the sheets, with factors
   that are not negative (the sheets bound a convex cone outside). */
#include "vertex_gradient.h"

#include "mesh/facet.h"
#include "sdm/internal/vec3.h"

// sheets through one point; more than a few do not cross in general position
#define SHEETS 16
// of unit vectors: what is left of the normal after the split is moved with the nearest triangle
#define SPLIT_ERROR 1e-6

typedef struct crossing {
    int n;
    uint32_t tri[SHEETS]; // of the mesh
    const double *normal[SHEETS];
} crossing;

typedef struct split {
    int n, sheet[3];
    double factor[3], error;
} split;

void sdm_sheets_frames(const sdm_mesh *m, int n_threads, sdm_frame *frames)
{
    (void)n_threads; // without OpenMP
#pragma omp parallel for num_threads(n_threads)
    for (size_t t = 0; t < m->n_tri; t++) sdm_facet_frame(m, t, &frames[t]);
}

static double clamp(double x, double most) { return x > 0 ? fmin(x, most) : 0; }

/* Barycentric coordinates of q in triangle t, none negative. Along the longest edge they are exact
 * for needles too. */
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

// the part of the normal that triangle t moves
static void add_triangle(const sdm_sheets *s, uint32_t t, const double q[3], const double part[3],
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

static void add_sheet(const sdm_sheets *s, uint32_t t, crossing *c)
{
    for (int i = 0; i < c->n; i++)
        if (c->tri[i] == t) return;
    c->tri[c->n] = t;
    c->normal[c->n++] = s->frames[t].n;
}

// the triangles of the mesh with surface at q; `first` comes first
static void find_sheets(const sdm_sheets *s, uint32_t first, const double q[3], crossing *c)
{
    const sdm_bvh *tree = &s->surface->tree;
    const double reach2 = s->seam * s->seam;
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0;
    c->n = 0;
    add_sheet(s, first, c);
    stack[top++] = 0;
    while (top && c->n < SHEETS) {
        const sdm_bvh_node *node = &tree->node[stack[--top]];
        if (!(sdm_bvh_box_distance2(node, q) <= reach2)) continue;
        for (uint32_t i = node->first; i < node->first + node->count && c->n < SHEETS; i++)
            if (sdm_frame_distance2(&s->surface->frames[i], q) <= reach2)
                add_sheet(s, s->source[tree->order[i]], c);
        if (node->count) continue;
        stack[top++] = node->first + 1;
        stack[top++] = node->first;
    }
}

// takes the split when no factor is negative and less is left than before
static void try_split(const crossing *c, const double normal[3], split p, split *best)
{
    double rest[3] = {normal[0], normal[1], normal[2]};
    for (int i = 0; i < p.n; i++) {
        if (!(p.factor[i] >= -SPLIT_ERROR)) return;
        v3_along(rest, -p.factor[i], c->normal[p.sheet[i]], rest);
    }
    p.error = v3_norm(rest);
    if (p.error < best->error) *best = p;
}

static void try_two(const crossing *c, const double normal[3], int i, int j, split *best)
{
    const double *a = c->normal[i], *b = c->normal[j];
    const double na = v3_dot(normal, a), nb = v3_dot(normal, b), ab = v3_dot(a, b),
                 det = 1 - ab * ab;
    if (det > 0)
        try_split(c, normal, (split){2, {i, j}, {(na - ab * nb) / det, (nb - ab * na) / det}, 0},
                  best);
}

static void try_three(const crossing *c, const double normal[3], int i, int j, int k, split *best)
{
    double bc[3], ca[3], ab[3];
    v3_cross(c->normal[j], c->normal[k], bc);
    v3_cross(c->normal[k], c->normal[i], ca);
    v3_cross(c->normal[i], c->normal[j], ab);
    const double det = v3_dot(c->normal[i], bc);
    if (det != 0)
        try_split(
            c, normal,
            (split){3,
                    {i, j, k},
                    {v3_dot(normal, bc) / det, v3_dot(normal, ca) / det, v3_dot(normal, ab) / det},
                    0},
            best);
}

// the fewest sheets that make up the normal
static split split_normal(const crossing *c, const double normal[3])
{
    split best = {.error = INFINITY};
    try_split(c, normal, (split){1, {0}, {v3_dot(normal, c->normal[0])}, 0}, &best);
    for (int i = 0; i < c->n && best.error > SPLIT_ERROR; i++)
        for (int j = i + 1; j < c->n; j++) try_two(c, normal, i, j, &best);
    for (int i = 0; i < c->n && best.error > SPLIT_ERROR; i++)
        for (int j = i + 1; j < c->n; j++)
            for (int k = j + 1; k < c->n; k++) try_three(c, normal, i, j, k, &best);
    return best;
}

void sdm_vertex_gradient_find(const sdm_sheets *s, uint32_t slot, int feature, const double q[3],
                              const double normal[3], bool inside, sdm_vertex_gradient *out)
{
    const uint32_t t = s->source[s->surface->tree.order[slot]];
    double rest[3] = {normal[0], normal[1], normal[2]};
    out->n = 0;
    // seen from outside, sheets that cross do so in a reentrant corner, which is nearest to nothing
    if (s->seam > 0 && inside && feature != SDM_FACE) {
        crossing c;
        find_sheets(s, t, q, &c);
        const split p = c.n > 1 ? split_normal(&c, normal) : (split){0};
        for (int i = 0; i < p.n; i++) {
            double part[3];
            for (int k = 0; k < 3; k++) part[k] = p.factor[i] * c.normal[p.sheet[i]][k];
            v3_sub(rest, part, rest);
            add_triangle(s, c.tri[p.sheet[i]], q, part, out);
        }
    }
    add_triangle(s, t, q, rest, out);
}
