/* Finds a mesh that depends on the call before it, such as one from a cache that does not compare
 * all parameters: two calls in which one parameter alone differs. */
#include <string.h>

#include "shape_internal.h"

/* A pair of shapes takes 4 + 4 n_params meshes. There are fewer pairs if these have more triangles
 * in all; the last one then takes 4 + 2 n_params meshes. */
enum { PAIRS = 4, PAIRS_BRIEF = 2, TRIANGLES = 1000000 };

/* Steps of a parameter, as shares of the way to its value in another shape. The small one shows
 * values that are compared with a tolerance, or rounded. */
static const double STEP = 0.5, STEP_SMALL = 1e-6;

typedef struct trial {
    const sdm_instance *shape;
    const double *p; /* [n][n_params] */
    size_t n;
    bool large; /* each parameter is tried beside one shape of a pair */
    sdm_mesh mesh;
} trial;

/* Checksum of the mesh at p[n_params]; 0: it cannot be made. */
static uint64_t make(trial *t, const double *p)
{
    return sdm_instance_mesh(t->shape, p, &t->mesh, NULL) ? 0 : sdm_mesh_checksum(&t->mesh);
}

bool sdm_shape_step_beside(const double *p, size_t n, size_t n_params, size_t from, size_t to,
                           size_t k, double share, double *q)
{
    const double *here = p + from * n_params;
    memcpy(q, here, n_params * sizeof *q);
    // in a corner of the ranges some values are those of the other shape
    for (size_t i = 0; i <= n && q[k] == here[k]; i++) {
        const double there = p[(i ? i - 1 : to) * n_params + k];
        q[k] = here[k] + share * (there - here[k]);
    }
    return q[k] != here[k];
}

/* The mesh of shape `at`, which was made just before it, too, and the one of shape `other` before
 * that. */
static uint64_t make_twice(trial *t, size_t at, size_t other)
{
    const size_t n = t->shape->n_params;
    (void)make(t, t->p + other * n);
    (void)make(t, t->p + at * n);
    return make(t, t->p + at * n);
}

/* Makes two shapes in turns, each after one in which a single parameter differs. In all others
 * differ from the shape before. false: a mesh cannot be made, which is told elsewhere. */
static bool try_pair(trial *t, const size_t shape[2], sdm_repeat *out)
{
    const size_t n = t->shape->n_params;
    const uint64_t first[2] = {make_twice(t, shape[0], shape[1]),
                               make_twice(t, shape[1], shape[0])};
    if (!first[0] || !first[1]) return false;
    for (size_t k = 0; k < n; k++)
        for (int side = 0; side < 2; side++) {
            double q[SHAPE_PARAMS_MAX];
            const size_t at = shape[side];
            if (t->large && side != (int)(k % 2)) continue;
            if (!sdm_shape_step_beside(t->p, t->n, n, at, shape[!side], k, side ? STEP_SMALL : STEP,
                                       q))
                continue;
            if (!make(t, q)) return false;
            if (make(t, t->p + at * n) == first[side]) continue;
            // a mesh that is another one in every call depends on no parameter
            const bool every = make_twice(t, at, shape[!side]) != first[side];
            *out = (sdm_repeat){.unlike = 1,
                                .first = at,
                                .cause = every ? SDM_REPEAT_HISTORY : SDM_REPEAT_BESIDE,
                                .param = k};
            return true;
        }
    return true;
}

void sdm_shape_repeat_beside(const sdm_instance *s, const double *p, size_t n, bool brief,
                             sdm_repeat *out)
{
    trial t = {.shape = s, .p = p, .n = n};
    size_t pairs = brief ? PAIRS_BRIEF : PAIRS;
    *out = (sdm_repeat){0};
    if (!s->n_params || !make(&t, p)) pairs = 0;
    const size_t triangles = (4 + 4 * s->n_params) * t.mesh.n_tri;
    while (pairs > 1 && (pairs * triangles > TRIANGLES || 2 * pairs > n)) pairs--;
    t.large = triangles > TRIANGLES;
    for (size_t i = 0; i < pairs && 2 * i + 1 < n && !out->unlike; i++)
        if (!try_pair(&t, (const size_t[2]){i, n - 1 - i}, out)) break;
    sdm_mesh_dispose(&t.mesh);
}
