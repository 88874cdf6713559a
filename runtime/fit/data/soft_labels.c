/* Labels are steps from 0 to 1 between two voxels, but the share that a map can represent is an
 * edge with the width of about a voxel of the map. Where the surface is curved, the wide edge fits
 * a step best with a surface that is shifted outwards, by the mean curvature times the difference
 * of the variances. So the labels get the same width. */
#include "soft_labels.h"

#include <math.h>
#include <string.h>

#include "blur.h"
#include "map_fields.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"

// the Gaussian is negligible beyond so many sd
#define REACH 6.0

/* A block of voxels of a grid: from[] inclusive, to[] exclusive. */
typedef struct voxel_block {
    int64_t from[3], to[3];
} voxel_block;

/* The voxels above 0 with a margin, within the grid; beyond them softening changes nothing. */
static voxel_block block_of_labels(const sdm_grid *g, const float *values, double sd)
{
    voxel_block b = {.from = {g->n[0], g->n[1], g->n[2]}};
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++) {
                const int64_t at[3] = {i, j, k};
                if (!(*values++ > 0)) continue;
                for (int a = 0; a < 3; a++) {
                    b.from[a] = at[a] < b.from[a] ? at[a] : b.from[a];
                    b.to[a] = at[a] + 1 > b.to[a] ? at[a] + 1 : b.to[a];
                }
            }
    for (int a = 0; a < 3; a++) {
        const int64_t margin = (int64_t)ceil(REACH * sd / g->spacing[a]) + 2;
        b.from[a] = b.from[a] > margin ? b.from[a] - margin : 0;
        b.to[a] = b.to[a] + margin < g->n[a] ? b.to[a] + margin : g->n[a];
    }
    return b;
}

sdm_status sdm_fit_soften_labels(const sdm_grid *g, const float *values, double sd, int n_threads,
                                 float *out, sdm_error *err)
{
    sd = fmin(sd, FIT_BLUR_MAX * fmin(g->spacing[0], fmin(g->spacing[1], g->spacing[2])));
    memcpy(out, values, sdm_grid_count(g) * sizeof *out);
    const voxel_block b = block_of_labels(g, values, sd);
    sdm_grid part = *g;
    for (int a = 0; a < 3; a++) part.n[a] = b.to[a] - b.from[a];
    if (part.n[0] <= 0 || part.n[1] <= 0 || part.n[2] <= 0) return SDM_OK;
    // two fields: the value and 1, both 0 where the value is NaN
    const size_t n = sdm_grid_count(&part);
    double *packed = NULL, *spare = NULL;
    sdm_status s = SDM_ALLOC(&packed, 2 * n, "labels", err);
    if (!s) s = SDM_ALLOC(&spare, 2 * n, "labels", err);
    for (int back = 0; back < 2 && !s; back++) {
        double *p = packed;
        for (int64_t k = b.from[2]; k < b.to[2]; k++)
            for (int64_t j = b.from[1]; j < b.to[1]; j++)
                for (int64_t i = b.from[0]; i < b.to[0]; i++, p += 2) {
                    const size_t at = (size_t)((k * g->n[1] + j) * g->n[0] + i);
                    const bool known = !isnan(values[at]);
                    if (!back)
                        p[0] = known ? (double)values[at] : 0, p[1] = known;
                    else if (known)
                        out[at] = (float)fmin(fmax(p[0] / p[1], 0), 1);
                }
        if (!back) sdm_fit_blur(&part, 2, sd * sd, false, n_threads, &packed, &spare);
    }
    sdm_free(packed);
    sdm_free(spare);
    return s;
}

sdm_status sdm_fit_labels_as_image(const sdm_fit_source *source, sdm_fit_target *target,
                                   sdm_fit_opts *opts, float **values, sdm_error *err)
{
    const sdm_grid *map = source->model ? &sdm_model_get_info(source->model)->grid : &source->grid;
    const double soft = 0.5 * fmax(fit_longest_edge(map), fit_longest_edge(&target->grid));
    sdm_status s = SDM_ALLOC(values, sdm_grid_count(&target->grid), "labels", err);
    if (!s)
        s = sdm_fit_soften_labels(&target->grid, target->values, soft, sdm_threads(opts->n_threads),
                                  *values, err);
    if (s) return s;
    target->values = *values;
    target->kind = SDM_FIT_IMAGE;
    opts->blur = sqrt(opts->blur * opts->blur + soft * soft);
    opts->appearance = (sdm_fit_appearance){.n_inside = 1,
                                            .n_outside = 1,
                                            .inside = {{.weight = 1, .mean = 1, .sd = 0.25}},
                                            .outside = {{.weight = 1, .mean = 0, .sd = 0.25}}};
    opts->keep_appearance = true;
    return SDM_OK;
}
