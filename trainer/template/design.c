/* Designs a template network: parts, frames and amplitudes as polynomials of the parameters, warps,
   templates. */
#include "design.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "motion.h"
#include "regression.h"
#include "rotations.h"
#include "sdm/internal/mat3.h"
#include "sdm/memory.h"
#include "template_maps.h"
#include "template_parts.h"
#include "warp_modes.h"

/* Number of meshes from which the polynomials are computed. */
static size_t sample_count(size_t n_params)
{
    const size_t quadratic = sdm_poly_count(n_params, 2);
    const size_t n = 6 * quadratic;
    return n < 768 ? 768 : n > 4096 ? 4096 : n;
}

// frames[n_parts][S] = motions of all parts at the samples, in the world
static sdm_status sample_motions(const template_design *d, size_t n, motion *frames, sdm_error *err)
{
    sdm_mesh mesh = {0};
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < n && !s; i++) {
        double p[SDM_POD_MAX_PARAMS];
        trainer_family_params(&d->family, i, p);
        s = trainer_family_mesh(&d->family, p, &mesh, err);
        for (size_t c = 0; c < d->n_parts && !s; c++)
            trainer_template_motion(d, c, mesh.vert, &frames[c * n + i]);
    }
    sdm_mesh_dispose(&mesh);
    return s;
}

// The pivot of relative motions: the point nearest to `centre` that moves least,
// sum over the samples of |m p + b - p|^2 -> min.
static void find_pivot(const motion *relative, size_t n, const double centre[3], double pivot[3])
{
    double a[9] = {0}, right[3] = {0}, trace = 0, inverse[9], x[3];
    for (size_t s = 0; s < n; s++) {
        double e[9], at[3];
        for (int i = 0; i < 9; i++) e[i] = relative[s].m[i] - (i % 4 == 0);
        m3_apply(e, centre, at);
        for (int i = 0; i < 3; i++) at[i] += relative[s].b[i];
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                right[i] -= e[3 * j + i] * at[j];
                for (int k = 0; k < 3; k++) a[3 * i + k] += e[3 * j + i] * e[3 * j + k];
            }
    }
    for (int i = 0; i < 3; i++) trace += a[4 * i];
    // turns of less than about 1e-5 rad, such as rounding, have no pivot
    for (int i = 0; i < 3; i++) a[4 * i] += 1e-9 * trace + 1e-10 * (double)n;
    m3_inverse(a, inverse);
    m3_apply(inverse, right, x);
    for (int i = 0; i < 3; i++) pivot[i] = centre[i] + (isfinite(x[i]) ? x[i] : 0);
}

// Centre and radius of a part in the base mesh.
static double part_radius(const template_design *d, size_t c, double centre[3])
{
    double radius = 0;
    memset(centre, 0, 3 * sizeof *centre);
    const double n = (double)(d->first[c + 1] - d->first[c]);
    for (size_t k = d->first[c]; k < d->first[c + 1]; k++)
        for (int a = 0; a < 3; a++)
            centre[a] += d->family.base.vert[3 * d->vertices[k] + (size_t)a] / n;
    for (size_t k = d->first[c]; k < d->first[c + 1]; k++) {
        double sum = 0;
        for (int a = 0; a < 3; a++) {
            const double e = d->family.base.vert[3 * d->vertices[k] + (size_t)a] - centre[a];
            sum += e * e;
        }
        radius = fmax(radius, sqrt(sum));
    }
    return radius;
}

// Numbers of the frame of part c at the samples: y[S][N] from p->numbers on, weight[N].
static sdm_status frame_numbers(template_design *d, size_t c, size_t n, const motion *frames,
                                double *y, double *weight, sdm_error *err)
{
    sdm_template_part *p = &d->parts[c];
    const size_t count = sdm_template_frame_numbers(p->frame);
    if (count == 0) return SDM_OK;
    motion *relative = NULL;
    const sdm_status s = SDM_ALLOC(&relative, n, "frames", err);
    if (s) return s;
    for (size_t i = 0; i < n; i++)
        if (p->parent >= 0)
            trainer_motion_relative(&frames[(size_t)p->parent * n + i], &frames[c * n + i],
                                    &relative[i]);
        else
            relative[i] = frames[c * n + i];
    double centre[3];
    const double radius = part_radius(d, c, centre);
    find_pivot(relative, n, centre, p->pivot);
    for (size_t i = 0; i < n; i++) {
        double *to = y + i * d->n_numbers + p->numbers, stretch[6];
        const motion *m = &relative[i];
        trainer_motion_polar(m->m, to, stretch);
        for (int a = 0; a < 3; a++)
            to[3 + a] = m->m[3 * a] * p->pivot[0] + m->m[3 * a + 1] * p->pivot[1] +
                        m->m[3 * a + 2] * p->pivot[2] + m->b[a] - p->pivot[a];
        if (p->frame == SDM_FRAME_AFFINE) memcpy(to + 6, stretch, sizeof stretch);
    }
    for (size_t k = 0; k < count; k++) weight[p->numbers + k] = k >= 3 && k < 6 ? 1 : radius;
    sdm_free(relative);
    return SDM_OK;
}

// Fits the functions to the numbers y[S][N].
static sdm_status fit_functions(template_design *d, size_t n, const double *y, const double *weight,
                                double tolerance, sdm_error *err)
{
    const family *f = &d->family;
    double *x = NULL;
    sdm_status s = SDM_ALLOC(&x, n * f->n_params, "polynomials", err);
    if (s) return s;
    for (size_t i = 0; i < n; i++) {
        double *to = x + i * f->n_params;
        trainer_family_params(f, i, to);
        for (size_t k = 0; k < f->n_params; k++)
            to[k] = 2 * (to[k] - f->min[k]) / (f->max[k] - f->min[k]) - 1;
    }
    const regression_data data = {.n_params = f->n_params,
                                  .n_samples = n,
                                  .n_numbers = d->n_numbers,
                                  .x = x,
                                  .y = y,
                                  .weight = weight};
    regression r;
    s = trainer_regression_fit(&data, tolerance, &r, err);
    if (s) {
        trainer_regression_dispose(&r);
    } else {
        d->degree = r.degree, d->n_terms = r.n_terms, d->functions = r.function;
        d->motion_error_mm = d->n_numbers ? r.error : 0;
    }
    sdm_free(x);
    return s;
}

// Frames and warps at random parameters, and the polynomials that give them.
static sdm_status design_motion(template_design *d, double tolerance, sdm_error *err)
{
    const size_t n = sample_count(d->family.n_params);
    double *y = NULL, *weight = NULL;
    double *amplitude[SDM_TEMPLATE_MAX_PARTS] = {NULL};
    motion *frames = NULL;
    sdm_status s = SDM_ALLOC(&frames, d->n_parts * n, "frames", err);
    if (!s) s = sample_motions(d, n, frames, err);
    for (size_t c = 0; c < d->n_parts && !s; c++) {
        sdm_template_part *p = &d->parts[c];
        p->numbers = d->n_numbers;
        d->n_numbers += sdm_template_frame_numbers(p->frame);
        p->amplitudes = d->n_numbers;
        if (p->n_modes == 0) continue;
        s = trainer_template_warp(d, c, n, frames + c * n, tolerance, &amplitude[c], err);
        d->n_numbers += p->n_modes;
    }
    if (!s) s = SDM_ALLOC(&y, n * d->n_numbers, "frames", err);
    if (!s) s = SDM_ALLOC(&weight, d->n_numbers, "frames", err);
    for (size_t c = 0; c < d->n_parts && !s; c++) {
        const sdm_template_part *p = &d->parts[c];
        s = frame_numbers(d, c, n, frames, y, weight, err);
        for (size_t m = 0; m < p->n_modes && !s; m++) {
            weight[p->amplitudes + m] = 1;
            for (size_t i = 0; i < n; i++)
                y[i * d->n_numbers + p->amplitudes + m] = amplitude[c][i * p->n_modes + m];
        }
    }
    if (!s) s = trainer_template_unwrap(d, n, y, err);
    if (!s) s = fit_functions(d, n, y, weight, tolerance, err);
    for (size_t c = 0; c < d->n_parts; c++) sdm_free(amplitude[c]);
    sdm_free(weight);
    sdm_free(y);
    sdm_free(frames);
    return s;
}

sdm_template_spec trainer_template_spec(const template_design *d)
{
    return (sdm_template_spec){.n_parts = d->n_parts,
                               .n_numbers = d->n_numbers,
                               .n_terms = d->n_terms,
                               .degree = d->degree,
                               .functions = d->functions,
                               .parts = d->parts};
}

// The network without a correction, to be evaluated during the training.
static sdm_status make_model(template_design *d, sdm_error *err)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(d->family.shape, &n);
    sdm_model_param p[SDM_POD_MAX_PARAMS] = {0};
    for (size_t i = 0; i < n; i++) {
        snprintf(p[i].name, sizeof p[i].name, "p%zu", i);
        p[i].min = d->family.min[i], p[i].max = d->family.max[i];
        p[i].def = fmin(fmax(params[i].def, p[i].min), p[i].max);
    }
    sdm_model_info info = {.n_params = n, .params = p, .grid = *d->grid};
    sdm_template_spec spec = trainer_template_spec(d);
    spec.info = &info;
    uint8_t *bytes = NULL;
    size_t size = 0;
    sdm_status s = sdm_template_build(&spec, &bytes, &size, err);
    if (!s) s = sdm_model_open_memory("template", bytes, size, &d->model, err);
    sdm_free(bytes);
    return s;
}

sdm_status trainer_template_design(template_design *d, sdm_error *err)
{
    const double h = fmin(fmin(d->grid->spacing[0], d->grid->spacing[1]), d->grid->spacing[2]);
    sdm_status s = trainer_family_create(&d->family, err);
    if (!s) s = trainer_template_parts(d, TRAINER_RIGID * h, err);
    if (!s && d->split && d->n_parts == 1) return SDM_OK;
    if (!s) s = design_motion(d, 0.005 * h, err);
    if (!s) s = trainer_template_maps(d, err);
    if (!s) s = make_model(d, err);
    return s;
}

void trainer_template_design_dispose(template_design *d)
{
    trainer_family_dispose(&d->family);
    for (size_t c = 0; c < SDM_TEMPLATE_MAX_PARTS; c++) {
        sdm_free((void *)d->parts[c].modes);
        sdm_free((void *)d->parts[c].near_nodes);
        sdm_free((void *)d->parts[c].far_nodes);
    }
    sdm_free(d->vertices);
    sdm_free(d->functions);
    sdm_model_free(d->model);
    *d = (template_design){0};
}
