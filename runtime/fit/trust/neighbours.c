/* Collects the voxels of the inner band, their residuals and scores. */
#include "neighbours.h"

#include <math.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"

// index of an image voxel along each axis
static void voxel_index(const sdm_grid *g, size_t voxel, int64_t index[3])
{
    index[0] = (int64_t)voxel % g->n[0];
    index[1] = (int64_t)voxel / g->n[0] % g->n[1];
    index[2] = (int64_t)voxel / g->n[0] / g->n[1];
}

// excludes samples with negligible scores, which would take the place of informative samples in
// subsamples
bool sdm_fit_in_inner_band(const fit_problem *p, size_t sample)
{
    return p->samples.row[sample] != SIZE_MAX && !fit_sample_is_beyond(&p->samples, sample) &&
           !(p->maps.share && fabs(fabs(p->samples.field[sample] - 0.5) - 0.5) <= 1e-6);
}

size_t sdm_fit_inner_band_count(const fit_problem *p)
{
    size_t n = 0;
    for (size_t i = 0; i < p->samples.n; i++) n += sdm_fit_in_inner_band(p, i);
    return n;
}

// positions are rounded to this part of the shortest edge of a voxel, after a shift that keeps the
// voxels of common grids away from where the rounding changes
#define QUANTUM 0.1
#define SHIFT 0.37

double sdm_fit_sample_draw(const fit_problem *p, size_t sample)
{
    const double *h = p->target->grid.spacing, *x = p->samples.world + 3 * sample;
    const double quantum = QUANTUM * fmin(h[0], fmin(h[1], h[2]));
    uint64_t hash = 0;
    for (int k = 0; k < 3; k++)
        hash = sdm_mix64(hash ^ (uint64_t)(int64_t)floor(x[k] / quantum + SHIFT));
    return sdm_rng_uniform(0, 0, hash);
}

// bounding box of the inner band
static void box_find(const fit_problem *p, fit_neighbours *v)
{
    int64_t to[3] = {0, 0, 0}, index[3];
    for (int a = 0; a < 3; a++) v->first[a] = INT64_MAX;
    for (size_t i = 0; i < p->samples.n; i++) {
        if (!sdm_fit_in_inner_band(p, i)) continue;
        voxel_index(&p->target->grid, p->samples.voxel[i], index);
        for (int a = 0; a < 3; a++) {
            if (index[a] < v->first[a]) v->first[a] = index[a];
            if (index[a] > to[a]) to[a] = index[a];
        }
    }
    for (int a = 0; a < 3; a++) v->size[a] = (to[a] - v->first[a]) / v->step + 1;
}

// change of the field per mm of map error: 1 for distances, else minus the norm of the gradient of
// the share
static double field_slope(const fit_problem *p, const float *columns)
{
    const float *shift = columns + fit_at_translation(p->n_params);
    if (!p->maps.share) return 1;
    return -sqrt((double)(shift[0] * shift[0]) + (double)(shift[1] * shift[1]) +
                 (double)(shift[2] * shift[2]));
}

static void neighbours_fill(const fit_problem *p, fit_neighbours *v)
{
    const fit_samples *s = &p->samples;
    const size_t nc = s->n_columns, n = v->n_unknowns;
    size_t count = 0;
    for (size_t i = 0; i < s->n; i++) {
        if (!sdm_fit_in_inner_band(p, i)) continue;
        const float *columns = s->jacobian + s->row[i] * nc;
        fit_likelihood r;
        sdm_fit_likelihood(&p->observation, (double)s->value[i], fit_sample_weights(s, i),
                           s->field[i], true, &r);
        // derivatives by the columns, then by the tissue means
        float *root = v->root + count * n, *model_score = v->model_score + count * n;
        const double slope = field_slope(p, columns);
        for (size_t a = 0; a < nc; a++) {
            root[a] = (float)(r.root[0] * (double)columns[a]);
            model_score[a] = (float)(r.complete[0] * slope * (double)columns[a]);
        }
        for (size_t a = nc; a < n; a++) {
            root[a] = (float)r.root[1 + a - nc];
            model_score[a] = (float)(r.complete[1 + a - nc] * slope);
        }
        // residual, weight and position
        v->residual[count] = (float)r.residual;
        v->weight[count] = (float)fabs(r.root[0]);
        v->draw[count] = (float)sdm_fit_sample_draw(p, i);
        int64_t index[3];
        voxel_index(&p->target->grid, s->voxel[i], index);
        for (int a = 0; a < 3; a++)
            v->position[3 * count + (size_t)a] = (int32_t)((index[a] - v->first[a]) / v->step);
        const int32_t *at = v->position + 3 * count;
        v->number_at[((size_t)at[2] * (size_t)v->size[1] + (size_t)at[1]) * (size_t)v->size[0] +
                     (size_t)at[0]] = (uint32_t)++count;
    }
}

float sdm_fit_neighbours_threshold(const fit_neighbours *v, double wanted)
{
    // rounded down to a power of 2^(1/4), so that a few voxels more or less do not change the
    // choice
    return (float)exp2(0.25 * floor(4 * log2(wanted / (double)v->n)));
}

sdm_status sdm_fit_neighbours_pick(const fit_neighbours *v, double wanted, uint32_t **list,
                                   size_t *n, sdm_error *err)
{
    const float threshold = sdm_fit_neighbours_threshold(v, wanted);
    *n = 0;
    const sdm_status s = SDM_ALLOC(list, v->n, "voxels near the surface", err);
    for (size_t i = 0; i < v->n && !s; i++)
        if (v->draw[i] <= threshold) (*list)[(*n)++] = (uint32_t)i;
    return s;
}

void sdm_fit_neighbours_dispose(fit_neighbours *v)
{
    sdm_free(v->number_at);
    sdm_free(v->position);
    sdm_free(v->draw);
    sdm_free(v->residual);
    sdm_free(v->weight);
    sdm_free(v->root);
    sdm_free(v->model_score);
    *v = (fit_neighbours){0};
}

sdm_status sdm_fit_neighbours_create(const fit_problem *p, fit_neighbours *out, sdm_error *err)
{
    fit_neighbours *v = out;
    *v = (fit_neighbours){.n = sdm_fit_inner_band_count(p),
                          .n_unknowns = p->information.n_unknowns,
                          .step = (int64_t)p->stride};
    box_find(p, v);
    size_t count, box;
    sdm_status s = sdm_mul(v->n, v->n_unknowns, &count, err);
    if (!s) s = sdm_mul((size_t)v->size[0] * (size_t)v->size[1], (size_t)v->size[2], &box, err);
    if (!s) s = SDM_ALLOC(&v->number_at, box, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->position, 3 * v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->draw, v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->residual, v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->weight, v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->root, count, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->model_score, count, "voxels near the surface", err);
    if (!s) neighbours_fill(p, v);
    return s;
}
