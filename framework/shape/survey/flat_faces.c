/* Finds flat faces of meshes that are perpendicular to an axis of a grid. */
#include "flat_faces.h"

#include <math.h>
#include <stdlib.h>

#include "sdm/internal/part_audit.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"
#include "shape_family.h"

/* Coordinates along an axis that differ by less than this share of a voxel are the same. */
static const double SAME = 1e-6;

static int compare_faces(const void *a, const void *b)
{
    const double x = ((const flat_face *)a)->at, y = ((const flat_face *)b)->at;
    return (x > y) - (x < y);
}

/* *out = the faces perpendicular to `axis`. The caller frees out->face. */
static sdm_status find_along(const sdm_mesh *m, const sdm_grid *g, int axis, face_list *out,
                             sdm_error *err)
{
    const double same = SAME * g->spacing[axis];
    flat_face *f = NULL;
    size_t n = 0;
    const sdm_status s = SDM_ALLOC(&f, m->n_tri + 1, "flat faces", err);
    if (s) return s;
    for (size_t t = 0; t < m->n_tri; t++) {
        const double *corner[3];
        double at[3];
        for (size_t k = 0; k < 3; k++) {
            corner[k] = m->vert + 3 * (size_t)m->tri[3 * t + k];
            at[k] = grid_coordinate(g, axis, corner[k]);
        }
        if (!(fabs(at[1] - at[0]) < same && fabs(at[2] - at[0]) < same)) continue;
        double normal[3];
        v3_triangle_normal(corner[0], corner[1], corner[2], normal);
        f[n++] = (flat_face){.at = at[0], .area = 0.5 * v3_norm(normal)};
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

sdm_status flat_faces_find(const sdm_mesh *m, const sdm_grid *g, flat_faces *out, sdm_error *err)
{
    sdm_status s = SDM_OK;
    sdm_mesh_sums(m, &out->volume, &out->area);
    out->volume = fabs(out->volume);
    for (int axis = 0; axis < 3 && !s; axis++) s = find_along(m, g, axis, &out->along[axis], err);
    return s;
}

sdm_status flat_faces_staying(const sdm_instance *shape, const double (*range)[2], size_t samples,
                              uint64_t seed, const sdm_grid *g, flat_faces *out, sdm_error *err)
{
    shape_family family;
    double p[SHAPE_PARAMS_MAX];
    sdm_mesh mesh = {0};
    *out = (flat_faces){0};
    sdm_status s = sdm_family_set(&family, shape, range, NULL, seed, err);
    for (size_t k = 0; k < samples && !s; k++) {
        flat_faces own = {0};
        sdm_family_sample(&family, k, p);
        s = sdm_instance_mesh(shape, p, &mesh, err);
        if (!s) s = flat_faces_find(&mesh, g, k ? &own : out, err);
        if (!s && k) {
            out->area = fmax(out->area, own.area);
            out->volume = fmin(out->volume, own.volume);
            for (int axis = 0; axis < 3; axis++)
                keep_common(&out->along[axis], &own.along[axis], SAME * g->spacing[axis]);
        }
        flat_faces_dispose(&own);
    }
    sdm_mesh_dispose(&mesh);
    return s;
}

void flat_faces_dispose(flat_faces *f)
{
    for (int axis = 0; axis < 3; axis++) sdm_free(f->along[axis].face);
    *f = (flat_faces){0};
}
