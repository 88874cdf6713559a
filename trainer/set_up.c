/* The beginning of a run: kind of network, shape, grid, memory for the maps. */
#include "set_up.h"

#include "direct/direct.h"
#include "pod/pod_kind.h"
#include "sdm/internal/shape_box.h"
#include "sdm/memory.h"
#include "state/export_model.h"
#include "state/progress.h"
#include "template/template_kind.h"

const train_kind *trainer_kind_find(sdm_network_kind kind)
{
    return kind == SDM_NETWORK_POD        ? &trainer_kind_pod
           : kind == SDM_NETWORK_TEMPLATE ? &trainer_kind_template
                                          : &trainer_kind_direct;
}

/* Checks the shape against the configuration; allocates the data set and the blocks of its maps. */
sdm_status trainer_set_up(trainer *t, sdm_error *err)
{
    const sdm_config *c = t->config;
    dataset *d = &t->data;
    if (c->grid.n[0] == 0)
        return sdm_fail(
            err, SDM_E_ARG,
            "the grid of the configuration is not complete: sdm_train_complete() fits it");
    sdm_instance_params(t->shape, &d->n_params);
    if (d->n_params > SDM_POD_MAX_PARAMS)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%zu parameters, at most %d can be trained",
                        d->n_params, SDM_POD_MAX_PARAMS);
    sdm_status s = trainer_export_prepare(t, err);
    if (!s) s = sdm_train_ranges(c, t->shape, d->min, d->max, err);
    if (!s) s = sdm_train_distributions(c, t->shape, d->min, d->max, d->distribution, err);
    if (s) return s;
    d->comm = t->hooks.comm;
    d->shape = t->shape;
    d->grid = &c->grid;
    d->seed = c->seed;
    d->store = t->hooks.store;
    if (t->kind->prepare && (s = t->kind->prepare(t, err))) return s;
    const sdm_grid *grid = d->target.make ? d->target.grid : &c->grid;
    d->n_voxels = sdm_grid_count(grid);
    // before the blocks: for a grid that is too large its message names the memory needed
    if ((s = trainer_dataset_size(d, c, err))) return s;
    if ((int64_t)d->n_start < c->data.start && !d->only_holdout)
        trainer_message(t,
                        "data.memory_gb is %g: of %lld random maps (data.start) on %.3g voxels the "
                        "training starts with %zu, and keeps the latest ones (raise it for more)",
                        c->data.memory_gb, (long long)c->data.start, (double)d->n_voxels,
                        d->n_start);

    // block edge 0 means map order: one block as large as the grid
    size_t block = t->kind->block(c);
    for (int i = 0; i < 3 && !t->kind->block(c); i++)
        if ((size_t)grid->n[i] > block) block = (size_t)grid->n[i];
    t->levels = sdm_pod_count(grid, block, t->kind->levels ? t->kind->levels(c) : 1);
    d->n_blocks = t->levels.first[1];
    if ((s = SDM_ALLOC(&t->blocks, t->levels.first[t->levels.n], "blocks", err))) return s;
    sdm_pod_blocks(grid, block, &t->levels, t->blocks);
    d->blocks = t->blocks;
    if (d->comm && t->kind->shares) {
        s = SDM_ALLOC(&d->share, (size_t)sdm_comm_size(d->comm) + 1, "shares of the ranks", err);
        if (s) return s;
        t->kind->shares(t, d->share);
    }
    return trainer_dataset_create(d, c, err);
}

/* Refuses a grid without a voxel inside any held-out shape: a network trained on it would have a
 * small error but be useless. */
sdm_status trainer_check_grid(const trainer *t, sdm_error *err)
{
    const dataset *d = &t->data;
    if (d->inside) return SDM_OK;
    return sdm_fail(
        err, SDM_E_CONFIG,
        "%s: no voxel of the grid is inside any of %zu held-out shapes: check grid.centre (or "
        "grid.origin), grid.size and grid.spacing (%g mm: smaller than the parts of the shape?)",
        t->config->file, d->n_holdout, sdm_grid_coarsest(d->grid));
}
