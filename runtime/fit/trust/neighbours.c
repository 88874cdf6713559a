/* The voxels whose scores say something of the shape. */
#include "neighbours.h"

#include <math.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"

static void place_of(const sdm_grid *g, size_t voxel, int64_t index[3])
{
    index[0] = (int64_t)voxel % g->n[0];
    index[1] = (int64_t)voxel / g->n[0] % g->n[1];
    index[2] = (int64_t)voxel / g->n[0] / g->n[1];
}

// whether a voxel's score says anything of the shape; those that hardly do would thin out the
// others, of which some are taken
bool sdm_fit_in_shell(const fit_problem *p, size_t site)
{
    return p->sites.slot[site] != SIZE_MAX &&
           !(p->maps.share && fabs(fabs(p->sites.field[site] - 0.5) - 0.5) <= 1e-6);
}

size_t sdm_fit_count_shell(const fit_problem *p)
{
    size_t n = 0;
    for (size_t i = 0; i < p->sites.n; i++) n += sdm_fit_in_shell(p, i);
    return n;
}

static void find_box(const fit_problem *p, fit_shell *v)
{
    int64_t to[3] = {0, 0, 0}, index[3];
    for (int a = 0; a < 3; a++) v->from[a] = INT64_MAX;
    for (size_t i = 0; i < p->sites.n; i++) {
        if (!sdm_fit_in_shell(p, i)) continue;
        place_of(&p->target->grid, p->sites.voxel[i], index);
        for (int a = 0; a < 3; a++) {
            if (index[a] < v->from[a]) v->from[a] = index[a];
            if (index[a] > to[a]) to[a] = index[a];
        }
    }
    for (int a = 0; a < 3; a++) v->size[a] = (to[a] - v->from[a]) / v->step + 1;
}

// what an error of the map of 1 mm does to the field: the slope of the field across the surface
static double field_slope(const fit_problem *p, const float *columns)
{
    const float *shift = columns + fit_at_translation(p->n_params);
    if (!p->maps.share) return 1;
    return -sqrt((double)(shift[0] * shift[0]) + (double)(shift[1] * shift[1]) +
                 (double)(shift[2] * shift[2]));
}

static void fill_near(const fit_problem *p, fit_shell *v)
{
    const fit_sites *s = &p->sites;
    const size_t nc = s->n_columns, n = v->n_unknowns;
    size_t count = 0;
    for (size_t i = 0; i < s->n; i++) {
        if (!sdm_fit_in_shell(p, i)) continue;
        const float *columns = s->columns + s->slot[i] * nc;
        fit_response r;
        sdm_fit_respond(&p->laws, (double)s->value[i], fit_place(s, i), s->field[i], true, &r);
        float *root = v->root + count * n, *push = v->push + count * n;
        const double slope = field_slope(p, columns);
        for (size_t a = 0; a < nc; a++) {
            root[a] = (float)(r.root[0] * (double)columns[a]);
            push[a] = (float)(r.complete[0] * slope * (double)columns[a]);
        }
        for (size_t a = nc; a < n; a++) {
            root[a] = (float)r.root[1 + a - nc];
            push[a] = (float)(r.complete[1 + a - nc] * slope);
        }
        v->residual[count] = (float)r.residual;
        v->weight[count] = (float)fabs(r.root[0]);
        v->lot[count] = (float)sdm_rng_uniform(0, 0, s->voxel[i]);
        int64_t index[3];
        place_of(&p->target->grid, s->voxel[i], index);
        for (int a = 0; a < 3; a++)
            v->place[3 * count + (size_t)a] = (int32_t)((index[a] - v->from[a]) / v->step);
        const int32_t *at = v->place + 3 * count;
        v->at[((size_t)at[2] * (size_t)v->size[1] + (size_t)at[1]) * (size_t)v->size[0] +
              (size_t)at[0]] = (uint32_t)++count;
    }
}

float sdm_fit_shell_share(const fit_shell *v, double wanted)
{
    // the same for a voxel more or less: other voxels would be chosen
    return (float)exp2(0.25 * floor(4 * log2(wanted / (double)v->n)));
}

sdm_status sdm_fit_shell_pick(const fit_shell *v, double wanted, uint32_t **list, size_t *n,
                              sdm_error *err)
{
    const float share = sdm_fit_shell_share(v, wanted);
    *n = 0;
    const sdm_status s = SDM_ALLOC(list, v->n, "voxels near the surface", err);
    for (size_t i = 0; i < v->n && !s; i++)
        if (v->lot[i] <= share) (*list)[(*n)++] = (uint32_t)i;
    return s;
}

void sdm_fit_shell_dispose(fit_shell *v)
{
    sdm_free(v->at);
    sdm_free(v->place);
    sdm_free(v->lot);
    sdm_free(v->residual);
    sdm_free(v->weight);
    sdm_free(v->root);
    sdm_free(v->push);
    *v = (fit_shell){0};
}

sdm_status sdm_fit_shell_create(const fit_problem *p, fit_shell *out, sdm_error *err)
{
    fit_shell *v = out;
    *v = (fit_shell){
        .n = sdm_fit_count_shell(p), .n_unknowns = p->sums.n_unknowns, .step = (int64_t)p->stride};
    find_box(p, v);
    size_t count, box;
    sdm_status s = sdm_mul(v->n, v->n_unknowns, &count, err);
    if (!s) s = sdm_mul((size_t)v->size[0] * (size_t)v->size[1], (size_t)v->size[2], &box, err);
    if (!s) s = SDM_ALLOC(&v->at, box, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->place, 3 * v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->lot, v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->residual, v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->weight, v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->root, count, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->push, count, "voxels near the surface", err);
    if (!s) fill_near(p, v);
    return s;
}
