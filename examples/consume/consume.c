/* Example of the C interface: opens a model, computes a signed distance map with default
 * parameters, and prints the value of the central voxel and the distance half a voxel from it.
 * Usage: consume MODEL */
#include <stdio.h>

#include "sdm/field.h"
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
               (double)values[sdm_grid_voxel(grid, i, j, k)], info->accuracy.rmse_mm);
        const double index[3] = {(double)i - 0.5, (double)j, (double)k};
        double x[3]; // LPS, mm
        float value;
        sdm_grid_world(grid, index, x);
        s = sdm_generate_points(model, params, NULL, x, 1, &value, NULL, NULL, NULL, err);
        if (!s) printf("%.4f mm at (%g, %g, %g) mm\n", (double)value, x[0], x[1], x[2]);
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
