/* Follows the line between two shapes and finds triangles that turn over on the way. */
#include "survey_fold.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

enum { STEPS = 16 };

/* A triangle on the way from one shape to the other. */
typedef struct face {
    double n[3];   /* the last normal whose length, twice the area, is above rounding */
    double length; /* of n; 0: there was none so far */
    double at;     /* where the triangle turned over last, if `turned` */
    bool turned;
} face;

static void normal_of(const sdm_mesh *m, size_t t, double n[3])
{
    v3_triangle_normal(m->vert + 3 * (size_t)m->tri[3 * t], m->vert + 3 * (size_t)m->tri[3 * t + 1],
                       m->vert + 3 * (size_t)m->tri[3 * t + 2], n);
}

/* Compares the triangles of the mesh at step `step` with those before. */
static void take_step(const sdm_mesh *m, int step, double smallest, face *faces)
{
    for (size_t t = 0; t < m->n_tri; t++) {
        face *f = &faces[t];
        double n[3];
        normal_of(m, t, n);
        const double length = v3_norm(n);
        if (!(length > smallest)) continue;
        if (f->length > 0 && v3_dot(n, f->n) < -0.5 * length * f->length) {
            f->turned = true;
            f->at = (step - length / (length + f->length)) / STEPS;
        }
        memcpy(f->n, n, sizeof n);
        f->length = length;
    }
}

/* out->share = the largest part of the area that turns over in one step; out->at = where on the way
 * that is, on average over this area. Both stay 0 where no triangle turns over. */
static void sum_up(const face *faces, size_t n, survey_fold *out)
{
    double all = 0, turned[STEPS] = {0}, moment[STEPS] = {0};
    size_t most = 0;
    for (size_t t = 0; t < n; t++) {
        const face *f = &faces[t];
        all += f->length;
        if (!f->turned) continue;
        const size_t step = (size_t)fmin(STEPS - 1, floor(f->at * STEPS));
        turned[step] += f->length;
        moment[step] += f->length * f->at;
        if (turned[step] > turned[most]) most = step;
    }
    if (!(turned[most] > 0)) return;
    out->share = turned[most] / all;
    out->at = moment[most] / turned[most];
}

sdm_status sdm_survey_find_fold(const shape_family *f, const double *from, const double *to,
                                double size, survey_fold *out, sdm_error *err)
{
    const size_t n = f->shape->n_params;
    double p[SHAPE_PARAMS_MAX];
    sdm_mesh mesh = {0};
    face *faces = NULL;
    size_t n_tri = 0;
    uint32_t *tri = NULL;
    *out = (survey_fold){0};
    sdm_status s = SDM_OK;
    bool same = true;
    for (int step = 0; step <= STEPS && !s && same; step++) {
        for (size_t i = 0; i < n; i++)
            p[i] = step == STEPS ? to[i] : from[i] + (to[i] - from[i]) * step / STEPS;
        s = sdm_instance_mesh(f->shape, p, &mesh, err);
        if (!s && !step) {
            n_tri = mesh.n_tri;
            s = SDM_ALLOC(&faces, n_tri, "normals of a mesh", err);
            if (!s) s = SDM_ALLOC(&tri, 3 * n_tri, "triangles of a mesh", err);
            if (!s) memcpy(tri, mesh.tri, 3 * n_tri * sizeof *tri);
        }
        same = !s && mesh.n_tri == n_tri && !memcmp(tri, mesh.tri, 3 * n_tri * sizeof *tri);
        if (same) take_step(&mesh, step, 1e-9 * size * size, faces);
    }
    if (!s && same) sum_up(faces, n_tri, out);
    sdm_free(faces);
    sdm_free(tri);
    sdm_mesh_dispose(&mesh);
    return s == SDM_E_NOMEM ? s : SDM_OK;
}
