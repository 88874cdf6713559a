/* Principal components of the displacements of vertices, extended into space. */
#include "warp_modes.h"

#include <math.h>
#include <string.h>

#include "freeform.h"
#include "motion.h"
#include "numerics/linalg.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

enum { SNAPSHOTS = 384, NODES_MAX = 9000 };

// out[3 n] = displacements of the part's vertices at sample i, in the part's frame
static sdm_status displacement(const template_design *d, size_t c, size_t i, const motion *frame,
                               sdm_mesh *mesh, float *out, sdm_error *err)
{
    double p[SDM_POD_MAX_PARAMS];
    trainer_family_params(&d->family, i, p);
    const sdm_status s = trainer_family_mesh(&d->family, p, mesh, err);
    if (s) return s;
    for (size_t k = d->first[c]; k < d->first[c + 1]; k++) {
        double y[3];
        const size_t v = d->vertices[k];
        trainer_motion_back(frame, mesh->vert + 3 * v, y);
        for (size_t a = 0; a < 3; a++)
            out[3 * (k - d->first[c]) + a] = (float)(y[a] - d->family.base.vert[3 * v + a]);
    }
    return SDM_OK;
}

// The displacements of the first n samples as rows of y[n][3 vertices].
static sdm_status snapshots(const template_design *d, size_t c, size_t n, const motion *frames,
                            float *y, sdm_error *err)
{
    sdm_mesh mesh = {0};
    const size_t row = 3 * (d->first[c + 1] - d->first[c]);
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < n && !s; i++)
        s = displacement(d, c, i, &frames[i], &mesh, y + i * row, err);
    sdm_mesh_dispose(&mesh);
    return s;
}

// Number of modes, and their values: mode m = sum over the snapshots of vector[m][i] y[i] / norm.
static size_t choose_modes(size_t n, size_t row, const double *values, double tolerance)
{
    double left = 0;
    for (size_t i = 0; i < n; i++) left += fmax(values[i], 0);
    // mean square displacement of a vertex that the modes leave: left / (n row / 3)
    const double limit = tolerance * tolerance * (double)n * (double)row / 3;
    // smaller values are rounding errors of the products in floats
    const double noise = 1e-6 * values[0];
    size_t m = 0;
    while (m < n && m < SDM_TEMPLATE_MAX_MODES && left > limit && values[m] > noise)
        left -= values[m++];
    return m ? m : 1;
}

// The box that the warp must cover: the vertices and the grid, and what lies around both.
static void warp_box(const template_design *d, size_t c, double reach, double min[3], double max[3])
{
    for (int a = 0; a < 3; a++) min[a] = INFINITY, max[a] = -INFINITY;
    for (size_t k = d->first[c]; k < d->first[c + 1]; k++)
        for (int a = 0; a < 3; a++) {
            const double x = d->family.base.vert[3 * d->vertices[k] + (size_t)a];
            min[a] = fmin(min[a], x - reach), max[a] = fmax(max[a], x + reach);
        }
    if (d->parts[c].frame != SDM_FRAME_NONE) return;
    for (int k = 0; k < 8; k++) {
        const double index[3] = {k & 1 ? (double)d->grid->n[0] - 1 : 0,
                                 k & 2 ? (double)d->grid->n[1] - 1 : 0,
                                 k & 4 ? (double)d->grid->n[2] - 1 : 0};
        double x[3];
        sdm_grid_world(d->grid, index, x);
        for (int a = 0; a < 3; a++)
            min[a] = fmin(min[a], x[a] - reach / 2), max[a] = fmax(max[a], x[a] + reach / 2);
    }
}

// Fits the modes on lattices that become finer until the vertices are met.
static sdm_status extend_modes(template_design *d, size_t c, const float *modes, double reach,
                               double tolerance, sdm_error *err)
{
    sdm_template_part *p = &d->parts[c];
    const size_t n = d->first[c + 1] - d->first[c];
    double *x = NULL, min[3], max[3], longest = 0;
    sdm_status s = SDM_ALLOC(&x, 3 * n, "warp", err);
    if (s) return s;
    for (size_t k = 0; k < n; k++)
        memcpy(x + 3 * k, d->family.base.vert + 3 * d->vertices[d->first[c] + k], 3 * sizeof *x);
    const double before = d->warp_error_mm;
    warp_box(d, c, reach, min, max);
    for (int a = 0; a < 3; a++) longest = fmax(longest, max[a] - min[a]);
    for (double cells = 10;; cells *= 1.3) {
        const sdm_lattice l = trainer_freeform_lattice(min, max, longest / cells);
        if (p->modes && sdm_lattice_count(&l) > NODES_MAX) break;
        sdm_free((void *)p->modes);
        float *control = NULL;
        s = SDM_ALLOC(&control, 3 * p->n_modes * sdm_lattice_count(&l), "warp", err);
        p->warp = l;
        p->modes = control;
        if (!s)
            s = trainer_freeform_fit(&l, n, x, p->n_modes, modes, d->family.n_threads, control,
                                     &d->warp_error_mm, err);
        if (s || d->warp_error_mm <= tolerance) break;
    }
    d->warp_error_mm = fmax(d->warp_error_mm, before);
    sdm_free(x);
    return s;
}

sdm_status trainer_template_warp(template_design *d, size_t c, size_t n_samples,
                                 const motion *frames, double tolerance, double **amplitude,
                                 sdm_error *err)
{
    sdm_template_part *p = &d->parts[c];
    const size_t n = n_samples < SNAPSHOTS ? n_samples : SNAPSHOTS,
                 row = 3 * (d->first[c + 1] - d->first[c]);
    float *y = NULL, *gram = NULL, *modes = NULL, *line = NULL;
    double *matrix = NULL, *values = NULL;
    sdm_mesh mesh = {0};
    sdm_status s = SDM_ALLOC(&y, n * row, "warp", err);
    if (!s) s = SDM_ALLOC(&gram, n * n, "warp", err);
    if (!s) s = SDM_ALLOC(&matrix, n * n, "warp", err);
    if (!s) s = SDM_ALLOC(&values, n, "warp", err);
    if (!s) s = SDM_ALLOC(&line, row, "warp", err);
    if (!s) s = snapshots(d, c, n, frames, y, err);
    if (!s) {
        sdm_gemm(n, n, row, (sdm_view){y, row, 1}, (sdm_view){y, 1, row}, false, gram, n,
                 d->family.n_threads);
        for (size_t i = 0; i < n * n; i++)
            matrix[i] = 0.5 * ((double)gram[i] + (double)gram[i % n * n + i / n]);
        s = trainer_eigen_symmetric(n, matrix, values, err);
    }
    double reach = 0; // largest displacement of a vertex
    if (!s) {
        for (size_t i = 0; i < n * row / 3; i++) {
            const float *u = y + 3 * i;
            reach =
                fmax(reach, sqrt((double)u[0] * u[0] + (double)u[1] * u[1] + (double)u[2] * u[2]));
        }
        p->n_modes = choose_modes(n, row, values, tolerance);
        s = SDM_ALLOC(&modes, p->n_modes * row, "warp", err);
    }
    // mode m, scaled so that an amplitude of 1 moves a vertex by 1 mm (root mean square)
    for (size_t m = 0; m < p->n_modes && !s; m++) {
        const double norm = sqrt((double)row / 3 / fmax(values[m], 1e-30));
        for (size_t i = 0; i < n; i++) {
            const float f = (float)(norm * matrix[m * n + i]);
            for (size_t k = 0; k < row; k++) modes[m * row + k] += f * y[i * row + k];
        }
    }
    if (!s) s = extend_modes(d, c, modes, reach, tolerance, err);
    // amplitudes of all samples
    if (!s) s = SDM_ALLOC(amplitude, n_samples * p->n_modes, "warp", err);
    for (size_t i = 0; i < n_samples && !s; i++) {
        const float *u = y + i * row;
        if (i >= n) {
            s = displacement(d, c, i, &frames[i], &mesh, line, err);
            u = line;
        }
        for (size_t m = 0; m < p->n_modes && !s; m++) {
            double sum = 0;
            for (size_t k = 0; k < row; k++) sum += (double)modes[m * row + k] * (double)u[k];
            (*amplitude)[i * p->n_modes + m] = sum / ((double)row / 3);
        }
    }
    sdm_mesh_dispose(&mesh);
    sdm_free(modes);
    sdm_free(line);
    sdm_free(values);
    sdm_free(matrix);
    sdm_free(gram);
    sdm_free(y);
    return s;
}
