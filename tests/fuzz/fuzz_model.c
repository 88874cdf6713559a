/* Fuzz target of models of every kind of network, with right checksums: a model that is accepted
 * gives a map and its derivatives of finite numbers or not, without reading beyond its arrays. */
#include <math.h>
#include <stdlib.h>

#include "fuzz_reader.h"
#include "sdm/field.h"
#include "sdm/memory.h"

/* larger networks take too long for a fuzzer */
#define MACS_MAX 2e7
#define FLOATS_MAX ((size_t)1 << 20)

static void check_info(const sdm_model_info *info)
{
    sdm_error err = {0};
    fuzz_require(!sdm_grid_check(&info->grid, &err));
    for (size_t i = 0; i < info->n_params; i++)
        fuzz_require(info->params[i].min < info->params[i].max && isfinite(info->params[i].def));
}

static void evaluate(const sdm_model *m, const sdm_model_info *info)
{
    sdm_error err = {0};
    double p[64];
    float *values = NULL, *jacobian = NULL, at_point = 0;
    sdm_field *field = NULL;
    const size_t n = sdm_grid_count(&info->grid), all = n * info->n_params;
    const sdm_generate_opts opts = {.n_threads = 1, .policy = SDM_RANGE_CLAMP};
    for (size_t i = 0; i < info->n_params; i++) p[i] = info->params[i].def;
    fuzz_require(!SDM_ALLOC(&values, n, "map", NULL));
    fuzz_require(!SDM_ALLOC(&jacobian, all, "derivatives", NULL));
    fuzz_check_status(sdm_generate(m, p, &opts, values, NULL, &err), &err);
    fuzz_check_status(sdm_generate_jacobian(m, p, &opts, values, jacobian, NULL, &err), &err);
    if (!sdm_field_create(m, &opts, false, &field, &err) &&
        !sdm_field_set_params(field, p, NULL, &err))
        (void)sdm_field_point(field, info->grid.origin, &at_point, NULL, NULL, &err);
    sdm_field_free(field);
    sdm_free(jacobian);
    sdm_free(values);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    sdm_model *m = NULL;
    sdm_error err = {0};
    uint8_t *bytes = fuzz_copy(data, size);
    fuzz_repair_container(bytes, size);
    const sdm_status s = sdm_model_open_memory("fuzz.sdm", bytes, size, &m, &err);
    free(bytes);
    fuzz_check_status(s, &err);
    fuzz_require((s == SDM_OK) == (m != NULL));
    if (s) return 0;
    const sdm_model_info *info = sdm_model_get_info(m);
    check_info(info);
    if (info->n_params <= 64 && info->macs < MACS_MAX &&
        sdm_grid_count(&info->grid) < FLOATS_MAX / (info->n_params + 1))
        evaluate(m, info);
    sdm_model_free(m);
    return 0;
}
