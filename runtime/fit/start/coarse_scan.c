/* Each rotation of a pattern becomes a short list of weights on the boxes about its centroid. A row
 * of places is computed in runs, with all weights of a rotation while the sums are in registers. */
#include "coarse_scan.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/mat3.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"
#include "turn_set.h"

// number of places of a run
enum { RUN = 16 };
// weights below this part of the mean absolute weight are left out
#define NEGLIGIBLE 0.1f

// a weight and the offset of its box from that of the centroid
typedef struct weight {
    int64_t offset;
    float value;
} weight;

// the weights of all rotations; those of rotation r are from[r] .. from[r + 1] - 1
typedef struct weights {
    size_t n_turns, *from;
    weight *list;
    int64_t radius[3];
} weights;

// spreads the points of a pattern over the boxes of cube[2 radius + 1]^3 about the centroid
static void points_spread(const fit_pattern *p, const double rotation[9], const fit_likeness *l,
                          const int64_t radius[3], float *cube)
{
    const int64_t nx = 2 * radius[0] + 1, ny = 2 * radius[1] + 1, nz = 2 * radius[2] + 1;
    double turn[9];
    memset(cube, 0, (size_t)(nx * ny * nz) * sizeof *cube);
    for (int i = 0; i < 9; i++) turn[i] = rotation[i] / l->edge[i / 3];
    for (size_t i = 0; i < p->n; i++) {
        const double value =
            i < p->n_inside ? 1 / (double)p->n_inside : -1 / (double)(p->n - p->n_inside);
        double x[3];
        int64_t low[3];
        m3_apply(turn, p->points[i], x);
        for (int a = 0; a < 3; a++) {
            low[a] = (int64_t)floor(x[a]);
            x[a] -= (double)low[a];
            low[a] += radius[a];
        }
        for (int c = 0; c < 8; c++) {
            const int64_t at[3] = {low[0] + (c & 1), low[1] + (c >> 1 & 1), low[2] + (c >> 2)};
            const double part =
                (c & 1 ? x[0] : 1 - x[0]) * (c & 2 ? x[1] : 1 - x[1]) * (c & 4 ? x[2] : 1 - x[2]);
            cube[(at[2] * ny + at[1]) * nx + at[0]] += (float)(value * part);
        }
    }
}

// lists the boxes of the cube that matter
static size_t weights_list(const float *cube, const int64_t radius[3], const fit_likeness *l,
                           weight *out)
{
    const int64_t nx = 2 * radius[0] + 1, ny = 2 * radius[1] + 1, nz = 2 * radius[2] + 1;
    const size_t all = (size_t)(nx * ny * nz);
    float sum = 0;
    size_t used = 0, n = 0;
    for (size_t i = 0; i < all; i++) sum += fabsf(cube[i]), used += cube[i] != 0;
    for (int64_t k = 0; k < nz; k++)
        for (int64_t j = 0; j < ny; j++)
            for (int64_t i = 0; i < nx; i++, cube++)
                if (fabsf(*cube) > NEGLIGIBLE * sum / (float)used)
                    out[n++] = (weight){((k - radius[2]) * l->n[1] + j - radius[1]) * l->n[0] + i -
                                            radius[0],
                                        *cube / 255};
    return n;
}

static void weights_dispose(weights *w)
{
    sdm_free(w->from);
    sdm_free(w->list);
}

static sdm_status weights_make(const fit_pattern *patterns, size_t n, size_t n_turns,
                               const fit_likeness *l, weights *w, sdm_error *err)
{
    float *cube = NULL;
    size_t all = 1;
    double reach = 0;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < patterns[i].n; j++) {
            const double *x = patterns[i].points[j];
            reach = fmax(reach, sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]));
        }
    for (int a = 0; a < 3; a++) {
        w->radius[a] = (int64_t)floor(reach / l->edge[a]) + 1;
        all *= (size_t)(2 * w->radius[a] + 1);
    }
    w->n_turns = n * n_turns;
    sdm_status s = SDM_ALLOC(&cube, all, "weights", err);
    if (!s) s = SDM_ALLOC(&w->from, w->n_turns + 1, "weights", err);
    if (!s) s = SDM_ALLOC(&w->list, w->n_turns * all, "weights", err);
    for (size_t r = 0; r < w->n_turns && !s; r++) {
        double rotation[9];
        sdm_fit_turn(SDM_FIT_TURNS_SPHERE, r % n_turns, n_turns, rotation);
        points_spread(&patterns[r / n_turns], rotation, l, w->radius, cube);
        w->from[r + 1] = w->from[r] + weights_list(cube, w->radius, l, w->list + w->from[r]);
    }
    sdm_free(cube);
    return s;
}

// four values in a register
typedef float four __attribute__((vector_size(16), aligned(4), may_alias));

// best[RUN] = largest sum of weighted values over the rotations
static void run_scan(const weights *w, const float *values, float *best)
{
    four most[RUN / 4] = {0};
    for (size_t r = 0; r < w->n_turns; r++) {
        four a = {0}, b = a, c = a, d = a;
        for (size_t i = w->from[r]; i < w->from[r + 1]; i++) {
            const float x = w->list[i].value;
            const four *v = (const four *)(values + w->list[i].offset);
            a += x * v[0];
            b += x * v[1];
            c += x * v[2];
            d += x * v[3];
        }
        const four sum[RUN / 4] = {a, b, c, d};
        for (int k = 0; k < RUN / 4; k++)
            for (int i = 0; i < 4; i++)
                if (sum[k][i] > most[k][i]) most[k][i] = sum[k][i];
    }
    memcpy(best, most, sizeof most);
}

// whether the values about a run differ by so much that a score can reach `least`
static bool run_matters(const weights *w, const fit_likeness *l, const float *values, int64_t m,
                        float least)
{
    float low = values[0], high = low;
    for (int64_t k = -w->radius[2]; k <= w->radius[2]; k++)
        for (int64_t j = -w->radius[1]; j <= w->radius[1]; j++) {
            const float *v = values + (k * l->n[1] + j) * l->n[0];
            for (int64_t i = -w->radius[0]; i < m + w->radius[0]; i++)
                low = v[i] < low ? v[i] : low, high = v[i] > high ? v[i] : high;
            if (high - low >= 255 * least) return true;
        }
    return false;
}

sdm_status sdm_fit_coarse_scan(const fit_pattern *patterns, size_t n, size_t n_turns,
                               const fit_likeness *l, float least, int n_threads, float *best,
                               sdm_error *err)
{
    const size_t count = (size_t)(l->n[0] * l->n[1] * l->n[2]);
    weights w = {0};
    float *values = NULL;
    sdm_status s = weights_make(patterns, n, n_turns, l, &w, err);
    if (!s) s = SDM_ALLOC(&values, count + RUN, "likeness of the image", err);
    for (size_t i = 0; i < count && !s; i++) values[i] = l->values[i], best[i] = 0;
    const int64_t last = l->n[0] - l->pad[0];
    if (!s) {
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
        for (int64_t k = l->pad[2]; k < l->n[2] - l->pad[2]; k++)
            for (int64_t j = l->pad[1]; j < l->n[1] - l->pad[1]; j++)
                for (int64_t i = l->pad[0]; i < last; i += RUN) {
                    const int64_t at = (k * l->n[1] + j) * l->n[0] + i,
                                  m = last - i < RUN ? last - i : RUN;
                    float run[RUN];
                    if (!run_matters(&w, l, values + at, m, least)) continue;
                    run_scan(&w, values + at, run);
                    memcpy(best + at, run, (size_t)m * sizeof *run);
                }
    }
    sdm_free(values);
    weights_dispose(&w);
    return s;
}
