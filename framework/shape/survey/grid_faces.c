/* Moves a grid so that flat faces of the shapes do not lie on planes of voxel centres, and says
 * which do. */
#include <math.h>

#include "flat_faces.h"
#include "sdm/internal/shape_box.h"
#include "two_digits.h"

/* Faces with a smaller share of the area of a shape do not count. */
static const double AREA_MIN = 0.01;

/* A face needs no larger distance from the planes of voxel centres than this, in voxels. */
static const double FAR = 0.25;

/* A face that is closer to a plane of voxel centres, in voxels, lies on it: that is how far apart
 * coordinates of single precision are. */
static const double ON_PLANE = 1e-5;

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
    flat_faces staying;
    const sdm_status s = flat_faces_staying(shape, range, samples, seed, g, &staying, err);
    for (int axis = 0; axis < 3 && !s; axis++) {
        const face_list *list = &staying.along[axis];
        if (face_list_area(list) > AREA_MIN * staying.area)
            move_origin(list, g->spacing[axis], &g->origin[axis]);
    }
    flat_faces_dispose(&staying);
    return s;
}

/* Area of the faces on planes of voxel centres of the grid, mm^2; `first`: coordinate of the first
 * plane, mm. A slice has no such planes: nobody counts its voxels. */
static double area_on_planes(const face_list *list, const sdm_grid *g, int axis, double first)
{
    double sum = 0;
    for (size_t i = 0; i < list->n && g->n[axis] > 1; i++) {
        const double index = (list->face[i].at - first) / g->spacing[axis],
                     plane = nearbyint(index);
        if (fabs(index - plane) < ON_PLANE && plane >= 0 && plane < (double)g->n[axis])
            sum += list->face[i].area;
    }
    return sum;
}

static void find_hits(const flat_faces *f, const sdm_grid *g, sdm_face_hits *out)
{
    *out = (sdm_face_hits){.moved = *g};
    for (int axis = 0; axis < 3; axis++) {
        const double first = grid_coordinate(g, axis, g->origin);
        const double share =
            0.5 * g->spacing[axis] * area_on_planes(&f->along[axis], g, axis, first) / f->volume;
        if (!(share > 0)) continue;
        double to = first;
        move_origin(&f->along[axis], g->spacing[axis], &to);
        for (int a = 0; a < 3; a++) out->moved.origin[a] += g->dir[3 * a + axis] * (to - first);
        out->axis[axis] = true;
        out->share += share;
    }
}

sdm_status sdm_grid_face_hits(const sdm_mesh *m, const sdm_grid *g, sdm_face_hits *out,
                              sdm_error *err)
{
    if (!m || !g || !out) return sdm_fail(err, SDM_E_ARG, "flat faces need a mesh and a grid");
    flat_faces f = {0};
    const sdm_status s = flat_faces_find(m, g, &f, err);
    if (!s) find_hits(&f, g, out);
    flat_faces_dispose(&f);
    return s;
}

sdm_status sdm_grid_family_hits(const sdm_instance *shape, const double (*range)[2], size_t samples,
                                uint64_t seed, const sdm_grid *g, sdm_face_hits *out,
                                sdm_error *err)
{
    if (!shape || !g || !out) return sdm_fail(err, SDM_E_ARG, "flat faces need a shape and a grid");
    flat_faces f;
    const sdm_status s = flat_faces_staying(shape, range, samples, seed, g, &f, err);
    if (!s) find_hits(&f, g, out);
    flat_faces_dispose(&f);
    return s;
}
