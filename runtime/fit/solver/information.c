/* Sums over the samples, computed in slices that are distributed over the threads and added in
 * order. */
#include "information.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "sdm/internal/threads.h"
#include "sdm/memory.h"

// relative rounding error of a field value; the factor 8 allows for neighbouring samples that share
// the rounding of one map voxel and have similar scores
#define ROUNDING (8 * (double)FLT_EPSILON)

// count of the numbers that a slice sums up: log-likelihood; squared derivatives of the
// log-likelihood by relative errors of the field; gradient; complete and observed information
static size_t part_size(size_t n) { return 2 + n + 2 * n * n; }

sdm_status sdm_fit_information_create(size_t n_unknowns, fit_information *out, sdm_error *err)
{
    const size_t n = n_unknowns;
    *out = (fit_information){.n_unknowns = n};
    sdm_status s = SDM_ALLOC(&out->gradient, n, "normal equations", err);
    if (!s) s = SDM_ALLOC(&out->complete, n * n, "normal equations", err);
    if (!s) s = SDM_ALLOC(&out->observed, n * n, "normal equations", err);
    if (!s) s = SDM_ALLOC(&out->parts, FIT_SLICES * part_size(n), "normal equations", err);
    if (s) sdm_fit_information_dispose(out);
    return s;
}

void sdm_fit_information_dispose(fit_information *s)
{
    sdm_free(s->gradient);
    sdm_free(s->complete);
    sdm_free(s->observed);
    sdm_free(s->parts);
    *s = (fit_information){0};
}

// adds one sample of the band to the gradient by the columns and to the upper triangles of both
// matrices: their blocks (column, column) and (column, tissue mean)
static void add_columns(const fit_likelihood *r, const float *column, size_t n_columns,
                        size_t n_channels, size_t n, double *gradient, double *complete,
                        double *observed)
{
    double d[FIT_COLUMNS_MAX];
    for (size_t a = 0; a < n_columns; a++) d[a] = (double)column[a];
    for (size_t a = 0; a < n_columns; a++) {
        const double c = r->complete[0] * d[a], o = r->observed[0] * d[a];
        gradient[a] += r->score[0] * d[a];
        for (size_t b = a; b < n_columns; b++) complete[a * n + b] += c * d[b];
        for (size_t b = a; b < n_columns; b++) observed[a * n + b] += o * d[b];
        for (size_t b = 1; b < n_channels; b++) {
            complete[a * n + n_columns + b - 1] += d[a] * r->complete[b];
            observed[a * n + n_columns + b - 1] += d[a] * r->observed[b];
        }
    }
}

// adds the derivatives by the weight of a sample beyond the open end: `score` is that of the
// log-likelihood, whose second derivative is -score^2, as it is the logarithm of a linear function
static void add_weight(double score, const float *column, size_t n_columns, size_t n,
                       double *gradient, double *complete, double *observed)
{
    for (size_t a = 0; a < n_columns; a++) {
        const double d = score * (double)column[a];
        gradient[a] += d;
        for (size_t b = a; b < n_columns; b++) {
            const double more = d * score * (double)column[b];
            complete[a * n + b] += more;
            observed[a * n + b] += more;
        }
    }
}

// sums over all samples of a slice; of the matrices only the upper triangles
static void add_slice(const fit_samples *s, const fit_observation *obs, size_t from, size_t to,
                      size_t n, double *part)
{
    double *gradient = part + 2, *complete = gradient + n, *observed = complete + n * n;
    const size_t nc = s->n_columns;
    memset(part, 0, part_size(n) * sizeof *part);
    for (size_t i = from; i < to; i++) {
        fit_likelihood r;
        const bool near = s->row[i] != SIZE_MAX;
        const double by_weight = sdm_fit_likelihood_beyond(
            obs, (double)s->value[i], fit_sample_weights(s, i), s->field[i],
            fit_sample_beyond(s, i), near || obs->n_channels > 1, &r);
        part[0] += r.log_likelihood;
        if (s->beyond.on && s->beyond.row[i] != SIZE_MAX)
            add_weight(by_weight, s->beyond.jacobian + s->beyond.row[i] * nc, nc, n, gradient,
                       complete, observed);
        if (near) part[1] += r.score[0] * r.score[0] * s->field[i] * s->field[i];
        if (near)
            add_columns(&r, s->jacobian + s->row[i] * nc, nc, obs->n_channels, n, gradient,
                        complete, observed);
        // blocks (tissue mean, tissue mean)
        for (size_t a = 1; a < obs->n_channels; a++) {
            gradient[nc + a - 1] += r.score[a];
            for (size_t b = a; b < obs->n_channels; b++) {
                complete[(nc + a - 1) * n + nc + b - 1] += r.complete[a * obs->n_channels + b];
                observed[(nc + a - 1) * n + nc + b - 1] += r.observed[a * obs->n_channels + b];
            }
        }
    }
}

void sdm_fit_information_compute(fit_information *s, const fit_samples *samples,
                                 const fit_observation *obs, int n_threads)
{
    const size_t n = s->n_unknowns, size = part_size(n);
    n_threads = sdm_threads(n_threads);
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        add_slice(samples, obs, samples->n * slice / FIT_SLICES,
                  samples->n * (slice + 1) / FIT_SLICES, n, s->parts + slice * size);
    for (size_t slice = 1; slice < FIT_SLICES; slice++)
        for (size_t i = 0; i < size; i++) s->parts[i] += s->parts[slice * size + i];
    // copy the total, and complete the matrices from their upper triangles
    s->log_likelihood = s->parts[0];
    s->rounding = ROUNDING * sqrt(s->parts[1]);
    memcpy(s->gradient, s->parts + 2, n * sizeof *s->gradient);
    for (size_t a = 0; a < n; a++)
        for (size_t b = 0; b < n; b++) {
            const size_t upper = a < b ? a * n + b : b * n + a;
            s->complete[a * n + b] = s->parts[2 + n + upper];
            s->observed[a * n + b] = s->parts[2 + n + n * n + upper];
        }
}

double sdm_fit_samples_log_likelihood(const fit_samples *samples, const fit_maps *maps,
                                      const fit_observation *obs, const fit_state *state)
{
    const size_t n = samples->n;
    double part[FIT_SLICES] = {0}, sum = 0;
    fit_open_end end;
    const bool open = sdm_fit_beyond_end(samples, maps, &end);
    const int n_threads = sdm_threads(maps->n_threads);
    (void)n_threads; // unused without OpenMP
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = n * slice / FIT_SLICES; i < n * (slice + 1) / FIT_SLICES; i++) {
            const double *x = samples->world + 3 * i, field = sdm_fit_maps_at(maps, state, x);
            fit_likelihood r;
            (void)sdm_fit_likelihood_beyond(
                obs, (double)samples->value[i], fit_sample_weights(samples, i), field,
                open ? sdm_fit_beyond_at(&end, state, x) : 0, false, &r);
            part[slice] += r.log_likelihood;
        }
    for (size_t slice = 0; slice < FIT_SLICES; slice++) sum += part[slice];
    return sum;
}

void sdm_fit_samples_moments(const fit_samples *samples, const fit_observation *obs, int n_threads,
                             fit_moments *out)
{
    const size_t n = samples->n;
    fit_moments part[FIT_SLICES];
    memset(part, 0, sizeof part);
    n_threads = sdm_threads(n_threads);
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = n * slice / FIT_SLICES; i < n * (slice + 1) / FIT_SLICES; i++)
            if (!fit_sample_is_beyond(samples, i))
                sdm_fit_moments_add(obs, (double)samples->value[i], fit_sample_weights(samples, i),
                                    samples->field[i], &part[slice]);
    *out = part[0];
    for (size_t slice = 1; slice < FIT_SLICES; slice++)
        for (size_t i = 0; i < FIT_TISSUES_MAX; i++) {
            out->share[i] += part[slice].share[i];
            out->n[i] += part[slice].n[i];
            out->count[i] += part[slice].count[i];
            out->first[i] += part[slice].first[i];
            out->square[i] += part[slice].square[i];
        }
}
