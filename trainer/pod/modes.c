/* Computes the global modes of the local coefficients, fits the mode coefficients by polynomials,
 * and computes the remainder that the polynomials leave over: the targets of the MLP. */
#include "modes.h"

#include <math.h>
#include <string.h>

#include "coefficients.h"
#include "data/dataset_ranks.h"
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

/* c[n][R] = mode coefficients, computed from the coefficients y[n][K] of the highest level; each
 * rank computes those of some maps. */
static sdm_status modes_from_coefficients(const pod_state *pod, size_t n, const float *y, float *c,
                                          sdm_error *err)
{
    const size_t k = pod->arch.n_coefficients, r = pod->n_modes;
    const sdm_comm_part own = sdm_comm_own(pod->t->hooks.comm, n);
    sdm_gemm(own.end - own.first, r, k, (sdm_view){y + own.first * k, k, 1},
             (sdm_view){pod->modes, 1, k}, false, c + own.first * r, r, trainer_threads(pod->t));
    return sdm_comm_gather_shares(pod->t->hooks.comm, c, n, r * sizeof *c, err);
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
    if (!s) s = modes_from_coefficients(pod, n, y, c, err);
    if (!s) s = subtract_polynomials(pod, n, phi, c, targets, err);
    sdm_free(targets);
    sdm_free(phi);
    sdm_free(c);
    sdm_free(y);
    return s;
}

/* Least squares of c[n][R] by the first `terms` polynomials. */
typedef struct polynomial_fit {
    const pod_state *pod;
    size_t n;
    const float *c;
    size_t degree, terms; /* terms: number of polynomials up to this total degree */
    double ridge; /* added to the diagonal of the normal equations, times n, but for the constant */
} polynomial_fit;

static void set_degree(polynomial_fit *p, size_t degree)
{
    p->degree = degree;
    p->terms = sdm_poly_count(p->pod->arch.n_params, degree);
}

/* x[terms][R] = the solution for the maps whose number is not 3 mod 4; all: for all maps. Returns
 * SDM_E_CONFIG if the maps do not determine it. */
static sdm_status fit_solve(const polynomial_fit *p, bool all, double *x, sdm_error *err)
{
    const pod_state *pod = p->pod;
    const size_t f = p->terms, r = pod->n_modes, ld = pod->n_poly;
    float *gram = NULL, *right = NULL;
    double *a = NULL;
    sdm_status s = SDM_ALLOC(&gram, f * f, "polynomial fit", err);
    if (!s) s = SDM_ALLOC(&right, f * r, "polynomial fit", err);
    if (!s) s = SDM_ALLOC(&a, f * f, "polynomial fit", err);
    // normal equations: of all maps, or of three of every four
    for (size_t k = 0; k < (all ? 1 : 3) && !s; k++) {
        const size_t rows = all ? p->n : (p->n + 3 - k) / 4, step = all ? 1 : 4;
        const float *phi = pod->phi + k * ld, *c = p->c + k * r;
        sdm_gemm(f, f, rows, (sdm_view){phi, 1, step * ld}, (sdm_view){phi, step * ld, 1}, k > 0,
                 gram, f, pod->t->n_threads);
        sdm_gemm(f, r, rows, (sdm_view){phi, 1, step * ld}, (sdm_view){c, step * r, 1}, k > 0,
                 right, r, pod->t->n_threads);
    }
    if (!s) {
        for (size_t i = 0; i < f * f; i++) a[i] = gram[i];
        for (size_t i = 0; i < f; i++)
            a[i * f + i] += (i ? p->ridge : POD_RIDGE) * (double)(all ? p->n : p->n * 3 / 4);
        for (size_t i = 0; i < f * r; i++) x[i] = right[i];
        if (trainer_cholesky(f, a))
            s = sdm_fail(err, SDM_E_CONFIG,
                         "%s: %zu maps cannot determine polynomials of %zu terms: lower "
                         "network.degree or raise data.start",
                         pod->t->config->file, p->n, f);
    }
    if (!s) trainer_cholesky_solve(f, a, r, x);
    sdm_free(a);
    sdm_free(right);
    sdm_free(gram);
    return s;
}

/* *error = sum of squared errors of the fit on the maps that it leaves out; infinite if the fit has
 * no solution. */
static sdm_status fit_validate(const polynomial_fit *p, double *error, sdm_error *err)
{
    const size_t r = p->pod->n_modes;
    double *x = NULL;
    sdm_status s = SDM_ALLOC(&x, p->terms * r, "polynomial fit", err);
    if (s) return s;
    *error = INFINITY;
    s = fit_solve(p, false, x, err);
    if (s == SDM_E_CONFIG) {
        sdm_free(x);
        return SDM_OK;
    }
    if (!s) *error = 0;
    for (size_t i = 3; i < p->n && !s; i += 4) {
        const float *phi = p->pod->phi + i * p->pod->n_poly;
        for (size_t j = 0; j < r; j++) {
            double e = -(double)p->c[i * r + j];
            for (size_t t = 0; t < p->terms; t++) e += x[t * r + j] * (double)phi[t];
            *error += e * e;
        }
    }
    sdm_free(x);
    return s;
}

/* Chooses degree and ridge: first those of many maps (four maps a term or more, a ridge far below
 * the noise); others if they are at least 2 % better on maps that the fit leaves out. */
static sdm_status choose_fit(const pod_state *pod, polynomial_fit *best, sdm_error *err)
{
    static const double RIDGES[] = {POD_RIDGE, 1e-4, 1e-3, 1e-2, 3e-2, 0.1, 0.3, 1};
    const sdm_pod_arch *a = &pod->arch;
    double least = INFINITY;
    sdm_status s = SDM_OK;
    size_t top = a->degree;
    while (top > 0 && 4 * sdm_poly_count(a->n_params, top) > best->n + 4) top--;
    set_degree(best, top);
    best->ridge = POD_RIDGE;
    // with so many maps that the highest degree is determined, there is nothing to choose
    if (top == a->degree) return SDM_OK;
    for (size_t degree = top; degree <= a->degree && !s; degree++)
        for (size_t k = 0; k < sizeof RIDGES / sizeof *RIDGES && !s; k++) {
            polynomial_fit p = *best;
            double error;
            set_degree(&p, degree);
            p.ridge = RIDGES[k];
            s = fit_validate(&p, &error, err);
            if (!s && error < 0.98 * least) least = error, *best = p;
        }
    return s;
}

/* Solves the fit for all maps. Maps at few values of a parameter do not determine a high degree,
 * however many they are: the degree is then lowered until they do. */
static sdm_status fit_determined(polynomial_fit *p, double *x, sdm_error *err)
{
    const size_t chosen = p->degree;
    sdm_status s = fit_solve(p, true, x, err);
    while (s == SDM_E_CONFIG && p->degree > 0) {
        set_degree(p, p->degree - 1);
        p->ridge = POD_RIDGE;
        s = fit_solve(p, true, x, err);
    }
    if (!s && p->degree < chosen)
        trainer_message(p->pod->t,
                        "network.degree lowered from %zu to %zu: the maps are at too few values of "
                        "a parameter to determine more (data.static)",
                        chosen, p->degree);
    return s;
}

/* poly[R][F] = least squares fit of c[n][R] by the polynomials. Sets degree, n_terms and n_latent
 * of the architecture, and ridge. */
static sdm_status fit_polynomials(pod_state *pod, size_t n, const float *c, sdm_error *err)
{
    sdm_pod_arch *a = &pod->arch;
    const size_t r = pod->n_modes;
    polynomial_fit p = {.pod = pod, .n = n, .c = c};
    double *x = NULL;
    sdm_status s = choose_fit(pod, &p, err);
    if (!s) s = SDM_ALLOC(&x, p.terms * r, "polynomial fit", err);
    if (!s) s = fit_determined(&p, x, err);
    if (!s) {
        a->degree = p.degree;
        a->n_latent -= a->n_terms - p.terms;
        a->n_terms = p.terms;
        pod->ridge = p.ridge;
        if (p.ridge > POD_RIDGE)
            trainer_message(pod->t,
                            "polynomials of degree %zu with a ridge of %g: best on maps that the "
                            "fit left out",
                            a->degree, p.ridge);
        for (size_t i = 0; i < p.terms; i++)
            for (size_t j = 0; j < r; j++) pod->poly[j * p.terms + i] = (float)x[i * r + j];
    }
    sdm_free(x);
    return s;
}

static double square_sum(const float *x, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++) sum += (double)x[i] * x[i];
    return sum;
}

/* *floor = mean square error (mm^2) that remains with the exact mode coefficients c[n][R] of the
 * maps in slots 0 .. n - 1, on a sample of these maps. */
static sdm_status training_floor(const pod_state *pod, size_t n, const float *c, double *floor,
                                 sdm_error *err)
{
    enum { SAMPLE = 64 };
    const dataset *d = &pod->t->data;
    const size_t sample = n < SAMPLE ? n : SAMPLE;
    double energy = 0;
    int16_t *values = NULL;
    sdm_status s = SDM_ALLOC(&values, d->n_voxels, "training map", err);
    for (size_t i = 0; i < sample && !s; i++) {
        const size_t map = i * n / sample;
        if ((s = trainer_dataset_whole(d, map, values, err))) break;
        for (size_t v = 0; v < d->n_voxels; v++) {
            const double e = d->scale[map] * (float)values[v] - pod->mean[v];
            energy += e * e;
        }
        energy -= square_sum(c + map * pod->n_modes, pod->n_modes);
    }
    *floor = fmax(0, energy / ((double)sample * (double)d->n_voxels));
    sdm_free(values);
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
    if (!s) s = modes_from_coefficients(pod, h, y, c, err);
    if (!s) {
        // orthonormal bases and modes: energy of the map minus that of its mode coefficients
        double energy = 0, left_out = 0;
        for (size_t i = 0; i < h; i++) {
            for (size_t v = 0; v < pod->t->data.n_voxels; v++) {
                const double e = pod->t->data.holdout[i * pod->t->data.n_voxels + v] - pod->mean[v];
                energy += e * e;
            }
            const double of_modes = square_sum(c + i * r, r);
            energy -= of_modes;
            left_out += square_sum(y + i * k, k) - of_modes;
            pod_phi(pod, pod->t->data.holdout_params + i * pod->t->data.n_params,
                    pod->holdout_phi + i * pod->n_poly);
            targets[i] = pod->holdout_target + i * r;
        }
        // clamped at 0: rounding could make the difference negative
        pod->holdout_floor = fmax(0, energy / ((double)h * (double)pod->t->data.n_voxels));
        pod->modes_mse = fmax(0, left_out / ((double)h * (double)pod->t->data.n_voxels));
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
        s = trainer_leading_space(pod->t->hooks.comm, n, k, y, r, pod->t->config->seed,
                                  STREAM_BASES, pod->t->n_threads, pod->modes, err);
    if (!s) s = modes_from_coefficients(pod, n, y, c, err);
    if (!s) s = training_floor(pod, n, c, &pod->training_floor, err);
    if (!s) {
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
