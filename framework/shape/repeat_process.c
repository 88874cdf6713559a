/* Makes meshes of a plug-in in another process and compares their bits. */
#include <string.h>

#include "sdm/internal/clock.h"
#include "sdm/memory.h"
#include "shape_internal.h"

/* At most so many meshes are made; after the first two, none begins after so many seconds. */
enum { SHAPES = 4 };
#define SECONDS 0.3

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

/* Begins with the last shape, so that the first mesh there is not the first mesh here. */
static sdm_status compare(const sdm_instance *here, const sdm_instance *there, const double *p,
                          size_t n, sdm_repeat *out, sdm_error *err)
{
    sdm_mesh a = {0}, b = {0};
    sdm_status s = SDM_OK;
    const double start = sdm_clock();
    for (size_t k = 0; k < n && k < SHAPES && !s; k++) {
        const size_t i = k ? k - 1 : n - 1;
        if (k > 1 && sdm_clock() - start > SECONDS) break;
        if (sdm_instance_mesh(here, p + i * here->n_params, &a, NULL)) continue; // told elsewhere
        s = sdm_instance_mesh(there, p + i * here->n_params, &b, err);
        if (s || sdm_mesh_checksum(&a) == sdm_mesh_checksum(&b)) continue;
        if (!out->unlike++) out->first = i;
        out->cause = SDM_REPEAT_PROCESS;
    }
    sdm_mesh_dispose(&a);
    sdm_mesh_dispose(&b);
    return s;
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
    if (!s) s = compare(shape, there, p, n, out, err);
    sdm_instance_free(there);
    sdm_registry_free(registry);
    return s;
}
