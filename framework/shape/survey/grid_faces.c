/* Moves a grid so that flat faces of the shapes do not lie on planes of voxel centres. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/internal/shape_box.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"
#include "shape_family.h"
#include "two_digits.h"

/* Coordinates along an axis that differ by less than this share of a voxel are the same. */
static const double SAME = 1e-6;

/* Faces with a smaller share of the area of a shape do not count. */
static const double AREA_MIN = 0.01;

/* A face needs no larger distance from the planes of voxel centres than this, in voxels. */
static const double FAR = 0.25;

/* The triangles of a mesh that lie in one plane perpendicular to an axis. */
typedef struct flat_face {
    double at, area; /* coordinate along the axis, mm; area, mm^2 */
} flat_face;

typedef struct face_list {
    flat_face *face; /* [n] at ascending coordinates */
    size_t n;
} face_list;

static int compare_faces(const void *a, const void *b)
{
    const double x = ((const flat_face *)a)->at, y = ((const flat_face *)b)->at;
    return (x > y) - (x < y);
}

/* *out = the flat faces of the mesh perpendicular to `axis`; `same`: coordinates that differ by
 * less, mm, are equal. *area = area of the whole mesh. The caller frees out->face. */
static sdm_status find_faces(const sdm_mesh *m, int axis, double same, face_list *out, double *area,
                             sdm_error *err)
{
    flat_face *f = NULL;
    size_t n = 0;
    const sdm_status s = SDM_ALLOC(&f, m->n_tri + 1, "flat faces", err);
    if (s) return s;
    *area = 0;
    for (size_t t = 0; t < m->n_tri; t++) {
        const double *a = m->vert + 3 * (size_t)m->tri[3 * t],
                     *b = m->vert + 3 * (size_t)m->tri[3 * t + 1],
                     *c = m->vert + 3 * (size_t)m->tri[3 * t + 2];
        double normal[3];
        v3_triangle_normal(a, b, c, normal);
        const double own = 0.5 * v3_norm(normal);
        *area += own;
        if (fabs(b[axis] - a[axis]) < same && fabs(c[axis] - a[axis]) < same)
            f[n++] = (flat_face){.at = a[axis], .area = own};
    }
    qsort(f, n, sizeof *f, compare_faces);
    // triangles in the same plane become one face
    size_t kept = 0;
    for (size_t i = 0; i < n; i++) {
        if (kept && f[i].at - f[kept - 1].at < same)
            f[kept - 1].area += f[i].area;
        else
            f[kept++] = f[i];
    }
    *out = (face_list){.face = f, .n = kept};
    return SDM_OK;
}

/* Removes the faces that `other` does not have, too; their areas become the smaller ones. */
static void keep_common(face_list *list, const face_list *other, double same)
{
    size_t kept = 0, k = 0;
    for (size_t i = 0; i < list->n; i++) {
        const flat_face f = list->face[i];
        while (k < other->n && other->face[k].at < f.at - same) k++;
        if (k < other->n && other->face[k].at < f.at + same)
            list->face[kept++] = (flat_face){f.at, fmin(f.area, other->face[k].area)};
    }
    list->n = kept;
}

/* Sum over the faces of the area times the distance from the closest plane of voxel centres, in
 * voxels and at most FAR, if the first plane is at `origin`. */
static double clearance(const face_list *list, double origin, double spacing)
{
    double sum = 0;
    for (size_t i = 0; i < list->n; i++) {
        const double index = (list->face[i].at - origin) / spacing;
        sum += list->face[i].area * fmin(FAR, fabs(index - nearbyint(index)));
    }
    return sum;
}

/* Moves *origin by a multiple of an eighth of the spacing, rounded as sdm_grid_around() rounds it,
 * to the largest clearance; of several the shortest way. */
static void move_origin(const face_list *list, double spacing, double *origin)
{
    static const int eighths[] = {-1, 1, -2, 2, -3, 3, 4};
    const int power = second_digit(spacing);
    const double from = *origin;
    double best = clearance(list, from, spacing);
    for (size_t i = 0; i < sizeof eighths / sizeof *eighths; i++) {
        const double moved = from + 0.125 * eighths[i] * spacing,
                     to = decimal(nearbyint(in_units(moved, power)), power),
                     here = clearance(list, to, spacing);
        if (here > best * (1 + 1e-6)) best = here, *origin = to;
    }
}

sdm_status sdm_grid_avoid_faces(const sdm_instance *shape, const double (*range)[2], size_t samples,
                                uint64_t seed, sdm_grid *g, sdm_error *err)
{
    if (!shape || !g) return sdm_fail(err, SDM_E_ARG, "flat faces need a shape and a grid");
    shape_family f;
    face_list staying[3] = {0};
    double p[SHAPE_PARAMS_MAX], area = 0;
    sdm_mesh mesh = {0};
    sdm_status s = sdm_family_set(&f, shape, range, NULL, seed, err);
    for (size_t k = 0; k < samples && !s; k++) {
        sdm_family_sample(&f, k, p);
        s = sdm_instance_mesh(shape, p, &mesh, err);
        for (int axis = 0; axis < 3 && !s; axis++) {
            const double same = SAME * g->spacing[axis];
            face_list faces = {0};
            double whole = 0;
            s = find_faces(&mesh, axis, same, &faces, &whole, err);
            area = fmax(area, whole);
            if (k == 0) {
                staying[axis] = faces;
            } else {
                keep_common(&staying[axis], &faces, same);
                sdm_free(faces.face);
            }
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        double flat = 0;
        for (size_t i = 0; i < staying[axis].n; i++) flat += staying[axis].face[i].area;
        if (!s && flat > AREA_MIN * area)
            move_origin(&staying[axis], g->spacing[axis], &g->origin[axis]);
        sdm_free(staying[axis].face);
    }
    sdm_mesh_dispose(&mesh);
    return s;
}
