/* The estimate of a fit through a network is where the score with the network's maps is zero. The
 * score with the exact map of the same shape, times the inverse of the information, is the way from
 * there to the estimate with exact maps, as long as it is short. */
#include "network_bias.h"

#include <string.h>

#include "fit/solver/objective.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

bool sdm_fit_can_measure_network(const fit_problem *p)
{
    return p->source->model && p->source->shape && !p->maps.exact;
}

// part[N] += the change of the score of sample i by the field of the exact map
static void sample_add(const fit_problem *p, const fit_maps *exact, size_t i, double *part)
{
    const fit_samples *s = &p->samples;
    const fit_observation *obs = &p->observation;
    const float *column = s->jacobian + s->row[i] * s->n_columns,
                *weights = fit_sample_weights(s, i);
    const double value = (double)s->value[i],
                 field = sdm_fit_maps_at(exact, &p->state, s->world + 3 * i);
    fit_likelihood by_network, by_exact;
    sdm_fit_likelihood(obs, value, weights, s->field[i], true, &by_network);
    sdm_fit_likelihood(obs, value, weights, field, true, &by_exact);
    const double change = by_exact.score[0] - by_network.score[0];
    for (size_t a = 0; a < s->n_columns; a++) part[a] += change * (double)column[a];
    for (size_t a = 1; a < obs->n_channels; a++)
        part[s->n_columns + a - 1] += by_exact.score[a] - by_network.score[a];
}

// score[N] = the change of the score by the exact map; parts: memory for FIT_SLICES * N numbers
static void score_change(const fit_problem *p, const fit_maps *exact, double *parts, double *score)
{
    const fit_samples *s = &p->samples;
    const size_t n = p->information.n_unknowns;
    const int n_threads = sdm_threads(p->opts->n_threads);
    (void)n_threads; // unused without OpenMP
    memset(parts, 0, FIT_SLICES * n * sizeof *parts);
    memset(score, 0, n * sizeof *score);
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = s->n * slice / FIT_SLICES; i < s->n * (slice + 1) / FIT_SLICES; i++)
            if (s->row[i] != SIZE_MAX) sample_add(p, exact, i, parts + slice * n);
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t a = 0; a < n; a++) score[a] += parts[slice * n + a];
}

sdm_status sdm_fit_network_bias(const fit_problem *p, const double *influence, double *change,
                                sdm_error *err)
{
    const size_t n = p->information.n_unknowns;
    double *parts = NULL, score[FIT_UNKNOWNS_MAX];
    fit_maps exact;
    memset(change, 0, n * sizeof *change);
    sdm_status s = sdm_fit_maps_create(p->source, p->maps.share, p->opts, &exact, err);
    if (s) return s;
    exact.exact = true;
    if (p->maps.between) s = sdm_fit_maps_between_begin(&exact, p->opts, err);
    if (!s) s = SDM_ALLOC(&parts, FIT_SLICES * n, "scores of the samples", err);
    if (!s) s = sdm_fit_maps_make(&exact, p->state.params, false, err);
    if (!s) {
        sdm_fit_maps_pack(&exact, sdm_fit_field_blur(p), false);
        score_change(p, &exact, parts, score);
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++) change[a] += influence[a * n + b] * score[b];
    }
    sdm_free(parts);
    sdm_fit_maps_dispose(&exact);
    return s;
}
