/* Finds folded parts by the winding numbers in front of their triangles.
 *
 * In front of the surface of a solid the winding number is 0, or more inside of other solids. An
 * outline that crosses itself, such as a fillet larger than half of the thickness, forms a loop
 * that runs the wrong way round: its inside has the winding number -1 and counts as outside. */
#include "part_fold.h"

#include <math.h>

#include "mesh/crossings.h"
#include "sdm/internal/vec3.h"

// Triangles of a part that are looked at.
#define TRIANGLES 1000
// Distance of the point in front of a triangle from it, over the longest edge of the box of the
// mesh.
#define IN_FRONT 1e-6

/* Adds the area of triangle t to *area, and to *folded if the winding number in front of it is
 * negative. ahead: distance of the point in front, mm. */
static void triangle_add(const sdm_mesh *m, const sdm_bvh *tree, size_t t, double ahead,
                         double *area, double *folded)
{
    const double *p[3];
    double normal[3], x[3];
    for (size_t k = 0; k < 3; k++) p[k] = m->vert + 3 * (size_t)m->tri[3 * t + k];
    v3_triangle_normal(p[0], p[1], p[2], normal);
    const double length = v3_norm(normal);
    if (!(length > 0)) return;
    for (int a = 0; a < 3; a++)
        x[a] = (p[0][a] + p[1][a] + p[2][a]) / 3 + ahead * normal[a] / length;
    *area += 0.5 * length;
    if (sdm_ray_winding_along(m, tree, x, normal, NULL, 0) < 0) *folded += 0.5 * length;
}

void sdm_part_folds(const sdm_mesh *m, const sdm_bvh *tree, const uint32_t *part_of, sdm_part *part,
                    size_t n)
{
    const sdm_bvh_node *box = &tree->node[0];
    double size = 0;
    for (int a = 0; a < 3; a++) size = fmax(size, box->hi[a] - box->lo[a]);
    for (size_t i = 0; i < n; i++) {
        if (part[i].state != SDM_PART_SOLID || !part[i].crossed) continue;
        const size_t each = (part[i].n_tri + TRIANGLES - 1) / TRIANGLES;
        double area = 0, folded = 0;
        for (size_t t = part[i].first_tri, k = 0; t < m->n_tri && k < part[i].n_tri; t++)
            if (part_of[t] == i && k++ % each == 0)
                triangle_add(m, tree, t, IN_FRONT * size, &area, &folded);
        if (area > 0) part[i].folded = folded / area;
    }
}
