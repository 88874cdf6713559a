/* The head by least squares: the best linear layer from the latent variables to the coefficients of
 * the highest level. */
#include <string.h>

#include "coefficients.h"
#include "linalg.h"
#include "mlp.h"
#include "sdm/internal/kernels.h"
#include "sdm/memory.h"
#include "trainer.h"

void head_latent(const trainer *t, const float *w, size_t rows, const float *const *phi, float *x,
                 float *z, float *workspace)
{
    const sdm_pod_arch *a = &t->arch;
    for (size_t i = 0; i < rows; i++) {
        memcpy(z + i * a->n_latent, phi[i], a->n_terms * sizeof *z);
        memcpy(x + i * a->n_inputs, phi[i] + 1, a->n_inputs * sizeof *x);
    }
    if (!a->depth) return;
    const float *h = mlp_forward(a, w, rows, x, workspace, trainer_threads(t));
    for (size_t i = 0; i < rows; i++)
        memcpy(z + i * a->n_latent + a->n_terms, h + i * a->width, a->width * sizeof *h);
}

// z[n][L] of the first n slots
static sdm_status all_latent(const trainer *t, const float *w, size_t n, float *z, sdm_error *err)
{
    enum { CHUNK = 512 };
    const sdm_pod_arch *a = &t->arch;
    float *x = NULL, *workspace = NULL;
    sdm_status s = SDM_ALLOC(&x, CHUNK * a->n_inputs, "head", err);
    if (!s) s = SDM_ALLOC(&workspace, mlp_workspace(a, CHUNK), "head", err);
    for (size_t at = 0; at < n && !s; at += CHUNK) {
        const size_t rows = n - at < CHUNK ? n - at : CHUNK;
        const float *phi[CHUNK];
        for (size_t i = 0; i < rows; i++) phi[i] = t->phi + (at + i) * t->n_poly;
        head_latent(t, w, rows, phi, x, z + at * a->n_latent, workspace);
    }
    sdm_free(workspace);
    sdm_free(x);
    return s;
}

// Cholesky factor of z^T z, factor[L][L]
static sdm_status factorise(const trainer *t, size_t n, const float *z, double *factor,
                            sdm_error *err)
{
    const size_t latents = t->arch.n_latent;
    float *gram = NULL;
    sdm_status s = SDM_ALLOC(&gram, latents * latents, "head", err);
    if (s) return s;
    sdm_gemm(latents, latents, n, (sdm_view){z, 1, latents}, (sdm_view){z, latents, 1}, false, gram,
             latents, trainer_threads(t));
    // hidden units may depend on each other linearly: a ridge, raised until the system is definite
    for (double ridge = 1e-6;; ridge *= 10) {
        for (size_t i = 0; i < latents * latents; i++)
            factor[i] = 0.5 * ((double)gram[i] + gram[i % latents * latents + i / latents]);
        for (size_t i = 0; i < latents; i++) factor[i * latents + i] += ridge * (double)n;
        if (!cholesky(latents, factor)) break;
        if (ridge > 1) {
            s = sdm_fail(err, SDM_E_INTERNAL, "the head's least squares has no solution");
            break;
        }
    }
    sdm_free(gram);
    return s;
}

// head[K][L] from right[L][K] = z^T y
static sdm_status solve(const trainer *t, const double *factor, const float *right, float *head,
                        sdm_error *err)
{
    enum { COLUMNS = 64 };
    const size_t latents = t->arch.n_latent, k = t->arch.n_coefficients;
    bool short_of_memory = false;
#pragma omp parallel for schedule(dynamic) num_threads(trainer_threads(t))
    for (long first = 0; first < (long)k; first += COLUMNS) {
        const size_t at = (size_t)first, n = k - at < COLUMNS ? k - at : COLUMNS;
        double *x = NULL;
        if (SDM_ALLOC(&x, latents * n, "head", NULL)) {
#pragma omp atomic write
            short_of_memory = true;
            continue;
        }
        for (size_t i = 0; i < latents; i++)
            for (size_t j = 0; j < n; j++) x[i * n + j] = right[i * k + at + j];
        cholesky_solve(latents, factor, n, x);
        for (size_t j = 0; j < n; j++)
            for (size_t i = 0; i < latents; i++) head[(at + j) * latents + i] = (float)x[i * n + j];
        sdm_free(x);
    }
    return short_of_memory ? sdm_fail(err, SDM_E_NOMEM, "no memory for the head") : SDM_OK;
}

sdm_status head_solve(const trainer *t, const float *w, float *head, sdm_error *err)
{
    enum { CHUNK = 1024 };
    const size_t n = t->data.n_static + dataset_random_slots(&t->data);
    const size_t latents = t->arch.n_latent, k = t->arch.n_coefficients;
    float *z = NULL, *y = NULL, *right = NULL;
    double *factor = NULL;
    size_t *slots = NULL;
    sdm_status s = SDM_ALLOC(&z, n * latents, "head", err);
    if (!s) s = SDM_ALLOC(&y, CHUNK * k, "head", err);
    if (!s) s = SDM_ALLOC(&right, latents * k, "head", err);
    if (!s) s = SDM_ALLOC(&factor, latents * latents, "head", err);
    if (!s) s = bases_slots(n, &slots, err);
    if (!s) s = all_latent(t, w, n, z, err);
    for (size_t at = 0; at < n && !s; at += CHUNK) {
        const size_t rows = n - at < CHUNK ? n - at : CHUNK;
        if ((s = coefficients_of(t, false, slots + at, rows, y, err))) break;
        sdm_gemm(latents, k, rows, (sdm_view){z + at * latents, 1, latents}, (sdm_view){y, k, 1},
                 at > 0, right, k, trainer_threads(t));
    }
    if (!s) s = factorise(t, n, z, factor, err);
    if (!s) s = solve(t, factor, right, head, err);
    sdm_free(slots);
    sdm_free(factor);
    sdm_free(right);
    sdm_free(y);
    sdm_free(z);
    return s;
}
