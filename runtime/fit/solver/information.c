/* Sums over slices of sites, added in the order of the slices. */
#include "information.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "sdm/internal/threads.h"
#include "sdm/memory.h"

// neighbouring voxels share the rounding of a voxel of the map, and their scores are alike
#define ROUNDING (8 * (double)FLT_EPSILON)

// numbers of one slice: log-likelihood, its squared derivatives by the relative rounding of fields,
// gradient, two matrices
static size_t part_size(size_t n) { return 2 + n + 2 * n * n; }

sdm_status sdm_fit_sums_create(size_t n_unknowns, fit_sums *out, sdm_error *err)
{
    const size_t n = n_unknowns;
    *out = (fit_sums){.n_unknowns = n};
    sdm_status s = SDM_ALLOC(&out->gradient, n, "sums of the fit", err);
    if (!s) s = SDM_ALLOC(&out->complete, n * n, "sums of the fit", err);
    if (!s) s = SDM_ALLOC(&out->observed, n * n, "sums of the fit", err);
    if (!s) s = SDM_ALLOC(&out->parts, FIT_SLICES * part_size(n), "sums of the fit", err);
    if (s) sdm_fit_sums_dispose(out);
    return s;
}

void sdm_fit_sums_dispose(fit_sums *s)
{
    sdm_free(s->gradient);
    sdm_free(s->complete);
    sdm_free(s->observed);
    sdm_free(s->parts);
    *s = (fit_sums){0};
}

// field of one site: the block of the columns, and their products with the means
static void add_columns(const fit_response *r, const float *column, size_t n_columns,
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

// upper triangles
static void add_slice(const fit_sites *s, const fit_laws *l, size_t from, size_t to, size_t n,
                      double *part)
{
    double *gradient = part + 2, *complete = gradient + n, *observed = complete + n * n;
    const size_t nc = s->n_columns;
    memset(part, 0, part_size(n) * sizeof *part);
    for (size_t i = from; i < to; i++) {
        fit_response r;
        const bool near = s->slot[i] != SIZE_MAX;
        sdm_fit_respond(l, (double)s->value[i], fit_place(s, i), s->field[i],
                        near || l->n_channels > 1, &r);
        part[0] += r.log_likelihood;
        if (near) part[1] += r.score[0] * r.score[0] * s->field[i] * s->field[i];
        if (near)
            add_columns(&r, s->columns + s->slot[i] * nc, nc, l->n_channels, n, gradient, complete,
                        observed);
        for (size_t a = 1; a < l->n_channels; a++) {
            gradient[nc + a - 1] += r.score[a];
            for (size_t b = a; b < l->n_channels; b++) {
                complete[(nc + a - 1) * n + nc + b - 1] += r.complete[a * l->n_channels + b];
                observed[(nc + a - 1) * n + nc + b - 1] += r.observed[a * l->n_channels + b];
            }
        }
    }
}

void sdm_fit_sums_fill(fit_sums *s, const fit_sites *sites, const fit_laws *laws, int n_threads)
{
    const size_t n = s->n_unknowns, size = part_size(n);
    n_threads = sdm_threads(n_threads);
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        add_slice(sites, laws, sites->n * slice / FIT_SLICES, sites->n * (slice + 1) / FIT_SLICES,
                  n, s->parts + slice * size);
    for (size_t slice = 1; slice < FIT_SLICES; slice++)
        for (size_t i = 0; i < size; i++) s->parts[i] += s->parts[slice * size + i];
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

double sdm_fit_sums_value(const fit_sites *sites, const fit_maps *maps, const fit_laws *laws,
                          const fit_state *state)
{
    const fit_field f = sdm_fit_field(maps);
    double part[FIT_SLICES] = {0}, sum = 0;
    const int n_threads = sdm_threads(maps->n_threads);
    (void)n_threads; // without OpenMP
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = sites->n * slice / FIT_SLICES; i < sites->n * (slice + 1) / FIT_SLICES;
             i++) {
            const double field = sdm_fit_field_at(&f, state, sites->world + 3 * i);
            fit_response r;
            sdm_fit_respond(laws, (double)sites->value[i], fit_place(sites, i), field, false, &r);
            part[slice] += r.log_likelihood;
        }
    for (size_t slice = 0; slice < FIT_SLICES; slice++) sum += part[slice];
    return sum;
}

void sdm_fit_sums_moments(const fit_sites *sites, const fit_laws *laws, int n_threads,
                          fit_moments *out)
{
    fit_moments part[FIT_SLICES];
    memset(part, 0, sizeof part);
    n_threads = sdm_threads(n_threads);
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = sites->n * slice / FIT_SLICES; i < sites->n * (slice + 1) / FIT_SLICES; i++)
            sdm_fit_moments_add(laws, (double)sites->value[i], fit_place(sites, i), sites->field[i],
                                &part[slice]);
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
