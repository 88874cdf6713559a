/* Samples beyond the open end of a shape. */
#include <math.h>
#include <string.h>

#include "samples.h"
#include "sdm/memory.h"

// memory for the weights of n samples
static sdm_status weights_room(fit_beyond *b, size_t n, sdm_error *err)
{
    if (n <= b->capacity) return SDM_OK;
    const size_t room = n + n / 4;
    sdm_free(b->weight);
    sdm_free(b->row);
    b->weight = NULL, b->row = NULL, b->capacity = 0;
    sdm_status s = SDM_ALLOC(&b->weight, room, "voxels beyond the open end", err);
    if (!s) s = SDM_ALLOC(&b->row, room, "voxels beyond the open end", err);
    if (!s) b->capacity = room;
    return s;
}

static sdm_status rows_room(fit_beyond *b, size_t n, size_t n_columns, sdm_error *err)
{
    if (n <= b->row_capacity) return SDM_OK;
    const size_t room = n + n / 4;
    sdm_free(b->jacobian);
    b->jacobian = NULL, b->row_capacity = 0;
    const sdm_status s =
        SDM_ALLOC(&b->jacobian, room * n_columns, "voxels beyond the open end", err);
    if (!s) b->row_capacity = room;
    return s;
}

sdm_status sdm_fit_beyond_evaluate(fit_samples *s, const fit_maps *maps, const fit_state *state,
                                   sdm_error *err)
{
    fit_beyond *b = &s->beyond;
    double params[FIT_PARAMS_MAX], slopes[FIT_PARAMS_MAX][FIT_OPEN_NUMBERS], y[3];
    const size_t n_columns = fit_columns(maps->n_params);
    fit_open_end end;
    if (!b->on) return SDM_OK;
    memcpy(params, state->params, sizeof params);
    sdm_status status = sdm_fit_open_end_make(maps->source->shape, params, b->margin, &end, err);
    if (!status) status = sdm_fit_open_end_slopes(maps->source->shape, params, slopes, err);
    if (!status) status = weights_room(b, s->n, err);
    if (status) return status;
    size_t rows = 0;
    for (size_t i = 0; i < s->n; i++) {
        sdm_fit_to_shape(state, s->world + 3 * i, y);
        b->weight[i] = sdm_fit_open_end_weight(&end, y, NULL, NULL);
        b->row[i] = b->weight[i] > 0 && b->weight[i] < 1 ? rows++ : SIZE_MAX;
    }
    status = rows_room(b, rows, n_columns, err);
    for (size_t i = 0; i < s->n && !status; i++) {
        double by_y[3], by_numbers[FIT_OPEN_NUMBERS], rest[FIT_FIELDS_MAX] = {0};
        if (b->row[i] == SIZE_MAX) continue;
        sdm_fit_to_shape(state, s->world + 3 * i, y);
        (void)sdm_fit_open_end_weight(&end, y, by_y, by_numbers);
        for (size_t k = 0; k < maps->n_params; k++)
            for (size_t a = 0; a < FIT_OPEN_NUMBERS; a++) rest[k] += by_numbers[a] * slopes[k][a];
        sdm_fit_jacobian_row(maps, state, s->world + 3 * i, by_y, rest,
                             b->jacobian + b->row[i] * n_columns);
    }
    return status;
}

bool sdm_fit_beyond_end(const fit_samples *s, const fit_maps *maps, fit_open_end *end)
{
    return s->beyond.on &&
           !sdm_fit_open_end_make(maps->source->shape, maps->params, s->beyond.margin, end, NULL);
}

// log of (exp(a) + exp(b))
static double log_sum(double a, double b)
{
    const double most = fmax(a, b);
    return most + log(exp(a - most) + exp(b - most));
}

// *a = the mixture of *a, with this share, and *b; log_likelihood is not set
static void derivatives_mix(size_t n_channels, double share, fit_likelihood *a,
                            const fit_likelihood *b)
{
    const double rest = 1 - share;
    for (size_t i = 0; i < n_channels; i++)
        for (size_t k = 0; k < n_channels; k++) {
            const size_t at = i * n_channels + k;
            const double apart = (a->score[i] - b->score[i]) * (a->score[k] - b->score[k]);
            a->complete[at] = share * a->complete[at] + rest * b->complete[at];
            a->observed[at] =
                share * a->observed[at] + rest * b->observed[at] - share * rest * apart;
        }
    for (size_t i = 0; i < n_channels; i++) a->score[i] = share * a->score[i] + rest * b->score[i];
}

// the field has no influence
static void field_forget(size_t n_channels, fit_likelihood *l)
{
    l->score[0] = 0;
    for (size_t k = 0; k < n_channels; k++)
        l->complete[k] = l->observed[k] = l->complete[k * n_channels] =
            l->observed[k * n_channels] = 0;
}

// likelihood of a sample beyond the end: outside + inside / 2
static void likelihood_of_either(const fit_observation *obs, double value, const float *log_weight,
                                 bool derivatives, fit_likelihood *out)
{
    const bool share = obs->kind == SDM_FIT_IMAGE && obs->model == SDM_FIT_PARTIAL_VOLUME;
    const double far = 1e3 * obs->l_ref; // mm, farther from the surface than the prior sees
    fit_likelihood in;
    sdm_fit_likelihood(obs, value, log_weight, share ? 1 : -far, derivatives, &in);
    sdm_fit_likelihood(obs, value, log_weight, share ? 0 : far, derivatives, out);
    const double outside = out->log_likelihood, all = log_sum(in.log_likelihood - log(2), outside);
    out->log_likelihood = all;
    if (!derivatives) return;
    field_forget(obs->n_channels, &in);
    field_forget(obs->n_channels, out);
    derivatives_mix(obs->n_channels, exp(outside - all), out, &in);
}

double sdm_fit_likelihood_beyond(const fit_observation *obs, double value, const float *log_weight,
                                 double field, double weight, bool derivatives, fit_likelihood *out)
{
    sdm_fit_likelihood(obs, value, log_weight, field, derivatives, out);
    if (!(weight > 0)) return 0;
    fit_likelihood either;
    likelihood_of_either(obs, value, log_weight, derivatives, &either);
    const double by_field = out->log_likelihood, beyond = either.log_likelihood,
                 all =
                     weight < 1 ? log_sum(log1p(-weight) + by_field, log(weight) + beyond) : beyond;
    out->log_likelihood = all;
    if (derivatives)
        derivatives_mix(obs->n_channels, weight < 1 ? (1 - weight) * exp(by_field - all) : 0, out,
                        &either);
    return exp(beyond - all) - exp(by_field - all);
}

size_t sdm_fit_samples_drop_beyond(fit_samples *s)
{
    const size_t before = s->n;
    size_t n = 0;
    for (size_t i = 0; i < before; i++) {
        if (fit_sample_is_beyond(s, i)) continue;
        memmove(s->world + 3 * n, s->world + 3 * i, 3 * sizeof *s->world);
        s->value[n] = s->value[i];
        s->voxel[n] = s->voxel[i];
        for (size_t k = 0; k < s->n_outside; k++)
            s->log_weight[n * s->n_outside + k] = s->log_weight[i * s->n_outside + k];
        n++;
    }
    s->n = n;
    s->beyond.on = false;
    return before - n;
}
