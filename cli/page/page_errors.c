/* The errors of a network on shapes that its training did not use, as a histogram for a page. */
#include <math.h>

#include "page.h"
#include "sdm/internal/near.h"
#include "sdm/memory.h"
#include "study/evaluate.h"

enum { SHAPES = 16 }; // the first ones of `sdmgen eval`

/* The first edge over the distance that counts as near the surface. */
#define FIRST_EDGE 5e-5

static size_t bin_of(double error, double first)
{
    const double at = 1 + CLI_PAGE_BINS_PER_DECADE * log10(error / first); // -INFINITY: no error
    return (size_t)fmin(fmax(at, 0), CLI_PAGE_BINS - 1);
}

static void count_errors(const float *network, const float *exact, size_t n, cli_page_errors *out)
{
    for (size_t i = 0; i < n; i++) {
        const double error = fabs((double)network[i] - (double)exact[i]);
        const size_t bin = bin_of(error, out->first_edge);
        out->voxels[bin]++;
        if (fabs((double)exact[i]) <= out->near_mm) out->near[bin]++;
    }
}

static sdm_status measure_shapes(const sdm_model *m, const sdm_instance *shape, double *p,
                                 float *network, float *exact, cli_page_errors *out, sdm_error *err)
{
    const sdm_grid *g = &sdm_model_get_info(m)->grid;
    const sdm_exact_opts opts = {0};
    for (; out->shapes < SHAPES; out->shapes++) {
        cli_eval_params(m, 1, out->shapes, p);
        sdm_status s = sdm_generate(m, p, NULL, network, NULL, err);
        if (!s) s = sdm_exact_shape_map(shape, p, &opts, g, exact, NULL, err);
        if (s) return s;
        count_errors(network, exact, sdm_grid_count(g), out);
    }
    return SDM_OK;
}

sdm_status cli_page_errors_make(const sdm_model *m, const sdm_instance *shape, cli_page_errors *out,
                                sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(m);
    const size_t n = sdm_grid_count(&info->grid);
    double *p = NULL;
    float *network = NULL, *exact = NULL;
    const double near_mm = sdm_grid_near(&info->grid);
    *out = (cli_page_errors){.near_mm = near_mm, .first_edge = FIRST_EDGE * near_mm};
    sdm_status s = SDM_ALLOC(&p, info->n_params, "parameters", err);
    if (!s) s = SDM_ALLOC(&network, n, "map", err);
    if (!s) s = SDM_ALLOC(&exact, n, "map", err);
    if (!s) s = measure_shapes(m, shape, p, network, exact, out, err);
    sdm_free(exact);
    sdm_free(network);
    sdm_free(p);
    return s;
}
