/* Makes meshes of a plug-in in another process and compares their bits. */
#include <string.h>

#include "sdm/internal/clock.h"
#include "sdm/memory.h"
#include "shape_internal.h"

/* At most so many shapes are made, and one beside a shape for each parameter; after the first two,
 * none begins after so many seconds. */
enum { SHAPES = 4 };
#define SECONDS 0.3

/* Of a parameter, as a share of the way to its value in the last shape: no value that the tests
 * before have used. */
#define STEP 0.375

/* *out = an instance with the options of *s of the shape of the same name. Their texts stay with
 * *s, which must live longer. */
static sdm_status copy_instance(const sdm_instance *s, const sdm_registry *r, sdm_instance **out,
                                sdm_error *err)
{
    const sdm_shape *shape = sdm_registry_find(r, s->shape->name, NULL);
    sdm_option_value *options = NULL;
    if (!shape || shape->n_options != s->shape->n_options)
        return sdm_fail(err, SDM_E_PLUGIN, "the file of the plug-in has changed");
    const sdm_status status = SDM_ALLOC(&options, shape->n_options, "option values", err);
    if (status) return status;
    if (shape->n_options) memcpy(options, s->options, shape->n_options * sizeof *options);
    return sdm_instance_start(shape, options, NULL, out, err);
}

/* The two processes, and the mesh of each. */
typedef struct both {
    const sdm_instance *here, *there;
    sdm_mesh a, b;
    double end; /* time of the clock, s */
} both;

/* Sets *unlike: do the meshes at p differ? A mesh that cannot be made here is told elsewhere. */
static sdm_status compare(both *t, const double *p, bool *unlike, sdm_error *err)
{
    *unlike = false;
    if (sdm_instance_mesh(t->here, p, &t->a, NULL)) return SDM_OK;
    const sdm_status s = sdm_instance_mesh(t->there, p, &t->b, err);
    *unlike = !s && sdm_mesh_checksum(&t->a) != sdm_mesh_checksum(&t->b);
    return s;
}

/* Begins with the last shape, so that the first mesh there is not the first mesh here. */
static sdm_status compare_shapes(both *t, const double *p, size_t n, sdm_repeat *out,
                                 sdm_error *err)
{
    for (size_t k = 0; k < n && k < SHAPES; k++) {
        const size_t i = k ? k - 1 : n - 1;
        bool unlike;
        if (k > 1 && sdm_clock() > t->end) break;
        const sdm_status s = compare(t, p + i * t->here->n_params, &unlike, err);
        if (s) return s;
        if (!unlike) continue;
        if (!out->unlike++) out->first = i;
        out->cause = SDM_REPEAT_PROCESS;
    }
    return SDM_OK;
}

/* Compares meshes beside shapes that are made before them here, but not there: a cache of several
 * meshes gives here that of the shape if it does not compare the parameter. Every parameter has a
 * shape of its own, so that nothing there is in such a cache. */
static sdm_status compare_beside(both *t, const double *p, size_t n, sdm_repeat *out,
                                 sdm_error *err)
{
    const size_t n_params = t->here->n_params;
    for (size_t k = 0; k < n_params && sdm_clock() <= t->end; k++) {
        double q[SHAPE_PARAMS_MAX];
        bool unlike;
        const size_t at = (2 * n - 2 - k % n) % n; // of many shapes it is a random one
        if (!sdm_shape_step_beside(p, n, n_params, at, n - 1, k, STEP, q)) continue;
        if (sdm_instance_mesh(t->here, p + at * n_params, &t->a, NULL)) return SDM_OK;
        const sdm_status s = compare(t, q, &unlike, err);
        if (s) return s;
        if (!unlike) continue;
        *out = (sdm_repeat){.unlike = 1, .first = at, .cause = SDM_REPEAT_BESIDE, .param = k};
        break;
    }
    return SDM_OK;
}

sdm_status sdm_repeat_in_process(const sdm_instance *shape, const sdm_repeat_process *process,
                                 const double *p, size_t n, sdm_repeat *out, sdm_error *err)
{
    sdm_registry *registry = NULL;
    sdm_instance *there = NULL;
    *out = (sdm_repeat){0};
    sdm_status s = sdm_registry_create(&registry, err);
    if (!s) s = sdm_registry_isolate(registry, &process->how, err);
    if (!s) s = sdm_registry_load(registry, process->plugin, err);
    if (!s) s = copy_instance(shape, registry, &there, err);
    both t = {.here = shape, .there = there, .end = sdm_clock() + SECONDS};
    if (!s) s = compare_shapes(&t, p, n, out, err);
    if (!s && !out->unlike) s = compare_beside(&t, p, n, out, err);
    sdm_mesh_dispose(&t.a);
    sdm_mesh_dispose(&t.b);
    sdm_instance_free(there);
    sdm_registry_free(registry);
    return s;
}
