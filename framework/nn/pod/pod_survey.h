/* Survey of a pod network: statistics of its coefficients at random parameters, from which
   pod_quantise.c derives the integer weights. Words and letters as in pod_internal.h. */
#pragma once

#include "pod_internal.h"

/* Statistics of a coefficient or latent. Both are multiplied by a column of a matrix; a coefficient
   is also computed by a row of another matrix. sdm_pod_survey() sets the first two members,
   sdm_pod_quantise() the others. */
typedef struct coefficient_stats {
    double square;  /* mean square over the distributions of the parameters */
    double largest; /* largest magnitude of all samples; NaN if a sample is NaN */
    double gain;    /* squared Euclidean norm of the map of a coefficient of 1, mm^2 */
    double unit;    /* largest abs(weight / row_scale) in its column */
    double scale;   /* row_scale of the row that computes it */
    double error;   /* mean square error of the map, mm^2, if its column is narrow */
    double step;    /* step of its column */
} coefficient_stats;

typedef struct survey {
    const sdm_pod_spec *spec;
    size_t *basis_at; /* [blocks + 1] index of the first weight of a block in spec->weights.basis */
    /* index of the first coefficient of each level, as in pod_network */
    size_t coefficients_at[SDM_POD_MAX_LEVELS + 1];
    coefficient_stats *stats; /* [C + L] all coefficients, then the latents */
    double variance;          /* mean square of (map - mean map) over voxels and parameters, mm^2 */
} survey;

/* The matrix from k inputs to `outputs` outputs: weight (o, i) is w[o * row + i * col]. */
typedef struct matrix {
    const float *w;
    size_t outputs, k, row, col;
    coefficient_stats *in; /* [k] statistics of the inputs */
    /* [outputs] statistics of the outputs; NULL if the outputs are voxels, with scale and gain 1.
     */
    coefficient_stats *out;
} matrix;

/* The maximum; NaN if a or b is NaN. */
static inline double max_or_nan(double a, double b) { return b > a || b != b ? b : a; }

static inline double weight(const matrix *m, size_t o, size_t i)
{
    return m->w[o * m->row + i * m->col];
}
static inline double row_scale(const matrix *m, size_t o) { return m->out ? m->out[o].scale : 1; }
static inline double row_gain(const matrix *m, size_t o) { return m->out ? m->out[o].gain : 1; }

static inline size_t n_blocks(const survey *s)
{
    return s->spec->arch.levels.first[s->spec->arch.levels.n];
}

/* The head as a matrix; the basis of block b of `level` as a matrix. */
matrix sdm_pod_head_matrix(const survey *s);
matrix sdm_pod_block_matrix(const survey *s, size_t b, size_t level);

/* Fills *s: mean square and largest magnitude of all coefficients and latents, variance of the map.
   SDM_E_NOMEM. Call sdm_pod_survey_dispose() after success and after an error. */
sdm_status sdm_pod_survey(const sdm_pod_spec *spec, survey *s, sdm_error *err);
void sdm_pod_survey_dispose(survey *s);
