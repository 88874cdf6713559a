/* The covariance caused by the steps of labels. */
#include "label_steps.h"

#include <math.h>

#include "fit/data/samples.h"
#include "fit/data/step_phase.h"
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

/* A piece of the surface between two layers of voxels. */
typedef struct piece {
    /* sums over the samples of the piece; the weight of a sample is its information about the
       place of the surface */
    fit_step_phase phase;
    /* sums of weight times place above the lower layer, and times its square, in voxels */
    double first, second;
    /* extent of the samples along the other two axes, in voxels */
    double low[2], high[2];
    /* [MODES][n_unknowns] sums of the score caused by an error of 1 mm of the place, and of the
       score times the place along each of the other two axes, in voxels */
    double *score;
} piece;

/* Where the surface next to sample i lies: *axis of the image along which it is nearly parallel to
 * the voxels, whether the outside is above, its place along this axis, and the index of the sample,
 * in voxels. false: it is parallel to no axis. */
static bool find_place(const fit_problem *p, const fit_field *f, size_t i, int *axis, bool *above,
                       double *place, double index[3])
{
    const sdm_grid *image = &p->target->grid;
    const double *x = p->samples.world + 3 * i, h = 0.5 * fit_longest_edge(&p->maps.grid);
    double normal[3], length = 0;
    for (int k = 0; k < 3; k++) {
        double side[2];
        for (int s = 0; s < 2; s++) {
            double y[3] = {x[0], x[1], x[2]};
            y[k] += s ? h : -h;
            side[s] = sdm_fit_field_at(f, &p->state, y);
        }
        normal[k] = side[1] - side[0];
        length += normal[k] * normal[k];
    }
    length = sqrt(length);
    for (int a = 0; a < 3; a++) {
        double along = 0;
        for (int k = 0; k < 3; k++) along += normal[k] * image->dir[3 * k + a] / length;
        if (!(fabs(along) > PARALLEL)) continue;
        sdm_grid_index(image, x, index);
        *axis = a, *above = along > 0;
        *place = index[a] - sdm_fit_field_at(f, &p->state, x) * along / image->spacing[a];
        return true;
    }
    return false;
}

static void piece_add(piece *q, size_t n, const double at[2], double weight, double place,
                      const float *score)
{
    for (int a = 0; a < 2; a++) {
        q->low[a] = q->phase.all > 0 ? fmin(q->low[a], at[a]) : at[a];
        q->high[a] = q->phase.all > 0 ? fmax(q->high[a], at[a]) : at[a];
    }
    fit_step_phase_add(&q->phase, weight, place);
    const double above = place - floor(place);
    q->first += weight * above;
    q->second += weight * above * above;
    for (size_t k = 0; k < n; k++) {
        q->score[k] += (double)score[k];
        for (size_t a = 0; a < 2; a++) q->score[(1 + a) * n + k] += (double)score[k] * at[a];
    }
}

// adds the covariance caused by a piece with voxels of this edge, mm
static void piece_covariance(piece *q, size_t n, double edge, double *out)
{
    if (!(q->phase.all > 0)) return;
    const double mean = q->first / q->phase.all, variance = q->second / q->phase.all - mean * mean,
                 whole = hypot(q->phase.turn[0], q->phase.turn[1]) / q->phase.all,
                 hidden = sqrt(fmax(1 - variance / (FIT_STEP_SD * FIT_STEP_SD), 0));
    for (size_t mode = 0; mode < MODES; mode++) {
        double *score = q->score + mode * n, sd = FIT_STEP_SD * whole * edge;
        // a tilt is 0 in the middle of the piece and 1 at its end
        if (mode > 0) {
            const double middle = 0.5 * (q->high[mode - 1] + q->low[mode - 1]),
                         half = 0.5 * (q->high[mode - 1] - q->low[mode - 1]);
            if (!(half > 0)) continue;
            for (size_t k = 0; k < n; k++) score[k] = (score[k] - middle * q->score[k]) / half;
            sd = sqrt(TILT_VARIANCE) * hidden * edge;
        }
        for (size_t j = 0; j < n; j++)
            for (size_t k = 0; k < n; k++) out[j * n + k] += sd * sd * score[j] * score[k];
    }
}

sdm_status sdm_fit_label_steps(const fit_problem *p, const fit_neighbours *v, double *out,
                               sdm_error *err)
{
    const fit_field field = sdm_fit_maps_distances(&p->maps);
    const size_t n = v->n_unknowns;
    size_t first[3], layers[3], count = 0, all = 0;
    piece *list = NULL;
    double *score = NULL;
    // pieces: by axis, by side, by layer of voxels
    for (int a = 0; a < 3; a++) {
        first[a] = all;
        layers[a] = (size_t)(v->size[a] * v->step) + 2 * MARGIN;
        all += 2 * layers[a];
    }
    sdm_status s = SDM_ALLOC(&list, all, "covariance of the score", err);
    if (!s) s = SDM_ALLOC(&score, all * MODES * n, "covariance of the score", err);
    for (size_t i = 0; i < all && !s; i++) list[i].score = score + i * MODES * n;
    for (size_t i = 0; i < p->samples.n && !s; i++) {
        int axis;
        bool above;
        double place, index[3];
        if (!sdm_fit_in_inner_band(p, i)) continue;
        const size_t at = count++;
        if (!find_place(p, &field, i, &axis, &above, &place, index)) continue;
        const double layer = floor(place) - (double)v->first[axis] + MARGIN;
        if (!(layer >= 0 && layer < (double)layers[axis])) continue;
        piece *q = &list[first[axis] + (above ? layers[axis] : 0) + (size_t)layer];
        const double other[2] = {index[(axis + 1) % 3], index[(axis + 2) % 3]};
        piece_add(q, n, other, (double)v->weight[at] * (double)v->weight[at], place,
                  v->model_score + at * n);
    }
    for (size_t i = 0; i < all && !s; i++) {
        const int axis = i < first[1] ? 0 : i < first[2] ? 1 : 2;
        piece_covariance(&list[i], n, p->target->grid.spacing[axis], out);
    }
    sdm_free(list);
    sdm_free(score);
    return s;
}
