/* The time, the memory and the bytes of a training on several nodes: the model of docs/plan.md. */
#include <math.h>

#include "sdm/internal/train_plan.h"

const char *sdm_plan_stage_name(sdm_plan_stage stage)
{
    static const char *const names[SDM_PLAN_STAGES] = {
        [SDM_PLAN_TRIALS] = "trials", [SDM_PLAN_DESIGN] = "design", [SDM_PLAN_MAPS] = "maps",
        [SDM_PLAN_BASES] = "bases",   [SDM_PLAN_MODES] = "modes",   [SDM_PLAN_FIT] = "fit",
        [SDM_PLAN_REFINE] = "refine"};
    return names[stage];
}

/* Voxels of each training map that a node keeps: nodes that share the work keep equal parts. */
static double kept_voxels(const sdm_train_work *w, double nodes)
{
    return w->shared ? w->n_voxels / nodes : w->n_voxels;
}

/* Bytes that a node has after each stage; the part that it has made itself is not sent. */
static void gathered_bytes(const sdm_train_work *w, double nodes, double bytes[SDM_PLAN_STAGES])
{
    const double row = 8 * w->n_params;
    for (int i = 0; i < SDM_PLAN_STAGES; i++) bytes[i] = 0;
    bytes[SDM_PLAN_TRIALS] = w->trial_maps * (2 * kept_voxels(w, nodes) + row + 4);
    bytes[SDM_PLAN_MAPS] =
        w->n_maps * (2 * kept_voxels(w, nodes) + row + 4) + w->n_holdout * (4 * w->n_voxels + row);
    if (!w->shared) return;
    // bases, mean map, eigenvalues; coefficients of all maps for modes, and again for the head
    bytes[SDM_PLAN_BASES] =
        4 * (w->basis + w->n_voxels) + 2 * 4 * (w->n_maps + w->n_holdout) * w->coefficients;
    // four iterations with two products each; the coefficients of the maps by the modes
    bytes[SDM_PLAN_MODES] =
        4 * w->modes_kept * (4 * (w->n_maps + w->coefficients) + w->n_maps + w->n_holdout);
    // loss, predictions, activations with their slopes, gradient
    bytes[SDM_PLAN_FIT] = w->steps * (w->batch * (8 + 4 * w->modes_kept + 8 * w->depth * w->width) +
                                      4 * w->fit_weights);
    // losses, gradient by the coefficients, head; at the end all weights with their averages
    if (w->refine_steps > 0)
        bytes[SDM_PLAN_REFINE] =
            w->refine_steps * (8 * w->trees + 4 * w->refine_batch * w->coefficients +
                               4 * w->coefficients * w->latents) +
            5 * 4 * w->weights;
}

/* Gathers, each of which waits for messages from all nodes. */
static double gathers(const sdm_train_work *w, sdm_plan_stage stage)
{
    if (stage == SDM_PLAN_FIT) return w->steps * (3 + 4 * w->depth);
    if (stage == SDM_PLAN_REFINE) return w->refine_steps * 3;
    return 0;
}

static double memory_of(const sdm_train_work *w, double nodes, double cores)
{
    const double kept = kept_voxels(w, nodes);
    const double maps = w->n_pool * (2 * kept + 8 * w->n_params + 4) +
                        w->n_holdout * (4 * w->n_voxels + 8 * w->n_params);
    // exact maps in work on each core, as floats in the order of the map and of the blocks
    const double work = cores * 4 * (w->n_map_voxels + w->n_voxels);
    if (!w->shared) return maps + work + 5 * 4 * w->weights;
    // the bases while they are computed, or the coefficients of all maps, or the trained weights
    const double bases = 4 * kept * w->keep + 4 * w->basis,
                 modes = 4 * (w->n_pool * (w->coefficients + 2 * w->modes_kept) +
                              w->modes_kept * w->coefficients),
                 weights = 6 * 4 * w->weights;
    return maps + work + 4 * w->n_pool * w->modes_kept + fmax(bases, fmax(modes, weights));
}

void sdm_train_plan_make(const sdm_train_work *w, int nodes, int cores, sdm_train_plan *out)
{
    const double n = nodes, m = cores, steps_by = w->shared ? n : 1;
    double bytes[SDM_PLAN_STAGES];
    *out = (sdm_train_plan){
        .seconds = {[SDM_PLAN_TRIALS] = w->trials / (n * m),
                    [SDM_PLAN_DESIGN] = w->design / m,
                    [SDM_PLAN_MAPS] = (w->n_maps + w->n_holdout) * w->map / (n * m),
                    [SDM_PLAN_BASES] = w->bases / (n * m),
                    [SDM_PLAN_MODES] = (w->modes - w->modes_products * (1 - 1 / n)) / m,
                    [SDM_PLAN_FIT] = w->steps * w->fit_step / (steps_by * m),
                    [SDM_PLAN_REFINE] = w->refine_steps * w->refine_step / (steps_by * m)}};
    gathered_bytes(w, n, bytes);
    for (int i = 0; i < SDM_PLAN_STAGES; i++) {
        out->received[i] = bytes[i] * (n - 1) / n;
        out->seconds[i] += out->received[i] / SDM_PLAN_BANDWIDTH;
        if (w->shared)
            out->seconds[i] += gathers(w, (sdm_plan_stage)i) * SDM_PLAN_LATENCY * ceil(log2(n));
        out->all_seconds += out->seconds[i];
        out->all_received += out->received[i];
    }
    out->memory = memory_of(w, n, m);
    out->model = w->weights * w->weight_bytes + 4 * w->n_voxels;
    out->checkpoint = 4 * 4 * fmax(w->weights, w->fit_weights);
    out->dataset = (w->n_maps + w->n_holdout) * (4 * w->n_map_voxels + 8 * w->n_params + 8);
}

int sdm_train_plan_pays(const sdm_train_work *w, int cores)
{
    enum { NODES_MAX = 1024 };
    static const double FASTER = 1.5;
    sdm_train_plan plan;
    int nodes = 1;
    sdm_train_plan_make(w, nodes, cores, &plan);
    for (double before = plan.all_seconds; nodes < NODES_MAX; before = plan.all_seconds) {
        sdm_train_plan_make(w, 2 * nodes, cores, &plan);
        if (plan.all_seconds * FASTER > before) break;
        nodes *= 2;
    }
    return nodes;
}
