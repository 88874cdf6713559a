/* The point networks deepsdf and imnet in the trainer: they learn from random voxels of the maps of
   a batch. */
#include <math.h>
#include <string.h>

#include "data/streams.h"
#include "direct_network.h"
#include "numerics/loss.h"
#include "point_draw.h"
#include "point_mlp.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/team.h"
#include "sdm/memory.h"
#include "state/progress.h"

enum {
    CHUNK = 2048,   // points that pass through the network together
    EVALUATED = 512 // random voxels of each held-out map in an evaluation
};

typedef struct point_trainer {
    sdm_point_arch arch;
    // Voxels drawn together: 1; with the eikonal term 4, a voxel and its next neighbours along x, y
    // and z.
    size_t group;
    float u[CHUNK * (SDM_POD_MAX_PARAMS + 3)], target[CHUNK], value[CHUNK], slope[CHUNK];
    float *workspace;
} point_trainer;

/* Sets *a to the configured network, scaled to the grid and to the maps made so far. */
static void point_design(const trainer *t, sdm_point_arch *a)
{
    const sdm_config *c = t->config;
    const dataset *d = &t->data;
    *a = (sdm_point_arch){.n_params = d->n_params,
                          .depth = (size_t)c->network.depth,
                          .activation = (int)c->network.activation,
                          .tanh_output = c->network.output == SDM_OUTPUT_TANH};
    const bool imnet = c->network.kind == SDM_NETWORK_IMNET;
    for (size_t l = 0; l < a->depth; l++) {
        const size_t width = (size_t)c->network.width >> (imnet ? l : 0);
        a->width[l] = width > 8 ? width : 8;
        if (l && (imnet || l == (size_t)c->network.skip)) a->skip |= 1u << l;
    }
    // centre and radius of the inputs: the grid
    double middle[3];
    for (int i = 0; i < 3; i++) {
        middle[i] = 0.5 * (double)(c->grid.n[i] - 1);
        const double half = fmax(middle[i], 0.5) * c->grid.spacing[i];
        if (half > a->radius) a->radius = half;
    }
    sdm_grid_world(&c->grid, middle, a->centre);
    // scale of the output: the largest distance of the maps so far, with some room for later maps
    float largest = 0;
    for (size_t i = 0; i < d->n_static + d->n_start; i++)
        if (d->scale[i] > largest) largest = d->scale[i];
    a->scale = 1.05 * 32767 * (double)largest;
}

static sdm_status point_create(const trainer *t, void **network, size_t *n_weights, sdm_error *err)
{
    point_trainer *p = NULL;
    sdm_status s = SDM_ALLOC(&p, 1, "batch", err);
    if (s) return s;
    *network = p;
    point_design(t, &p->arch);
    const int64_t *n = t->config->grid.n;
    p->group = t->config->train.eikonal > 0 && n[0] > 1 && n[1] > 1 && n[2] > 1 ? 4 : 1;
    *n_weights = sdm_point_count(&p->arch);
    return SDM_ALLOC(&p->workspace, trainer_point_workspace(&p->arch, CHUNK), "batch", err);
}

static void point_dispose(void *network)
{
    point_trainer *p = network;
    if (!p) return;
    sdm_free(p->workspace);
    sdm_free(p);
}

static void point_init(const trainer *t, const void *network, float *w)
{
    trainer_point_init(&((const point_trainer *)network)->arch, t->config->seed, w);
}

/* Sets row i of the input u to the shape parameters params[P] and the world position of a voxel. */
static void point_set_input(const trainer *t, point_trainer *p, size_t i, const double *params,
                            size_t voxel)
{
    const sdm_point_arch *a = &p->arch;
    const sdm_grid *g = &t->config->grid;
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
    float *u = p->u + i * (a->n_params + 3);
    for (size_t k = 0; k < a->n_params; k++)
        *u++ = (float)(2 * (params[k] - t->data.min[k]) / (t->data.max[k] - t->data.min[k]) - 1);
    double world[3];
    sdm_grid_world(g,
                   (const double[3]){(double)(voxel % nx), (double)(voxel / nx % ny),
                                     (double)(voxel / nx / ny)},
                   world);
    for (int k = 0; k < 3; k++) *u++ = (float)((world[k] - a->centre[k]) / a->radius);
}

/* The arguments of points_gather(). */
typedef struct point_gather {
    const trainer *t;
    point_trainer *p;
    const direct_batch *batch;
    size_t each, first, n;
} point_gather;

enum { SLICE = 64 }; // points that a thread draws at a time

static void gather_slice(void *user, size_t index, int member)
{
    const point_gather *g = user;
    point_trainer *p = g->p;
    const sdm_config *c = g->t->config;
    const dataset *d = &g->t->data;
    const size_t row = (size_t)c->grid.n[0], slice = row * (size_t)c->grid.n[1];
    const size_t step[4] = {0, 1, row, slice};
    (void)member;
    for (size_t i = index * SLICE; i < (index + 1) * SLICE && i < g->n; i += p->group) {
        const size_t slot = g->batch->slots[(g->first + i) / g->each];
        size_t voxel =
            trainer_point_draw(c, d, slot, g->batch->step * g->batch->n * g->each + g->first + i);
        if (p->group > 1) voxel = trainer_point_with_neighbours(&c->grid, voxel);
        for (size_t k = 0; k < p->group; k++) {
            point_set_input(g->t, p, i + k, d->params + slot * d->n_params, voxel + step[k]);
            p->target[i + k] =
                d->scale[slot] * (float)*trainer_dataset_values(d, slot, voxel + step[k]);
        }
    }
}

/* Draws points first .. first + n - 1 of the batch, which has `each` points from every map, and
 * sets their inputs p->u and exact distances p->target. */
static void points_gather(const trainer *t, point_trainer *p, const direct_batch *b, size_t each,
                          size_t first, size_t n)
{
    point_gather g = {t, p, b, each, first, n};
    sdm_team_run(trainer_threads(t), (n + SLICE - 1) / SLICE, gather_slice, &g);
}

/* The passes of n points with weights w. */
static point_pass pass_of(const trainer *t, const point_trainer *p, const float *w, size_t n)
{
    return (point_pass){.arch = &p->arch,
                        .w = w,
                        .batch = n,
                        .u = p->u,
                        .workspace = p->workspace,
                        .comm = t->hooks.comm,
                        .n_threads = trainer_threads(t)};
}

static sdm_status point_gradient(const trainer *t, void *network, const float *w,
                                 const direct_batch *b, float *out, double *mse, sdm_error *err)
{
    point_trainer *p = network;
    const sdm_config *c = t->config;
    const size_t each = ((size_t)c->train.points + p->group - 1) / p->group * p->group,
                 all = b->n * each;
    const float share = 1.0f / (float)all;
    double square = 0;
    sdm_status s = SDM_OK;
    memset(out, 0, sdm_point_count(&p->arch) * sizeof *out);
    for (size_t first = 0; first < all && !s; first += CHUNK) {
        const size_t n = all - first < CHUNK ? all - first : CHUNK;
        const point_pass pass = pass_of(t, p, w, n);
        points_gather(t, p, b, each, first, n);
        if ((s = trainer_point_forward(&pass, p->value, err))) break;
        for (size_t i = 0; i < n; i++)
            p->slope[i] = share * trainer_loss_slope_drawn(c, p->value[i], p->target[i], &square);
        for (size_t i = 0; i + 3 < n && p->group > 1; i += 4)
            trainer_loss_eikonal(c, p->value + i, 4 * share, p->slope + i);
        s = trainer_point_backward(&pass, p->slope, out, err);
    }
    *mse = square / (double)all;
    return s ? s : trainer_point_gather(&p->arch, t->hooks.comm, out, err);
}

static sdm_status point_evaluate(const trainer *t, void *network, const float *w, bool training,
                                 double *mse, sdm_error *err)
{
    point_trainer *p = network;
    const dataset *d = &t->data;
    const size_t maps = training ? trainer_dataset_measured(d) : d->n_holdout,
                 all = maps * EVALUATED;
    double square = 0;
    for (size_t first = 0; first < all; first += CHUNK) {
        const size_t n = all - first < CHUNK ? all - first : CHUNK;
        const point_pass pass = pass_of(t, p, w, n);
        for (size_t i = 0; i < n; i++) {
            const size_t map = (first + i) / EVALUATED;
            const size_t voxel =
                (size_t)sdm_rng_below(t->config->seed, STREAM_EVALUATE, first + i, d->n_voxels);
            if (training) {
                const size_t slot = trainer_dataset_measured_slot(d, map);
                p->target[i] = d->scale[slot] * (float)*trainer_dataset_values(d, slot, voxel);
                point_set_input(t, p, i, d->params + slot * d->n_params, voxel);
            } else {
                p->target[i] = d->holdout[map * d->n_voxels + voxel];
                point_set_input(t, p, i, d->holdout_params + map * d->n_params, voxel);
            }
        }
        const sdm_status s = trainer_point_forward(&pass, p->value, err);
        if (s) return s;
        for (size_t i = 0; i < n; i++) {
            const double e = (double)p->value[i] - (double)p->target[i];
            square += e * e;
        }
    }
    *mse = square / (double)all;
    return SDM_OK;
}

static sdm_status point_build(const trainer *t, const void *network, const float *w,
                              const sdm_model_info *info, uint8_t **bytes, size_t *size,
                              sdm_error *err)
{
    const sdm_point_spec spec = {.info = info,
                                 .kind = t->config->network.kind == SDM_NETWORK_IMNET ? "imnet"
                                                                                      : "deepsdf",
                                 .arch = ((const point_trainer *)network)->arch,
                                 .weights = w,
                                 .half = t->config->network.weights == SDM_WEIGHT_F16};
    return sdm_point_build(&spec, bytes, size, err);
}

const direct_network trainer_network_point = {.create = point_create,
                                              .dispose = point_dispose,
                                              .init = point_init,
                                              .gradient = point_gradient,
                                              .evaluate = point_evaluate,
                                              .build = point_build};
