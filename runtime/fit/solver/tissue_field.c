/* Spatially variant mixtures (Sanjay-Gopal and Hebert 1998): the weight of a tissue at a place is
   its part of what is about the place, seen through a Gaussian; expectation-maximisation, as for
   weights that are the same everywhere. The parts are collected in the cells of a grid, with
   B-splines between their middles. */
#include "tissue_field.h"

#include <math.h>
#include <string.h>

#include "fit/data/blur.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"

// cells to a standard deviation of the Gaussian, and along an axis at most
#define CELLS 2.0
#define CELLS_MOST 96.0
// ... of the Gaussian in cells at least: a narrower one than the splines between them would have to
// undo these
#define CELLS_LEAST 0.6
// so many standard deviations from the voxels nothing is left of them
#define BEYOND 4.0
// steps of expectation-maximisation to one step of the shape
#define ROUNDS 4
// a tissue that holds fewer independent values has no places: it would be given the texture of
// another
#define VALUES_LEAST 10.0

#define TWO_PI 6.28318530717958648

typedef struct cells {
    sdm_grid grid;
    double sd; // of the Gaussian, mm
    size_t n_tissues;
    double
        known; // what the weights that are the same everywhere count, in units of the packed sums
    double *packed, *spare, *part; // [cells][n_tissues], the same, [sites][n_tissues]
} cells;

static sdm_grid grid_about(const fit_sites *s, double sd)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY},
           longest = 0;
    for (size_t i = 0; i < s->n; i++)
        for (size_t a = 0; a < 3; a++) {
            low[a] = fmin(low[a], s->world[3 * i + a]);
            high[a] = fmax(high[a], s->world[3 * i + a]);
        }
    for (int a = 0; a < 3; a++) longest = fmax(longest, high[a] - low[a] + 2 * BEYOND * sd);
    const double cell = fmax(sd / CELLS, longest / CELLS_MOST);
    int64_t n[3];
    double middle[3];
    for (int a = 0; a < 3; a++) {
        n[a] = (int64_t)ceil((high[a] - low[a] + 2 * BEYOND * sd) / cell) + 1;
        middle[a] = 0.5 * (low[a] + high[a]);
    }
    return sdm_grid_centred(n, cell, middle);
}

static size_t cell_at(const sdm_grid *g, const double x[3])
{
    double index[3];
    sdm_grid_index(g, x, index);
    size_t at = 0;
    for (int a = 2; a >= 0; a--) at = at * (size_t)g->n[a] + (size_t)floor(index[a] + 0.5);
    return at;
}

static void dispose(cells *c)
{
    sdm_free(c->packed);
    sdm_free(c->spare);
    sdm_free(c->part);
}

static sdm_status create(const fit_problem *p, cells *c, sdm_error *err)
{
    *c =
        (cells){.grid = grid_about(&p->sites, p->opts->tissue_mm), .n_tissues = p->sites.n_outside};
    c->sd = fmax(p->opts->tissue_mm, CELLS_LEAST * c->grid.spacing[0]);
    // as much as one independent value in the middle of the Gaussian
    c->known = p->noise_factor * pow(c->grid.spacing[0] / c->sd, 3) / pow(TWO_PI, 1.5);
    const size_t n = sdm_grid_count(&c->grid) * c->n_tissues;
    sdm_status s = SDM_ALLOC(&c->packed, n, "places of tissues", err);
    if (!s) s = SDM_ALLOC(&c->spare, n, "places of tissues", err);
    if (!s) s = SDM_ALLOC(&c->part, p->sites.n * c->n_tissues, "places of tissues", err);
    if (s) dispose(c);
    return s;
}

// one step of expectation-maximisation
static void improve(fit_problem *p, cells *c)
{
    fit_sites *s = &p->sites;
    const size_t n = c->n_tissues, size = sdm_grid_count(&c->grid) * n;
    const int n_threads = sdm_threads(p->opts->n_threads);
    (void)n_threads; // without OpenMP
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (size_t i = 0; i < s->n; i++)
        sdm_fit_outside(&p->laws, (double)s->value[i], fit_place(s, i), s->field[i],
                        c->part + i * n);
    memset(c->packed, 0, size * sizeof *c->packed);
    for (size_t i = 0; i < s->n; i++) {
        double *to = c->packed + cell_at(&c->grid, s->world + 3 * i) * n;
        for (size_t k = 0; k < n; k++) to[k] += c->part[i * n + k];
    }
    sdm_fit_blur(&c->grid, n, c->sd * c->sd, true, n_threads, &c->packed, &c->spare);
    const fit_field f = {.grid = &c->grid, .packed = c->packed, .n_fields = n};
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (size_t i = 0; i < s->n; i++) {
        double found[SDM_FIT_LAWS], ignored[3], sum = c->known;
        found[0] = sdm_fit_sample_all(&f, s->world + 3 * i, ignored, found + 1);
        for (size_t k = 0; k < n; k++) sum += found[k];
        for (size_t k = 0; k < n; k++) {
            const double everywhere = p->laws.tissue[p->laws.n_in + k].weight;
            s->place[i * n + k] = (float)log((found[k] + c->known * everywhere) / sum);
        }
    }
}

// whether the image holds two tissues outside
static bool has_several(const fit_problem *p)
{
    const fit_laws *l = &p->laws;
    size_t n = 0;
    for (size_t k = l->n_in; k < l->n_tissues; k++)
        n += l->tissue[k].weight * (double)p->sites.n > VALUES_LEAST * p->noise_factor;
    return n > 1;
}

// the same weights everywhere
static sdm_status begin(fit_problem *p, sdm_error *err)
{
    fit_sites *s = &p->sites;
    const size_t n = p->laws.n_tissues - p->laws.n_in;
    size_t count;
    sdm_status status = sdm_mul(s->n, n, &count, err);
    if (!status && count > s->place_capacity) {
        sdm_free(s->place);
        s->place = NULL;
        s->place_capacity = 0;
        status = SDM_ALLOC(&s->place, count, "voxels of the fit", err);
        if (!status) s->place_capacity = count;
    }
    if (status) return status;
    s->n_outside = n;
    for (size_t i = 0; i < s->n; i++)
        memcpy(s->place + i * n, p->laws.log_outside, n * sizeof *s->place);
    return SDM_OK;
}

sdm_status sdm_fit_places_update(fit_problem *p, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    if (!p->places || !(o->tissue_mm > 0) || o->keep_appearance || !p->maps.share ||
        !has_several(p)) {
        p->sites.n_outside = 0;
        return SDM_OK;
    }
    cells c;
    sdm_status s = p->sites.n_outside ? SDM_OK : begin(p, err);
    if (!s) s = create(p, &c, err);
    if (s) return s;
    for (int round = 0; round < ROUNDS; round++) improve(p, &c);
    dispose(&c);
    sdm_fit_sums_fill(&p->sums, &p->sites, &p->laws, o->n_threads);
    return SDM_OK;
}
