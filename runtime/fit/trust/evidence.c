/* The mixture without a shape by expectation-maximisation (Dempster, Laird and Rubin 1977) on a
   sample of the voxels. Where tissues outside have places, they have them without the shape, too.
 */
#include "evidence.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/threads.h"
#include "sdm/memory.h"

#define SAMPLE 20000
#define ITERATIONS 40

// log density of the mixture at a value; p: the probabilities of the tissues
static double ask(const fit_laws *l, double value, const float *place, double *p)
{
    double most = -INFINITY, sum = 0, outside = 0;
    for (size_t i = l->n_in; i < l->n_tissues; i++) outside += l->tissue[i].weight;
    for (size_t i = 0; i < l->n_tissues; i++) {
        const bool local = place && i >= l->n_in;
        p[i] = (local ? log(outside) + (double)place[i - l->n_in] : log(l->tissue[i].weight)) +
               sdm_fit_log_density(l, i, value);
        most = fmax(most, p[i]);
    }
    for (size_t i = 0; i < l->n_tissues; i++) sum += p[i] = exp(p[i] - most);
    for (size_t i = 0; i < l->n_tissues; i++) p[i] /= sum;
    return most + log(sum);
}

static void improve(fit_laws *l, const fit_sites *s, size_t step, double least_sd)
{
    double n[FIT_TISSUES_MAX] = {0}, count[FIT_TISSUES_MAX] = {0}, first[FIT_TISSUES_MAX] = {0},
           square[FIT_TISSUES_MAX] = {0}, p[FIT_TISSUES_MAX], all = 0;
    for (size_t i = 0; i < s->n; i += step) {
        (void)ask(l, (double)s->value[i], fit_place(s, i), p);
        all++;
        for (size_t k = 0; k < l->n_tissues; k++) {
            const sdm_fit_law *t = &l->tissue[k];
            const double r = (double)s->value[i] - t->mean;
            const double w =
                p[k] * (t->dof > 0 ? (t->dof + 1) / (t->dof + r * r / (t->sd * t->sd)) : 1);
            n[k] += p[k], count[k] += w, first[k] += w * r, square[k] += w * r * r;
        }
    }
    for (size_t k = 0; k < l->n_tissues; k++) {
        sdm_fit_law *t = &l->tissue[k];
        t->weight = fmax(n[k] / all, 1e-6);
        if (!(n[k] > 10)) continue;
        const double moved = first[k] / count[k];
        t->mean += moved;
        t->sd = fmax(sqrt(fmax((square[k] - moved * moved * count[k]) / n[k], 0)), least_sd);
    }
}

sdm_status sdm_fit_without_shape(const fit_problem *p, double *log_likelihood, sdm_error *err)
{
    fit_laws l = p->laws;
    double *parts = NULL;
    const sdm_status s = SDM_ALLOC(&parts, FIT_SLICES, "sums of the fit", err);
    if (s) return s;
    const double step = fabs(l.tissue[0].mean - l.tissue[l.n_in].mean);
    for (size_t i = 0; i < l.n_tissues; i++) l.tissue[i].weight *= 0.5;
    for (int i = 0; i < ITERATIONS; i++)
        improve(&l, &p->sites, p->sites.n / SAMPLE + 1, 1e-3 * step);
    const int n_threads = sdm_threads(p->opts->n_threads);
    (void)n_threads; // without OpenMP
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = p->sites.n * slice / FIT_SLICES; i < p->sites.n * (slice + 1) / FIT_SLICES;
             i++) {
            double ignored[FIT_TISSUES_MAX];
            parts[slice] += ask(&l, (double)p->sites.value[i], fit_place(&p->sites, i), ignored);
        }
    *log_likelihood = 0;
    for (size_t slice = 0; slice < FIT_SLICES; slice++) *log_likelihood += parts[slice];
    sdm_free(parts);
    return SDM_OK;
}

double sdm_fit_inside_share(const fit_problem *p)
{
    const sdm_grid *map = &p->maps.grid, *image = &p->target->grid;
    size_t all = 0, inside = 0;
    if (p->target->kind == SDM_FIT_POINTS) return 1;
    for (size_t v = 0; v < p->maps.n_voxels; v++) {
        if (!(p->maps.distance[v] < 0)) continue;
        const size_t nx = (size_t)map->n[0], ny = (size_t)map->n[1];
        const double at[3] = {(double)(v % nx), (double)(v / nx % ny), (double)(v / nx / ny)};
        double y[3], x[3], index[3];
        sdm_grid_world(map, at, y);
        sdm_fit_to_world(&p->state, y, x);
        sdm_grid_index(image, x, index);
        int64_t k[3];
        bool in = true;
        for (int a = 0; a < 3; a++) {
            in = in && index[a] >= -0.5 && index[a] < (double)image->n[a] - 0.5;
            k[a] = in ? (int64_t)floor(index[a] + 0.5) : 0;
            if (k[a] > image->n[a] - 1) k[a] = image->n[a] - 1; // by rounding
        }
        all++;
        if (in && !isnan(p->target->values[(k[2] * image->n[1] + k[1]) * image->n[0] + k[0]]))
            inside++;
    }
    return all ? (double)inside / (double)all : 0;
}
