/* Trains MLP, head, bases and mean map together, end to end, on maps. The blocks of a tree
   (pod_tree.h) are computed by one thread, of the rank that has the tree. B is the size of a batch;
   other letters as in pod_state.h. */
#include "refine.h"

#include <math.h>
#include <string.h>

#include "data/streams.h"
#include "head.h"
#include "mlp.h"
#include "numerics/loss.h"
#include "pod_ranks.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/team.h"
#include "sdm/memory.h"
#include "state/best.h"
#include "state/checkpoint.h"
#include "state/new_samples.h"
#include "state/progress.h"
#include "tree_pass.h"

/* Adam step sizes, relative to the typical size of a weight. They were found by trials on the
 * cochlea, and are within a factor of three of the best values. */
#define HEAD_STEP 0.05f // times pod->deviation
#define BASIS_STEP 0.3f // divided by sqrt(outputs of the block)
#define MEAN_STEP 0.05f // mm

/* Arrays for one batch. */
typedef struct refine_batch {
    size_t rows;
    float *x, *z, *dz; // [B][I], [B][L], [B][W]
    float *c, *dc;     // [B][K]
    float *workspace, *gradient;
    size_t *slots;      // [B]
    double *loss;       // [trees] sum of squared errors, mm^2
    size_t tree_floats; // floats of scratch memory of a tree
    int tree_threads;   // threads that have scratch memory for a tree
    float *scratch;
    // of this rank: trees; columns of c and dc, which are rows of the head
    pod_share share;
    size_t column, columns;
} refine_batch;

static void refine_batch_dispose(refine_batch *b)
{
    sdm_free(b->x);
    sdm_free(b->z);
    sdm_free(b->dz);
    sdm_free(b->c);
    sdm_free(b->dc);
    sdm_free(b->workspace);
    sdm_free(b->gradient);
    sdm_free(b->slots);
    sdm_free(b->loss);
    sdm_free(b->scratch);
}

/* Rows of the head that a thread updates at a time. */
enum { HEAD_ROWS = 256 };

static size_t first_tree(const pod_state *pod)
{
    return pod->arch.levels.first[pod->arch.levels.n - 1];
}
static size_t n_trees(const pod_state *pod)
{
    return pod->arch.levels.first[pod->arch.levels.n] - first_tree(pod);
}

/* The first coefficient of the highest level in the trees from number `tree` on. */
static size_t first_column(const pod_state *pod, size_t tree)
{
    return trainer_pod_place_coefficient(pod, first_tree(pod) + tree);
}

static sdm_status refine_batch_create(const pod_state *pod, size_t rows, refine_batch *b,
                                      sdm_error *err)
{
    const sdm_pod_arch *a = &pod->arch;
    const pod_share share = trainer_pod_share(pod);
    const size_t column = first_column(pod, share.first);
    *b = (refine_batch){.rows = rows,
                        .tree_threads = (int)n_trees(pod),
                        .share = share,
                        .column = column,
                        .columns = first_column(pod, share.end) - column};
    if (b->tree_threads > pod->t->n_threads) b->tree_threads = pod->t->n_threads;
    for (size_t i = 0; i < n_trees(pod); i++) {
        const size_t need = trainer_tree_floats(pod, rows, first_tree(pod) + i);
        if (need > b->tree_floats) b->tree_floats = need;
    }
    sdm_status s = SDM_ALLOC(&b->x, rows * a->n_inputs, "batch", err);
    if (!s) s = SDM_ALLOC(&b->z, rows * a->n_latent, "batch", err);
    if (!s) s = SDM_ALLOC(&b->dz, rows * a->width, "batch", err);
    if (!s) s = SDM_ALLOC(&b->c, rows * a->n_coefficients, "batch", err);
    if (!s) s = SDM_ALLOC(&b->dc, rows * a->n_coefficients, "batch", err);
    if (!s) s = SDM_ALLOC(&b->workspace, trainer_mlp_workspace(a, rows), "batch", err);
    if (!s) s = SDM_ALLOC(&b->gradient, trainer_mlp_count(a), "batch", err);
    if (!s) s = SDM_ALLOC(&b->slots, rows, "batch", err);
    if (!s) s = SDM_ALLOC(&b->loss, n_trees(pod), "batch", err);
    const size_t trees = b->tree_floats * (size_t)b->tree_threads,
                 heads = HEAD_ROWS * a->n_latent * (size_t)pod->t->n_threads;
    if (!s) s = SDM_ALLOC(&b->scratch, trees > heads ? trees : heads, "batch", err);
    return s;
}

/* Number of threads for the trees. */
static int threads_for_trees(const pod_state *pod, const refine_batch *b)
{
    const int n = trainer_threads(pod->t);
    return n < b->tree_threads ? n : b->tree_threads;
}

/* b->c[rows][K] = coefficients of the highest level from the latent variables b->z, in the columns
 * of this rank. */
static void head_forward(const pod_state *pod, const float *w, refine_batch *b, size_t rows)
{
    const sdm_pod_arch *a = &pod->arch;
    sdm_gemm(rows, b->columns, a->n_latent, (sdm_view){b->z, a->n_latent, 1},
             (sdm_view){w + pod->head_at + b->column * a->n_latent, 1, a->n_latent}, false,
             b->c + b->column, a->n_coefficients, trainer_threads(pod->t));
}

/* The arrays of a tree in the scratch memory of a member of the team. */
static tree_work batch_tree(const pod_state *pod, const refine_batch *b, size_t root, int member)
{
    return trainer_tree_work(pod, b->rows, root, b->scratch + b->tree_floats * (size_t)member, b->c,
                             b->dc);
}

/* Carries the gradient from w->delta[rows][voxels] up to the coefficients of the highest level, and
 * updates each basis and the mean map on the way. */
static void tree_backward(pod_state *pod, size_t rows, const tree_work *w, adam_step adam)
{
    const size_t first = pod->blocks[w->tree.first[0]].voxel, voxels = w->tree.voxels;
    for (size_t level = 0; level < pod->arch.levels.n; level++)
        for (size_t b = w->tree.first[level]; b < w->tree.end[level]; b++) {
            const block_place p = trainer_tree_place(pod, w, level, b);
            const size_t rank = pod->blocks[b].rank, at = pod->basis_at + pod->matrix_at[b];
            const float *from = (level ? w->dc[level - 1] : w->delta) + p.output;
            const size_t ldf = level ? w->ld[level - 1] : voxels;
            // gradient with respect to the coefficients, then to the basis
            trainer_tree_back(pod, pod->refine.w, rows, w, level, b);
            sdm_gemm(rank, p.outputs, rows,
                     (sdm_view){w->c[level] + p.coefficient, 1, w->ld[level]},
                     (sdm_view){from, ldf, 1}, false, w->basis_gradient, p.outputs, 1);
            trainer_adam_update(&pod->refine, at, rank * p.outputs, w->basis_gradient, adam,
                                BASIS_STEP / sqrtf((float)p.outputs));
        }
    float *mean_gradient = w->predicted; // re-uses the memory of w->predicted
    memset(mean_gradient, 0, voxels * sizeof *mean_gradient);
    for (size_t r = 0; r < rows; r++)
        for (size_t v = 0; v < voxels; v++) mean_gradient[v] += w->delta[r * voxels + v];
    trainer_adam_update(&pod->refine, pod->mean_at + first, voxels, mean_gradient, adam, MEAN_STEP);
}

/* A loop over the trees or over rows of the head. */
typedef struct refine_loop {
    pod_state *pod;
    refine_batch *batch;
    adam_step adam;
    // for the evaluation: weights, and the held-out maps first .. first + rows - 1
    const float *weights;
    size_t first, rows;
} refine_loop;

/* Forward pass, backward pass and weight update of tree `index` of this rank on the batch. */
static void tree_train(void *user, size_t index, int member)
{
    const refine_loop *l = user;
    pod_state *pod = l->pod;
    refine_batch *b = l->batch;
    const size_t i = b->share.first + index;
    const tree_work w = batch_tree(pod, b, first_tree(pod) + i, member);
    const size_t first = pod->blocks[w.tree.first[0]].voxel, voxels = w.tree.voxels;
    trainer_tree_forward(pod, pod->refine.w, b->rows, &w);
    double sum = 0;
    for (size_t r = 0; r < b->rows; r++) {
        const int16_t *target = trainer_dataset_values(&pod->t->data, b->slots[r], first);
        const float scale = pod->t->data.scale[b->slots[r]];
        float *delta = w.delta + r * voxels;
        for (size_t v = 0; v < voxels; v++) delta[v] = scale * (float)target[v];
        sum += trainer_loss_slopes(pod->t->config, voxels, w.predicted + r * voxels, delta, delta);
    }
    b->loss[i] = sum;
    tree_backward(pod, b->rows, &w, l->adam);
}

/* Updates rows of the head, HEAD_ROWS from row index * HEAD_ROWS of this rank on, from the gradient
 * of the batch. */
static void head_train(void *user, size_t index, int member)
{
    const refine_loop *l = user;
    pod_state *pod = l->pod;
    const refine_batch *b = l->batch;
    const size_t n_c = pod->arch.n_coefficients, latents = pod->arch.n_latent;
    const size_t done = index * HEAD_ROWS, first = b->column + done,
                 rows = b->columns - done < HEAD_ROWS ? b->columns - done : HEAD_ROWS;
    float *gradient = b->scratch + HEAD_ROWS * latents * (size_t)member;
    sdm_gemm(rows, latents, b->rows, (sdm_view){b->dc + first, 1, n_c},
             (sdm_view){b->z, latents, 1}, false, gradient, latents, 1);
    for (size_t i = 0; i < rows; i++)
        trainer_adam_update(&pod->refine, pod->head_at + (first + i) * latents, latents,
                            gradient + i * latents, l->adam, HEAD_STEP * pod->deviation[first + i]);
}

/* Gives all ranks the losses of all trees. */
static sdm_status share_losses(const pod_state *pod, refine_batch *b, sdm_error *err)
{
    return trainer_pod_gather(pod, pod->arch.levels.n - 1, trainer_pod_place_root, sizeof *b->loss,
                              b->loss, err);
}

/* Gives all ranks the rows of the head in an array laid out as the weights. */
static sdm_status share_head(const pod_state *pod, float *weights, sdm_error *err)
{
    return trainer_pod_gather(pod, pod->arch.levels.n - 1, trainer_pod_place_coefficient,
                              pod->arch.n_latent * sizeof *weights, weights + pod->head_at, err);
}

/* One Adam step on a random batch. */
static sdm_status refine_step(pod_state *pod, refine_batch *b, double rate, sdm_error *err)
{
    const sdm_pod_arch *a = &pod->arch;
    const float **phi = NULL;
    sdm_status s = SDM_ALLOC(&phi, b->rows, "batch", err);
    if (s) return s;
    // random batch
    for (size_t i = 0; i < b->rows; i++) {
        b->slots[i] =
            trainer_dataset_draw(&pod->t->data, STREAM_REFINE, pod->t->config->data.static_share,
                                 b->rows, (uint64_t)pod->t->step, i);
        phi[i] = pod->phi + b->slots[i] * pod->n_poly;
    }
    // forward pass from the parameters to the coefficients of the highest level
    const float *w = pod->refine.w;
    trainer_head_latent(pod, w, b->rows, phi, b->x, b->z, b->workspace);
    sdm_free((void *)phi);
    head_forward(pod, w, b, b->rows);
    // trees: maps, loss, gradients; bases and mean map are updated
    refine_loop loop = {.pod = pod,
                        .batch = b,
                        .adam = trainer_adam_begin(rate, ADAM_DECAY, pod->t->phase_step + 1)};
    sdm_team_run(threads_for_trees(pod, b), b->share.end - b->share.first, tree_train, &loop);
    if ((s = share_losses(pod, b, err))) return s;
    if ((s = trainer_pod_gather_columns(pod, b->rows, b->dc, err))) return s;
    double sum = 0;
    for (size_t i = 0; i < n_trees(pod); i++) sum += b->loss[i];
    pod->t->loss = sum / ((double)b->rows * (double)pod->t->data.n_voxels);

    // gradient of the MLP before the head is updated: it needs the head of the forward pass
    if (a->depth) {
        sdm_gemm(b->rows, a->width, a->n_coefficients, (sdm_view){b->dc, a->n_coefficients, 1},
                 (sdm_view){w + pod->head_at + a->n_terms, a->n_latent, 1}, false, b->dz, a->width,
                 trainer_threads(pod->t));
        trainer_mlp_backward(a, w, b->rows, b->x, b->workspace, b->dz, b->gradient,
                             trainer_threads(pod->t));
    }
    sdm_team_run(trainer_threads(pod->t), (b->columns + HEAD_ROWS - 1) / HEAD_ROWS, head_train,
                 &loop);
    if (!a->depth) return SDM_OK;
    trainer_adam_update(&pod->refine, 0, trainer_mlp_count(a), b->gradient, loop.adam, 1);
    return share_head(pod, pod->refine.w, err); // the gradient of the MLP needs all rows
}

sdm_status trainer_refine_gather(pod_state *pod, sdm_error *err)
{
    parameters *p = &pod->refine;
    float *const arrays[] = {p->w, p->m, p->v, p->average, p->best};
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays && !s; i++) {
        float *mean = arrays[i] + pod->mean_at, *basis = arrays[i] + pod->basis_at;
        s = share_head(pod, arrays[i], err);
        if (!s) s = trainer_pod_gather(pod, 0, trainer_pod_place_voxel, sizeof *mean, mean, err);
        for (size_t level = 0; level < pod->arch.levels.n && !s; level++)
            s = trainer_pod_gather(pod, level, trainer_pod_place_matrix, sizeof *basis, basis, err);
    }
    return s;
}

/* batch->loss[i] = sum of the squared errors of tree i on held-out maps; the tree has number
 * `index` among those of this rank. */
static void tree_evaluate(void *user, size_t index, int member)
{
    const refine_loop *l = user;
    const pod_state *pod = l->pod;
    const size_t i = l->batch->share.first + index;
    const dataset *d = &pod->t->data;
    const tree_work w = batch_tree(pod, l->batch, first_tree(pod) + i, member);
    const size_t voxels = w.tree.voxels;
    trainer_tree_forward(pod, l->weights, l->rows, &w);
    double sum = 0;
    for (size_t r = 0; r < l->rows; r++) {
        const float *truth =
            d->holdout + (l->first + r) * d->n_voxels + pod->blocks[w.tree.first[0]].voxel;
        for (size_t v = 0; v < voxels; v++) {
            const double e = (double)w.predicted[r * voxels + v] - truth[v];
            sum += e * e;
        }
    }
    l->batch->loss[i] = sum;
}

sdm_status trainer_refine_evaluate(pod_state *pod, const float *w, double *mse, sdm_error *err)
{
    enum { ROWS = 32 };
    const dataset *d = &pod->t->data;
    refine_batch b = {0};
    sdm_status s = refine_batch_create(pod, ROWS, &b, err);
    double sum = 0;
    for (size_t at = 0; at < d->n_holdout && !s; at += ROWS) {
        const size_t rows = d->n_holdout - at < ROWS ? d->n_holdout - at : ROWS;
        // coefficients of the next held-out maps
        const float *phi[ROWS];
        for (size_t i = 0; i < rows; i++) phi[i] = pod->holdout_phi + (at + i) * pod->n_poly;
        trainer_head_latent(pod, w, rows, phi, b.x, b.z, b.workspace);
        head_forward(pod, w, &b, rows);
        refine_loop loop = {.pod = pod, .batch = &b, .weights = w, .first = at, .rows = rows};
        sdm_team_run(threads_for_trees(pod, &b), b.share.end - b.share.first, tree_evaluate, &loop);
        s = share_losses(pod, &b, err);
        for (size_t i = 0; i < n_trees(pod) && !s; i++) sum += b.loss[i];
    }
    refine_batch_dispose(&b);
    *mse = sum / ((double)d->n_holdout * (double)d->n_voxels);
    return s;
}

sdm_status trainer_refine_note(pod_state *pod, const float *w, double rate, sdm_error *err)
{
    const double began = trainer_shared_seconds(pod->t);
    double mse;
    const sdm_status s = trainer_refine_evaluate(pod, w, &mse, err);
    if (s) return s;
    trainer_evaluated(pod->t, mse, began);
    return trainer_metric(pod->t, rate, err);
}

sdm_status trainer_refine_start(pod_state *pod, bool resumed, sdm_error *err)
{
    const sdm_pod_arch *a = &pod->arch;
    const size_t basis_count = pod->matrix_at[a->levels.first[a->levels.n]];
    pod->head_at = trainer_mlp_count(a);
    pod->mean_at = pod->head_at + a->n_coefficients * a->n_latent;
    pod->basis_at = pod->mean_at + a->n_voxels;
    sdm_status s = trainer_parameters_create(&pod->refine, pod->basis_at + basis_count, err);
    if (s || resumed) return s;
    if (a->depth)
        memcpy(pod->refine.w, pod->mode_fit.average, trainer_mlp_count(a) * sizeof *pod->refine.w);
    memcpy(pod->refine.w + pod->mean_at, pod->mean, a->n_voxels * sizeof *pod->mean);
    memcpy(pod->refine.w + pod->basis_at, pod->basis, basis_count * sizeof *pod->basis);
    memcpy(pod->refine.average, pod->refine.w, pod->refine.n * sizeof *pod->refine.w);
    return SDM_OK;
}

/* Used fraction of the phase's budget: of the steps that the mode fit left over (a resumed run may
 * have a different budget), or of the time until trainer_shared_seconds() = `end`. */
static double refine_fraction(const trainer *t, double end)
{
    const bool by_time = trainer_by_time(t);
    const double length =
        by_time ? end - t->phase_started : (double)(trainer_steps(t) - (t->step - t->phase_step));
    const double used =
        by_time ? trainer_shared_seconds(t) - t->phase_started : (double)t->phase_step;
    return length > 0 ? used / length : 1;
}

sdm_status trainer_refine_run(pod_state *pod, sdm_error *err)
{
    trainer *t = pod->t;
    const sdm_config *c = t->config;
    if (!(c->train.refine > 0)) return SDM_OK;
    refine_batch b = {0};
    sdm_status s = refine_batch_create(pod, (size_t)c->train.refine_batch, &b, err);
    trainer_pace_start(t, (double)c->train.refine_batch);
    double at = refine_fraction(t, pod->refine_end);
    bool done = false;
    // the start counts too: the refinement must not lose what least squares have found
    if (t->phase_step == 0) trainer_best_note(t, &pod->refine, 0, t->heldout_mse);
    while (!s && at < 1 && !done) {
        // new maps, or stop
        if ((s = trainer_samples_take(t, t->data.n_start + t->data.n_online, err))) break;
        if (trainer_all_cancelled(t)) {
            s = trainer_stop(t, err);
            break;
        }
        // one step
        const double rate = c->train.refine_rate * trainer_rate_schedule(at, c->train.warmup);
        if ((s = refine_step(pod, &b, rate, err))) break;
        t->step++, t->phase_step++;
        at = refine_fraction(t, pod->refine_end);
        trainer_average_follow(&pod->refine, c->train.average, t->phase_step, !(at < 1),
                               trainer_threads(t));
        if (!isfinite(t->loss)) {
            s = sdm_fail(err, SDM_E_CONFIG,
                         "%s: training diverged at step %lld (loss is not a number): lower "
                         "train.refine_rate",
                         c->file, (long long)t->step);
            break;
        }
        // evaluate, report, save
        const double now = trainer_shared_seconds(t);
        if (trainer_evaluation_due(t, now)) {
            if ((s = trainer_refine_note(pod, pod->refine.average, rate, err))) break;
            if (trainer_evaluation_counts(t))
                done = trainer_best_note(t, &pod->refine, at, t->heldout_mse);
        }
        trainer_step_done(t);
        trainer_checkpoint_if_due(t, now);
    }
    if (!s && t->evaluated_step != t->step)
        s = trainer_refine_note(pod, pod->refine.average, 0, err);
    if (!s) {
        trainer_best_note(t, &pod->refine, at, t->heldout_mse);
        trainer_best_restore(t, &pod->refine);
        s = trainer_refine_gather(pod, err);
    }
    if (!s && done) trainer_ended_early(t, at);
    refine_batch_dispose(&b);
    return s;
}
