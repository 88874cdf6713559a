/* Computes the global modes of the local coefficients, fits the mode coefficients by polynomials,
 * and computes the remainder that the polynomials leave over: the targets of the MLP. */
#include "modes.h"

#include <math.h>
#include <string.h>

#include "coefficients.h"
#include "data/streams.h"
#include "numerics/linalg.h"
#include "sdm/internal/kernels.h"
#include "sdm/memory.h"
#include "state/progress.h"

/* phi[n_poly] = products of polynomials at parameters p. */
static void pod_phi(const pod_state *pod, const double *p, float *phi)
{
    double x[SDM_POD_MAX_PARAMS];
    const dataset *d = &pod->t->data;
    for (size_t i = 0; i < d->n_params; i++)
        x[i] = 2 * (p[i] - d->min[i]) / (d->max[i] - d->min[i]) - 1;
    const size_t degree =
        pod->arch.degree > pod->arch.input_degree ? pod->arch.degree : pod->arch.input_degree;
    sdm_poly_eval(pod->exponents, pod->n_poly, d->n_params, degree, x, phi, NULL);
}

/* targets[i] = (c[i] - poly * phi[i]) / target_scale for the n rows of c[n][R]. */
static sdm_status subtract_polynomials(const pod_state *pod, size_t n, const float *phi,
                                       const float *c, float *const *targets, sdm_error *err)
{
    const size_t r = pod->n_modes, f = pod->arch.n_terms;
    float *fitted = NULL;
    const sdm_status s = SDM_ALLOC(&fitted, n * r, "targets", err);
    if (s) return s;
    sdm_gemm(n, r, f, (sdm_view){phi, pod->n_poly, 1}, (sdm_view){pod->poly, 1, f}, false, fitted,
             r, trainer_threads(pod->t));
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < r; j++)
            targets[i][j] = (c[i * r + j] - fitted[i * r + j]) / pod->target_scale;
    sdm_free(fitted);
    return SDM_OK;
}

/* c[n][R] = mode coefficients, computed from the coefficients y[n][K] of the highest level. */
static void modes_from_coefficients(const pod_state *pod, size_t n, const float *y, float *c)
{
    const size_t k = pod->arch.n_coefficients, r = pod->n_modes;
    sdm_gemm(n, r, k, (sdm_view){y, k, 1}, (sdm_view){pod->modes, 1, k}, false, c, r,
             trainer_threads(pod->t));
}

sdm_status trainer_modes_project(pod_state *pod, const size_t *slots, size_t n, sdm_error *err)
{
    const size_t k = pod->arch.n_coefficients, r = pod->n_modes;
    float *y = NULL, *c = NULL, *phi = NULL, **targets = NULL;
    sdm_status s = SDM_ALLOC(&y, n * k, "projection", err);
    if (!s) s = SDM_ALLOC(&c, n * r, "projection", err);
    if (!s) s = SDM_ALLOC(&phi, n * pod->n_poly, "projection", err);
    if (!s) s = SDM_ALLOC(&targets, n, "projection", err);
    if (!s) s = trainer_coefficients_project(pod, false, slots, n, y, err);
    for (size_t i = 0; i < n && !s; i++) {
        float *row = pod->phi + slots[i] * pod->n_poly;
        pod_phi(pod, pod->t->data.params + slots[i] * pod->t->data.n_params, row);
        memcpy(phi + i * pod->n_poly, row, pod->n_poly * sizeof *phi);
        targets[i] = pod->target + slots[i] * r;
    }
    if (!s) {
        modes_from_coefficients(pod, n, y, c);
        s = subtract_polynomials(pod, n, phi, c, targets, err);
    }
    sdm_free(targets);
    sdm_free(phi);
    sdm_free(c);
    sdm_free(y);
    return s;
}

/* poly[R][F] = least squares fit of c[n][R] by the polynomials, with a ridge far below
   the noise. */
static sdm_status fit_polynomials(pod_state *pod, size_t n, const float *c, sdm_error *err)
{
    const size_t f = pod->arch.n_terms, r = pod->n_modes;
    float *gram = NULL, *right = NULL;
    double *a = NULL, *b = NULL;
    sdm_status s = SDM_ALLOC(&gram, f * f, "polynomial fit", err);
    if (!s) s = SDM_ALLOC(&right, f * r, "polynomial fit", err);
    if (!s) s = SDM_ALLOC(&a, f * f, "polynomial fit", err);
    if (!s) s = SDM_ALLOC(&b, f * r, "polynomial fit", err);
    if (s) goto done;
    // normal equations
    sdm_gemm(f, f, n, (sdm_view){pod->phi, 1, pod->n_poly}, (sdm_view){pod->phi, pod->n_poly, 1},
             false, gram, f, pod->t->n_threads);
    sdm_gemm(f, r, n, (sdm_view){pod->phi, 1, pod->n_poly}, (sdm_view){c, r, 1}, false, right, r,
             pod->t->n_threads);
    // solve the normal equations
    for (size_t i = 0; i < f * f; i++) a[i] = gram[i];
    for (size_t i = 0; i < f; i++) a[i * f + i] += 1e-6 * (double)n;
    for (size_t i = 0; i < f * r; i++) b[i] = right[i];
    if (trainer_cholesky(f, a)) {
        s = sdm_fail(err, SDM_E_CONFIG,
                     "%s: %zu maps cannot determine polynomials of %zu terms: lower network.degree "
                     "or raise data.start",
                     pod->t->config->file, n, f);
        goto done;
    }
    trainer_cholesky_solve(f, a, r, b);
    for (size_t i = 0; i < f; i++)
        for (size_t j = 0; j < r; j++) pod->poly[j * f + i] = (float)b[i * r + j];
done:
    sdm_free(b);
    sdm_free(a);
    sdm_free(right);
    sdm_free(gram);
    return s;
}

/* Computes the targets of the held-out maps, and the mean square error on these maps that remains
 * with exact mode coefficients. */
static sdm_status project_holdout(pod_state *pod, sdm_error *err)
{
    const size_t h = pod->t->data.n_holdout, k = pod->arch.n_coefficients, r = pod->n_modes;
    size_t *slots = NULL;
    float *y = NULL, *c = NULL, **targets = NULL;
    sdm_status s = SDM_ALLOC(&y, h * k, "held-out targets", err);
    if (!s) s = SDM_ALLOC(&c, h * r, "held-out targets", err);
    if (!s) s = SDM_ALLOC(&targets, h, "held-out targets", err);
    // mode coefficients of the held-out maps
    if (!s) s = trainer_dataset_first_slots(h, &slots, err);
    if (!s) s = trainer_coefficients_project(pod, true, slots, h, y, err);
    if (!s) {
        modes_from_coefficients(pod, h, y, c);
        // orthonormal bases and modes: energy of the map minus that of its mode coefficients
        double energy = 0;
        for (size_t i = 0; i < h; i++) {
            for (size_t v = 0; v < pod->t->data.n_voxels; v++) {
                const double e = pod->t->data.holdout[i * pod->t->data.n_voxels + v] - pod->mean[v];
                energy += e * e;
            }
            for (size_t j = 0; j < r; j++) energy -= (double)c[i * r + j] * c[i * r + j];
            pod_phi(pod, pod->t->data.holdout_params + i * pod->t->data.n_params,
                    pod->holdout_phi + i * pod->n_poly);
            targets[i] = pod->holdout_target + i * r;
        }
        // clamped at 0: rounding could make the difference negative
        pod->holdout_floor = fmax(0, energy / ((double)h * (double)pod->t->data.n_voxels));
        s = subtract_polynomials(pod, h, pod->holdout_phi, c, targets, err);
    }
    sdm_free(targets);
    sdm_free(c);
    sdm_free(slots);
    sdm_free(y);
    return s;
}

sdm_status trainer_modes_make(pod_state *pod, size_t n, sdm_error *err)
{
    const size_t k = pod->arch.n_coefficients;
    size_t r = (size_t)pod->t->config->network.modes;
    if (r > n) r = n;
    if (r > k) r = k;
    pod->n_modes = r;
    // arrays of the state, and scratch memory
    size_t *slots = NULL;
    float *y = NULL, *c = NULL, **targets = NULL;
    sdm_status s = SDM_ALLOC(&y, n * k, "local coefficients", err);
    if (!s) s = SDM_ALLOC(&c, n * r, "coefficients of the modes", err);
    if (!s) s = SDM_ALLOC(&targets, n, "targets", err);
    if (!s) s = SDM_ALLOC(&pod->modes, r * k, "global modes", err);
    if (!s) s = SDM_ALLOC(&pod->poly, r * pod->arch.n_terms, "polynomials", err);
    if (!s) s = SDM_ALLOC(&pod->deviation, k, "local coefficients", err);
    if (!s) s = SDM_ALLOC(&pod->phi, pod->t->data.n_slots * pod->n_poly, "polynomial inputs", err);
    if (!s) s = SDM_ALLOC(&pod->target, pod->t->data.n_slots * r, "targets", err);
    if (!s)
        s = SDM_ALLOC(&pod->holdout_phi, pod->t->data.n_holdout * pod->n_poly, "held-out inputs",
                      err);
    if (!s)
        s = SDM_ALLOC(&pod->holdout_target, pod->t->data.n_holdout * r, "held-out targets", err);
    if (!s) s = trainer_dataset_first_slots(n, &slots, err);
    // coefficients of the highest level and their root mean squares
    if (!s) s = trainer_coefficients_project(pod, false, slots, n, y, err);
    for (size_t j = 0; j < k && !s; j++) {
        double sum = 0;
        for (size_t i = 0; i < n; i++) sum += (double)y[i * k + j] * y[i * k + j];
        pod->deviation[j] = (float)sqrt(sum / (double)n);
    }
    // modes, and the polynomial part of their coefficients
    if (!s)
        s = trainer_leading_space(n, k, y, r, pod->t->config->seed, STREAM_BASES, pod->t->n_threads,
                                  pod->modes, err);
    if (!s) {
        modes_from_coefficients(pod, n, y, c);
        // inputs and target rows of the slots
        for (size_t i = 0; i < n; i++) {
            pod_phi(pod, pod->t->data.params + i * pod->t->data.n_params,
                    pod->phi + i * pod->n_poly);
            targets[i] = pod->target + i * r;
        }
        s = fit_polynomials(pod, n, c, err);
    }
    if (!s) {
        // targets: unscaled first, then divided by their root mean square
        pod->target_scale = 1;
        s = subtract_polynomials(pod, n, pod->phi, c, targets, err);
    }
    if (!s) {
        double sum = 0;
        for (size_t i = 0; i < n * r; i++) sum += (double)pod->target[i] * pod->target[i];
        const float scale = (float)sqrt(sum / (double)(n * r));
        pod->target_scale = scale > 0 ? scale : 1;
        for (size_t i = 0; i < n * r; i++) pod->target[i] /= pod->target_scale;
        s = project_holdout(pod, err);
    }
    sdm_free(targets);
    sdm_free(c);
    sdm_free(slots);
    sdm_free(y);
    return s;
}
