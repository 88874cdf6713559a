/* The covariance caused by the steps of labels. */
#include "label_steps.h"

#include <math.h>

#include "fit/data/samples.h"
#include "fit/data/step_phase.h"
#include "matching_steps.h"
#include "sdm/internal/heap.h"

// least component of the normal along an axis of the image on a face parallel to the voxels
#define PARALLEL 0.9
// layers of voxels beyond the box of the neighbours on either side
enum { MARGIN = 4 };

// ways in which a piece can be off: as a whole, and tilted along each of the other two axes
enum { MODES = 3 };
// variance of the end of a tilted piece in squared voxels; with that of its middle, also 1 / 24, it
// is the variance of a straight line between two ends anywhere within a voxel
#define TILT_VARIANCE (1.0 / 24)

// a fit puts a straight line through one step in the middle of a face, with this rise, in voxels,
// from the step to either end, though any rise between 0 and 1 has the same labels
#define ONE_STEP 0.75
// variance of the unit normals of a piece from which on it counts as curved
#define CURVED 0.1
// the same of a piece together with the pieces in the layers above and below, from which on its
// place within a voxel is known: that of a flat face fits best half-way between two layers,
// wherever the face lies
#define BENT 0.03

/* The surface next to a sample, where it is nearly parallel to the voxels. */
typedef struct place {
    /* axis of the image along which it lies, and whether the outside is above */
    int axis;
    bool above;
    /* place of the surface along this axis, and index of the sample, in voxels; normal along the
       axes of the image */
    double along, index[3], normal[3];
} place;

/* A piece of the surface between two layers of voxels. */
typedef struct piece {
    /* sums over the samples of the piece; the weight of a sample is its information about the
       place of the surface */
    fit_step_phase phase;
    /* sums over the samples of weight * normal, weight * height and weight * height^2; height:
       distance of the surface, in voxels, from the layer of voxels below it */
    double normal[3], first, second;
    /* extent of the samples along the other two axes, in voxels */
    double low[2], high[2];
    /* [MODES][n_unknowns] sums of the score caused by an error of 1 mm of the place, and of the
       score times the place along each of the other two axes, in voxels */
    double *score;
} piece;

// finds the surface next to sample i; false: it is parallel to no axis
static bool find_place(const fit_problem *p, const fit_field *f, size_t i, place *out)
{
    const sdm_grid *image = &p->target->grid;
    const double *x = p->samples.world + 3 * i, h = 0.5 * fit_longest_edge(&p->maps.grid);
    double slope[3], length = 0;
    for (int k = 0; k < 3; k++) {
        double side[2];
        for (int s = 0; s < 2; s++) {
            double y[3] = {x[0], x[1], x[2]};
            y[k] += s ? h : -h;
            side[s] = sdm_fit_field_at(f, &p->state, y);
        }
        slope[k] = side[1] - side[0];
        length += slope[k] * slope[k];
    }
    length = sqrt(length);
    out->axis = -1;
    for (int a = 0; a < 3; a++) {
        out->normal[a] = 0;
        for (int k = 0; k < 3; k++) out->normal[a] += slope[k] * image->dir[3 * k + a] / length;
        if (fabs(out->normal[a]) > PARALLEL) out->axis = a;
    }
    if (out->axis < 0) return false;
    const double normal = out->normal[out->axis];
    sdm_grid_index(image, x, out->index);
    out->above = normal > 0;
    out->along = out->index[out->axis] -
                 sdm_fit_field_at(f, &p->state, x) * normal / image->spacing[out->axis];
    return true;
}

static void piece_add(piece *q, size_t n, const place *at, double weight, const float *score)
{
    const double above = at->along - floor(at->along),
                 other[2] = {at->index[(at->axis + 1) % 3], at->index[(at->axis + 2) % 3]};
    for (int a = 0; a < 2; a++) {
        q->low[a] = q->phase.all > 0 ? fmin(q->low[a], other[a]) : other[a];
        q->high[a] = q->phase.all > 0 ? fmax(q->high[a], other[a]) : other[a];
    }
    fit_step_phase_add(&q->phase, weight, at->along);
    for (int a = 0; a < 3; a++) q->normal[a] += weight * at->normal[a];
    q->first += weight * above;
    q->second += weight * above * above;
    for (size_t k = 0; k < n; k++) {
        q->score[k] += (double)score[k];
        for (size_t a = 0; a < 2; a++) q->score[(1 + a) * n + k] += (double)score[k] * other[a];
    }
}

// variance of the unit normals of n pieces: 1 - squared length of their mean
static double normal_variance(const piece *list, size_t n)
{
    double normal[3] = {0}, all = 0, length2 = 0;
    for (size_t i = 0; i < n; i++) {
        all += list[i].phase.all;
        for (int a = 0; a < 3; a++) normal[a] += list[i].normal[a];
    }
    for (int a = 0; a < 3; a++) length2 += normal[a] * normal[a] / (all * all);
    return 1 - length2;
}

// sd[MODES] of a piece in voxels, as a whole and at its ends
static void piece_deviations(const piece *q, double sd[MODES])
{
    const double all = q->phase.all, mean = q->first / all,
                 even = (q->second / all - mean * mean) / (FIT_STEP_SD * FIT_STEP_SD),
                 hidden = fmin(fmax((1 - even) / (1 - ONE_STEP * ONE_STEP), 0), 1);
    const double flat = fmin(fmax(1 - normal_variance(q, 1) / CURVED, 0), 1),
                 whole = hypot(q->phase.turn[0], q->phase.turn[1]) / all;
    sd[0] = FIT_STEP_SD * (flat * fmax(hidden, whole) + (1 - flat) * whole);
    sd[1] = sd[2] = sqrt(TILT_VARIANCE) * flat * hidden;
}

// adds the covariance caused by a piece with voxels of this edge, mm
static void piece_covariance(piece *q, size_t n, double edge, double *out)
{
    double sd[MODES];
    piece_deviations(q, sd);
    for (size_t mode = 0; mode < MODES; mode++) {
        double *score = q->score + mode * n;
        const double variance = edge * edge * sd[mode] * sd[mode];
        // a tilt is 0 in the middle of the piece and 1 at its ends
        if (mode > 0) {
            const double middle = 0.5 * (q->high[mode - 1] + q->low[mode - 1]),
                         half = 0.5 * (q->high[mode - 1] - q->low[mode - 1]);
            if (!(half > 0)) continue;
            for (size_t k = 0; k < n; k++) score[k] = (score[k] - middle * q->score[k]) / half;
        }
        for (size_t j = 0; j < n; j++)
            for (size_t k = 0; k < n; k++) out[j * n + k] += variance * score[j] * score[k];
    }
}

// the piece *q, described as a step whose error others may share; near[n]: this piece and those of
// its side in the layers next to it
static fit_matching_step piece_step(const piece *q, const piece *near, size_t n, bool above,
                                    double edge)
{
    const double whole = hypot(q->phase.turn[0], q->phase.turn[1]) / q->phase.all,
                 bent = fmin(fmax(normal_variance(near, n) / BENT, 0), 1),
                 within = atan2(q->phase.turn[1], q->phase.turn[0]) / 6.283185307179586;
    return (fit_matching_step){.place = above ? within : -within,
                               .sd = edge * FIT_STEP_SD * whole * bent,
                               .weight = q->phase.all * whole * bent,
                               .score = q->score};
}

// adds the covariance caused by the pieces of one side, by layer, and appends their steps
static size_t side_covariance(piece *list, size_t layers, size_t n, bool above, double edge,
                              fit_matching_step *steps, double *out)
{
    size_t n_steps = 0;
    for (size_t i = 0; i < layers; i++) {
        if (!(list[i].phase.all > 0)) continue;
        const size_t from = i > 0 ? i - 1 : 0, to = i + 1 < layers ? i + 1 : i;
        const fit_matching_step step =
            piece_step(&list[i], list + from, to + 1 - from, above, edge);
        if (step.sd > 0) steps[n_steps++] = step;
        piece_covariance(&list[i], n, edge, out);
    }
    return n_steps;
}

sdm_status sdm_fit_label_steps(const fit_problem *p, const fit_neighbours *v, double *out,
                               sdm_error *err)
{
    const fit_field field = sdm_fit_maps_distances(&p->maps);
    const size_t n = v->n_unknowns;
    size_t first[3], layers[3], count = 0, all = 0, n_steps = 0;
    piece *list = NULL;
    double *score = NULL;
    fit_matching_step *steps = NULL;
    // pieces: by axis, by side, by layer of voxels
    for (int a = 0; a < 3; a++) {
        first[a] = all;
        layers[a] = (size_t)(v->size[a] * v->step) + 2 * MARGIN;
        all += 2 * layers[a];
    }
    sdm_status s = SDM_ALLOC(&list, all, "covariance of the score", err);
    if (!s) s = SDM_ALLOC(&score, (all * MODES + 1) * n + all, "covariance of the score", err);
    if (!s) s = SDM_ALLOC(&steps, all, "covariance of the score", err);
    for (size_t i = 0; i < all && !s; i++) list[i].score = score + i * MODES * n;
    for (size_t i = 0; i < p->samples.n && !s; i++) {
        place at;
        if (!sdm_fit_in_inner_band(p, i)) continue;
        const size_t number = count++;
        if (!find_place(p, &field, i, &at)) continue;
        const double layer = floor(at.along) - (double)v->first[at.axis] + MARGIN,
                     weight = (double)v->weight[number];
        if (!(layer >= 0 && layer < (double)layers[at.axis])) continue;
        piece *q = &list[first[at.axis] + (at.above ? layers[at.axis] : 0) + (size_t)layer];
        piece_add(q, n, &at, weight * weight, v->model_score + number * n);
    }
    for (size_t side = 0; side < 6 && !s; side++) {
        const size_t a = side / 2, above = side % 2;
        n_steps += side_covariance(list + first[a] + above * layers[a], layers[a], n, above,
                                   p->target->grid.spacing[a], steps + n_steps, out);
    }
    if (!s) sdm_fit_matching_steps(steps, n_steps, n, score + all * MODES * n, out);
    sdm_free(steps);
    sdm_free(list);
    sdm_free(score);
    return s;
}
