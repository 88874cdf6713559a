/* Measures the errors of a network or another method on random shapes, against exact maps. */
#include "evaluate.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "report/terminal.h"
#include "sdm/field.h"
#include "sdm/internal/near.h"
#include "sdm/internal/sampling.h"
#include "sdm/internal/threads.h"
#include "sdm/internal/train.h"
#include "sdm/isosurface.h"
#include "sdm/memory.h"
#include "sdm/picture.h"

static sdm_status make_by_model(const void *user, const double *p, float *values, sdm_error *err)
{
    const sdm_generate_opts opts = {.policy = SDM_RANGE_REFUSE, .n_threads = 1};
    return sdm_generate(user, p, &opts, values, NULL, err);
}

cli_map_maker cli_maker_of_model(const sdm_model *m, const sdm_instance *shape)
{
    const sdm_model_info *info = sdm_model_get_info(m);
    cli_map_maker maker = {.shape = shape, .grid = info->grid, .make = make_by_model, .user = m};
    maker.n_params = info->n_params < SDM_MAX_PARAMS ? info->n_params : SDM_MAX_PARAMS;
    for (size_t i = 0; i < maker.n_params; i++) {
        maker.min[i] = info->params[i].min;
        maker.max[i] = info->params[i].max;
        maker.distribution[i] = info->params[i].distribution;
    }
    return maker;
}

static sdm_status make_on_grid(const void *user, const double *p, float *values, sdm_error *err)
{
    const cli_model_on_grid *on = user;
    const sdm_generate_opts opts = {.policy = SDM_RANGE_REFUSE, .n_threads = 1};
    return sdm_generate_grid(on->model, p, &opts, &on->grid, values, NULL, NULL, err);
}

cli_map_maker cli_maker_on_grid(const cli_model_on_grid *on, const sdm_instance *shape)
{
    cli_map_maker maker = cli_maker_of_model(on->model, shape);
    maker.grid = on->grid;
    maker.make = make_on_grid;
    maker.user = on;
    return maker;
}

void cli_maker_params(const cli_map_maker *m, uint64_t seed, size_t index, double *p)
{
    sdm_sample_params(seed, CLI_STREAM_EVAL, index, m->min, m->max, m->distribution, m->n_params,
                      p);
}

void cli_eval_params(const sdm_model *m, uint64_t seed, size_t index, double *p)
{
    const cli_map_maker maker = cli_maker_of_model(m, NULL);
    cli_maker_params(&maker, seed, index, p);
}

static void compare_values(const float *network, const float *exact, const sdm_grid *g,
                           cli_eval_sample *out)
{
    const size_t n = sdm_grid_count(g);
    const float near_mm = (float)sdm_grid_near(g),
                voxel = (float)fmin(fmin(g->spacing[0], g->spacing[1]), g->spacing[2]);
    double sum2 = 0, sum = 0, worst = 0, near = 0;
    size_t n_near = 0, both = 0, in_network = 0, in_exact = 0;
    for (size_t i = 0; i < n; i++) {
        const double e = fabs((double)network[i] - (double)exact[i]);
        sum2 += e * e;
        sum += e;
        if (!(e <= worst)) worst = e; // a NaN stays
        if (fabsf(exact[i]) <= near_mm) {
            near += e * e;
            n_near++;
        }
        const bool inside = sdm_inside_beside(exact[i], network[i], voxel);
        in_network += network[i] < 0;
        in_exact += inside;
        both += network[i] < 0 && inside;
    }
    out->mse_mm2 = sum2 / (double)n;
    out->mae_mm = sum / (double)n;
    out->max_abs_mm = worst;
    out->near_sum = near;
    out->n_near = n_near;
    out->dice =
        in_network + in_exact > 0 ? 2.0 * (double)both / (double)(in_network + in_exact) : 1.0;
}

/* Adds the distances from the vertices of `from` to the surface of `to` to *sum and updates their
 * maximum *largest. */
static sdm_status add_distances(const sdm_mesh *from, const sdm_mesh *to, double *sum,
                                double *largest, sdm_error *err)
{
    const sdm_exact_opts opts = {.keep_overlap = true, .n_threads = 1};
    sdm_exact *engine = NULL;
    const sdm_status s = sdm_exact_create(to, &opts, &engine, err);
    if (s) return s;
    for (size_t i = 0; i < from->n_vert; i++) {
        const double d = sdm_exact_distance(engine, from->vert + 3 * i);
        *sum += d;
        *largest = fmax(*largest, d);
    }
    sdm_exact_free(engine);
    return SDM_OK;
}

static sdm_status compare_surfaces(const sdm_grid *g, const float *network, const float *exact,
                                   cli_eval_sample *out, sdm_error *err)
{
    sdm_mesh a = {0}, b = {0};
    double sum = 0, largest = 0;
    sdm_status s = sdm_isosurface(g, network, 0.0f, &a, NULL, err);
    if (!s) s = sdm_isosurface(g, exact, 0.0f, &b, NULL, err);
    out->has_surface = !s && a.n_tri > 0 && b.n_tri > 0;
    if (out->has_surface) {
        s = add_distances(&a, &b, &sum, &largest, err);
        if (!s) s = add_distances(&b, &a, &sum, &largest, err);
        out->surface_mean_mm = sum / (double)(a.n_vert + b.n_vert);
        out->surface_hausdorff_mm = largest;
    }
    sdm_mesh_dispose(&a);
    sdm_mesh_dispose(&b);
    return s;
}

sdm_status cli_compare_maps(const sdm_grid *g, const float *values, const float *exact,
                            bool surfaces, cli_eval_sample *out, sdm_error *err)
{
    compare_values(values, exact, g, out);
    return surfaces ? compare_surfaces(g, values, exact, out, err) : SDM_OK;
}

/* Makes the maker's map and the exact map at p, on the calling thread alone. */
static sdm_status make_maps(const cli_map_maker *m, const double *p, float *values, float *exact,
                            sdm_error *err)
{
    const sdm_exact_opts opts = {.n_threads = 1};
    const sdm_status s = m->make(m->user, p, values, err);
    return s ? s : sdm_exact_shape_map(m->shape, p, &opts, &m->grid, exact, NULL, err);
}

/* Computes the errors for random shape `index`; maps: memory for two maps. */
static sdm_status evaluate_sample(const cli_map_maker *m, uint64_t seed, size_t index,
                                  bool surfaces, float *maps, cli_eval_sample *out, sdm_error *err)
{
    const size_t n = sdm_grid_count(&m->grid);
    double p[SDM_MAX_PARAMS];
    cli_maker_params(m, seed, index, p);
    const sdm_status s = make_maps(m, p, maps, maps + n, err);
    return s ? s : cli_compare_maps(&m->grid, maps, maps + n, surfaces, out, err);
}

/* ---- all samples ---- */

/* State of an evaluation, shared by all threads. */
typedef struct evaluation {
    const cli_map_maker *m;
    uint64_t seed;
    bool surfaces;
    cli_eval *out;
    size_t failed; /* lowest index of a failed sample; n: none */
    sdm_error err; /* message of that sample */
    size_t done;
    cli_progress progress;
} evaluation;

/* Keeps the error with the lowest index, so that the message does not depend on the threads. */
static void keep_first_error(evaluation *w, size_t index, const sdm_error *err)
{
#pragma omp critical(cli_evaluate_error)
    if (index < w->failed) {
        w->failed = index;
        w->err = *err;
    }
}

static void evaluate_index(evaluation *w, size_t index, float *maps)
{
    sdm_error err = {0};
    sdm_status s = cli_check_interrupt(&err);
    if (!s)
        s = evaluate_sample(w->m, w->seed, index, w->surfaces, maps, &w->out->sample[index], &err);
    if (s) {
        err.status = s;
        keep_first_error(w, index, &err);
    }
    size_t done;
#pragma omp atomic capture
    done = ++w->done;
    if (sdm_thread() == 0)
        cli_progress_show(&w->progress, "measure", (double)done / (double)w->out->n, NULL);
}

static void evaluate_all(evaluation *w)
{
    const size_t n_values = sdm_grid_count(&w->m->grid);
    const long n = (long)w->out->n;
#pragma omp parallel
    {
        float *maps = NULL;
        sdm_error err = {0};
        const sdm_status s =
            sdm_alloc((void **)&maps, n_values, 2 * sizeof *maps, "maps to compare", &err);
        if (s) keep_first_error(w, 0, &err);
#pragma omp for schedule(dynamic, 1)
        for (long i = 0; i < n; i++)
            if (!s) evaluate_index(w, (size_t)i, maps);
        sdm_free(maps);
    }
}

typedef struct ranked {
    double mse;
    size_t index;
} ranked;

static int compare_ranked(const void *a, const void *b)
{
    const ranked *x = a, *y = b;
    if (x->mse != y->mse) return x->mse < y->mse ? -1 : 1;
    return (x->index > y->index) - (x->index < y->index);
}

/* Finds the samples with the largest and the median MSE; equal MSE are ordered by index. */
static sdm_status rank_samples(cli_eval *e, sdm_error *err)
{
    ranked *order = NULL;
    const sdm_status s = SDM_ALLOC(&order, e->n, "order of the samples", err);
    if (s) return s;
    for (size_t i = 0; i < e->n; i++) order[i] = (ranked){e->sample[i].mse_mm2, i};
    qsort(order, e->n, sizeof *order, compare_ranked);
    e->worst = order[e->n - 1].index;
    e->median = order[(e->n - 1) / 2].index;
    sdm_free(order);
    return SDM_OK;
}

/* Sums in the order of the indices, so that the result has the same bits for every number of
 * threads. */
void cli_eval_reduce(cli_eval *e)
{
    double near_sum = 0;
    size_t n_near = 0;
    e->dice_min = 1;
    for (size_t i = 0; i < e->n; i++) {
        const cli_eval_sample *x = &e->sample[i];
        e->dice_min = fmin(e->dice_min, x->dice);
        e->mse_mm2 += x->mse_mm2 / (double)e->n;
        e->mae_mm += x->mae_mm / (double)e->n;
        e->dice += x->dice / (double)e->n;
        if (!(x->max_abs_mm <= e->max_abs_mm)) e->max_abs_mm = x->max_abs_mm;
        near_sum += x->near_sum;
        n_near += x->n_near;
        if (!x->has_surface) continue;
        e->n_surface++;
        e->surface_mean_mm += x->surface_mean_mm;
        e->surface_hausdorff_mm += x->surface_hausdorff_mm;
        e->surface_hausdorff_max_mm = fmax(e->surface_hausdorff_max_mm, x->surface_hausdorff_mm);
    }
    e->rmse_mm = sqrt(e->mse_mm2);
    e->rmse_near_mm = n_near > 0 ? sqrt(near_sum / (double)n_near) : NAN;
    e->surface_mean_mm = e->n_surface > 0 ? e->surface_mean_mm / (double)e->n_surface : NAN;
    e->surface_hausdorff_mm =
        e->n_surface > 0 ? e->surface_hausdorff_mm / (double)e->n_surface : NAN;
    if (e->n_surface == 0) e->surface_hausdorff_max_mm = NAN;
}

sdm_status cli_evaluate(const sdm_model *m, const sdm_instance *shape, uint64_t seed, size_t n,
                        bool surfaces, cli_eval *out, sdm_error *err)
{
    memset(out, 0, sizeof *out);
    if (sdm_model_get_info(m)->n_params > SDM_MAX_PARAMS)
        return sdm_fail(err, SDM_E_ARG, "%zu parameters, at most %d can be sampled",
                        sdm_model_get_info(m)->n_params, SDM_MAX_PARAMS);
    const cli_map_maker maker = cli_maker_of_model(m, shape);
    return cli_evaluate_maps(&maker, seed, n, surfaces, out, err);
}

sdm_status cli_evaluate_maps(const cli_map_maker *m, uint64_t seed, size_t n, bool surfaces,
                             cli_eval *out, sdm_error *err)
{
    memset(out, 0, sizeof *out);
    if (n == 0) return sdm_fail(err, SDM_E_ARG, "0 samples, need at least 1");
    sdm_status s = SDM_ALLOC(&out->sample, n, "figures of the samples", err);
    if (s) return s;
    out->n = n;
    evaluation w = {.m = m, .seed = seed, .surfaces = surfaces, .out = out, .failed = n};
    cli_progress_start(&w.progress);
    evaluate_all(&w);
    cli_progress_end(&w.progress, w.failed == n);
    if (w.failed < n) s = sdm_fail(err, w.err.status, "random shape %zu: %s", w.failed, w.err.text);
    if (s == SDM_E_CANCELLED) s = sdm_fail(err, s, "interrupted");
    if (!s) cli_eval_reduce(out);
    if (!s) s = rank_samples(out, err);
    if (s) cli_eval_dispose(out);
    return s;
}

void cli_eval_dispose(cli_eval *e)
{
    if (!e) return;
    sdm_free(e->sample);
    memset(e, 0, sizeof *e);
}

sdm_status cli_picture_compare(const sdm_model *m, const sdm_instance *shape, uint64_t seed,
                               size_t index, const double *p, const char *path, sdm_error *err)
{
    const cli_map_maker maker = cli_maker_of_model(m, shape);
    const sdm_grid *g = &maker.grid;
    const float levels[] = {0.0f, sdm_grid_contour(g)};
    const size_t n = sdm_grid_count(g);
    double sampled[SDM_MAX_PARAMS];
    float *maps = NULL;
    sdm_status s = sdm_alloc((void **)&maps, n, 3 * sizeof *maps, "maps of the picture", err);
    if (s) return s;
    if (!p) cli_maker_params(&maker, seed, index, sampled);
    s = make_maps(&maker, p ? p : sampled, maps + n, maps, err);
    double square = 0;
    for (size_t i = 0; i < n && !s; i++) {
        const float e = maps[2 * n + i] = maps[n + i] - maps[i];
        square += (double)e * (double)e;
    }
    size_t n_params;
    const sdm_param *params = sdm_instance_params(shape, &n_params);
    sdm_text exact = {0};
    char error[64];
    sdm_text_add(&exact, "exact\n");
    for (size_t i = 0; i < n_params; i++)
        sdm_text_add(&exact, "%s=%.4g ", params[i].name, p ? p[i] : sampled[i]);
    snprintf(error, sizeof error, "error\nroot mean square %.3g mm", sqrt(square / (double)n));
    const sdm_picture_map columns[] = {
        {.title = exact.failed ? "exact" : exact.data, .values = maps},
        {.title = "network", .values = maps + n},
        {.title = error, .values = maps + 2 * n, .error = true}};
    if (!s) s = sdm_picture_slices(path, g, columns, 3, levels, 2, err);
    sdm_text_dispose(&exact);
    sdm_free(maps);
    return s;
}
