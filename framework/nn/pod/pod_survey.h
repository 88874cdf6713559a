/* What the weights of a pod network do, seen at random parameters (pod_quantise.c). Letters as in
 * sdm/pod.h. */
#ifndef SDM_POD_SURVEY_H
#define SDM_POD_SURVEY_H

#include "pod_internal.h"

/* Of a coefficient of a block, or of a latent variable; all but the first two are left to
 * sdm_pod_quantise(). */
typedef struct coefficient_stats {
    double square;  /* mean square */
    double largest; /* magnitude; NaN when one is not a number */
    double gain;    /* square of the map that a coefficient of 1 makes */
    double unit;    /* largest magnitude in its column */
    double scale;   /* of the row that gives it */
    double error;   /* mean square error of the map when its column is single bytes */
    double step;    /* of the integers of its column */
} coefficient_stats;

typedef struct survey {
    const sdm_pod_spec *spec;
    size_t *basis_at; /* [blocks] first weight of a block in spec->weights.basis */
    size_t coefficients_at[SDM_POD_MAX_LEVELS + 1]; /* the last: C */
    coefficient_stats *stats;                       /* [C + L] */
    double variance;                                /* of the map about its mean */
} survey;

/* Weights w[outputs][k] at w[o * row + i * col]. */
typedef struct matrix {
    const float *w;
    size_t outputs, k, row, col;
    coefficient_stats *in;  /* [k] */
    coefficient_stats *out; /* [outputs], NULL: voxels */
} matrix;

static inline double max_or_nan(double a, double b) { return b > a || b != b ? b : a; } // NaN stays

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

/* The weights that give the coefficients of the highest level; those of block b of `level`. */
matrix sdm_pod_head_matrix(const survey *s);
matrix sdm_pod_block_matrix(const survey *s, size_t b, size_t level);

/* Mean squares of all coefficients and latent variables, variance of the map. SDM_E_NOMEM;
 * sdm_pod_survey_dispose() also after an error. */
sdm_status sdm_pod_survey(const sdm_pod_spec *spec, survey *s, sdm_error *err);
void sdm_pod_survey_dispose(survey *s);

#endif
