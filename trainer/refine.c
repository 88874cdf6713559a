/* End-to-end training: MLP, head, bases and mean map together, on maps. It starts from the spectral start and the fitted MLP, with a head by
   least squares on all local coefficients. Letters as in sdm/pod.h; B batch. */
#include <math.h>
#include <string.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#include "linalg.h"
#include "mlp.h"
#include "sdm/kernels.h"
#include "sdm/memory.h"
#include "streams.h"
#include "trainer.h"

// Adam steps in units of what a weight typically is: found by trial on the cochlea, within a factor of three of the best
#define HEAD_STEP 0.05f // times the deviation of the coefficient
#define BASIS_STEP 0.3f // times 1 / sqrt(voxels)
#define MEAN_STEP 0.05f // mm

typedef struct refine_batch {
    size_t rows;
    float *x, *z, *dz; // [B][I], [B][L], [B][W]
    float *c, *dc;     // [B][K]
    float *workspace, *gradient;
    size_t *slots;         // [B]
    double *loss;          // [n_blocks]
    size_t *basis_at;      // [n_blocks]
    size_t scratch_floats; // for each thread
    float *scratch;
    int n_scratch;
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
    sdm_free(b->basis_at);
    sdm_free(b->scratch);
}

enum { HEAD_ROWS = 256 };

static sdm_status batch_create(const trainer *t, size_t rows, refine_batch *b, sdm_error *err)
{
    const sdm_pod_arch *a = &t->arch;
    size_t voxels = 0, rank = 0, at = 0;
    *b = (refine_batch){.rows = rows, .n_scratch = t->n_threads};
    sdm_status s = SDM_ALLOC(&b->basis_at, a->n_blocks, "batch", err);
    for (size_t i = 0; i < a->n_blocks && !s; i++) {
        const sdm_pod_block *k = &t->blocks[i];
        if (sdm_pod_block_voxels(k) > voxels) voxels = sdm_pod_block_voxels(k);
        if (k->rank > rank) rank = k->rank;
        b->basis_at[i] = at;
        at += sdm_pod_block_voxels(k) * k->rank;
    }
    b->scratch_floats = 2 * rows * voxels + (rank + 1) * voxels;
    if (b->scratch_floats < HEAD_ROWS * a->n_latent) b->scratch_floats = HEAD_ROWS * a->n_latent;
    if (!s) s = SDM_ALLOC(&b->x, rows * a->n_inputs, "batch", err);
    if (!s) s = SDM_ALLOC(&b->z, rows * a->n_latent, "batch", err);
    if (!s) s = SDM_ALLOC(&b->dz, rows * a->width, "batch", err);
    if (!s) s = SDM_ALLOC(&b->c, rows * a->n_coefficients, "batch", err);
    if (!s) s = SDM_ALLOC(&b->dc, rows * a->n_coefficients, "batch", err);
    if (!s) s = SDM_ALLOC(&b->workspace, mlp_workspace(a, rows), "batch", err);
    if (!s) s = SDM_ALLOC(&b->gradient, mlp_count(a), "batch", err);
    if (!s) s = SDM_ALLOC(&b->slots, rows, "batch", err);
    if (!s) s = SDM_ALLOC(&b->loss, a->n_blocks, "batch", err);
    if (!s) s = SDM_ALLOC(&b->scratch, b->scratch_floats * (size_t)b->n_scratch, "batch", err);
    return s;
}

static int thread_number(void)
{
#ifdef _OPENMP
    return omp_get_thread_num();
#else
    return 0;
#endif
}

// z[rows][L] from products phi (one pointer a row) with MLP weights w
static void latent(const trainer *t, const float *w, refine_batch *b, size_t rows, const float *const *phi)
{
    const sdm_pod_arch *a = &t->arch;
    for (size_t i = 0; i < rows; i++) {
        memcpy(b->z + i * a->n_latent, phi[i], a->n_terms * sizeof *b->z);
        memcpy(b->x + i * a->n_inputs, phi[i] + 1, a->n_inputs * sizeof *b->x);
    }
    if (!a->depth) return;
    const float *h = mlp_forward(a, w, rows, b->x, b->workspace, trainer_threads(t));
    for (size_t i = 0; i < rows; i++)
        memcpy(b->z + i * a->n_latent + a->n_terms, h + i * a->width, a->width * sizeof *h);
}

static void coefficients(const trainer *t, const float *w, refine_batch *b, size_t rows)
{
    const sdm_pod_arch *a = &t->arch;
    sdm_gemm(rows, a->n_coefficients, a->n_latent, (sdm_view){b->z, a->n_latent, 1},
             (sdm_view){w + t->head_at, 1, a->n_latent}, false, b->c, a->n_coefficients, trainer_threads(t));
}

// gradient of the loss in one voxel (mean over the batch, not yet over voxels); *sum gets the loss as mean square error
static float loss_gradient(const sdm_config *c, float predicted, float target, double *sum)
{
    const float e = predicted - target;
    const float weight = fabsf(target) < (float)c->train.near_mm ? 1 + (float)c->train.near_weight : 1;
    *sum += (double)e * e;
    switch (c->train.loss) {
    case SDM_LOSS_L1:
        return weight * (e > 0 ? 1.0f : e < 0 ? -1.0f : 0.0f);
    case SDM_LOSS_HUBER: {
        const float knee = 0.01f; // mm: square below, linear above
        return weight * (fabsf(e) < knee ? e / knee : e > 0 ? 1.0f : -1.0f);
    }
    case SDM_LOSS_MSE:
        break;
    }
    return weight * 2 * e;
}

// forward, backward and update of block i on the batch
static void train_block(trainer *t, refine_batch *b, size_t i, adam_step adam)
{
    const sdm_pod_block *k = &t->blocks[i];
    const size_t voxels = sdm_pod_block_voxels(k), rows = b->rows, n_c = t->arch.n_coefficients;
    float *predicted = b->scratch + b->scratch_floats * (size_t)thread_number(), *delta = predicted + rows * voxels;
    float *gradient = delta + rows * voxels, *mean_gradient = gradient + k->rank * voxels;
    float *mean = t->refine.w + t->mean_at + k->voxel, *basis = t->refine.w + t->basis_at + b->basis_at[i];
    const float *c = b->c + k->coefficient;

    for (size_t r = 0; r < rows; r++) memcpy(predicted + r * voxels, mean, voxels * sizeof *mean);
    sdm_gemm(rows, voxels, k->rank, (sdm_view){c, n_c, 1}, (sdm_view){basis, voxels, 1}, true, predicted, voxels, 1);
    double sum = 0;
    for (size_t r = 0; r < rows; r++) {
        const int16_t *target = t->data.maps + b->slots[r] * t->data.n_voxels + k->voxel;
        const float scale = t->data.scale[b->slots[r]];
        for (size_t v = 0; v < voxels; v++)
            delta[r * voxels + v] = loss_gradient(t->config, predicted[r * voxels + v], scale * (float)target[v], &sum);
    }
    b->loss[i] = sum;
    memset(mean_gradient, 0, voxels * sizeof *mean_gradient);
    for (size_t r = 0; r < rows; r++)
        for (size_t v = 0; v < voxels; v++) mean_gradient[v] += delta[r * voxels + v];
    sdm_gemm(rows, k->rank, voxels, (sdm_view){delta, voxels, 1}, (sdm_view){basis, 1, voxels}, false,
             b->dc + k->coefficient, n_c, 1);
    sdm_gemm(k->rank, voxels, rows, (sdm_view){c, 1, n_c}, (sdm_view){delta, voxels, 1}, false, gradient, voxels, 1);
    adam_update(&t->refine, t->basis_at + b->basis_at[i], k->rank * voxels, gradient, adam,
                BASIS_STEP / sqrtf((float)voxels));
    adam_update(&t->refine, t->mean_at + k->voxel, voxels, mean_gradient, adam, MEAN_STEP);
}

static void train_head(trainer *t, refine_batch *b, adam_step adam)
{
    const sdm_pod_arch *a = &t->arch;
    const size_t n_c = a->n_coefficients, latents = a->n_latent;
#ifdef _OPENMP
#pragma omp parallel for schedule(static) num_threads(trainer_threads(t))
#endif
    for (long at = 0; at < (long)n_c; at += HEAD_ROWS) {
        const size_t first = (size_t)at, rows = n_c - first < HEAD_ROWS ? n_c - first : HEAD_ROWS;
        float *gradient = b->scratch + b->scratch_floats * (size_t)thread_number();
        sdm_gemm(rows, latents, b->rows, (sdm_view){b->dc + first, 1, n_c}, (sdm_view){b->z, latents, 1}, false,
                 gradient, latents, 1);
        for (size_t i = 0; i < rows; i++)
            adam_update(&t->refine, t->head_at + (first + i) * latents, latents, gradient + i * latents, adam,
                        HEAD_STEP * t->deviation[first + i]);
    }
}

static sdm_status step(trainer *t, refine_batch *b, double rate, sdm_error *err)
{
    const sdm_pod_arch *a = &t->arch;
    const float **phi = NULL;
    const sdm_status s = SDM_ALLOC(&phi, b->rows, "batch", err);
    if (s) return s;
    for (size_t i = 0; i < b->rows; i++) {
        b->slots[i] =
            dataset_draw(&t->data, STREAM_REFINE, t->config->data.static_share, b->rows, (uint64_t)t->step, i);
        phi[i] = t->phi + b->slots[i] * t->n_poly;
    }
    const float *w = t->refine.w;
    latent(t, w, b, b->rows, phi);
    sdm_free((void *)phi);
    coefficients(t, w, b, b->rows);
    const adam_step adam = adam_begin(rate, t->phase_step + 1);
#ifdef _OPENMP
#pragma omp parallel for schedule(dynamic) num_threads(trainer_threads(t))
#endif
    for (long i = 0; i < (long)a->n_blocks; i++) train_block(t, b, (size_t)i, adam);
    double sum = 0;
    for (size_t i = 0; i < a->n_blocks; i++) sum += b->loss[i];
    t->loss = sum / ((double)b->rows * (double)t->data.n_voxels);

    // the MLP's gradient needs the head as it was in the forward pass
    if (a->depth) {
        sdm_gemm(b->rows, a->width, a->n_coefficients, (sdm_view){b->dc, a->n_coefficients, 1},
                 (sdm_view){w + t->head_at + a->n_terms, a->n_latent, 1}, false, b->dz, a->width, trainer_threads(t));
        mlp_backward(a, w, b->rows, b->x, b->workspace, b->dz, b->gradient, trainer_threads(t));
    }
    train_head(t, b, adam);
    if (a->depth) adam_update(&t->refine, 0, mlp_count(a), b->gradient, adam, 1);
    return SDM_OK;
}

sdm_status refine_evaluate(trainer *t, const float *w, double *mse, sdm_error *err)
{
    enum { ROWS = 32 };
    const sdm_pod_arch *a = &t->arch;
    const dataset *d = &t->data;
    refine_batch b = {0};
    sdm_status s = batch_create(t, ROWS, &b, err);
    double sum = 0;
    for (size_t at = 0; at < d->n_holdout && !s; at += ROWS) {
        const size_t rows = d->n_holdout - at < ROWS ? d->n_holdout - at : ROWS;
        const float *phi[ROWS];
        for (size_t i = 0; i < rows; i++) phi[i] = t->holdout_phi + (at + i) * t->n_poly;
        latent(t, w, &b, rows, phi);
        coefficients(t, w, &b, rows);
#ifdef _OPENMP
#pragma omp parallel for schedule(dynamic) num_threads(trainer_threads(t))
#endif
        for (long i = 0; i < (long)a->n_blocks; i++) {
            const sdm_pod_block *k = &t->blocks[i];
            const size_t voxels = sdm_pod_block_voxels(k);
            float *predicted = b.scratch + b.scratch_floats * (size_t)thread_number();
            for (size_t r = 0; r < rows; r++)
                memcpy(predicted + r * voxels, w + t->mean_at + k->voxel, voxels * sizeof *w);
            sdm_gemm(rows, voxels, k->rank, (sdm_view){b.c + k->coefficient, a->n_coefficients, 1},
                     (sdm_view){w + t->basis_at + b.basis_at[i], voxels, 1}, true, predicted, voxels, 1);
            double block_sum = 0;
            for (size_t r = 0; r < rows; r++) {
                const float *truth = d->holdout + (at + r) * d->n_voxels + k->voxel;
                for (size_t v = 0; v < voxels; v++) {
                    const double e = (double)predicted[r * voxels + v] - truth[v];
                    block_sum += e * e;
                }
            }
            b.loss[i] = block_sum;
        }
        for (size_t i = 0; i < a->n_blocks; i++) sum += b.loss[i];
    }
    batch_dispose(&b);
    *mse = sum / ((double)d->n_holdout * (double)d->n_voxels);
    return s;
}

// ---- start: the head by least squares ----

typedef struct head_problem {
    size_t n;       // rows: filled slots
    float *z;       // [n][L]
    double *factor; // Cholesky factor of z^T z
} head_problem;

// rows of the head for block i: least squares of its coefficients on z over all slots
static sdm_status solve_block(const trainer *t, const head_problem *p, const sdm_pod_block *k, const float *basis,
                              float *head, sdm_error *err)
{
    enum { CHUNK = 1024 };
    const dataset *d = &t->data;
    const size_t voxels = sdm_pod_block_voxels(k), latents = t->arch.n_latent, rank = k->rank;
    float *rows = NULL, *y = NULL, *right = NULL;
    double *solution = NULL;
    sdm_status s = SDM_ALLOC(&rows, CHUNK * voxels, "head", err);
    if (!s) s = SDM_ALLOC(&y, CHUNK * rank, "head", err);
    if (!s) s = SDM_ALLOC(&right, latents * rank, "head", err);
    if (!s) s = SDM_ALLOC(&solution, latents * rank, "head", err);
    for (size_t at = 0; at < p->n && !s; at += CHUNK) {
        const size_t n = p->n - at < CHUNK ? p->n - at : CHUNK;
        for (size_t i = 0; i < n; i++) {
            const int16_t *from = d->maps + (at + i) * d->n_voxels + k->voxel;
            for (size_t v = 0; v < voxels; v++)
                rows[i * voxels + v] = d->scale[at + i] * (float)from[v] - t->mean[k->voxel + v];
        }
        sdm_gemm(n, rank, voxels, (sdm_view){rows, voxels, 1}, (sdm_view){basis, 1, voxels}, false, y, rank, 1);
        sdm_gemm(latents, rank, n, (sdm_view){p->z + at * latents, 1, latents}, (sdm_view){y, rank, 1}, at > 0, right,
                 rank, 1);
    }
    if (!s) {
        for (size_t i = 0; i < latents * rank; i++) solution[i] = right[i];
        cholesky_solve(latents, p->factor, rank, solution);
        for (size_t i = 0; i < latents; i++)
            for (size_t j = 0; j < rank; j++) head[j * latents + i] = (float)solution[i * rank + j];
    }
    sdm_free(solution);
    sdm_free(right);
    sdm_free(y);
    sdm_free(rows);
    return s;
}

static sdm_status problem_create(trainer *t, head_problem *p, sdm_error *err)
{
    enum { CHUNK = 512 };
    const sdm_pod_arch *a = &t->arch;
    const size_t latents = a->n_latent;
    p->n = t->data.n_static + dataset_random_slots(&t->data);
    float *gram = NULL;
    refine_batch b = {0};
    sdm_status s = SDM_ALLOC(&p->z, p->n * latents, "head", err);
    if (!s) s = SDM_ALLOC(&gram, latents * latents, "head", err);
    if (!s) s = SDM_ALLOC(&p->factor, latents * latents, "head", err);
    if (!s) s = SDM_ALLOC(&b.x, CHUNK * a->n_inputs, "head", err);
    if (!s) s = SDM_ALLOC(&b.z, CHUNK * latents, "head", err);
    if (!s) s = SDM_ALLOC(&b.workspace, mlp_workspace(a, CHUNK), "head", err);
    for (size_t at = 0; at < p->n && !s; at += CHUNK) {
        const size_t rows = p->n - at < CHUNK ? p->n - at : CHUNK;
        const float *phi[CHUNK];
        for (size_t i = 0; i < rows; i++) phi[i] = t->phi + (at + i) * t->n_poly;
        latent(t, t->refine.w, &b, rows, phi);
        memcpy(p->z + at * latents, b.z, rows * latents * sizeof *b.z);
    }
    batch_dispose(&b);
    if (!s) {
        sdm_gemm(latents, latents, p->n, (sdm_view){p->z, 1, latents}, (sdm_view){p->z, latents, 1}, false, gram,
                 latents, trainer_threads(t));
        // hidden units may depend on each other linearly: a ridge relative to their size, raised until the system is definite
        for (double ridge = 1e-6;; ridge *= 10) {
            for (size_t i = 0; i < latents * latents; i++)
                p->factor[i] = 0.5 * ((double)gram[i] + gram[i % latents * latents + i / latents]);
            for (size_t i = 0; i < latents; i++) p->factor[i * latents + i] += ridge * (double)p->n;
            if (!cholesky(latents, p->factor)) break;
            if (ridge > 1) {
                s = sdm_fail(err, SDM_E_INTERNAL, "the head's least squares has no solution");
                break;
            }
        }
    }
    sdm_free(gram);
    return s;
}

sdm_status refine_start(trainer *t, sdm_error *err)
{
    const sdm_pod_arch *a = &t->arch;
    size_t basis_count = 0;
    for (size_t i = 0; i < a->n_blocks; i++) basis_count += sdm_pod_block_voxels(&t->blocks[i]) * t->blocks[i].rank;
    t->head_at = mlp_count(a);
    t->mean_at = t->head_at + a->n_coefficients * a->n_latent;
    t->basis_at = t->mean_at + a->n_voxels;
    sdm_status s = parameters_create(&t->refine, t->basis_at + basis_count, err);
    if (s) return s;
    if (a->depth) memcpy(t->refine.w, t->fit.average, mlp_count(a) * sizeof *t->refine.w);
    memcpy(t->refine.w + t->mean_at, t->mean, a->n_voxels * sizeof *t->mean);
    memcpy(t->refine.w + t->basis_at, t->basis, basis_count * sizeof *t->basis);

    head_problem p = {0};
    long failed = -1;
    sdm_error first = {0};
    refine_batch b = {0};
    if (!(s = problem_create(t, &p, err))) s = batch_create(t, 1, &b, err); // for basis_at
    if (!s) {
#ifdef _OPENMP
#pragma omp parallel for schedule(dynamic) num_threads(trainer_threads(t))
#endif
        for (long i = 0; i < (long)a->n_blocks; i++) {
            sdm_error mine = {0};
            const sdm_pod_block *k = &t->blocks[i];
            const sdm_status one = solve_block(t, &p, k, t->basis + b.basis_at[i],
                                               t->refine.w + t->head_at + (size_t)k->coefficient * a->n_latent, &mine);
            if (one) {
#ifdef _OPENMP
#pragma omp critical(sdm_refine_start)
#endif
                if (failed < 0 || i < failed) failed = i, first = mine;
            }
        }
    }
    if (!s && failed >= 0) {
        s = first.status;
        if (err) *err = first;
    }
    batch_dispose(&b);
    sdm_free(p.factor);
    sdm_free(p.z);
    if (!s) memcpy(t->refine.average, t->refine.w, t->refine.n * sizeof *t->refine.w);
    return s;
}

static double fraction_of_phase(const trainer *t, double end)
{
    if (!trainer_by_time(t)) return (double)t->phase_step / (double)(trainer_steps(t) - trainer_fit_steps(t));
    const double length = end - t->phase_started;
    return length > 0 ? (trainer_seconds(t) - t->phase_started) / length : 1;
}

// the average of the weights reads and writes all of them: once in a few steps is enough
enum { AVERAGE_EVERY = 8 };

static void take_average(trainer *t)
{
    const double n = (double)t->phase_step / AVERAGE_EVERY;
    const double decay =
        t->config->train.average > 0 ? fmin(pow(t->config->train.average, AVERAGE_EVERY), n / (n + 10)) : 0;
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
    for (double at; !s && (at = fraction_of_phase(t, end)) < 1;) {
        if ((s = trainer_take_samples(t, t->data.n_start + t->data.n_online, err))) break;
        if (trainer_cancelled(t)) {
            s = trainer_stop(t, err);
            break;
        }
        const double rate = c->train.refine_rate * schedule(at, c->train.warmup);
        if ((s = step(t, &b, rate, err))) break;
        t->step++, t->phase_step++;
        if (t->phase_step % AVERAGE_EVERY == 0) take_average(t);
        if (!isfinite(t->loss)) {
            s = sdm_fail(err, SDM_E_CONFIG,
                         "%s: training diverged at step %lld (loss is not a number): lower train.refine_rate", c->file,
                         (long long)t->step);
            break;
        }
        const double now = trainer_seconds(t);
        if (trainer_by_time(t) ? now - t->last_evaluation >= c->train.evaluate_seconds : t->phase_step % 500 == 0) {
            if ((s = refine_evaluate(t, t->refine.average, &t->heldout_mse, err))) break;
            t->last_evaluation = now;
            if ((s = trainer_metric(t, rate, err))) break;
        }
        if (now - last_time > 0.5) {
            trainer_report(t, trainer_fraction(t),
                           (double)(t->phase_step - last_step) * (double)b.rows / (now - last_time), true);
            last_step = t->phase_step, last_time = now;
        }
        if (now - t->last_checkpoint > c->train.checkpoint_seconds) s = checkpoint_write(t, err);
    }
    if (!s && t->phase_step % AVERAGE_EVERY) take_average(t); // the last steps count too
    batch_dispose(&b);
    return s;
}
