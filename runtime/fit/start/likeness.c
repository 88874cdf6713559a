/* The probability of the inside's material in a voxel, from a table of values, averaged over boxes.
 */
#include "likeness.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/threads.h"
#include "sdm/memory.h"

// number of steps of the table from value to probability
enum { STEPS = 4096 };
// likeness of places that nothing is known about
enum { UNKNOWN = 128 };
// number of boxes of a row that are averaged at a time
enum { CHUNK = 64 };
// the table spans the means of all tissues and so many sd beyond
#define REACH_SD 6.0

// probability of the inside as a function of the value
typedef struct table {
    double first, step;
    uint8_t inside[STEPS];
} table;

// log density of the most likely law of a mixture
static double log_density(const sdm_fit_law *law, size_t n, double value)
{
    double most = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        const double r = (value - law[i].mean) / law[i].sd;
        most = fmax(most, -0.5 * r * r - log(law[i].sd));
    }
    return most;
}

static void range_widen(const sdm_fit_law *law, size_t n, double *low, double *high)
{
    for (size_t i = 0; i < n; i++) {
        *low = fmin(*low, law[i].mean - REACH_SD * law[i].sd);
        *high = fmax(*high, law[i].mean + REACH_SD * law[i].sd);
    }
}

static void table_fill(const sdm_fit_target *target, const sdm_fit_appearance *a, table *t)
{
    double low = 0, high = 1;
    if (target->kind == SDM_FIT_IMAGE) {
        low = INFINITY, high = -INFINITY;
        range_widen(a->inside, a->n_inside, &low, &high);
        range_widen(a->outside, a->n_outside, &low, &high);
    }
    t->first = low;
    t->step = (high - low) / (STEPS - 1);
    for (int i = 0; i < STEPS; i++) {
        const double value = low + t->step * i,
                     more = log_density(a->outside, a->n_outside, value) -
                            log_density(a->inside, a->n_inside, value);
        const double p = target->kind == SDM_FIT_IMAGE ? 1 / (1 + exp(more)) : value;
        t->inside[i] = (uint8_t)lrint(255 * p);
    }
}

static inline int table_look(const table *t, float value)
{
    if (isnan(value)) return UNKNOWN;
    const double at = ((double)value - t->first) / t->step;
    return t->inside[at < 0 ? 0 : at > STEPS - 1 ? STEPS - 1 : (int)(at + 0.5)];
}

// averages one row of boxes; j, k: its indices without padding, n: number of its boxes
static void row_average(const sdm_fit_target *target, const table *t, const int64_t factor[3],
                        int64_t j, int64_t k, int64_t n, uint8_t *out)
{
    const int64_t *voxels = target->grid.n;
    const double share = 1 / (double)(factor[0] * factor[1] * factor[2]);
    for (int64_t from = 0; from < n; from += CHUNK) {
        const int64_t m = n - from < CHUNK ? n - from : CHUNK;
        int64_t sum[CHUNK] = {0};
        for (int64_t dz = 0; dz < factor[2]; dz++)
            for (int64_t dy = 0; dy < factor[1]; dy++) {
                const int64_t z = k * factor[2] + dz, y = j * factor[1] + dy;
                const float *v =
                    target->values + (z * voxels[1] + y) * voxels[0] + from * factor[0];
                for (int64_t i = 0; i < m; i++)
                    for (int64_t dx = 0; dx < factor[0]; dx++) sum[i] += table_look(t, *v++);
            }
        for (int64_t i = 0; i < m; i++) out[from + i] = (uint8_t)lrint(share * (double)sum[i]);
    }
}

sdm_status sdm_fit_likeness_make(const sdm_fit_target *target, const sdm_fit_opts *opts,
                                 double edge, double margin, fit_likeness *out, sdm_error *err)
{
    const sdm_grid *g = &target->grid;
    int64_t factor[3], full[3];
    *out = (fit_likeness){0};
    for (int a = 0; a < 3; a++) {
        factor[a] = (int64_t)fmax(1, fmin(floor(edge / g->spacing[a] + 0.5), (double)g->n[a]));
        full[a] = g->n[a] / factor[a];
        out->edge[a] = g->spacing[a] * (double)factor[a];
        out->pad[a] = (int64_t)ceil(margin / out->edge[a]) + 1;
        out->n[a] = full[a] + 2 * out->pad[a];
    }
    table *t = NULL;
    const size_t count = (size_t)(out->n[0] * out->n[1] * out->n[2]);
    sdm_status s = SDM_ALLOC(&t, 1, "table of likeness", err);
    if (!s) s = SDM_ALLOC(&out->values, count, "likeness of the image", err);
    if (!s) {
        memset(out->values, UNKNOWN, count);
        table_fill(target, &opts->appearance, t);
#pragma omp parallel for schedule(static) num_threads(sdm_threads(opts->n_threads))
        for (int64_t k = 0; k < full[2]; k++)
            for (int64_t j = 0; j < full[1]; j++)
                row_average(target, t, factor, j, k, full[0],
                            out->values +
                                ((k + out->pad[2]) * out->n[1] + j + out->pad[1]) * out->n[0] +
                                out->pad[0]);
    }
    sdm_free(t);
    return s;
}

void sdm_fit_likeness_dispose(fit_likeness *l)
{
    sdm_free(l->values);
    *l = (fit_likeness){0};
}

void sdm_fit_likeness_index(const fit_likeness *l, const sdm_grid *g, const double u[3],
                            double index[3])
{
    for (int a = 0; a < 3; a++)
        index[a] = (double)l->pad[a] + (u[a] + 0.5 * g->spacing[a]) / l->edge[a] - 0.5;
}

void sdm_fit_likeness_point(const fit_likeness *l, const sdm_grid *g, const double index[3],
                            double u[3])
{
    for (int a = 0; a < 3; a++)
        u[a] = (index[a] - (double)l->pad[a] + 0.5) * l->edge[a] - 0.5 * g->spacing[a];
}
