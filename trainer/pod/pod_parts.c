/* Measures the error of the bases and of the network on held-out maps and on training maps. */
#include "pod_parts.h"

#include <math.h>

#include "head.h"
#include "mlp.h"
#include "pod_ranks.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/team.h"
#include "sdm/memory.h"
#include "state/progress.h"
#include "tree_pass.h"

enum {
    ROWS = 32, // maps at a time
    STEPS = 4  // towards the best coefficients: one would do if the bases were exactly orthonormal
};

/* Maps whose error is measured: the held-out maps, or the maps in `slots`. */
typedef struct measured_maps {
    bool holdout;
    const size_t *slots;
    size_t n;
} measured_maps;

/* The loop over the trees of this rank for the maps first .. first + rows - 1. */
typedef struct parts_loop {
    const pod_state *pod;
    const measured_maps *maps;
    size_t first, rows;
    size_t root; // block number of tree 0
    pod_share share;
    float *c, *dc;  // [ROWS][K]
    float *scratch; // [members][tree_floats]
    size_t tree_floats;
    double *network, *bases; // [all trees] sums of squared errors, mm^2
} parts_loop;

/* w->delta[rows][voxels] = exact maps minus predicted ones. Returns the sum of the squares. */
static double remainder_of(const parts_loop *l, const tree_work *w)
{
    const dataset *d = &l->pod->t->data;
    const size_t first = l->pod->blocks[w->tree.first[0]].voxel, voxels = w->tree.voxels;
    double sum = 0;
    for (size_t r = 0; r < l->rows; r++) {
        const size_t map = l->first + r;
        const float *predicted = w->predicted + r * voxels;
        float *delta = w->delta + r * voxels;
        if (l->maps->holdout) {
            const float *exact = d->holdout + map * d->n_voxels + first;
            for (size_t v = 0; v < voxels; v++) delta[v] = exact[v] - predicted[v];
        } else {
            const size_t slot = l->maps->slots[map];
            const int16_t *exact = trainer_dataset_values(d, slot, first);
            for (size_t v = 0; v < voxels; v++)
                delta[v] = d->scale[slot] * (float)exact[v] - predicted[v];
        }
        for (size_t v = 0; v < voxels; v++) sum += (double)delta[v] * delta[v];
    }
    return sum;
}

/* Error of the network's coefficients; then gradient steps of unit length towards those with the
   smallest error. */
static void measure_tree(void *user, size_t index, int member)
{
    const parts_loop *l = user;
    const size_t i = l->share.first + index;
    const pod_state *pod = l->pod;
    const float *weights = pod->refine.average;
    const size_t root = l->root + i, rank = pod->blocks[root].rank, top = pod->arch.levels.n - 1;
    const tree_work w = trainer_tree_work(
        pod, ROWS, root, l->scratch + l->tree_floats * (size_t)member, l->c, l->dc);
    trainer_tree_forward(pod, weights, l->rows, &w);
    double least = remainder_of(l, &w);
    l->network[i] += least;
    for (int step = 0; step < STEPS; step++) {
        for (size_t level = 0; level <= top; level++)
            for (size_t b = w.tree.first[level]; b < w.tree.end[level]; b++)
                trainer_tree_back(pod, weights, l->rows, &w, level, b);
        for (size_t r = 0; r < l->rows; r++)
            for (size_t k = 0; k < rank; k++)
                w.c[top][r * w.ld[top] + k] += w.dc[top][r * w.ld[top] + k];
        trainer_tree_forward(pod, weights, l->rows, &w);
        least = fmin(least, remainder_of(l, &w));
    }
    l->bases[i] += least;
}

/* l->c[rows][K] = coefficients that the network computes. x, z, workspace: for ROWS maps. */
static void network_coefficients(const parts_loop *l, float *x, float *z, float *workspace)
{
    const pod_state *pod = l->pod;
    const sdm_pod_arch *a = &pod->arch;
    const float *w = pod->refine.average, *phi[ROWS];
    for (size_t r = 0; r < l->rows; r++) {
        const size_t map = l->first + r;
        phi[r] = l->maps->holdout ? pod->holdout_phi + map * pod->n_poly
                                  : pod->phi + l->maps->slots[map] * pod->n_poly;
    }
    trainer_head_latent(pod, w, l->rows, phi, x, z, workspace);
    sdm_gemm(l->rows, a->n_coefficients, a->n_latent, (sdm_view){z, a->n_latent, 1},
             (sdm_view){w + pod->head_at, 1, a->n_latent}, false, l->c, a->n_coefficients,
             trainer_threads(pod->t));
}

/* *network, *bases = mean square errors on the maps, mm^2. */
static sdm_status measure(const pod_state *pod, const measured_maps *maps, double *network,
                          double *bases, sdm_error *err)
{
    const sdm_pod_arch *a = &pod->arch;
    const size_t root = a->levels.first[a->levels.n - 1],
                 trees = a->levels.first[a->levels.n] - root;
    const size_t most = (size_t)pod->t->n_threads, members = trees < most ? trees : most;
    parts_loop l = {.pod = pod, .maps = maps, .root = root, .share = trainer_pod_share(pod)};
    float *x = NULL, *z = NULL, *workspace = NULL;
    for (size_t i = 0; i < trees; i++) {
        const size_t floats = trainer_tree_floats(pod, ROWS, root + i);
        if (floats > l.tree_floats) l.tree_floats = floats;
    }
    sdm_status s = SDM_ALLOC(&x, ROWS * a->n_inputs, "parts of the error", err);
    if (!s) s = SDM_ALLOC(&z, ROWS * a->n_latent, "parts of the error", err);
    if (!s) s = SDM_ALLOC(&workspace, trainer_mlp_workspace(a, ROWS), "parts of the error", err);
    if (!s) s = SDM_ALLOC(&l.c, ROWS * a->n_coefficients, "parts of the error", err);
    if (!s) s = SDM_ALLOC(&l.dc, ROWS * a->n_coefficients, "parts of the error", err);
    if (!s) s = SDM_ALLOC(&l.scratch, members * l.tree_floats, "parts of the error", err);
    if (!s) s = SDM_ALLOC(&l.network, trees, "parts of the error", err);
    if (!s) s = SDM_ALLOC(&l.bases, trees, "parts of the error", err);
    for (; l.first < maps->n && !s; l.first += ROWS) {
        l.rows = maps->n - l.first < ROWS ? maps->n - l.first : ROWS;
        network_coefficients(&l, x, z, workspace);
        sdm_team_run((int)members, l.share.end - l.share.first, measure_tree, &l);
    }
    const size_t top = a->levels.n - 1, size = sizeof *l.network;
    if (!s) s = trainer_pod_gather(pod, top, trainer_pod_place_root, size, l.network, err);
    if (!s) s = trainer_pod_gather(pod, top, trainer_pod_place_root, size, l.bases, err);
    *network = *bases = 0;
    const double voxels = (double)maps->n * (double)a->n_voxels;
    for (size_t i = 0; i < trees && !s; i++)
        *network += l.network[i] / voxels, *bases += l.bases[i] / voxels;
    sdm_free(l.bases);
    sdm_free(l.network);
    sdm_free(l.scratch);
    sdm_free(l.dc);
    sdm_free(l.c);
    sdm_free(workspace);
    sdm_free(z);
    sdm_free(x);
    return s;
}

sdm_status trainer_pod_parts(const trainer *t, error_measures *out, sdm_error *err)
{
    const pod_state *pod = t->state;
    const dataset *d = &t->data;
    size_t *slots = NULL;
    const size_t n = trainer_dataset_measured(d);
    sdm_status s = SDM_ALLOC(&slots, n, "parts of the error", err);
    for (size_t i = 0; i < n && !s; i++) slots[i] = trainer_dataset_measured_slot(d, i);
    const measured_maps training = {.slots = slots, .n = n},
                        heldout = {.holdout = true, .n = d->n_holdout};
    if (!s) s = measure(pod, &training, &out->network.training, &out->bases.training, err);
    if (!s) s = measure(pod, &heldout, &out->network.heldout, &out->bases.heldout, err);
    out->modes = pod->modes_mse;
    out->degree = (double)pod->arch.degree;
    out->ridge = pod->ridge;
    sdm_free(slots);
    return s;
}
