/* Distance transform as a lower envelope of parabolas along each axis in turn (Felzenszwalb and
 * Huttenlocher 2012). */
#include "distance_transform.h"

#include "sdm/internal/envelope.h"
#include "sdm/memory.h"

sdm_status sdm_fit_distance_transform(const sdm_grid *g, int n_threads, float *f, sdm_error *err)
{
    const size_t step[3] = {1, (size_t)g->n[0], (size_t)(g->n[0] * g->n[1])};
    const int64_t longest = g->n[0] > g->n[1] ? g->n[0] : g->n[1],
                  room = longest > g->n[2] ? longest : g->n[2];
    double *work = NULL; // [n_threads][4 room] a row, and scratch for its lower envelope
    sdm_status s =
        SDM_ALLOC(&work, (size_t)n_threads * (size_t)(4 * room), "rows of an image", err);
    for (int axis = 0; axis < 3 && !s; axis++) {
        const int b = (axis + 1) % 3, c = (axis + 2) % 3;
        const int64_t rows = g->n[b] * g->n[c], n = g->n[axis];
#pragma omp parallel for schedule(static, 1) num_threads(n_threads)
        for (int64_t thread = 0; thread < n_threads; thread++)
            for (int64_t row = rows * thread / n_threads; row < rows * (thread + 1) / n_threads;
                 row++) {
                float *at =
                    f + (size_t)(row % g->n[b]) * step[b] + (size_t)(row / g->n[b]) * step[c];
                double *line = work + 4 * thread * room;
                for (int64_t i = 0; i < n; i++) line[i] = (double)at[(size_t)i * step[axis]];
                sdm_lower_envelope(line, n, g->spacing[axis], line + room);
                for (int64_t i = 0; i < n; i++) at[(size_t)i * step[axis]] = (float)line[i];
            }
    }
    sdm_free(work);
    return s;
}
