/* At an edge the distance has a kink. There its interpolation is wrong by a part of a voxel, on a
 * share of the surface that is as wide as a voxel: the effect on the unknowns grows with the square
 * of the voxel. So it is a third of the difference between the fit with every second voxel of the
 * map and the one with all (Richardson 1911). There are eight maps of every second voxel; the mean
 * of their squares also holds how the effect changes with the place of the voxels. */
#include "map_bias.h"

#include <math.h>
#include <string.h>

#include "fit/solver/objective.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

enum { COARSE_MAPS = 8 };
#define EFFECT_OVER_DIFFERENCE (1.0 / 3)

// *out: every second voxel of the map, from voxel 0 or 1 of each axis, as the bits of m say; values
// are to be freed
static sdm_status coarse_make(const fit_maps *maps, int m, sdm_grid *out, double **values,
                              sdm_error *err)
{
    const sdm_grid *fine = &maps->grid;
    double first[3];
    *out = *fine;
    for (int a = 0; a < 3; a++) {
        first[a] = m >> a & 1 && fine->n[a] > 1;
        out->n[a] = (fine->n[a] - (int64_t)first[a] + 1) / 2;
        out->spacing[a] = 2 * fine->spacing[a];
    }
    sdm_grid_world(fine, first, out->origin);
    const sdm_status s = SDM_ALLOC(values, sdm_grid_count(out), "coarser map", err);
    size_t v = 0;
    for (int64_t k = (int64_t)first[2]; k < fine->n[2] && !s; k += 2)
        for (int64_t j = (int64_t)first[1]; j < fine->n[1]; j += 2)
            for (int64_t i = (int64_t)first[0]; i < fine->n[0]; i += 2)
                (*values)[v++] = maps->distance[(k * fine->n[1] + j) * fine->n[0] + i];
    return s;
}

// score[N]: change of the score of the points by the distances of the coarser map; parts: memory
// for FIT_SLICES * N numbers
static void score_change(const fit_problem *p, const fit_field *coarse, double *parts,
                         double *score)
{
    const fit_samples *s = &p->samples;
    const size_t n = p->information.n_unknowns;
    const int n_threads = sdm_threads(p->opts->n_threads);
    (void)n_threads; // unused without OpenMP
    memset(parts, 0, FIT_SLICES * n * sizeof *parts);
    memset(score, 0, n * sizeof *score);
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = s->n * slice / FIT_SLICES; i < s->n * (slice + 1) / FIT_SLICES; i++) {
            if (s->row[i] == SIZE_MAX) continue;
            const float *column = s->jacobian + s->row[i] * s->n_columns;
            const double more = sdm_fit_field_at(coarse, &p->state, s->world + 3 * i) - s->field[i];
            fit_likelihood r;
            sdm_fit_likelihood(&p->observation, 0, NULL, s->field[i], true, &r);
            for (size_t a = 0; a < n; a++)
                parts[slice * n + a] -= r.complete[0] * (double)column[a] * more;
        }
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t a = 0; a < n; a++) score[a] += parts[slice * n + a];
}

// spread += the products of the changes of the unknowns by this change of the score
static void spread_add(size_t n, const double *influence, const double *score, double *spread)
{
    double change[FIT_UNKNOWNS_MAX] = {0};
    for (size_t a = 0; a < n; a++)
        for (size_t b = 0; b < n; b++)
            change[a] += EFFECT_OVER_DIFFERENCE * influence[a * n + b] * score[b];
    for (size_t a = 0; a < n; a++)
        for (size_t b = 0; b < n; b++) spread[a * n + b] += change[a] * change[b] / COARSE_MAPS;
}

sdm_status sdm_fit_map_bias(const fit_problem *p, const double *influence, double *spread,
                            sdm_error *err)
{
    const size_t n = p->information.n_unknowns;
    double *parts = NULL, score[FIT_UNKNOWNS_MAX];
    sdm_status s = SDM_ALLOC(&parts, FIT_SLICES * n, "scores of the points", err);
    memset(spread, 0, n * n * sizeof *spread);
    for (int m = 0; m < COARSE_MAPS && !s; m++) {
        sdm_grid grid;
        double *values = NULL;
        s = coarse_make(&p->maps, m, &grid, &values, err);
        const fit_field f = {.grid = &grid, .packed = values, .n_fields = 1, .distance = true};
        if (!s) score_change(p, &f, parts, score);
        if (!s) spread_add(n, influence, score, spread);
        sdm_free(values);
    }
    sdm_free(parts);
    return s;
}

// The same for the share of images, whose edge is drawn from the distances within half a voxel, as
// if the surface were flat there: at sharp edges and thin walls it is wrong in proportion to the
// edge of a voxel. (A trowel with a blade of 3.6 mm: voxels of 1.5 and 1 mm, its width 0.39 and
// 0.27 mm too large.)
//
// largest number of voxels of finer maps, and the smallest factor between the edges
#define FINER_VOXELS_MAX 16e6
#define FINER_MIN 1.3

// the map of the shape at the state of *p, with voxels smaller by the factor `by` that are moved by
// the part `place` of their edge, and its shares
static sdm_status finer_maps_create(const fit_problem *p, double by, double place, fit_maps *f,
                                    sdm_error *err)
{
    const fit_maps *m = &p->maps;
    *f = (fit_maps){.source = m->source,
                    .share = true,
                    .exact = true,
                    .n_threads = m->n_threads,
                    .cancelled = m->cancelled,
                    .user = m->user,
                    .grid = m->grid};
    const double corner = (0.5 + place) / by - 0.5;
    for (int a = 0; a < 3; a++) {
        f->grid.n[a] = (int64_t)ceil((double)m->grid.n[a] * by);
        f->grid.spacing[a] /= by;
    }
    sdm_grid_world(&m->grid, (const double[3]){corner, corner, corner}, f->grid.origin);
    f->n_voxels = sdm_grid_count(&f->grid);
    f->min_blur = 0.5 * fit_longest_edge(&f->grid);
    sdm_status s = SDM_ALLOC(&f->values, f->n_voxels, "finer map", err);
    if (!s) s = SDM_ALLOC(&f->distance, f->n_voxels, "finer map", err);
    if (!s) s = SDM_ALLOC(&f->packed, f->n_voxels, "finer map", err);
    if (!s) s = SDM_ALLOC(&f->spare, f->n_voxels, "finer map", err);
    if (!s) s = sdm_fit_maps_make(f, p->state.params, false, err);
    if (!s) sdm_fit_maps_pack(f, sdm_fit_field_blur(p), false);
    return s;
}

// change[N] = the derivatives of the log-likelihood by the unknowns with the finer maps, less those
// with the maps of the fit
static sdm_status finer_score_change(const fit_problem *p, const fit_maps *finer, double *change,
                                     sdm_error *err)
{
    const fit_samples *s = &p->samples;
    const size_t n = p->information.n_unknowns, nc = s->n_columns;
    double *part = NULL;
    const sdm_status status = SDM_ALLOC(&part, FIT_SLICES * n, "derivatives of the fit", err);
    const int n_threads = sdm_threads(p->opts->n_threads);
    (void)n_threads; // unused without OpenMP
    memset(change, 0, n * sizeof *change);
    if (status) return status;
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = s->n * slice / FIT_SLICES; i < s->n * (slice + 1) / FIT_SLICES; i++) {
            double *sum = part + slice * n;
            fit_likelihood here, there;
            if (s->row[i] == SIZE_MAX) continue;
            const float *weights = fit_sample_weights(s, i), *column = s->jacobian + s->row[i] * nc;
            const double value = (double)s->value[i],
                         field = sdm_fit_maps_at(finer, &p->state, s->world + 3 * i);
            sdm_fit_likelihood(&p->observation, value, weights, s->field[i], true, &here);
            sdm_fit_likelihood(&p->observation, value, weights, field, true, &there);
            for (size_t k = 0; k < nc; k++)
                sum[k] += (there.score[0] - here.score[0]) * (double)column[k];
            for (size_t k = nc; k < n; k++)
                sum[k] += there.score[1 + k - nc] - here.score[1 + k - nc];
        }
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t k = 0; k < n; k++) change[k] += part[slice * n + k];
    sdm_free(part);
    return SDM_OK;
}

sdm_status sdm_fit_finer_map_bias(const fit_problem *p, const double *influence, double *spread,
                                  sdm_error *err)
{
    const size_t n = p->information.n_unknowns;
    const double by = fmin(2, cbrt(FINER_VOXELS_MAX / (double)p->maps.n_voxels)),
                 all = 1 / (1 - 1 / by);
    sdm_status s = SDM_OK;
    if (!(by >= FINER_MIN)) return SDM_OK;
    // faces parallel to the voxels may lie alike between those of both maps: so the finer ones lie
    // at two places
    for (int place = 0; place < 2 && !s; place++) {
        double score[FIT_UNKNOWNS_MAX], change[FIT_UNKNOWNS_MAX] = {0};
        fit_maps finer = {0};
        s = finer_maps_create(p, by, 0.5 * place, &finer, err);
        if (!s) s = finer_score_change(p, &finer, score, err);
        sdm_fit_maps_dispose(&finer);
        for (size_t a = 0; a < n && !s; a++)
            for (size_t b = 0; b < n; b++) change[a] += all * influence[a * n + b] * score[b];
        for (size_t a = 0; a < n && !s; a++)
            for (size_t b = 0; b < n; b++) spread[a * n + b] += 0.5 * change[a] * change[b];
    }
    return s;
}
