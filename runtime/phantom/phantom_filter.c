/* Filters along one axis: the point spread function averaged over the box of a voxel, and the
   smoothing of random fields. */
#include <math.h>

#include "phantom_parts.h"
#include "sdm/memory.h"

/* Number of results computed together: the sums of ROW_RESULTS stay in the first-level cache, those
   of LINE_RESULTS in registers. */
enum { ROW_RESULTS = 64, LINE_RESULTS = 8 };

/* g[2 radius + 1] = Gaussian at -radius .. radius samples, scaled to the sum 1. */
static void gaussian(double sigma, size_t radius, double *g)
{
    const size_t n = 2 * radius + 1;
    double sum = 0;
    for (size_t j = 0; j < n; j++) {
        const double x = ((double)j - (double)radius) / sigma;
        sum += g[j] = exp(-0.5 * x * x);
    }
    for (size_t j = 0; j < n; j++) g[j] /= sum;
}

sdm_status phantom_filter_make(double sigma, size_t step, phantom_filter *out, sdm_error *err)
{
    // for sigma < 0.5 a sampled Gaussian has too small a variance
    const bool narrow = sigma < 0.5;
    const size_t radius = sigma == 0 ? 0 : narrow ? 1 : (size_t)ceil(4 * sigma), n = 2 * radius + 1;
    double *g = NULL;
    *out = (phantom_filter){.n = step + 2 * radius, .step = step};
    sdm_status s = SDM_ALLOC(&g, n + out->n, "filter", err);
    if (!s) s = SDM_ALLOC(&out->weight, out->n, "filter", err);
    if (s) {
        sdm_free(g);
        return s;
    }
    if (radius == 0)
        g[0] = 1;
    else if (narrow)
        g[0] = g[2] = 0.5 * sigma * sigma, g[1] = 1 - sigma * sigma;
    else
        gaussian(sigma, radius, g);
    // convolution with the box
    double *w = g + n;
    for (size_t i = 0; i < step; i++)
        for (size_t j = 0; j < n; j++) w[i + j] += g[j] / (double)step;
    for (size_t j = 0; j < out->n; j++) out->weight[j] = (float)w[j];
    sdm_free(g);
    return SDM_OK;
}

void phantom_filter_dispose(phantom_filter *f)
{
    sdm_free(f->weight);
    *f = (phantom_filter){0};
}

size_t phantom_filter_samples(const phantom_filter *f, size_t n)
{
    return n * f->step + (f->n - f->step);
}

/* The filters may work in place: result k is written to index k, and later results read only from
   (k + 1) * step > k on. */

void phantom_filter_line(const phantom_filter *f, float *data, size_t n)
{
    for (size_t first = 0; first < n; first += LINE_RESULTS) {
        const size_t m = n - first < LINE_RESULTS ? n - first : LINE_RESULTS;
        const float *in = data + first * f->step;
        float sum[LINE_RESULTS] = {0};
        if (m == LINE_RESULTS)
            for (size_t j = 0; j < f->n; j++)
                for (size_t i = 0; i < LINE_RESULTS; i++)
                    sum[i] += f->weight[j] * in[i * f->step + j];
        else
            for (size_t j = 0; j < f->n; j++)
                for (size_t i = 0; i < m; i++) sum[i] += f->weight[j] * in[i * f->step + j];
        for (size_t i = 0; i < m; i++) data[first + i] = sum[i];
    }
}

void phantom_filter_rows(const phantom_filter *f, float *data, size_t n, size_t stride,
                         size_t inner)
{
    for (size_t k = 0; k < n; k++) {
        for (size_t first = 0; first < inner; first += ROW_RESULTS) {
            const size_t m = inner - first < ROW_RESULTS ? inner - first : ROW_RESULTS;
            const float *in = data + k * f->step * stride + first;
            float sum[ROW_RESULTS] = {0};
            for (size_t j = 0; j < f->n; j++)
                for (size_t i = 0; i < m; i++) sum[i] += f->weight[j] * in[j * stride + i];
            float *to = data + k * stride + first;
            for (size_t i = 0; i < m; i++) to[i] = sum[i];
        }
    }
}
