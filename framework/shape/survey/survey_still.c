/* Compares the surface of the union at several values of a parameter: one that moves vertices
 * inside of other parts alone leaves it as it is. */
#include "survey_still.h"

#include <math.h>
#include <string.h>

#include "sdm/exact.h"
#include "sdm/memory.h"

/* Shapes at which a parameter must be still: the first one and samples. */
enum { SHAPES = 4, CORNERS = 3, VALUES = 3 };

/* Surfaces that differ by less than this part of the size are the same. */
static const double SAME = 1e-6;

/* Where in its range a parameter is looked at: at a third value, too, since both ends of a full
 * turn are the same. */
static const double AT[VALUES] = {1, 0, 0.382};

/* A shape, its mesh and its union. */
typedef struct solid {
    sdm_mesh mesh;
    sdm_exact *exact; /* NULL: it cannot be made */
} solid;

static void solid_dispose(solid *s)
{
    sdm_exact_free(s->exact);
    sdm_mesh_dispose(&s->mesh);
    *s = (solid){0};
}

/* Only want of memory and an end on demand are errors; from a broken mesh nothing follows. */
static sdm_status only_fatal(sdm_status s)
{
    return s == SDM_E_NOMEM || s == SDM_E_CANCELLED ? s : SDM_OK;
}

static sdm_status solid_make(const shape_family *f, const sdm_exact_opts *opts, const double *p,
                             solid *out, sdm_error *err)
{
    *out = (solid){0};
    sdm_status s = sdm_instance_mesh(f->shape, p, &out->mesh, err);
    if (!s) s = sdm_exact_create(&out->mesh, opts, &out->exact, err);
    return only_fatal(s);
}

/* *off = a point of `x` that the others do not rule out lies farther than `same` from the surface
 * of e. on[n]: points that count; NULL: all. */
static sdm_status any_off(const sdm_exact *e, const double *x, size_t n, const bool *on,
                          double same, bool *off, sdm_error *err)
{
    double *distance = NULL;
    sdm_status s = SDM_ALLOC(&distance, n, "distances of surfaces", err);
    const sdm_exact_at at = {.distance = distance};
    *off = false;
    if (!s) s = sdm_exact_points(e, x, n, &at, err);
    for (size_t i = 0; i < n && !s; i++)
        *off = *off || ((!on || on[i]) && !(fabs(distance[i]) <= same));
    sdm_free(distance);
    return s;
}

/* *off: a corner or the middle of a triangle of the surface of a is not on that of b. */
static sdm_status surface_off(const sdm_exact *a, const sdm_exact *b, double same, bool *off,
                              sdm_error *err)
{
    const sdm_mesh *m = sdm_exact_surface(a);
    const size_t n = (CORNERS + 1) * m->n_tri;
    double *x = NULL, *at;
    sdm_status s = SDM_ALLOC(&x, 3 * n, "points of surfaces", err);
    if (s) return s;
    at = x;
    for (size_t t = 0; t < m->n_tri; t++, at += 3 * (CORNERS + 1))
        for (int d = 0; d < 3; d++) {
            double sum = 0;
            for (int c = 0; c < CORNERS; c++)
                sum += at[3 * c + d] = m->vert[3 * (size_t)m->tri[3 * t + (size_t)c] + (size_t)d];
            at[3 * CORNERS + d] = sum / CORNERS;
        }
    s = any_off(b, x, n, NULL, same, off, err);
    sdm_free(x);
    return s;
}

/* Marks the vertices of the mesh that lie on the surface of its union. */
static sdm_status mark_surface(const solid *s, double same, bool *on, sdm_error *err)
{
    double *distance = NULL;
    sdm_status status = SDM_ALLOC(&distance, s->mesh.n_vert, "distances of vertices", err);
    const sdm_exact_at at = {.distance = distance};
    if (!status) status = sdm_exact_points(s->exact, s->mesh.vert, s->mesh.n_vert, &at, err);
    for (size_t v = 0; v < s->mesh.n_vert && !status; v++) on[v] = fabs(distance[v]) <= same;
    sdm_free(distance);
    return status;
}

/* *moves = the surface at q differs from that of `here`, or is not known. on: mark_surface(). */
static sdm_status compare(const shape_family *f, const sdm_exact_opts *opts, const double *q,
                          const solid *here, const bool *on, double same, bool *moves,
                          sdm_error *err)
{
    sdm_mesh mesh = {0};
    sdm_status s = sdm_instance_mesh(f->shape, q, &mesh, err);
    *moves = true;
    if (s || mesh.n_vert != here->mesh.n_vert) {
        sdm_mesh_dispose(&mesh);
        return only_fatal(s);
    }
    // mostly vertices of the surface leave it, which is seen at once
    s = any_off(here->exact, mesh.vert, mesh.n_vert, on, same, moves, err);
    sdm_mesh_dispose(&mesh);
    if (s || *moves) return s;
    solid there;
    s = solid_make(f, opts, q, &there, err);
    *moves = !there.exact;
    if (!s && !*moves) {
        const double bound = fmax(sdm_exact_get_report(here->exact)->union_error_mm,
                                  sdm_exact_get_report(there.exact)->union_error_mm);
        s = surface_off(here->exact, there.exact, fmax(same, bound), moves, err);
        if (!s && !*moves) s = surface_off(there.exact, here->exact, fmax(same, bound), moves, err);
    }
    solid_dispose(&there);
    return s;
}

/* Takes back s->still of the parameters that move the surface at p. */
static sdm_status look_at(const shape_family *f, const sdm_exact_opts *opts, const double *p,
                          double same, sdm_shape_survey *s, sdm_error *err)
{
    const size_t n = s->n_params;
    solid here;
    bool *on = NULL;
    sdm_status status = solid_make(f, opts, p, &here, err);
    if (!status && !here.exact) memset(s->still, 0, n * sizeof *s->still);
    if (!status && here.exact) status = SDM_ALLOC(&on, here.mesh.n_vert, "vertices", err);
    if (!status && here.exact) status = mark_surface(&here, same, on, err);
    for (size_t k = 0; k < n && !status; k++)
        for (int i = 0; i < VALUES && s->still[k] && !status; i++) {
            double q[SHAPE_PARAMS_MAX];
            bool moves;
            memcpy(q, p, n * sizeof *q);
            q[k] = f->min[k] + AT[i] * (f->max[k] - f->min[k]);
            status = compare(f, opts, q, &here, on, same, &moves, err);
            s->still[k] = !moves;
        }
    sdm_free(on);
    solid_dispose(&here);
    return status;
}

sdm_status sdm_survey_find_still(const shape_family *f, const sdm_exact_opts *opts, double size,
                                 sdm_shape_survey *s, sdm_error *err)
{
    sdm_status status = SDM_ALLOC(&s->still, s->n_params, "parameters", err);
    bool any = false;
    for (size_t k = 0; k < s->n_params && !status; k++)
        any |= s->still[k] = s->speed[k] > 0 && f->max[k] > f->min[k];
    for (size_t i = 0; i < SHAPES && i < s->n && any && !status; i++) {
        status = look_at(f, opts, s->p + (i ? s->n - i : 0) * s->n_params, SAME * size, s, err);
        any = false;
        for (size_t k = 0; k < s->n_params; k++) any |= s->still[k];
    }
    return status;
}
