/* Tissue field as a spatially variant mixture (Sanjay-Gopal and Hebert 1998). The weight of a
 * tissue at a point is its part of the material around the point, averaged with a Gaussian window.
 * It is estimated by expectation-maximisation, as are the weights that are the same everywhere. The
 * shares of the tissues are collected in the cells of a coarse grid and interpolated by cubic
 * B-splines. */
#include "tissue_field.h"

#include <math.h>
#include <string.h>

#include "fit/data/blur.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"

// cells per sd of the window; largest number of cells along an axis
#define CELLS_PER_SD 2.0
#define CELLS_MAX 96.0
// smallest sd of the window, in cells: the B-splines alone spread by 0.58 cells
#define SD_CELLS_MIN 0.6
// distance in sd beyond which the window is negligible
#define BEYOND 4.0
// steps of expectation-maximisation for each Newton step
#define ROUNDS 4
// independent samples that a tissue must hold; with fewer the field would model the texture of
// another tissue
#define VALUES_MIN 10.0

#define TWO_PI 6.28318530717958648

/* The coarse grid of the tissue field. */
typedef struct cells {
    sdm_grid grid;
    /* sd of the Gaussian window, mm */
    double sd;
    size_t n_tissues;
    /* pseudo-count of the weights that are the same everywhere, in units of the smoothed shares */
    double prior_count;
    /* [cells][n_tissues] shares in each cell, scratch of the same size, [samples][n_tissues] shares
     * of each sample */
    double *packed, *spare, *share;
    /* [samples] cell of each sample */
    uint32_t *cell;
} cells;

// grid of cubic cells around all samples, with a margin for the window
static sdm_grid cells_grid(const fit_samples *s, double sd)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY},
           longest = 0;
    for (size_t i = 0; i < s->n; i++)
        for (size_t a = 0; a < 3; a++) {
            low[a] = fmin(low[a], s->world[3 * i + a]);
            high[a] = fmax(high[a], s->world[3 * i + a]);
        }
    for (int a = 0; a < 3; a++) longest = fmax(longest, high[a] - low[a] + 2 * BEYOND * sd);
    const double cell = fmax(sd / CELLS_PER_SD, longest / CELLS_MAX);
    int64_t n[3];
    double middle[3];
    for (int a = 0; a < 3; a++) {
        n[a] = (int64_t)ceil((high[a] - low[a] + 2 * BEYOND * sd) / cell) + 1;
        middle[a] = 0.5 * (low[a] + high[a]);
    }
    return sdm_grid_centred(n, cell, middle);
}

// the cell whose centre is nearest to x
static uint32_t cell_index(const sdm_grid *g, const double x[3])
{
    double index[3];
    sdm_grid_index(g, x, index);
    size_t at = 0;
    for (int a = 2; a >= 0; a--) at = at * (size_t)g->n[a] + (size_t)floor(index[a] + 0.5);
    return (uint32_t)at; // CELLS_MAX^3 cells at most
}

static void cells_dispose(cells *c)
{
    sdm_free(c->packed);
    sdm_free(c->spare);
    sdm_free(c->share);
    sdm_free(c->cell);
}

static sdm_status cells_create(const fit_problem *p, cells *c, sdm_error *err)
{
    *c = (cells){.grid = cells_grid(&p->samples, p->opts->tissue_mm),
                 .n_tissues = p->samples.n_outside};
    c->sd = fmax(p->opts->tissue_mm, SD_CELLS_MIN * c->grid.spacing[0]);
    // a prior as strong as one independent sample in the centre of the window
    c->prior_count = p->noise_factor * pow(c->grid.spacing[0] / c->sd, 3) / pow(TWO_PI, 1.5);
    const size_t n = sdm_grid_count(&c->grid) * c->n_tissues;
    sdm_status s = SDM_ALLOC(&c->packed, n, "tissue field", err);
    if (!s) s = SDM_ALLOC(&c->spare, n, "tissue field", err);
    if (!s) s = SDM_ALLOC(&c->share, p->samples.n * c->n_tissues, "tissue field", err);
    if (!s) s = SDM_ALLOC(&c->cell, p->samples.n, "tissue field", err);
    if (s) {
        cells_dispose(c);
        return s;
    }
    const int n_threads = sdm_threads(p->opts->n_threads);
    (void)n_threads; // unused without OpenMP
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (size_t i = 0; i < p->samples.n; i++)
        c->cell[i] = cell_index(&c->grid, p->samples.world + 3 * i);
    return SDM_OK;
}

// one step of expectation-maximisation
static void em_step(fit_problem *p, cells *c)
{
    fit_samples *s = &p->samples;
    const size_t n = c->n_tissues, size = sdm_grid_count(&c->grid) * n;
    const int n_threads = sdm_threads(p->opts->n_threads);
    (void)n_threads; // unused without OpenMP
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (size_t i = 0; i < s->n; i++)
        sdm_fit_outside_shares(&p->observation, (double)s->value[i], fit_sample_weights(s, i),
                               s->field[i], c->share + i * n);
    // add up the shares in the cells, and smooth them
    memset(c->packed, 0, size * sizeof *c->packed);
    for (size_t i = 0; i < s->n; i++) {
        double *to = c->packed + c->cell[i] * n;
        if (fit_sample_is_beyond(s, i)) continue;
        for (size_t k = 0; k < n; k++) to[k] += c->share[i * n + k];
    }
    sdm_fit_blur(&c->grid, n, c->sd * c->sd, true, n_threads, &c->packed, &c->spare);
    // weights at the samples: smoothed shares and pseudo-counts, normalised
    const fit_field f = {.grid = &c->grid, .packed = c->packed, .n_fields = n};
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (size_t i = 0; i < s->n; i++) {
        double found[SDM_FIT_LAWS], sum = c->prior_count;
        sdm_fit_interpolate_fields(&f, s->world + 3 * i, found);
        for (size_t k = 0; k < n; k++) sum += found[k];
        for (size_t k = 0; k < n; k++) {
            const double global = p->observation.tissue[p->observation.n_in + k].weight;
            s->log_weight[i * n + k] = (float)log((found[k] + c->prior_count * global) / sum);
        }
    }
}

// whether the image holds at least two outside tissues
static bool has_two_tissues(const fit_problem *p)
{
    const fit_observation *obs = &p->observation;
    size_t n = 0;
    for (size_t k = obs->n_in; k < obs->n_tissues; k++)
        n += obs->tissue[k].weight * (double)p->samples.n > VALUES_MIN * p->noise_factor;
    return n > 1;
}

// starts the field with the weights that are the same everywhere
static sdm_status log_weights_init(fit_problem *p, sdm_error *err)
{
    fit_samples *samples = &p->samples;
    const size_t n = p->observation.n_tissues - p->observation.n_in;
    size_t count;
    sdm_status s = sdm_mul(samples->n, n, &count, err);
    if (!s && count > samples->log_weight_capacity) {
        sdm_free(samples->log_weight);
        samples->log_weight = NULL;
        samples->log_weight_capacity = 0;
        s = SDM_ALLOC(&samples->log_weight, count, "voxels of the fit", err);
        if (!s) samples->log_weight_capacity = count;
    }
    if (s) return s;
    samples->n_outside = n;
    for (size_t i = 0; i < samples->n; i++)
        memcpy(samples->log_weight + i * n, p->observation.log_outside,
               n * sizeof *samples->log_weight);
    return SDM_OK;
}

sdm_status sdm_fit_tissue_field_update(fit_problem *p, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    if (!p->use_tissue_field || !(o->tissue_mm > 0) || o->keep_appearance || !p->maps.share ||
        !has_two_tissues(p)) {
        p->samples.n_outside = 0;
        return SDM_OK;
    }
    cells c;
    sdm_status s = p->samples.n_outside ? SDM_OK : log_weights_init(p, err);
    if (!s) s = cells_create(p, &c, err);
    if (s) return s;
    for (int round = 0; round < ROUNDS; round++) em_step(p, &c);
    cells_dispose(&c);
    sdm_fit_information_compute(&p->information, &p->samples, &p->observation, o->n_threads);
    return SDM_OK;
}
