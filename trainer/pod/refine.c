/* End-to-end training: MLP, head, bases and mean map together, on maps. It starts from the spectral
   start and the fitted MLP, with a head by least squares on all local coefficients. Letters as in
   sdm/pod.h; B batch. */
#include <math.h>
#include <string.h>

#include "data/streams.h"
#include "loss.h"
#include "mlp.h"
#include "pod_tree.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"
#include "trainer.h"

// Adam steps in units of what a weight typically is: found by trial on the cochlea, within a factor
// of three of the best
#define HEAD_STEP 0.05f // times the deviation of the coefficient
#define BASIS_STEP 0.3f // times 1 / sqrt(voxels)
#define MEAN_STEP 0.05f // mm

typedef struct refine_batch {
    size_t rows;
    float *x, *z, *dz; // [B][I], [B][L], [B][W]
    float *c, *dc;     // [B][K]
    float *workspace, *gradient;
    size_t *slots;      // [B]
    double *loss;       // [trees]
    size_t tree_floats; // scratch of a tree; threads with a tree: tree_threads
    int tree_threads;
    float *scratch;
} refine_batch;

static void batch_dispose(refine_batch *b)
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

enum { HEAD_ROWS = 256 };

static size_t first_tree(const trainer *t) { return t->arch.levels.first[t->arch.levels.n - 1]; }
static size_t n_trees(const trainer *t)
{
    return t->arch.levels.first[t->arch.levels.n] - first_tree(t);
}

// what a tree needs for a batch: voxels and their gradients, coefficients and theirs below the
// highest level, gradient of a basis
static size_t tree_floats(const trainer *t, size_t rows, size_t root)
{
    const pod_tree tree = pod_tree_of(&t->arch.levels, t->blocks, root);
    size_t each = tree.voxels, largest = tree.largest;
    for (size_t level = 0; level + 1 < t->arch.levels.n; level++)
        each += pod_tree_coefficients(t->blocks, &tree, level);
    for (size_t level = 0; level < t->arch.levels.n; level++)
        for (size_t b = tree.first[level]; b < tree.end[level]; b++) {
            const size_t matrix = t->matrix_at[b + 1] - t->matrix_at[b];
            if (matrix > largest) largest = matrix;
        }
    return 2 * rows * each + largest;
}

static sdm_status batch_create(const trainer *t, size_t rows, refine_batch *b, sdm_error *err)
{
    const sdm_pod_arch *a = &t->arch;
    *b = (refine_batch){.rows = rows, .tree_threads = (int)n_trees(t)};
    if (b->tree_threads > t->n_threads) b->tree_threads = t->n_threads;
    for (size_t i = 0; i < n_trees(t); i++) {
        const size_t need = tree_floats(t, rows, first_tree(t) + i);
        if (need > b->tree_floats) b->tree_floats = need;
    }
    sdm_status s = SDM_ALLOC(&b->x, rows * a->n_inputs, "batch", err);
    if (!s) s = SDM_ALLOC(&b->z, rows * a->n_latent, "batch", err);
    if (!s) s = SDM_ALLOC(&b->dz, rows * a->width, "batch", err);
    if (!s) s = SDM_ALLOC(&b->c, rows * a->n_coefficients, "batch", err);
    if (!s) s = SDM_ALLOC(&b->dc, rows * a->n_coefficients, "batch", err);
    if (!s) s = SDM_ALLOC(&b->workspace, mlp_workspace(a, rows), "batch", err);
    if (!s) s = SDM_ALLOC(&b->gradient, mlp_count(a), "batch", err);
    if (!s) s = SDM_ALLOC(&b->slots, rows, "batch", err);
    if (!s) s = SDM_ALLOC(&b->loss, n_trees(t), "batch", err);
    const size_t trees = b->tree_floats * (size_t)b->tree_threads,
                 heads = HEAD_ROWS * a->n_latent * (size_t)t->n_threads;
    if (!s) s = SDM_ALLOC(&b->scratch, trees > heads ? trees : heads, "batch", err);
    return s;
}

static int tree_threads(const trainer *t, const refine_batch *b)
{
    const int n = trainer_threads(t);
    return n < b->tree_threads ? n : b->tree_threads;
}

static void coefficients(const trainer *t, const float *w, refine_batch *b, size_t rows)
{
    const sdm_pod_arch *a = &t->arch;
    sdm_gemm(rows, a->n_coefficients, a->n_latent, (sdm_view){b->z, a->n_latent, 1},
             (sdm_view){w + t->head_at, 1, a->n_latent}, false, b->c, a->n_coefficients,
             trainer_threads(t));
}

// a tree's numbers in the scratch memory of a thread
typedef struct tree_work {
    pod_tree tree;
    size_t ld[SDM_POD_MAX_LEVELS];             // numbers in a row of a level
    float *c[SDM_POD_MAX_LEVELS];              // [B][ld] coefficients
    float *dc[SDM_POD_MAX_LEVELS];             // [B][ld] gradients at them
    float *predicted, *delta, *basis_gradient; // [B][voxels], [B][voxels], of one block
} tree_work;

static tree_work work_on(const trainer *t, const refine_batch *b, size_t root)
{
    tree_work w = {.tree = pod_tree_of(&t->arch.levels, t->blocks, root)};
    const size_t top = t->arch.levels.n - 1;
    float *at = b->scratch + b->tree_floats * (size_t)sdm_thread();
    for (size_t level = 0; level < top; level++) {
        w.ld[level] = pod_tree_coefficients(t->blocks, &w.tree, level);
        w.c[level] = at, at += b->rows * w.ld[level];
        w.dc[level] = at, at += b->rows * w.ld[level];
    }
    w.ld[top] = t->arch.n_coefficients;
    w.c[top] = b->c + t->blocks[root].coefficient;
    w.dc[top] = b->dc + t->blocks[root].coefficient;
    w.predicted = at, at += b->rows * w.tree.voxels;
    w.delta = at, at += b->rows * w.tree.voxels;
    w.basis_gradient = at;
    return w;
}

// a block of a level within the tree: place of its coefficients and of its outputs
typedef struct place {
    size_t coefficient, output, outputs;
} place;

static place place_of(const trainer *t, const tree_work *w, size_t level, size_t b)
{
    const sdm_pod_block *k = &t->blocks[b];
    const size_t lowest = w->tree.first[0];
    return (place){k->coefficient - t->blocks[w->tree.first[level]].coefficient,
                   level ? t->blocks[k->child].coefficient -
                               t->blocks[w->tree.first[level - 1]].coefficient
                         : (size_t)(k->voxel - t->blocks[lowest].voxel),
                   sdm_pod_outputs(t->blocks, b)};
}

// coefficients of the highest level -> predicted[rows][voxels]
static void tree_forward(const trainer *t, const float *weights, size_t rows, const tree_work *w)
{
    const float *mean = weights + t->mean_at + t->blocks[w->tree.first[0]].voxel;
    for (size_t r = 0; r < rows; r++)
        memcpy(w->predicted + r * w->tree.voxels, mean, w->tree.voxels * sizeof *mean);
    for (size_t level = t->arch.levels.n; level-- > 0;)
        for (size_t b = w->tree.first[level]; b < w->tree.end[level]; b++) {
            const place p = place_of(t, w, level, b);
            float *to = level ? w->c[level - 1] : w->predicted;
            const size_t ldt = level ? w->ld[level - 1] : w->tree.voxels;
            sdm_gemm(rows, p.outputs, t->blocks[b].rank,
                     (sdm_view){w->c[level] + p.coefficient, w->ld[level], 1},
                     (sdm_view){weights + t->basis_at + t->matrix_at[b], p.outputs, 1}, level == 0,
                     to + p.output, ldt, 1);
        }
}

// gradients from delta[rows][voxels] up to the coefficients of the highest level; bases and mean
// take their step on the way
static void tree_backward(trainer *t, size_t rows, const tree_work *w, adam_step adam)
{
    const size_t first = t->blocks[w->tree.first[0]].voxel, voxels = w->tree.voxels;
    for (size_t level = 0; level < t->arch.levels.n; level++)
        for (size_t b = w->tree.first[level]; b < w->tree.end[level]; b++) {
            const place p = place_of(t, w, level, b);
            const size_t rank = t->blocks[b].rank, at = t->basis_at + t->matrix_at[b];
            const float *from = (level ? w->dc[level - 1] : w->delta) + p.output;
            const size_t ldf = level ? w->ld[level - 1] : voxels;
            sdm_gemm(rows, rank, p.outputs, (sdm_view){from, ldf, 1},
                     (sdm_view){t->refine.w + at, 1, p.outputs}, false,
                     w->dc[level] + p.coefficient, w->ld[level], 1);
            sdm_gemm(rank, p.outputs, rows,
                     (sdm_view){w->c[level] + p.coefficient, 1, w->ld[level]},
                     (sdm_view){from, ldf, 1}, false, w->basis_gradient, p.outputs, 1);
            adam_update(&t->refine, at, rank * p.outputs, w->basis_gradient, adam,
                        BASIS_STEP / sqrtf((float)p.outputs));
        }
    float *mean_gradient = w->predicted; // no longer needed
    memset(mean_gradient, 0, voxels * sizeof *mean_gradient);
    for (size_t r = 0; r < rows; r++)
        for (size_t v = 0; v < voxels; v++) mean_gradient[v] += w->delta[r * voxels + v];
    adam_update(&t->refine, t->mean_at + first, voxels, mean_gradient, adam, MEAN_STEP);
}

// forward, backward and update of a tree on the batch
static void train_tree(trainer *t, refine_batch *b, size_t i, adam_step adam)
{
    const tree_work w = work_on(t, b, first_tree(t) + i);
    const size_t first = t->blocks[w.tree.first[0]].voxel, voxels = w.tree.voxels;
    tree_forward(t, t->refine.w, b->rows, &w);
    double sum = 0;
    for (size_t r = 0; r < b->rows; r++) {
        const int16_t *target = t->data.maps + b->slots[r] * t->data.n_voxels + first;
        const float scale = t->data.scale[b->slots[r]];
        for (size_t v = 0; v < voxels; v++)
            w.delta[r * voxels + v] =
                loss_slope(t->config, w.predicted[r * voxels + v], scale * (float)target[v], &sum);
    }
    b->loss[i] = sum;
    tree_backward(t, b->rows, &w, adam);
}

static void train_head(trainer *t, refine_batch *b, adam_step adam)
{
    const sdm_pod_arch *a = &t->arch;
    const size_t n_c = a->n_coefficients, latents = a->n_latent;
#pragma omp parallel for schedule(static) num_threads(trainer_threads(t))
    for (long at = 0; at < (long)n_c; at += HEAD_ROWS) {
        const size_t first = (size_t)at, rows = n_c - first < HEAD_ROWS ? n_c - first : HEAD_ROWS;
        float *gradient = b->scratch + HEAD_ROWS * latents * (size_t)sdm_thread();
        sdm_gemm(rows, latents, b->rows, (sdm_view){b->dc + first, 1, n_c},
                 (sdm_view){b->z, latents, 1}, false, gradient, latents, 1);
        for (size_t i = 0; i < rows; i++)
            adam_update(&t->refine, t->head_at + (first + i) * latents, latents,
                        gradient + i * latents, adam, HEAD_STEP * t->deviation[first + i]);
    }
}

static sdm_status step(trainer *t, refine_batch *b, double rate, sdm_error *err)
{
    const sdm_pod_arch *a = &t->arch;
    const float **phi = NULL;
    const sdm_status s = SDM_ALLOC(&phi, b->rows, "batch", err);
    if (s) return s;
    for (size_t i = 0; i < b->rows; i++) {
        b->slots[i] = dataset_draw(&t->data, STREAM_REFINE, t->config->data.static_share, b->rows,
                                   (uint64_t)t->step, i);
        phi[i] = t->phi + b->slots[i] * t->n_poly;
    }
    const float *w = t->refine.w;
    head_latent(t, w, b->rows, phi, b->x, b->z, b->workspace);
    sdm_free((void *)phi);
    coefficients(t, w, b, b->rows);
    const adam_step adam = adam_begin(rate, t->phase_step + 1);
#pragma omp parallel for schedule(dynamic) num_threads(tree_threads(t, b))
    for (long i = 0; i < (long)n_trees(t); i++) train_tree(t, b, (size_t)i, adam);
    double sum = 0;
    for (size_t i = 0; i < n_trees(t); i++) sum += b->loss[i];
    t->loss = sum / ((double)b->rows * (double)t->data.n_voxels);

    // the MLP's gradient needs the head as it was in the forward pass
    if (a->depth) {
        sdm_gemm(b->rows, a->width, a->n_coefficients, (sdm_view){b->dc, a->n_coefficients, 1},
                 (sdm_view){w + t->head_at + a->n_terms, a->n_latent, 1}, false, b->dz, a->width,
                 trainer_threads(t));
        mlp_backward(a, w, b->rows, b->x, b->workspace, b->dz, b->gradient, trainer_threads(t));
    }
    train_head(t, b, adam);
    if (a->depth) adam_update(&t->refine, 0, mlp_count(a), b->gradient, adam, 1);
    return SDM_OK;
}

sdm_status refine_evaluate(trainer *t, const float *w, double *mse, sdm_error *err)
{
    enum { ROWS = 32 };
    const dataset *d = &t->data;
    refine_batch b = {0};
    sdm_status s = batch_create(t, ROWS, &b, err);
    double sum = 0;
    for (size_t at = 0; at < d->n_holdout && !s; at += ROWS) {
        const size_t rows = d->n_holdout - at < ROWS ? d->n_holdout - at : ROWS;
        const float *phi[ROWS];
        for (size_t i = 0; i < rows; i++) phi[i] = t->holdout_phi + (at + i) * t->n_poly;
        head_latent(t, w, rows, phi, b.x, b.z, b.workspace);
        coefficients(t, w, &b, rows);
#pragma omp parallel for schedule(dynamic) num_threads(tree_threads(t, &b))
        for (long i = 0; i < (long)n_trees(t); i++) {
            const tree_work work = work_on(t, &b, first_tree(t) + (size_t)i);
            const size_t voxels = work.tree.voxels;
            tree_forward(t, w, rows, &work);
            double tree_sum = 0;
            for (size_t r = 0; r < rows; r++) {
                const float *truth =
                    d->holdout + (at + r) * d->n_voxels + t->blocks[work.tree.first[0]].voxel;
                for (size_t v = 0; v < voxels; v++) {
                    const double e = (double)work.predicted[r * voxels + v] - truth[v];
                    tree_sum += e * e;
                }
            }
            b.loss[i] = tree_sum;
        }
        for (size_t i = 0; i < n_trees(t); i++) sum += b.loss[i];
    }
    batch_dispose(&b);
    *mse = sum / ((double)d->n_holdout * (double)d->n_voxels);
    return s;
}

sdm_status refine_start(trainer *t, bool resumed, sdm_error *err)
{
    const sdm_pod_arch *a = &t->arch;
    const size_t basis_count = t->matrix_at[a->levels.first[a->levels.n]];
    t->head_at = mlp_count(a);
    t->mean_at = t->head_at + a->n_coefficients * a->n_latent;
    t->basis_at = t->mean_at + a->n_voxels;
    sdm_status s = parameters_create(&t->refine, t->basis_at + basis_count, err);
    if (s || resumed) return s;
    if (a->depth) memcpy(t->refine.w, t->fit.average, mlp_count(a) * sizeof *t->refine.w);
    memcpy(t->refine.w + t->mean_at, t->mean, a->n_voxels * sizeof *t->mean);
    memcpy(t->refine.w + t->basis_at, t->basis, basis_count * sizeof *t->basis);
    if ((s = head_solve(t, t->refine.w, t->refine.w + t->head_at, err))) return s;
    memcpy(t->refine.average, t->refine.w, t->refine.n * sizeof *t->refine.w);
    return SDM_OK;
}

static double fraction_of_phase(const trainer *t, double end)
{
    // what is left after the steps of the fit: a resumed run may have another budget than it began
    // with
    if (!trainer_by_time(t))
        return (double)t->phase_step / (double)(trainer_steps(t) - (t->step - t->phase_step));
    const double length = end - t->phase_started;
    return length > 0 ? (trainer_seconds(t) - t->phase_started) / length : 1;
}

// the average of the weights reads and writes all of them: once in a few steps is enough
enum { AVERAGE_EVERY = 8 };

static void take_average(trainer *t)
{
    const double n = (double)t->phase_step / AVERAGE_EVERY;
    const double decay = t->config->train.average > 0
                             ? fmin(pow(t->config->train.average, AVERAGE_EVERY), n / (n + 10))
                             : 0;
    average_update(&t->refine, decay, trainer_threads(t));
}

sdm_status refine_run(trainer *t, sdm_error *err)
{
    const sdm_config *c = t->config;
    const double total = c->train.minutes * 60,
                 end = total - fmin(10, 0.03 * total); // the final evaluation needs the rest
    if (!(c->train.refine > 0)) return SDM_OK;
    refine_batch b = {0};
    sdm_status s = batch_create(t, (size_t)c->train.refine_batch, &b, err);
    int64_t last_step = t->phase_step;
    double last_time = trainer_seconds(t);
    double at = fraction_of_phase(t, end);
    while (!s && at < 1) {
        if ((s = trainer_take_samples(t, t->data.n_start + t->data.n_online, err))) break;
        if (trainer_cancelled(t)) {
            s = trainer_stop(t, err);
            break;
        }
        const double rate = c->train.refine_rate * schedule(at, c->train.warmup);
        if ((s = step(t, &b, rate, err))) break;
        t->step++, t->phase_step++;
        at = fraction_of_phase(t, end);
        if (t->phase_step % AVERAGE_EVERY == 0 || !(at < 1))
            take_average(t); // the last steps count too
        if (!isfinite(t->loss)) {
            s = sdm_fail(err, SDM_E_CONFIG,
                         "%s: training diverged at step %lld (loss is not a number): lower "
                         "train.refine_rate",
                         c->file, (long long)t->step);
            break;
        }
        const double now = trainer_seconds(t);
        if (trainer_by_time(t) ? now - t->last_evaluation >= c->train.evaluate_seconds
                               : t->phase_step % 500 == 0) {
            if ((s = refine_evaluate(t, t->refine.average, &t->heldout_mse, err))) break;
            t->last_evaluation = now;
            if ((s = trainer_metric(t, rate, err))) break;
        }
        if (now - last_time > 0.5) {
            trainer_report(t, trainer_fraction(t),
                           (double)(t->phase_step - last_step) * (double)b.rows / (now - last_time),
                           true);
            last_step = t->phase_step, last_time = now;
        }
        if (now - t->last_checkpoint > c->train.checkpoint_seconds) s = checkpoint_write(t, err);
    }
    batch_dispose(&b);
    return s;
}
