/* Weights as bytes. How large coefficients become is seen at random parameters; from that follows what the rounding of a column does to the
   map, and which columns need two bytes. Letters as in sdm/pod.h; N samples, C coefficients of all levels. */
#include "pod_quantise.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/kernels.h"
#include "sdm/memory.h"
#include "sdm/rng.h"

enum { N = 256, FINE = 127, STREAM = 0x51 };

// mean square error of the map that rounding may add, of the variance of the maps: small beside what the most accurate networks leave
#define TOLERATED 1e-6

// of a coefficient of a block, or of a latent variable
typedef struct figures {
    double square; // mean square
    double gain;   // square of the map that a coefficient of 1 makes
    double unit;   // largest magnitude in its column
    double scale;  // of the row that gives it
    double error;  // mean square error of the map when its column is single bytes
} figures;

typedef struct survey {
    const sdm_pod_spec *spec;
    size_t *basis_at;                               // [blocks] first weight of a block in spec->weights.basis
    size_t coefficients_at[SDM_POD_MAX_LEVELS + 1]; // the last: C
    figures *figures;                               // [C + L]
    double variance;                                // of the map about its mean
} survey;

// weights w[outputs][k] at w[o * row + i * col]
typedef struct matrix {
    const float *w;
    size_t outputs, k, row, col;
    figures *in;  // [k]
    figures *out; // [outputs], NULL: voxels
} matrix;

static double weight(const matrix *m, size_t o, size_t i) { return m->w[o * m->row + i * m->col]; }
static double row_scale(const matrix *m, size_t o) { return m->out ? m->out[o].scale : 1; }
static double row_gain(const matrix *m, size_t o) { return m->out ? m->out[o].gain : 1; }

static size_t n_blocks(const survey *s) { return s->spec->arch.levels.first[s->spec->arch.levels.n]; }

static matrix head_matrix(const survey *s)
{
    const sdm_pod_arch *a = &s->spec->arch;
    return (matrix){.w = s->spec->weights.head,
                    .outputs = a->n_coefficients,
                    .k = a->n_latent,
                    .row = a->n_latent,
                    .col = 1,
                    .in = s->figures + s->coefficients_at[a->levels.n],
                    .out = s->figures + s->coefficients_at[a->levels.n - 1]};
}

static matrix block_matrix(const survey *s, size_t b, size_t level)
{
    const sdm_pod_block *k = &s->spec->blocks[b];
    const size_t outputs = sdm_pod_outputs(s->spec->blocks, b);
    matrix m = {.w = s->spec->weights.basis + s->basis_at[b],
                .outputs = outputs,
                .k = k->rank,
                .row = 1,
                .col = outputs,
                .in = s->figures + s->coefficients_at[level] + k->coefficient};
    if (level) m.out = s->figures + s->coefficients_at[level - 1] + s->spec->blocks[k->child].coefficient;
    return m;
}

/* At random parameters. */

// z[N][L]
static sdm_status sample_latent(const sdm_pod_spec *spec, float *z, sdm_error *err)
{
    const sdm_pod_arch *a = &spec->arch;
    const size_t total = a->n_terms > 1 + a->n_inputs ? a->n_terms : 1 + a->n_inputs, w = a->width;
    const size_t degree = a->degree > a->input_degree ? a->degree : a->input_degree;
    uint8_t *exponents = NULL;
    float *phi = NULL, *h[2] = {NULL, NULL};
    sdm_status s = SDM_ALLOC(&exponents, total * a->n_params, "weights as bytes", err);
    if (!s) s = SDM_ALLOC(&phi, N * total, "weights as bytes", err);
    for (int i = 0; i < 2 && !s; i++) s = SDM_ALLOC(&h[i], N * w, "weights as bytes", err);
    if (s) goto done;
    sdm_poly_table(a->n_params, degree, exponents);
    for (size_t n = 0; n < N; n++) {
        double x[SDM_POD_MAX_PARAMS];
        for (size_t i = 0; i < a->n_params; i++) x[i] = 2 * sdm_rng_uniform(0, STREAM, n * a->n_params + i) - 1;
        sdm_poly_eval(exponents, total, a->n_params, degree, x, phi + n * total, NULL);
        memcpy(z + n * a->n_latent, phi + n * total, a->n_terms * sizeof *z);
    }
    const float *in = phi + 1;
    size_t stride = total;
    for (size_t l = 0; l < a->depth; l++) {
        const size_t k = sdm_pod_layer_inputs(a, l);
        float *out = h[l % 2];
        for (size_t n = 0; n < N; n++) memcpy(out + n * w, spec->weights.bias[l], w * sizeof *out);
        sdm_gemm(N, w, k, (sdm_view){in, stride, 1}, (sdm_view){spec->weights.layer[l], 1, k}, true, out, w, 1);
        sdm_activate(a->activation, N * w, out, out, NULL);
        in = out, stride = w;
    }
    for (size_t n = 0; n < N && a->depth; n++) memcpy(z + n * a->n_latent + a->n_terms, in + n * stride, w * sizeof *z);
done:
    sdm_free(exponents);
    sdm_free(phi);
    sdm_free(h[0]);
    sdm_free(h[1]);
    return s;
}

static void mean_squares(size_t n, const float *x, size_t ldx, figures *f)
{
    for (size_t r = 0; r < N; r++)
        for (size_t i = 0; i < n; i++) f[i].square += (double)x[r * ldx + i] * x[r * ldx + i] / N;
}

// c[N][ldc]: coefficients of block b; y: of each level [N][most outputs of a block there]
static void sample_block(survey *s, size_t b, size_t level, const float *c, size_t ldc, float *const *y)
{
    const sdm_pod_block *k = &s->spec->blocks[b];
    const matrix m = block_matrix(s, b, level);
    mean_squares(m.k, c, ldc, m.in);
    sdm_gemm(N, m.outputs, m.k, (sdm_view){c, ldc, 1}, (sdm_view){m.w, m.col, m.row}, false, y[level], m.outputs, 1);
    for (size_t i = k->child; i < k->child + k->n_children; i++)
        sample_block(s, i, level - 1,
                     y[level] + (s->spec->blocks[i].coefficient - s->spec->blocks[k->child].coefficient), m.outputs, y);
    for (size_t i = 0; i < N * m.outputs && !level; i++)
        s->variance += (double)y[0][i] * y[0][i] / N / (double)s->spec->arch.n_voxels;
}

static sdm_status sample(survey *s, sdm_error *err)
{
    const sdm_pod_arch *a = &s->spec->arch;
    const size_t top = a->levels.n - 1;
    float *z = NULL, *c = NULL, *y[SDM_POD_MAX_LEVELS] = {NULL};
    sdm_status status = SDM_ALLOC(&z, N * a->n_latent, "weights as bytes", err);
    if (!status) status = SDM_ALLOC(&c, N * a->n_coefficients, "weights as bytes", err);
    for (size_t l = 0; l < a->levels.n && !status; l++) {
        size_t most = 1;
        for (size_t b = a->levels.first[l]; b < a->levels.first[l + 1]; b++) {
            const size_t outputs = sdm_pod_outputs(s->spec->blocks, b);
            if (outputs > most) most = outputs;
        }
        status = SDM_ALLOC(&y[l], N * most, "weights as bytes", err);
    }
    if (!status) status = sample_latent(s->spec, z, err);
    if (!status) {
        const matrix m = head_matrix(s);
        mean_squares(m.k, z, m.k, m.in);
        sdm_gemm(N, m.outputs, m.k, (sdm_view){z, m.k, 1}, (sdm_view){m.w, m.col, m.row}, false, c, m.outputs, 1);
        for (size_t b = a->levels.first[top]; b < a->levels.first[top + 1]; b++)
            sample_block(s, b, top, c + s->spec->blocks[b].coefficient, a->n_coefficients, y);
    }
    for (size_t l = 0; l < a->levels.n; l++) sdm_free(y[l]);
    sdm_free(c);
    sdm_free(z);
    return status;
}

/* Scales. */

// largest magnitude in a column, rows scaled; NaN when one is not finite
static double column_unit(const matrix *m, size_t i)
{
    double most = 0;
    for (size_t o = 0; o < m->outputs; o++) {
        const double w = fabs(weight(m, o, i)) / row_scale(m, o);
        if (!isfinite(w)) return NAN;
        most = fmax(most, w);
    }
    return most > 0 ? most : 1;
}

// what an error of 1 of the scale of each row does to the map
static double gain_of_rows(const matrix *m)
{
    double sum = 0;
    if (!m->out) return (double)m->outputs;
    for (size_t o = 0; o < m->outputs; o++) sum += m->out[o].scale * m->out[o].scale * m->out[o].gain;
    return sum;
}

static double column_gain(const matrix *m, size_t i)
{
    double sum = 0;
    for (size_t o = 0; o < m->outputs; o++) sum += weight(m, o, i) * weight(m, o, i) * row_gain(m, o);
    return sum;
}

// columns to at most 1, then rows, then columns again; the figures of the matrices below are known
static void find_scales(const matrix *m, size_t n_voxels)
{
    for (size_t o = 0; o < m->outputs && m->out; o++) m->out[o].scale = 1;
    for (size_t i = 0; i < m->k; i++) m->in[i].unit = column_unit(m, i);
    for (size_t o = 0; o < m->outputs && m->out; o++) {
        double most = 0;
        for (size_t i = 0; i < m->k; i++) {
            const double w = fabs(weight(m, o, i)) / m->in[i].unit;
            if (w > most) most = w; // not fmax(): GCC 12 for arm64 fails on it here
        }
        m->out[o].scale = most > 0 ? most : 1;
    }
    const double rows = gain_of_rows(m);
    for (size_t i = 0; i < m->k; i++) {
        m->in[i].gain = column_gain(m, i);
        m->in[i].unit = column_unit(m, i);
        const double step = m->in[i].unit / FINE;
        m->in[i].error = m->in[i].square * step * step / 12 * rows / (double)n_voxels;
    }
}

// the first columns that have an error above `worth` for a byte of the coarse part
static size_t coarse_columns(const matrix *m, double worth)
{
    size_t n = m->k;
    while (n && m->in[n - 1].error <= worth * (double)sdm_panel_outputs(m->outputs)) n--;
    return n;
}

typedef struct ranked {
    double error;
    uint32_t column;
} ranked;

static int by_error(const void *a, const void *b)
{
    const ranked *x = a, *y = b;
    if (x->error != y->error) return x->error > y->error ? -1 : 1;
    return x->column < y->column ? -1 : 1;
}

// error left when columns worth their byte have two; their numbers to coarse[blocks + 1]; head: its columns by error
static double choose(const survey *s, const ranked *head, double worth, uint32_t *coarse)
{
    const sdm_pod_levels *levels = &s->spec->arch.levels;
    const size_t latent = s->spec->arch.n_latent, padded = sdm_panel_outputs(s->spec->arch.n_coefficients);
    double left = 0;
    size_t n = 0;
    while (n < latent && head[n].error > worth * (double)padded) n++;
    coarse[n_blocks(s)] = (uint32_t)n;
    for (; n < latent; n++) left += head[n].error;
    for (size_t l = 0; l < levels->n; l++)
        for (size_t b = levels->first[l]; b < levels->first[l + 1]; b++) {
            const matrix m = block_matrix(s, b, l);
            coarse[b] = (uint32_t)coarse_columns(&m, worth);
            for (size_t i = coarse[b]; i < m.k; i++) left += m.in[i].error;
        }
    return left;
}

// the largest worth with which the error is tolerable
static sdm_status choose_coarse(const survey *s, pod_integers *q, sdm_error *err)
{
    const size_t latent = s->spec->arch.n_latent, c = s->coefficients_at[s->spec->arch.levels.n];
    ranked *head = NULL;
    const sdm_status status = SDM_ALLOC(&head, latent, "weights as bytes", err);
    if (status) return status;
    double most = 0;
    for (size_t i = 0; i < c + latent; i++) most = fmax(most, s->figures[i].error);
    for (size_t i = 0; i < latent; i++) head[i] = (ranked){s->figures[c + i].error, (uint32_t)i};
    qsort(head, latent, sizeof *head, by_error);
    double low = -100, high = 0; // binary logarithms of worth / most
    while (high - low > 0.01) {
        const double middle = 0.5 * (low + high);
        if (choose(s, head, most * exp2(middle), q->coarse) <= TOLERATED * s->variance)
            low = middle;
        else
            high = middle;
    }
    choose(s, head, most * exp2(low), q->coarse);
    for (size_t i = 0; i < latent; i++) q->order[i] = head[i].column;
    sdm_free(head);
    return SDM_OK;
}

/* Integers. */

// to[outputs][k]: columns order[i] (NULL: i), the first n_coarse finer by SDM_COARSE / FINE; step[k] of the columns
static void round_matrix(const matrix *m, const uint32_t *order, size_t n_coarse, int16_t *to)
{
    for (size_t o = 0; o < m->outputs; o++)
        for (size_t i = 0; i < m->k; i++) {
            const size_t column = order ? order[i] : i;
            const double v =
                weight(m, o, column) / (m->in[column].unit * row_scale(m, o)) * (i < n_coarse ? SDM_COARSE : FINE);
            *to++ = (int16_t)(isfinite(v) ? lrint(v) : 0);
        }
}

static double step(const survey *s, size_t i, bool coarse) { return s->figures[i].unit / (coarse ? SDM_COARSE : FINE); }

static void round_all(const survey *s, pod_integers *q)
{
    const sdm_pod_arch *a = &s->spec->arch;
    const size_t c = s->coefficients_at[a->levels.n], of_head = q->coarse[n_blocks(s)];
    const matrix head = head_matrix(s);
    round_matrix(&head, q->order, of_head, q->head);
    for (size_t i = 0; i < a->n_latent; i++) q->factor[c + i] = (float)step(s, c + q->order[i], i < of_head);
    for (size_t l = 0; l < a->levels.n; l++)
        for (size_t b = a->levels.first[l]; b < a->levels.first[l + 1]; b++) {
            const matrix m = block_matrix(s, b, l);
            const size_t at = s->coefficients_at[l] + s->spec->blocks[b].coefficient;
            round_matrix(&m, NULL, q->coarse[b], q->basis + s->basis_at[b]);
            for (size_t i = 0; i < m.k; i++)
                q->factor[at + i] = (float)(s->figures[at + i].scale * step(s, at + i, i < q->coarse[b]));
        }
}

static sdm_status prepare(const sdm_pod_spec *spec, survey *s, pod_integers *q, sdm_error *err)
{
    const sdm_pod_arch *a = &spec->arch;
    *s = (survey){.spec = spec};
    sdm_status status = SDM_ALLOC(&s->basis_at, n_blocks(s) + 1, "weights as bytes", err);
    if (status) return status;
    for (size_t b = 0; b < n_blocks(s); b++)
        s->basis_at[b + 1] = s->basis_at[b] + sdm_pod_outputs(spec->blocks, b) * spec->blocks[b].rank;
    sdm_pod_place_coefficients(&a->levels, spec->blocks, s->coefficients_at);
    const size_t c = s->coefficients_at[a->levels.n], all = c + a->n_latent;
    if (!status) status = SDM_ALLOC(&s->figures, all, "weights as bytes", err);
    if (!status) status = SDM_ALLOC(&q->coarse, n_blocks(s) + 1, "weights as bytes", err);
    if (!status) status = SDM_ALLOC(&q->order, a->n_latent, "weights as bytes", err);
    if (!status) status = SDM_ALLOC(&q->factor, all, "weights as bytes", err);
    if (!status) status = SDM_ALLOC(&q->head, a->n_coefficients * a->n_latent, "weights as bytes", err);
    if (!status) status = SDM_ALLOC(&q->basis, s->basis_at[n_blocks(s)], "weights as bytes", err);
    return status;
}

sdm_status sdm_pod_quantise(const sdm_pod_spec *spec, pod_integers *out, sdm_error *err)
{
    const sdm_pod_arch *a = &spec->arch;
    survey s;
    *out = (pod_integers){0};
    sdm_status status = prepare(spec, &s, out, err);
    if (!status) status = sample(&s, err);
    if (!status) {
        for (size_t l = 0; l < a->levels.n; l++)
            for (size_t b = a->levels.first[l]; b < a->levels.first[l + 1]; b++) {
                const matrix m = block_matrix(&s, b, l);
                find_scales(&m, a->n_voxels);
            }
        const matrix head = head_matrix(&s);
        find_scales(&head, a->n_voxels);
        status = choose_coarse(&s, out, err);
    }
    if (!status) round_all(&s, out);
    sdm_free(s.figures);
    sdm_free(s.basis_at);
    return status;
}

void sdm_pod_integers_dispose(pod_integers *q)
{
    sdm_free(q->coarse);
    sdm_free(q->order);
    sdm_free(q->factor);
    sdm_free(q->head);
    sdm_free(q->basis);
    *q = (pod_integers){0};
}
