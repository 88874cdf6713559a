/* The spectral start: local bases by proper orthogonal decomposition in blocks of voxels, global modes of their coefficients,
   least squares on the polynomials. Linear algebra on maps that are there: no optimiser yet. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#include "linalg.h"
#include "sdm/kernels.h"
#include "sdm/memory.h"
#include "streams.h"
#include "trainer.h"

// rows[n][V_b] of block b for the given slots (NULL: slot i for row i), without the mean
static void load_slots(const trainer *t, const sdm_pod_block *b, const size_t *slots, size_t n, float *rows)
{
    const dataset *d = &t->data;
    const size_t voxels = sdm_pod_block_voxels(b);
    const float *mean = t->mean + b->voxel;
    for (size_t i = 0; i < n; i++) {
        const size_t slot = slots ? slots[i] : i;
        const int16_t *from = d->maps + slot * d->n_voxels + b->voxel;
        const float scale = d->scale[slot];
        for (size_t v = 0; v < voxels; v++) rows[i * voxels + v] = scale * (float)from[v] - mean[v];
    }
}

typedef struct candidate {
    double value; // eigenvalue: variance it explains, mm^2
    uint32_t block, index;
} candidate;

static int by_value(const void *a, const void *b)
{
    const candidate *x = a, *y = b;
    if (x->value != y->value) return x->value < y->value ? 1 : -1;
    if (x->block != y->block) return x->block < y->block ? -1 : 1;
    return x->index < y->index ? -1 : 1;
}

// mean and leading eigenvectors of one block over the first n slots
static sdm_status block_basis(trainer *t, size_t index, size_t n, size_t keep, float *rows, float *covariance,
                              float *vectors, double *values, sdm_error *err)
{
    const sdm_pod_block *b = &t->blocks[index];
    const size_t voxels = sdm_pod_block_voxels(b);
    float *mean = t->mean + b->voxel;
    memset(mean, 0, voxels * sizeof *mean);
    load_slots(t, b, NULL, n, rows);
    for (size_t v = 0; v < voxels; v++) {
        double sum = 0;
        for (size_t i = 0; i < n; i++) sum += rows[i * voxels + v];
        mean[v] = (float)(sum / (double)n);
    }
    for (size_t i = 0; i < n; i++)
        for (size_t v = 0; v < voxels; v++) rows[i * voxels + v] -= mean[v];
    sdm_gemm(voxels, voxels, n, (sdm_view){rows, 1, voxels}, (sdm_view){rows, voxels, 1}, false, covariance, voxels, 1);
    for (size_t i = 0; i < voxels * voxels; i++) covariance[i] /= (float)n;
    return leading_eigenvectors(voxels, covariance, keep, t->config->seed, STREAM_BASES + 1 + index, vectors, values,
                                err);
}

// ranks: the functions that explain most over all blocks, at least one in each block
static sdm_status choose_ranks(trainer *t, const size_t *keep, const double *values, size_t stride, sdm_error *err)
{
    const size_t n_blocks = t->arch.n_blocks, wanted = (size_t)t->config->network.rank * n_blocks;
    candidate *c = NULL;
    size_t n = 0;
    const sdm_status s = SDM_ALLOC(&c, n_blocks * stride, "basis candidates", err);
    if (s) return s;
    for (size_t b = 0; b < n_blocks; b++) {
        t->blocks[b].rank = 1;
        for (size_t i = 1; i < keep[b]; i++) c[n++] = (candidate){values[b * stride + i], (uint32_t)b, (uint32_t)i};
    }
    qsort(c, n, sizeof *c, by_value);
    for (size_t i = 0; i < n && i + n_blocks < wanted; i++) t->blocks[c[i].block].rank++;
    sdm_free(c);
    t->arch.n_coefficients = 0;
    for (size_t b = 0; b < n_blocks; b++) {
        t->blocks[b].coefficient = (uint32_t)t->arch.n_coefficients;
        t->arch.n_coefficients += t->blocks[b].rank;
    }
    return SDM_OK;
}

static sdm_status local_bases(trainer *t, size_t n, sdm_error *err)
{
    const size_t n_blocks = t->arch.n_blocks, most = 4 * (size_t)t->config->network.rank;
    size_t largest = 0, *keep = NULL;
    for (size_t b = 0; b < n_blocks; b++)
        if (sdm_pod_block_voxels(&t->blocks[b]) > largest) largest = sdm_pod_block_voxels(&t->blocks[b]);
    const size_t stride = most < largest ? most : largest;
    float *vectors = NULL;
    double *values = NULL;
    sdm_status s = SDM_ALLOC(&keep, n_blocks, "local bases", err);
    if (!s) s = SDM_ALLOC(&vectors, t->arch.n_voxels * stride, "local bases", err);
    if (!s) s = SDM_ALLOC(&values, n_blocks * stride, "local bases", err);
    long failed = -1;
    sdm_error first = {0};
#ifdef _OPENMP
#pragma omp parallel num_threads(t->n_threads)
#endif
    {
        float *rows = NULL, *covariance = NULL;
        sdm_error mine = {0};
        sdm_status made = s;
        if (!made) made = SDM_ALLOC(&rows, n * largest, "local bases", &mine);
        if (!made) made = SDM_ALLOC(&covariance, largest * largest, "local bases", &mine);
#ifdef _OPENMP
#pragma omp for schedule(dynamic)
#endif
        for (long b = 0; b < (long)n_blocks; b++) {
            const size_t at = (size_t)b, voxels = sdm_pod_block_voxels(&t->blocks[at]);
            sdm_status mine_s = made;
            if (!mine_s) {
                keep[at] = stride < voxels ? stride : voxels;
                mine_s = block_basis(t, at, n, keep[at], rows, covariance, vectors + t->blocks[at].voxel * stride,
                                     values + at * stride, &mine);
            }
            if (mine_s) {
#ifdef _OPENMP
#pragma omp critical(sdm_local_bases)
#endif
                if (failed < 0 || b < failed) failed = b, first = mine;
            }
        }
        sdm_free(covariance);
        sdm_free(rows);
    }
    if (!s && failed >= 0) {
        s = first.status;
        if (err) *err = first;
    }
    if (!s) s = choose_ranks(t, keep, values, stride, err);
    size_t count = 0;
    for (size_t b = 0; b < n_blocks && !s; b++) count += t->blocks[b].rank * sdm_pod_block_voxels(&t->blocks[b]);
    if (!s) s = SDM_ALLOC(&t->basis, count, "local bases", err);
    float *to = t->basis;
    for (size_t b = 0; b < n_blocks && !s; b++) {
        const size_t voxels = sdm_pod_block_voxels(&t->blocks[b]), size = t->blocks[b].rank * voxels;
        memcpy(to, vectors + t->blocks[b].voxel * stride, size * sizeof *to);
        to += size;
    }
    sdm_free(values);
    sdm_free(vectors);
    sdm_free(keep);
    return s;
}

// local coefficients y[n][K] of slots (or of the first n held-out maps when `holdout`)
static sdm_status coefficients(const trainer *t, bool holdout, const size_t *slots, size_t n, float *y, sdm_error *err)
{
    const size_t k = t->arch.n_coefficients;
    sdm_status s = SDM_OK;
    const float *basis = t->basis;
    size_t largest = 0;
    size_t *basis_at = NULL;
    if ((s = SDM_ALLOC(&basis_at, t->arch.n_blocks, "local coefficients", err))) return s;
    size_t at = 0;
    for (size_t b = 0; b < t->arch.n_blocks; b++) {
        const size_t voxels = sdm_pod_block_voxels(&t->blocks[b]);
        if (voxels > largest) largest = voxels;
        basis_at[b] = at;
        at += voxels * t->blocks[b].rank;
    }
    bool short_of_memory = false;
#ifdef _OPENMP
#pragma omp parallel num_threads(trainer_threads(t))
#endif
    {
        float *rows = NULL;
        const sdm_status made = SDM_ALLOC(&rows, n * largest, "local coefficients", NULL);
        if (made) {
#ifdef _OPENMP
#pragma omp atomic write
#endif
            short_of_memory = true;
        }
#ifdef _OPENMP
#pragma omp for schedule(dynamic)
#endif
        for (long i = 0; i < (long)t->arch.n_blocks; i++) {
            if (made) continue;
            const sdm_pod_block *b = &t->blocks[i];
            const size_t voxels = sdm_pod_block_voxels(b);
            if (holdout) {
                for (size_t r = 0; r < n; r++)
                    for (size_t v = 0; v < voxels; v++)
                        rows[r * voxels + v] =
                            t->data.holdout[r * t->data.n_voxels + b->voxel + v] - t->mean[b->voxel + v];
            } else
                load_slots(t, b, slots, n, rows);
            sdm_gemm(n, b->rank, voxels, (sdm_view){rows, voxels, 1}, (sdm_view){basis + basis_at[i], 1, voxels}, false,
                     y + b->coefficient, k, 1);
        }
        sdm_free(rows);
    }
    sdm_free(basis_at);
    return short_of_memory ? sdm_fail(err, SDM_E_NOMEM, "no memory for local coefficients") : SDM_OK;
}

void trainer_phi(const trainer *t, const double *p, float *phi)
{
    double x[SDM_POD_MAX_PARAMS];
    const dataset *d = &t->data;
    for (size_t i = 0; i < d->n_params; i++) x[i] = 2 * (p[i] - d->min[i]) / (d->max[i] - d->min[i]) - 1;
    const size_t degree = t->arch.degree > t->arch.input_degree ? t->arch.degree : t->arch.input_degree;
    sdm_poly_eval(t->exponents, t->n_poly, d->n_params, degree, x, phi, NULL);
}

// target = (c - poly phi) / scale for n rows; c[n][R]
static sdm_status leave(const trainer *t, size_t n, const float *phi, const float *c, float *const *targets,
                        sdm_error *err)
{
    const size_t r = t->n_modes, f = t->arch.n_terms;
    float *fitted = NULL;
    const sdm_status s = SDM_ALLOC(&fitted, n * r, "targets", err);
    if (s) return s;
    sdm_gemm(n, r, f, (sdm_view){phi, t->n_poly, 1}, (sdm_view){t->poly, 1, f}, false, fitted, r, trainer_threads(t));
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < r; j++) targets[i][j] = (c[i * r + j] - fitted[i * r + j]) / t->target_scale;
    sdm_free(fitted);
    return SDM_OK;
}

static void to_modes(const trainer *t, size_t n, const float *y, float *c)
{
    const size_t k = t->arch.n_coefficients, r = t->n_modes;
    sdm_gemm(n, r, k, (sdm_view){y, k, 1}, (sdm_view){t->modes, 1, k}, false, c, r, trainer_threads(t));
}

sdm_status bases_project(trainer *t, const size_t *slots, size_t n, sdm_error *err)
{
    const size_t k = t->arch.n_coefficients, r = t->n_modes;
    float *y = NULL, *c = NULL, *phi = NULL, **targets = NULL;
    sdm_status s = SDM_ALLOC(&y, n * k, "projection", err);
    if (!s) s = SDM_ALLOC(&c, n * r, "projection", err);
    if (!s) s = SDM_ALLOC(&phi, n * t->n_poly, "projection", err);
    if (!s) s = SDM_ALLOC(&targets, n, "projection", err);
    if (!s) s = coefficients(t, false, slots, n, y, err);
    for (size_t i = 0; i < n && !s; i++) {
        float *row = t->phi + slots[i] * t->n_poly;
        trainer_phi(t, t->data.params + slots[i] * t->data.n_params, row);
        memcpy(phi + i * t->n_poly, row, t->n_poly * sizeof *phi);
        targets[i] = t->target + slots[i] * r;
    }
    if (!s) {
        to_modes(t, n, y, c);
        s = leave(t, n, phi, c, targets, err);
    }
    sdm_free(targets);
    sdm_free(phi);
    sdm_free(c);
    sdm_free(y);
    return s;
}

// least squares of c[n][R] on the polynomials (ridge far below the noise) -> poly[R][F]
static sdm_status fit_polynomials(trainer *t, size_t n, const float *c, sdm_error *err)
{
    const size_t f = t->arch.n_terms, r = t->n_modes;
    float *gram = NULL, *right = NULL;
    double *a = NULL, *b = NULL;
    sdm_status s = SDM_ALLOC(&gram, f * f, "polynomial fit", err);
    if (!s) s = SDM_ALLOC(&right, f * r, "polynomial fit", err);
    if (!s) s = SDM_ALLOC(&a, f * f, "polynomial fit", err);
    if (!s) s = SDM_ALLOC(&b, f * r, "polynomial fit", err);
    if (s) goto done;
    sdm_gemm(f, f, n, (sdm_view){t->phi, 1, t->n_poly}, (sdm_view){t->phi, t->n_poly, 1}, false, gram, f, t->n_threads);
    sdm_gemm(f, r, n, (sdm_view){t->phi, 1, t->n_poly}, (sdm_view){c, r, 1}, false, right, r, t->n_threads);
    for (size_t i = 0; i < f * f; i++) a[i] = gram[i];
    for (size_t i = 0; i < f; i++) a[i * f + i] += 1e-6 * (double)n;
    for (size_t i = 0; i < f * r; i++) b[i] = right[i];
    if (cholesky(f, a)) {
        s = sdm_fail(err, SDM_E_CONFIG,
                     "%s: %zu maps cannot determine polynomials of %zu terms: lower network.degree or raise data.start",
                     t->config->file, n, f);
        goto done;
    }
    cholesky_solve(f, a, r, b);
    for (size_t i = 0; i < f; i++)
        for (size_t j = 0; j < r; j++) t->poly[j * f + i] = (float)b[i * r + j];
done:
    sdm_free(b);
    sdm_free(a);
    sdm_free(right);
    sdm_free(gram);
    return s;
}

// held-out targets and what the bases cannot represent
static sdm_status project_holdout(trainer *t, sdm_error *err)
{
    const size_t h = t->data.n_holdout, k = t->arch.n_coefficients, r = t->n_modes;
    float *y = NULL, *c = NULL, **targets = NULL;
    sdm_status s = SDM_ALLOC(&y, h * k, "held-out targets", err);
    if (!s) s = SDM_ALLOC(&c, h * r, "held-out targets", err);
    if (!s) s = SDM_ALLOC(&targets, h, "held-out targets", err);
    if (!s) s = coefficients(t, true, NULL, h, y, err);
    if (!s) {
        to_modes(t, h, y, c);
        double energy = 0;
        for (size_t i = 0; i < h; i++) {
            for (size_t v = 0; v < t->data.n_voxels; v++) {
                const double e = t->data.holdout[i * t->data.n_voxels + v] - t->mean[v];
                energy += e * e;
            }
            for (size_t j = 0; j < r; j++) energy -= (double)c[i * r + j] * c[i * r + j];
            trainer_phi(t, t->data.holdout_params + i * t->data.n_params, t->holdout_phi + i * t->n_poly);
            targets[i] = t->holdout_target + i * r;
        }
        t->holdout_floor =
            fmax(0, energy / ((double)h * (double)t->data.n_voxels)); // a difference: rounding may pass zero
        s = leave(t, h, t->holdout_phi, c, targets, err);
    }
    sdm_free(targets);
    sdm_free(c);
    sdm_free(y);
    return s;
}

static sdm_status global_modes(trainer *t, size_t n, sdm_error *err)
{
    const size_t k = t->arch.n_coefficients;
    size_t r = (size_t)t->config->network.modes;
    if (r > n) r = n;
    if (r > k) r = k;
    t->n_modes = r;
    float *y = NULL, *c = NULL, **targets = NULL;
    sdm_status s = SDM_ALLOC(&y, n * k, "local coefficients", err);
    if (!s) s = SDM_ALLOC(&c, n * r, "coefficients of the modes", err);
    if (!s) s = SDM_ALLOC(&targets, n, "targets", err);
    if (!s) s = SDM_ALLOC(&t->modes, r * k, "global modes", err);
    if (!s) s = SDM_ALLOC(&t->poly, r * t->arch.n_terms, "polynomials", err);
    if (!s) s = SDM_ALLOC(&t->deviation, k, "local coefficients", err);
    if (!s) s = SDM_ALLOC(&t->phi, t->data.n_slots * t->n_poly, "polynomial inputs", err);
    if (!s) s = SDM_ALLOC(&t->target, t->data.n_slots * r, "targets", err);
    if (!s) s = SDM_ALLOC(&t->holdout_phi, t->data.n_holdout * t->n_poly, "held-out inputs", err);
    if (!s) s = SDM_ALLOC(&t->holdout_target, t->data.n_holdout * r, "held-out targets", err);
    if (!s) s = coefficients(t, false, NULL, n, y, err);
    for (size_t j = 0; j < k && !s; j++) {
        double sum = 0;
        for (size_t i = 0; i < n; i++) sum += (double)y[i * k + j] * y[i * k + j];
        t->deviation[j] = (float)sqrt(sum / (double)n);
    }
    if (!s) s = leading_space(n, k, y, r, t->config->seed, t->n_threads, t->modes, err);
    if (!s) {
        to_modes(t, n, y, c);
        for (size_t i = 0; i < n; i++) {
            trainer_phi(t, t->data.params + i * t->data.n_params, t->phi + i * t->n_poly);
            targets[i] = t->target + i * r;
        }
        s = fit_polynomials(t, n, c, err);
    }
    if (!s) {
        t->target_scale = 1;
        s = leave(t, n, t->phi, c, targets, err);
    }
    if (!s) {
        double sum = 0;
        for (size_t i = 0; i < n * r; i++) sum += (double)t->target[i] * t->target[i];
        const float scale = (float)sqrt(sum / (double)(n * r));
        t->target_scale = scale > 0 ? scale : 1;
        for (size_t i = 0; i < n * r; i++) t->target[i] /= t->target_scale;
        s = project_holdout(t, err);
    }
    sdm_free(targets);
    sdm_free(c);
    sdm_free(y);
    return s;
}

sdm_status bases_make(trainer *t, sdm_error *err)
{
    const size_t n = t->data.n_static + t->data.n_start;
    sdm_status s = SDM_ALLOC(&t->mean, t->arch.n_voxels, "mean map", err);
    if (!s) s = local_bases(t, n, err);
    return s ? s : global_modes(t, n, err);
}

void bases_dispose(trainer *t)
{
    sdm_free(t->mean);
    sdm_free(t->basis);
    sdm_free(t->deviation);
    sdm_free(t->modes);
    sdm_free(t->poly);
    sdm_free(t->phi);
    sdm_free(t->target);
    sdm_free(t->holdout_phi);
    sdm_free(t->holdout_target);
}
