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

/* A piece of the surface between two layers of voxels. */
typedef struct piece {
    /* sums over the samples of the piece; the weight of a sample is its information about the
       place of the surface */
    fit_step_phase phase;
    double *score; /* [n_unknowns] the score caused by an error of 1 mm of the place */
} piece;

/* Where the surface next to sample i lies: *axis of the image along which it is nearly parallel to
 * the voxels, whether the outside is above, and its place along this axis in voxels. false: it is
 * parallel to no axis. */
static bool find_place(const fit_problem *p, const fit_field *f, size_t i, int *axis, bool *above,
                       double *place)
{
    const sdm_grid *image = &p->target->grid;
    const double *x = p->samples.world + 3 * i, h = 0.5 * fit_longest_edge(&p->maps.grid);
    double normal[3], length = 0, index[3];
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
    if (!s) s = SDM_ALLOC(&score, all * n, "covariance of the score", err);
    for (size_t i = 0; i < all && !s; i++) list[i].score = score + i * n;
    for (size_t i = 0; i < p->samples.n && !s; i++) {
        int axis;
        bool above;
        double place;
        if (!sdm_fit_in_inner_band(p, i)) continue;
        const size_t at = count++;
        if (!find_place(p, &field, i, &axis, &above, &place)) continue;
        const double layer = floor(place) - (double)v->first[axis] + MARGIN;
        if (!(layer >= 0 && layer < (double)layers[axis])) continue;
        piece *q = &list[first[axis] + (above ? layers[axis] : 0) + (size_t)layer];
        fit_step_phase_add(&q->phase, (double)v->weight[at] * (double)v->weight[at], place);
        for (size_t k = 0; k < n; k++) q->score[k] += (double)v->model_score[at * n + k];
    }
    for (size_t i = 0; i < all && !s; i++) {
        const piece *q = &list[i];
        if (!(q->phase.all > 0)) continue;
        const int axis = i < first[1] ? 0 : i < first[2] ? 1 : 2;
        const double sd = FIT_STEP_SD * p->target->grid.spacing[axis] *
                          hypot(q->phase.turn[0], q->phase.turn[1]) / q->phase.all;
        for (size_t j = 0; j < n; j++)
            for (size_t k = 0; k < n; k++) out[j * n + k] += sd * sd * q->score[j] * q->score[k];
    }
    sdm_free(list);
    sdm_free(score);
    return s;
}
