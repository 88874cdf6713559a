/* Log-likelihoods for the evidence of the shape. The mixture without a shape is estimated by
 * expectation-maximisation (Dempster, Laird and Rubin 1977) on a subsample of the voxels. The
 * outside tissues keep the tissue field of the fit. */
#include "evidence.h"

#include <math.h>
#include <string.h>

#include "neighbours.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

// number of voxels in the subsample; number of iterations of expectation-maximisation
#define SUBSAMPLE 20000
#define ITERATIONS 40

// log density of the mixture at a value; p: posterior probabilities of the tissues
static double mixture_log_density(const fit_observation *obs, double value, const float *log_weight,
                                  double *p)
{
    double most = -INFINITY, sum = 0, outside = 0;
    for (size_t i = obs->n_in; i < obs->n_tissues; i++) outside += obs->tissue[i].weight;
    for (size_t i = 0; i < obs->n_tissues; i++) {
        const bool local = log_weight && i >= obs->n_in;
        p[i] = (local ? log(outside) + (double)log_weight[i - obs->n_in]
                      : log(obs->tissue[i].weight)) +
               sdm_fit_log_density(obs, i, value);
        most = fmax(most, p[i]);
    }
    for (size_t i = 0; i < obs->n_tissues; i++) sum += p[i] = exp(p[i] - most);
    for (size_t i = 0; i < obs->n_tissues; i++) p[i] /= sum;
    return most + log(sum);
}

// re-estimates the tissues on the samples list[n_list]
static void mixture_em_step(fit_observation *obs, const fit_samples *s, const size_t *list,
                            size_t n_list, double min_sd)
{
    double n[FIT_TISSUES_MAX] = {0}, count[FIT_TISSUES_MAX] = {0}, first[FIT_TISSUES_MAX] = {0},
           square[FIT_TISSUES_MAX] = {0}, p[FIT_TISSUES_MAX], all = 0;
    for (size_t l = 0; l < n_list; l++) {
        const size_t i = list[l];
        (void)mixture_log_density(obs, (double)s->value[i], fit_sample_weights(s, i), p);
        all++;
        for (size_t k = 0; k < obs->n_tissues; k++) {
            const sdm_fit_law *t = &obs->tissue[k];
            const double r = (double)s->value[i] - t->mean;
            const double w =
                p[k] * (t->dof > 0 ? (t->dof + 1) / (t->dof + r * r / (t->sd * t->sd)) : 1);
            n[k] += p[k], count[k] += w, first[k] += w * r, square[k] += w * r * r;
        }
    }
    for (size_t k = 0; k < obs->n_tissues; k++) {
        sdm_fit_law *t = &obs->tissue[k];
        t->weight = fmax(n[k] / all, 1e-6);
        if (!(n[k] > 10)) continue;
        const double moved = first[k] / count[k];
        t->mean += moved;
        t->sd = fmax(sqrt(fmax((square[k] - moved * moved * count[k]) / n[k], 0)), min_sd);
    }
}

sdm_status sdm_fit_shapeless_log_likelihood(const fit_problem *p, double *log_likelihood,
                                            sdm_error *err)
{
    fit_observation obs = p->observation;
    double *parts = NULL;
    size_t *list = NULL, n = 0;
    sdm_status s = SDM_ALLOC(&list, p->samples.n, "log-likelihood of the fit", err);
    if (!s) s = SDM_ALLOC(&parts, FIT_SLICES, "log-likelihood of the fit", err);
    if (s) {
        sdm_free(list);
        return s;
    }
    const double share = (double)SUBSAMPLE / (double)p->samples.n;
    for (size_t i = 0; i < p->samples.n; i++)
        if (sdm_fit_sample_draw(p, i) <= share) list[n++] = i;
    const double step = fabs(obs.tissue[0].mean - obs.tissue[obs.n_in].mean);
    // start: half inside, half outside
    for (size_t i = 0; i < obs.n_tissues; i++) obs.tissue[i].weight *= 0.5;
    for (int i = 0; i < ITERATIONS; i++) mixture_em_step(&obs, &p->samples, list, n, 1e-3 * step);
    const int n_threads = sdm_threads(p->opts->n_threads);
    (void)n_threads; // unused without OpenMP
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = p->samples.n * slice / FIT_SLICES;
             i < p->samples.n * (slice + 1) / FIT_SLICES; i++) {
            double ignored[FIT_TISSUES_MAX];
            parts[slice] += mixture_log_density(&obs, (double)p->samples.value[i],
                                                fit_sample_weights(&p->samples, i), ignored);
        }
    *log_likelihood = 0;
    for (size_t slice = 0; slice < FIT_SLICES; slice++) *log_likelihood += parts[slice];
    sdm_free(parts);
    sdm_free(list);
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
        // centre of the map voxel, and the image voxel that holds it
        double y[3], x[3], index[3];
        sdm_grid_world(map, at, y);
        sdm_fit_to_world(&p->state, y, x);
        sdm_grid_index(image, x, index);
        int64_t k[3];
        bool in = true;
        for (int a = 0; a < 3; a++) {
            in = in && index[a] >= -0.5 && index[a] < (double)image->n[a] - 0.5;
            k[a] = in ? (int64_t)floor(index[a] + 0.5) : 0;
            if (k[a] > image->n[a] - 1) k[a] = image->n[a] - 1; // rounding at the border
        }
        all++;
        if (in && !isnan(p->target->values[(k[2] * image->n[1] + k[1]) * image->n[0] + k[0]]))
            inside++;
    }
    return all ? (double)inside / (double)all : 0;
}
