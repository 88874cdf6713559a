/* The global modes of the local coefficients and least squares of the modes on the polynomials;
 * what those leave is what the MLP learns. */
#include <math.h>
#include <string.h>

#include "coefficients.h"
#include "linalg.h"
#include "sdm/internal/kernels.h"
#include "sdm/memory.h"
#include "trainer.h"

void trainer_phi(const trainer *t, const double *p, float *phi)
{
    double x[SDM_POD_MAX_PARAMS];
    const dataset *d = &t->data;
    for (size_t i = 0; i < d->n_params; i++)
        x[i] = 2 * (p[i] - d->min[i]) / (d->max[i] - d->min[i]) - 1;
    const size_t degree =
        t->arch.degree > t->arch.input_degree ? t->arch.degree : t->arch.input_degree;
    sdm_poly_eval(t->exponents, t->n_poly, d->n_params, degree, x, phi, NULL);
}

// target = (c - poly phi) / scale for n rows; c[n][R]
static sdm_status leave(const trainer *t, size_t n, const float *phi, const float *c,
                        float *const *targets, sdm_error *err)
{
    const size_t r = t->n_modes, f = t->arch.n_terms;
    float *fitted = NULL;
    const sdm_status s = SDM_ALLOC(&fitted, n * r, "targets", err);
    if (s) return s;
    sdm_gemm(n, r, f, (sdm_view){phi, t->n_poly, 1}, (sdm_view){t->poly, 1, f}, false, fitted, r,
             trainer_threads(t));
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < r; j++)
            targets[i][j] = (c[i * r + j] - fitted[i * r + j]) / t->target_scale;
    sdm_free(fitted);
    return SDM_OK;
}

static void to_modes(const trainer *t, size_t n, const float *y, float *c)
{
    const size_t k = t->arch.n_coefficients, r = t->n_modes;
    sdm_gemm(n, r, k, (sdm_view){y, k, 1}, (sdm_view){t->modes, 1, k}, false, c, r,
             trainer_threads(t));
}

sdm_status modes_project(trainer *t, const size_t *slots, size_t n, sdm_error *err)
{
    const size_t k = t->arch.n_coefficients, r = t->n_modes;
    float *y = NULL, *c = NULL, *phi = NULL, **targets = NULL;
    sdm_status s = SDM_ALLOC(&y, n * k, "projection", err);
    if (!s) s = SDM_ALLOC(&c, n * r, "projection", err);
    if (!s) s = SDM_ALLOC(&phi, n * t->n_poly, "projection", err);
    if (!s) s = SDM_ALLOC(&targets, n, "projection", err);
    if (!s) s = coefficients_of(t, false, slots, n, y, err);
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
    sdm_gemm(f, f, n, (sdm_view){t->phi, 1, t->n_poly}, (sdm_view){t->phi, t->n_poly, 1}, false,
             gram, f, t->n_threads);
    sdm_gemm(f, r, n, (sdm_view){t->phi, 1, t->n_poly}, (sdm_view){c, r, 1}, false, right, r,
             t->n_threads);
    for (size_t i = 0; i < f * f; i++) a[i] = gram[i];
    for (size_t i = 0; i < f; i++) a[i * f + i] += 1e-6 * (double)n;
    for (size_t i = 0; i < f * r; i++) b[i] = right[i];
    if (cholesky(f, a)) {
        s = sdm_fail(err, SDM_E_CONFIG,
                     "%s: %zu maps cannot determine polynomials of %zu terms: lower network.degree "
                     "or raise data.start",
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
    size_t *slots = NULL;
    float *y = NULL, *c = NULL, **targets = NULL;
    sdm_status s = SDM_ALLOC(&y, h * k, "held-out targets", err);
    if (!s) s = SDM_ALLOC(&c, h * r, "held-out targets", err);
    if (!s) s = SDM_ALLOC(&targets, h, "held-out targets", err);
    if (!s) s = bases_slots(h, &slots, err);
    if (!s) s = coefficients_of(t, true, slots, h, y, err);
    if (!s) {
        to_modes(t, h, y, c);
        double energy = 0;
        for (size_t i = 0; i < h; i++) {
            for (size_t v = 0; v < t->data.n_voxels; v++) {
                const double e = t->data.holdout[i * t->data.n_voxels + v] - t->mean[v];
                energy += e * e;
            }
            for (size_t j = 0; j < r; j++) energy -= (double)c[i * r + j] * c[i * r + j];
            trainer_phi(t, t->data.holdout_params + i * t->data.n_params,
                        t->holdout_phi + i * t->n_poly);
            targets[i] = t->holdout_target + i * r;
        }
        t->holdout_floor =
            fmax(0, energy / ((double)h *
                              (double)t->data.n_voxels)); // a difference: rounding may pass zero
        s = leave(t, h, t->holdout_phi, c, targets, err);
    }
    sdm_free(targets);
    sdm_free(c);
    sdm_free(slots);
    sdm_free(y);
    return s;
}

sdm_status modes_make(trainer *t, size_t n, sdm_error *err)
{
    const size_t k = t->arch.n_coefficients;
    size_t r = (size_t)t->config->network.modes;
    if (r > n) r = n;
    if (r > k) r = k;
    t->n_modes = r;
    size_t *slots = NULL;
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
    if (!s) s = bases_slots(n, &slots, err);
    if (!s) s = coefficients_of(t, false, slots, n, y, err);
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
    sdm_free(slots);
    sdm_free(y);
    return s;
}
