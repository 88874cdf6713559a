/* Finds folded parts by the winding numbers in front of their triangles.
 *
 * In front of the surface of a solid the winding number is 0, or more inside of other solids. An
 * outline that crosses itself, such as a fillet larger than half of the thickness, forms a loop
 * that runs the wrong way round: its inside has the winding number -1 and counts as outside. Where
 * the loop lies in another part, the two winding numbers add up to 0: it is a hole in that part. */
#include "part_fold.h"

#include <math.h>

#include "mesh/crossings.h"
#include "part_places.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

// Places on the surface of a part that are looked at.
enum { PLACES = 2000 };
// Distance of the point in front of a place from it, over the longest edge of the box of the mesh.
#define IN_FRONT 1e-6

/* The mesh, and one part of it alone if it meets others. */
typedef struct fold {
    const sdm_mesh *m;
    const sdm_bvh *tree;
    sdm_mesh alone; /* shares the vertices of m; without triangles: the part meets no other */
    sdm_bvh alone_tree;
    double ahead; /* distance of the point in front of a place, mm */
    part_places at;
    size_t folded; /* places that face the wrong way */
} fold;

/* Does the place x on the surface, where it has this unit normal, face the wrong way? */
static bool is_folded(const fold *f, const double x[3], const double normal[3])
{
    double ahead[3];
    v3_along(x, f->ahead, normal, ahead);
    const int winding = sdm_ray_winding_along(f->m, f->tree, ahead, normal, NULL, 0);
    return winding < 0 ||
           (winding == 0 && f->alone.n_tri &&
            sdm_ray_winding_along(&f->alone, &f->alone_tree, ahead, normal, NULL, 0) < 0);
}

/* Looks at the places in triangle t of a part. */
static void look_at(fold *f, const sdm_part *part, size_t t)
{
    const sdm_mesh *m = f->m;
    const uint32_t *v = m->tri + 3 * t;
    double normal[3], x[3];
    v3_triangle_normal(m->vert + 3 * (size_t)v[0], m->vert + 3 * (size_t)v[1],
                       m->vert + 3 * (size_t)v[2], normal);
    const double length = v3_norm(normal);
    if (!(length > 0)) return;
    for (int d = 0; d < 3; d++) normal[d] /= length;
    f->at.area += 0.5 * length;
    while (part_places_next(&f->at, PLACES, part->area, m, t, x))
        f->folded += is_folded(f, x, normal);
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
    for (size_t t = part->first_tri; t < m->n_tri && f.at.n < PLACES && !s; t++)
        if (part_of[t] == index) look_at(&f, part, t);
    if (f.at.n && !s) part->folded = (double)f.folded / (double)f.at.n;
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
