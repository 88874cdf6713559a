/* Example of the C interface: opens a model, computes a signed distance map with default parameters
 * and prints the value of the central voxel. Usage: consume MODEL */
#include <stdio.h>

#include "sdm/memory.h"
#include "sdm/runtime.h"

static sdm_status use_model(const sdm_model *model, sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(model);
    const sdm_grid *grid = &info->grid;
    float *values = NULL;
    double *params = NULL;
    sdm_status s = SDM_ALLOC(&values, sdm_grid_count(grid), "map", err);
    if (!s) s = SDM_ALLOC(&params, info->n_params, "parameters", err);
    for (size_t i = 0; i < info->n_params && !s; i++) params[i] = info->params[i].def;
    if (!s) s = sdm_generate(model, params, NULL, values, NULL, err);
    if (!s) {
        const int64_t i = grid->n[0] / 2, j = grid->n[1] / 2, k = grid->n[2] / 2;
        printf("%s: %.4f mm in the middle voxel, RMSE %.4f mm\n", info->shape,
               (double)values[(k * grid->n[1] + j) * grid->n[0] + i], info->accuracy.rmse_mm);
    }
    sdm_free(params);
    sdm_free(values);
    return s;
}

int main(int argc, char **argv)
{
    sdm_error err = {0};
    sdm_model *model = NULL;
    if (argc != 2) {
        fputs("usage: consume MODEL\n", stderr);
        return 2;
    }
    sdm_status s = sdm_model_open(argv[1], &model, &err);
    if (!s) s = use_model(model, &err);
    if (s) fprintf(stderr, "consume: %s\n", err.text);
    sdm_model_free(model);
    return s ? 1 : 0;
}
