/* Survey of a pod network: its layers are evaluated in floats at N random parameter vectors
   (samples). Mean squares are taken over the samples that follow the distributions of the
   parameters. Largest magnitudes are taken over all samples, including corners and faces of the
   ranges, where extremes are most likely. */
#include "pod_survey.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/distribution.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"

enum { RANDOM = 256, CORNERS = 64, FACES = 256, N = RANDOM + CORNERS + FACES, STREAM = 0x51 };

matrix sdm_pod_head_matrix(const survey *s)
{
    const sdm_pod_arch *a = &s->spec->arch;
    return (matrix){.w = s->spec->weights.head,
                    .outputs = a->n_coefficients,
                    .k = a->n_latent,
                    .row = a->n_latent,
                    .col = 1,
                    .in = s->stats + s->coefficients_at[a->levels.n],
                    .out = s->stats + s->coefficients_at[a->levels.n - 1]};
}

matrix sdm_pod_block_matrix(const survey *s, size_t b, size_t level)
{
    const sdm_pod_block *k = &s->spec->blocks[b];
    const size_t outputs = sdm_pod_outputs(s->spec->blocks, b);
    matrix m = {.w = s->spec->weights.basis + s->basis_at[b],
                .outputs = outputs,
                .k = k->rank,
                .row = 1,
                .col = outputs,
                .in = s->stats + s->coefficients_at[level] + k->coefficient};
    if (level)
        m.out = s->stats + s->coefficients_at[level - 1] + s->spec->blocks[k->child].coefficient;
    return m;
}

// Parameter i of sample n, in [-1, 1]. The first RANDOM samples follow the distribution of the
// parameter. The next CORNERS samples are corners: all 64 corners of the first six parameters,
// random -1 or 1 for the others. The last FACES samples lie on faces: each parameter is -1 or 1
// with probability 1/2, else uniform.
static double sample_parameter(const sdm_model_info *info, size_t n, size_t i)
{
    const double u = sdm_rng_uniform(0, STREAM, n * info->n_params + i), x = 2 * u - 1;
    if (n < RANDOM) {
        const sdm_model_param *p = &info->params[i];
        const double half = 0.5 * (p->max - p->min), middle = 0.5 * (p->min + p->max);
        const sdm_distribution scaled = {.kind = p->distribution.kind,
                                         .mean = (p->distribution.mean - middle) / half,
                                         .deviation = p->distribution.deviation / half};
        return sdm_distribution_quantile(&scaled, -1, 1, u);
    }
    if (n < RANDOM + CORNERS && i < 6) return n >> i & 1 ? 1 : -1;
    return n >= RANDOM + CORNERS && fabs(x) < 0.5 ? 2 * x : x < 0 ? -1 : 1;
}

// z[N][L] = the latents of all samples.
static sdm_status sample_latent(const sdm_pod_spec *spec, float *z, sdm_error *err)
{
    const sdm_pod_arch *a = &spec->arch;
    const size_t total = a->n_terms > 1 + a->n_inputs ? a->n_terms : 1 + a->n_inputs, w = a->width;
    const size_t degree = a->degree > a->input_degree ? a->degree : a->input_degree;
    uint8_t *exponents = NULL;
    float *phi = NULL, *h[2] = {NULL, NULL};
    sdm_status s = SDM_ALLOC(&exponents, total * a->n_params, "integer weights", err);
    if (!s) s = SDM_ALLOC(&phi, N * total, "integer weights", err);
    for (int i = 0; i < 2 && !s; i++) s = SDM_ALLOC(&h[i], N * w, "integer weights", err);
    if (s) goto done;

    // polynomials
    sdm_poly_table(a->n_params, degree, exponents);
    for (size_t n = 0; n < N; n++) {
        double x[SDM_POD_MAX_PARAMS];
        for (size_t i = 0; i < a->n_params; i++) x[i] = sample_parameter(spec->info, n, i);
        sdm_poly_eval(exponents, total, a->n_params, degree, x, phi + n * total, NULL);
        memcpy(z + n * a->n_latent, phi + n * total, a->n_terms * sizeof *z);
    }

    // MLP
    const float *in = phi + 1;
    size_t stride = total;
    for (size_t l = 0; l < a->depth; l++) {
        const size_t k = sdm_pod_layer_inputs(a, l);
        float *out = h[l % 2];
        for (size_t n = 0; n < N; n++) memcpy(out + n * w, spec->weights.bias[l], w * sizeof *out);
        sdm_gemm(N, w, k, (sdm_view){in, stride, 1}, (sdm_view){spec->weights.layer[l], 1, k}, true,
                 out, w, 1);
        sdm_activate(a->activation, N * w, out, out, NULL);
        in = out, stride = w;
    }
    for (size_t n = 0; n < N && a->depth; n++)
        memcpy(z + n * a->n_latent + a->n_terms, in + n * stride, w * sizeof *z);
done:
    sdm_free(exponents);
    sdm_free(phi);
    sdm_free(h[0]);
    sdm_free(h[1]);
    return s;
}

// adds the samples x[N][ldx] of n coefficients to their statistics f[n]
static void stats_update(size_t n, const float *x, size_t ldx, coefficient_stats *f)
{
    for (size_t r = 0; r < N; r++)
        for (size_t i = 0; i < n; i++) {
            const double v = x[r * ldx + i];
            if (r < RANDOM) f[i].square += v * v / RANDOM;
            f[i].largest = max_or_nan(f[i].largest, fabs(v));
        }
}

// Updates the statistics of the coefficients of block b of `level` and its descendants, and
// s->variance. c[N][ldc]: coefficients of b; y[level]: buffer for the outputs of one block of each
// level.
static void block_sample(survey *s, size_t b, size_t level, const float *c, size_t ldc,
                         float *const *y)
{
    const sdm_pod_block *k = &s->spec->blocks[b];
    const matrix m = sdm_pod_block_matrix(s, b, level);
    stats_update(m.k, c, ldc, m.in);
    sdm_gemm(N, m.outputs, m.k, (sdm_view){c, ldc, 1}, (sdm_view){m.w, m.col, m.row}, false,
             y[level], m.outputs, 1);
    for (size_t i = k->child; i < k->child + k->n_children; i++)
        block_sample(s, i, level - 1,
                     y[level] +
                         (s->spec->blocks[i].coefficient - s->spec->blocks[k->child].coefficient),
                     m.outputs, y);
    for (size_t i = 0; i < RANDOM * m.outputs && !level; i++)
        s->variance += (double)y[0][i] * y[0][i] / RANDOM / (double)s->spec->arch.n_voxels;
}

static sdm_status survey_sample(survey *s, sdm_error *err)
{
    const sdm_pod_arch *a = &s->spec->arch;
    const size_t top = a->levels.n - 1;

    // memory for the latents, and for the outputs of a block of each level
    float *z = NULL, *c = NULL, *y[SDM_POD_MAX_LEVELS] = {NULL};
    sdm_status status = SDM_ALLOC(&z, N * a->n_latent, "integer weights", err);
    if (!status) status = SDM_ALLOC(&c, N * a->n_coefficients, "integer weights", err);
    for (size_t l = 0; l < a->levels.n && !status; l++) {
        size_t most = 1;
        for (size_t b = a->levels.first[l]; b < a->levels.first[l + 1]; b++) {
            const size_t outputs = sdm_pod_outputs(s->spec->blocks, b);
            if (outputs > most) most = outputs;
        }
        status = SDM_ALLOC(&y[l], N * most, "integer weights", err);
    }

    // latents, coefficients of the highest level, then all blocks below
    if (!status) status = sample_latent(s->spec, z, err);
    if (!status) {
        const matrix m = sdm_pod_head_matrix(s);
        stats_update(m.k, z, m.k, m.in);
        sdm_gemm(N, m.outputs, m.k, (sdm_view){z, m.k, 1}, (sdm_view){m.w, m.col, m.row}, false, c,
                 m.outputs, 1);
        for (size_t b = a->levels.first[top]; b < a->levels.first[top + 1]; b++)
            block_sample(s, b, top, c + s->spec->blocks[b].coefficient, a->n_coefficients, y);
    }
    for (size_t l = 0; l < a->levels.n; l++) sdm_free(y[l]);
    sdm_free(c);
    sdm_free(z);
    return status;
}

sdm_status sdm_pod_survey(const sdm_pod_spec *spec, survey *s, sdm_error *err)
{
    const sdm_pod_arch *a = &spec->arch;
    *s = (survey){.spec = spec};
    sdm_pod_place_coefficients(&a->levels, spec->blocks, s->coefficients_at);
    sdm_status status = SDM_ALLOC(&s->basis_at, n_blocks(s) + 1, "integer weights", err);
    if (!status)
        status = SDM_ALLOC(&s->stats, s->coefficients_at[a->levels.n] + a->n_latent,
                           "integer weights", err);
    if (status) return status;
    for (size_t b = 0; b < n_blocks(s); b++)
        s->basis_at[b + 1] =
            s->basis_at[b] + sdm_pod_outputs(spec->blocks, b) * spec->blocks[b].rank;
    return survey_sample(s, err);
}

void sdm_pod_survey_dispose(survey *s)
{
    sdm_free(s->stats);
    sdm_free(s->basis_at);
    *s = (survey){0};
}
