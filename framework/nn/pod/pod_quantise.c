/* Integer weights of a pod network. The survey shows how large the inputs of each column are. This
   gives the error of the map that rounding a column causes, and thus the columns that must be wide.
   Words and letters as in pod_internal.h. */
#include "pod_quantise.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "pod_survey.h"
#include "sdm/internal/kernels.h"
#include "sdm/memory.h"

enum { BYTE_MAX = 127 }; // largest narrow weight
enum { WIDE_FINER = 2 }; // error of a wide column <= largest error of a narrow one / WIDE_FINER^2
enum { MLP_WEIGHT_MAX = 2047 }; // largest integer weight of the MLP

// an input is clipped when it exceeds HEADROOM times the largest one of its group in the survey
#define HEADROOM 2

// Bound: (mean square error that rounding adds to the map) <= ERROR_SHARE_MAX * (variance of the
// map). It is small compared with the error of the most accurate networks.
#define ERROR_SHARE_MAX 5e-7

// largest abs(weight / row_scale) in column i; 1 if all weights are 0, NaN if one is not finite
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

// expected squared norm of the error of the map if each output has an independent error of standard
// deviation row_scale
static double gain_of_rows(const matrix *m)
{
    double sum = 0;
    if (!m->out) return (double)m->outputs;
    for (size_t o = 0; o < m->outputs; o++)
        sum += m->out[o].scale * m->out[o].scale * m->out[o].gain;
    return sum;
}

// squared norm of the map if input i is 1 and the others are 0, with the maps of the outputs taken
// as orthogonal
static double column_gain(const matrix *m, size_t i)
{
    double sum = 0;
    for (size_t o = 0; o < m->outputs; o++)
        sum += weight(m, o, i) * weight(m, o, i) * row_gain(m, o);
    return sum;
}

// Sets the row scales of m, and unit, gain and error of its columns: the columns are scaled to a
// largest magnitude of 1, then the rows, then the columns again. The matrices of the level below
// must have been done before, because the gains of the outputs are needed.
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

    // a rounding error is uniform within one step: variance step^2 / 12
    const double rows = gain_of_rows(m);
    for (size_t i = 0; i < m->k; i++) {
        m->in[i].gain = column_gain(m, i);
        m->in[i].unit = column_unit(m, i);
        const double step = m->in[i].unit / BYTE_MAX;
        m->in[i].error = m->in[i].square * step * step / 12 * rows / (double)n_voxels;
    }
}

// a group: the blocks first .. end - 1 of `level`
typedef struct group {
    size_t level, first, end;
} group;

static size_t n_groups(const survey *s, size_t level)
{
    const sdm_pod_levels *l = &s->spec->arch.levels;
    return level + 1 < l->n ? l->first[level + 2] - l->first[level + 1]
                            : l->first[level + 1] - l->first[level];
}

static group group_at(const survey *s, size_t level, size_t i)
{
    const sdm_pod_levels *l = &s->spec->arch.levels;
    if (level + 1 == l->n) return (group){level, l->first[level] + i, l->first[level] + i + 1};
    const sdm_pod_block *parent = &s->spec->blocks[l->first[level + 1] + i];
    return (group){level, parent->child, parent->child + parent->n_children};
}

// Number of columns of m to make wide. Columns are stored in pairs: the result includes the last
// pair with error > error_per_byte * (bytes by which the pair grows when it is made wide).
static size_t wide_columns(const matrix *m, double error_per_byte)
{
    const double bytes = 2 * (double)sdm_panel_outputs(m->outputs);
    size_t n = m->k;
    while (n) {
        const size_t first = (n - 1) / 2 * 2;
        const double error = m->in[first].error + (n - first > 1 ? m->in[n - 1].error : 0);
        if (error > error_per_byte * bytes) break;
        n = first;
    }
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

// Sets wide[] of the blocks of a group by wide_columns(). Returns the estimated mean square error
// of the map that the group causes: the sum over its narrow columns, and over its wide columns with
// the steps of find_steps().
static double wide_choose_in_group(const survey *s, group g, double error_per_byte, uint32_t *wide)
{
    double left = 0, most = 0;
    size_t n = 0;
    for (size_t b = g.first; b < g.end; b++) {
        const matrix m = sdm_pod_block_matrix(s, b, g.level);
        wide[b] = (uint32_t)wide_columns(&m, error_per_byte);
        n += wide[b];
        for (size_t i = wide[b]; i < m.k; i++)
            left += m.in[i].error, most = fmax(most, m.in[i].error);
    }
    return left + (double)n * most / (WIDE_FINER * WIDE_FINER);
}

// Sets wide[blocks + 1] for all blocks and the head; returns the estimated mean square error of the
// map. head[L]: the columns of the head in descending order of their errors.
static double wide_choose(const survey *s, const ranked *head, double error_per_byte,
                          uint32_t *wide)
{
    const size_t latent = s->spec->arch.n_latent,
                 padded = sdm_panel_outputs(s->spec->arch.n_coefficients);
    double left = 0;
    size_t n = 0;
    while (n < latent && head[n].error > error_per_byte * (double)padded) n++;
    n = n < latent ? sdm_panel_even(n) : n;
    wide[n_blocks(s)] = (uint32_t)n;
    if (n < latent) left += (double)n * head[n].error / (WIDE_FINER * WIDE_FINER);
    for (; n < latent; n++) left += head[n].error;
    for (size_t l = 0; l < s->spec->arch.levels.n; l++)
        for (size_t i = 0; i < n_groups(s, l); i++)
            left += wide_choose_in_group(s, group_at(s, l, i), error_per_byte, wide);
    return left;
}

// Sets q->wide and q->order. Bisection finds the largest error_per_byte for which the mean square
// error of the map is at most ERROR_SHARE_MAX * variance.
static sdm_status wide_find(const survey *s, pod_integers *q, sdm_error *err)
{
    const size_t latent = s->spec->arch.n_latent, c = s->coefficients_at[s->spec->arch.levels.n];
    ranked *head = NULL;
    const sdm_status status = SDM_ALLOC(&head, latent, "integer weights", err);
    if (status) return status;
    double most = 0;
    for (size_t i = 0; i < c + latent; i++) most = fmax(most, s->stats[i].error);
    for (size_t i = 0; i < latent; i++) head[i] = (ranked){s->stats[c + i].error, (uint32_t)i};
    qsort(head, latent, sizeof *head, by_error);
    double low = -100, high = 0; // log2(error_per_byte / most)
    while (high - low > 0.01) {
        const double middle = 0.5 * (low + high);
        if (wide_choose(s, head, most * exp2(middle), q->wide) <= ERROR_SHARE_MAX * s->variance)
            low = middle;
        else
            high = middle;
    }
    wide_choose(s, head, most * exp2(low), q->wide);
    for (size_t i = 0; i < latent; i++) q->order[i] = head[i].column;
    sdm_free(head);
    return SDM_OK;
}

/* Rounding to integers. */

// Largest (RMS input * unit) of the narrow columns. order[k]: order of the columns (NULL:
// 0 .. k - 1), of which the first n_wide are wide.
static double largest_input(const matrix *m, const uint32_t *order, size_t n_wide)
{
    double most = 0;
    for (size_t i = n_wide; i < m->k; i++) {
        const coefficient_stats *f = &m->in[order ? order[i] : i];
        most = fmax(most, sqrt(f->square) * f->unit);
    }
    return most;
}

// Sets the steps of the columns, of which the first n_wide are wide. A narrow column has the step
// unit / BYTE_MAX. The error of a column is proportional to (RMS input * step)^2. For a wide column
// the step is such that RMS input * step = most / (WIDE_FINER * BYTE_MAX), with `most` from
// largest_input(). It is no smaller, because inputs are multiplied by the step before they are
// rounded: a smaller step leaves fewer bits to the input. unit / step is clamped to
// 2 * BYTE_MAX .. SDM_WIDE.
static void find_steps(const matrix *m, const uint32_t *order, size_t n_wide, double most)
{
    for (size_t i = 0; i < m->k; i++) {
        coefficient_stats *f = &m->in[order ? order[i] : i];
        const double share = most > 0 ? sqrt(f->square) * f->unit / most : INFINITY;
        f->step = f->unit / (i < n_wide
                                 ? fmin(fmax(WIDE_FINER * BYTE_MAX * share, 2 * BYTE_MAX), SDM_WIDE)
                                 : BYTE_MAX);
    }
}

// to[outputs][k] = weight / (step * row_scale), rounded, with the columns in `order`; 0 where the
// quotient is not finite.
static void round_matrix(const matrix *m, const uint32_t *order, int16_t *to)
{
    for (size_t o = 0; o < m->outputs; o++)
        for (size_t i = 0; i < m->k; i++) {
            const size_t column = order ? order[i] : i;
            const double v = weight(m, o, column) / (m->in[column].step * row_scale(m, o));
            *to++ = (int16_t)(isfinite(v) ? lrint(v) : 0);
        }
}

// *limit = min(*limit, limit of the inputs of matrix m with the integer weights w)
static void limit_lower(uint32_t *limit, const matrix *m, const int16_t *w)
{
    const uint32_t here = (uint32_t)sdm_panel_i8_limit(m->outputs, m->k, w);
    if (here < *limit) *limit = here;
}

static void round_block(const survey *s, size_t b, size_t level, double most, pod_integers *q)
{
    const matrix m = sdm_pod_block_matrix(s, b, level);
    int16_t *basis = q->basis + s->basis_at[b];
    float *factor = q->factor + s->coefficients_at[level] + s->spec->blocks[b].coefficient;
    find_steps(&m, NULL, q->wide[b], most);
    round_matrix(&m, NULL, basis);
    limit_lower(&q->limit[level], &m, basis);
    for (size_t i = 0; i < m.k; i++) factor[i] = (float)(m.in[i].scale * m.in[i].step);
}

// computes integer weights, limits and factors of the head and of all blocks
static void round_all(const survey *s, pod_integers *q)
{
    const sdm_pod_arch *a = &s->spec->arch;
    const size_t of_head = q->wide[n_blocks(s)];
    const matrix head = sdm_pod_head_matrix(s);
    for (size_t l = 0; l <= SDM_POD_MAX_LEVELS; l++) q->limit[l] = INT16_MAX;
    find_steps(&head, q->order, of_head, largest_input(&head, q->order, of_head));
    round_matrix(&head, q->order, q->head);
    limit_lower(&q->limit[a->levels.n], &head, q->head);
    for (size_t i = 0; i < a->n_latent; i++)
        q->factor[s->coefficients_at[a->levels.n] + i] = (float)head.in[q->order[i]].step;
    for (size_t l = 0; l < a->levels.n; l++)
        for (size_t i = 0; i < n_groups(s, l); i++) {
            const group g = group_at(s, l, i);
            double most = 0;
            for (size_t b = g.first; b < g.end; b++) {
                const matrix m = sdm_pod_block_matrix(s, b, l);
                most = fmax(most, largest_input(&m, NULL, q->wide[b]));
            }
            for (size_t b = g.first; b < g.end; b++) round_block(s, b, l, most, q);
        }
}

// Sets the quanta, the values of one unit of the integer inputs: the largest integer stands for
// HEADROOM times the largest input that the survey found in the group of blocks.
static void find_quanta(const survey *s, pod_integers *q)
{
    for (size_t l = 0; l < s->spec->arch.levels.n; l++)
        for (size_t i = 0; i < n_groups(s, l); i++) {
            const group g = group_at(s, l, i);
            double most = 0;
            for (size_t b = g.first; b < g.end; b++) {
                const matrix m = sdm_pod_block_matrix(s, b, l);
                for (size_t c = 0; c < m.k; c++)
                    most = max_or_nan(most, m.in[c].largest * m.in[c].step);
            }
            for (size_t b = g.first; b < g.end; b++)
                q->quantum[b] = (float)(HEADROOM * most / q->limit[l]);
        }
}

// Rounds the weights of the MLP, which is small: all its weights are wide. They use only 12 bits
// including the sign, so that about 13 of the 32 bits of the sums are left for the inputs.
static void round_mlp(const sdm_pod_spec *spec, pod_integers *q)
{
    const sdm_pod_arch *a = &spec->arch;
    int16_t *to = q->mlp;
    for (size_t l = 0; l < a->depth; l++) {
        const size_t k = sdm_pod_layer_inputs(a, l);
        for (size_t o = 0; o < a->width; o++) {
            const float *w = spec->weights.layer[l] + o * k;
            double most = 0;
            for (size_t i = 0; i < k; i++) most = max_or_nan(most, fabs((double)w[i]));
            q->layer_scale[l * a->width + o] = (float)(most / MLP_WEIGHT_MAX);
            for (size_t i = 0; i < k; i++)
                to[o * k + i] =
                    (int16_t)(isfinite(w[i] / most) ? lrint(w[i] / most * MLP_WEIGHT_MAX) : 0);
        }
        q->layer_limit[l] = (uint32_t)sdm_panel_i8_limit(a->width, k, to);
        to += a->width * k;
    }
}

static sdm_status integers_allocate(const survey *s, pod_integers *q, sdm_error *err)
{
    const sdm_pod_arch *a = &s->spec->arch;
    sdm_status status = SDM_ALLOC(&q->wide, n_blocks(s) + 1, "integer weights", err);
    if (!status) status = SDM_ALLOC(&q->order, a->n_latent, "integer weights", err);
    if (!status)
        status = SDM_ALLOC(&q->factor, s->coefficients_at[a->levels.n] + a->n_latent,
                           "integer weights", err);
    size_t mlp = 0;
    for (size_t l = 0; l < a->depth; l++) mlp += a->width * sdm_pod_layer_inputs(a, l);
    if (!status) status = SDM_ALLOC(&q->mlp, mlp, "integer weights", err);
    if (!status) status = SDM_ALLOC(&q->layer_scale, a->depth * a->width, "integer weights", err);
    if (!status) status = SDM_ALLOC(&q->quantum, n_blocks(s), "integer weights", err);
    if (!status)
        status = SDM_ALLOC(&q->head, a->n_coefficients * a->n_latent, "integer weights", err);
    if (!status) status = SDM_ALLOC(&q->basis, s->basis_at[n_blocks(s)], "integer weights", err);
    return status;
}

sdm_status sdm_pod_quantise(const sdm_pod_spec *spec, pod_integers *out, sdm_error *err)
{
    const sdm_pod_arch *a = &spec->arch;
    survey s;
    *out = (pod_integers){0};
    sdm_status status = sdm_pod_survey(spec, &s, err);
    if (!status) status = integers_allocate(&s, out, err);
    if (!status) {
        for (size_t l = 0; l < a->levels.n; l++)
            for (size_t b = a->levels.first[l]; b < a->levels.first[l + 1]; b++) {
                const matrix m = sdm_pod_block_matrix(&s, b, l);
                find_scales(&m, a->n_voxels);
            }
        const matrix head = sdm_pod_head_matrix(&s);
        find_scales(&head, a->n_voxels);
        status = wide_find(&s, out, err);
    }
    if (!status) round_all(&s, out);
    if (!status) find_quanta(&s, out);
    if (!status) round_mlp(spec, out);
    sdm_pod_survey_dispose(&s);
    return status;
}

void sdm_pod_integers_dispose(pod_integers *q)
{
    sdm_free(q->wide);
    sdm_free(q->order);
    sdm_free(q->factor);
    sdm_free(q->quantum);
    sdm_free(q->layer_scale);
    sdm_free(q->mlp);
    sdm_free(q->head);
    sdm_free(q->basis);
    *q = (pod_integers){0};
}
