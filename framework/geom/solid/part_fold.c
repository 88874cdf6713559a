/* Finds folded parts by the winding numbers in front of their triangles.
 *
 * In front of the surface of a solid the winding number is 0, or more inside of other solids. An
 * outline that crosses itself, such as a fillet larger than half of the thickness, forms a loop
 * that runs the wrong way round: its inside has the winding number -1 and counts as outside. Where
 * the loop lies in another part, the two winding numbers add up to 0: it is a hole in that part. */
#include "part_fold.h"

#include <math.h>

#include "mesh/crossings.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

// Triangles of a part that are looked at.
#define TRIANGLES 1000
// Distance of the point in front of a triangle from it, over the longest edge of the box of the
// mesh.
#define IN_FRONT 1e-6

/* The mesh, and one part of it alone if it meets others. */
typedef struct fold {
    const sdm_mesh *m;
    const sdm_bvh *tree;
    sdm_mesh alone; /* shares the vertices of m; without triangles: the part meets no other */
    sdm_bvh alone_tree;
    double ahead; /* distance of the point in front of a triangle, mm */
    double area, folded;
} fold;

/* Adds the area of triangle t to f->area, and to f->folded if it faces the wrong way. */
static void triangle_add(fold *f, size_t t)
{
    const sdm_mesh *m = f->m;
    const double *p[3];
    double normal[3], x[3];
    for (size_t k = 0; k < 3; k++) p[k] = m->vert + 3 * (size_t)m->tri[3 * t + k];
    v3_triangle_normal(p[0], p[1], p[2], normal);
    const double length = v3_norm(normal);
    if (!(length > 0)) return;
    for (int a = 0; a < 3; a++)
        x[a] = (p[0][a] + p[1][a] + p[2][a]) / 3 + f->ahead * normal[a] / length;
    f->area += 0.5 * length;
    const int winding = sdm_ray_winding_along(m, f->tree, x, normal, NULL, 0);
    const bool hole = winding == 0 && f->alone.n_tri &&
                      sdm_ray_winding_along(&f->alone, &f->alone_tree, x, normal, NULL, 0) < 0;
    if (winding < 0 || hole) f->folded += 0.5 * length;
}

/* Collects the triangles of part `index`, which has n of them, and builds their tree. */
static sdm_status set_alone(fold *f, const uint32_t *part_of, size_t index, size_t n,
                            sdm_arena *arena, sdm_error *err)
{
    const sdm_mesh *m = f->m;
    const sdm_status s = SDM_ALLOC(&f->alone.tri, 3 * n, "triangles of a part", err);
    if (s) return s;
    f->alone.vert = m->vert;
    f->alone.n_vert = m->n_vert;
    for (size_t t = 0; t < m->n_tri && f->alone.n_tri < n; t++) {
        if (part_of[t] != index) continue;
        for (size_t k = 0; k < 3; k++) f->alone.tri[3 * f->alone.n_tri + k] = m->tri[3 * t + k];
        f->alone.n_tri++;
    }
    return sdm_bvh_build(&f->alone, arena, &f->alone_tree, err);
}

static sdm_status find_fold(const sdm_mesh *m, const sdm_bvh *tree, const uint32_t *part_of,
                            sdm_part *part, size_t index, double size, sdm_error *err)
{
    fold f = {.m = m, .tree = tree, .ahead = IN_FRONT * size};
    sdm_arena arena = {0};
    sdm_status s = SDM_OK;
    if (part->met) s = set_alone(&f, part_of, index, part->n_tri, &arena, err);
    const size_t each = (part->n_tri + TRIANGLES - 1) / TRIANGLES;
    for (size_t t = part->first_tri, k = 0; t < m->n_tri && k < part->n_tri && !s; t++)
        if (part_of[t] == index && k++ % each == 0) triangle_add(&f, t);
    if (f.area > 0 && !s) part->folded = f.folded / f.area;
    sdm_arena_dispose(&arena);
    sdm_free(f.alone.tri);
    return s;
}

sdm_status sdm_part_folds(const sdm_mesh *m, const sdm_bvh *tree, const uint32_t *part_of,
                          sdm_part *part, size_t n, sdm_error *err)
{
    const sdm_bvh_node *box = &tree->node[0];
    double size = 0;
    sdm_status s = SDM_OK;
    for (int a = 0; a < 3; a++) size = fmax(size, box->hi[a] - box->lo[a]);
    for (size_t i = 0; i < n && !s; i++)
        if (part[i].state == SDM_PART_SOLID && part[i].crossed)
            s = find_fold(m, tree, part_of, &part[i], i, size, err);
    return s;
}
