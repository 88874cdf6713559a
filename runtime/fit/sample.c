/* Piecewise cubic polynomials on 4 x 4 x 4 voxels. */
#include "sample.h"

#include <math.h>

#include "problem.h"

typedef struct taps {
    size_t at[3][4];                  // offsets of the voxels along each axis, in voxels of the packed array
    double weight[3][4], slope[3][4]; // slope: by the index
    double beyond[3], distance;       // way from the border of the grid to x, mm along its axes
} taps;

// Keys' kernel with a = -1/2, for the part u of the way from the second to the third voxel
static void keys(double u, double w[4], double d[4])
{
    const double u2 = u * u, u3 = u2 * u;
    w[0] = -0.5 * u3 + u2 - 0.5 * u, d[0] = -1.5 * u2 + 2 * u - 0.5;
    w[1] = 1.5 * u3 - 2.5 * u2 + 1, d[1] = 4.5 * u2 - 5 * u;
    w[2] = -1.5 * u3 + 2 * u2 + 0.5 * u, d[2] = -4.5 * u2 + 4 * u + 0.5;
    w[3] = 0.5 * u3 - 0.5 * u2, d[3] = 1.5 * u2 - u;
}

// cubic B-splines there
static void spline(double u, double w[4], double d[4])
{
    const double v = 1 - u, u2 = u * u, v2 = v * v;
    w[0] = v2 * v / 6, d[0] = -0.5 * v2;
    w[1] = 2.0 / 3 - u2 + 0.5 * u2 * u, d[1] = 1.5 * u2 - 2 * u;
    w[2] = 2.0 / 3 - v2 + 0.5 * v2 * v, d[2] = 2 * v - 1.5 * v2;
    w[3] = u2 * u / 6, d[3] = 0.5 * u2;
}

static void find(const fit_field *f, const double x[3], taps *t)
{
    const sdm_grid *g = f->grid;
    double index[3];
    sdm_grid_index(g, x, index);
    const size_t step[3] = {1, (size_t)g->n[0], (size_t)g->n[0] * (size_t)g->n[1]};
    double beyond2 = 0;
    for (int a = 0; a < 3; a++) {
        const double last = (double)(g->n[a] - 1), c = index[a] > 0 ? fmin(index[a], last) : 0;
        t->beyond[a] = (index[a] - c) * g->spacing[a];
        beyond2 += t->beyond[a] * t->beyond[a];
        int64_t first = (int64_t)c;
        if (first > g->n[a] - 2 && first > 0) first--;
        (f->distance ? keys : spline)(c - (double)first, t->weight[a], t->slope[a]);
        for (int i = 0; i < 4; i++) {
            const int64_t k = first - 1 + i;
            t->at[a][i] = step[a] * (size_t)(k < 0 ? 0 : k < g->n[a] ? k : g->n[a] - 1);
            if (t->beyond[a] != 0) t->slope[a][i] = 0; // the border repeats
        }
    }
    t->distance = sqrt(beyond2);
}

double sdm_fit_sample(const fit_field *f, const double x[3])
{
    taps t;
    find(f, x, &t);
    double sum = 0;
    for (int k = 0; k < 4; k++) {
        double plane = 0;
        for (int j = 0; j < 4; j++) {
            const double *row = f->packed + (t.at[2][k] + t.at[1][j]) * f->n_fields;
            double line = 0;
            for (int i = 0; i < 4; i++) line += t.weight[0][i] * row[t.at[0][i] * f->n_fields];
            plane += t.weight[1][j] * line;
        }
        sum += t.weight[2][k] * plane;
    }
    return f->distance ? sum + t.distance : sum;
}

double sdm_fit_sample_all(const fit_field *f, const double x[3], double gradient[3], double *rest)
{
    taps t;
    find(f, x, &t);
    double sum[FIT_FIELDS_MAX] = {0}, slope[3] = {0, 0, 0};
    const size_t n = f->n_fields;
    for (int k = 0; k < 4; k++)
        for (int j = 0; j < 4; j++) {
            const double *row = f->packed + (t.at[2][k] + t.at[1][j]) * n;
            const double w = t.weight[2][k] * t.weight[1][j];
            double line = 0, along = 0;
            for (int i = 0; i < 4; i++) {
                const double *v = row + t.at[0][i] * n, wx = w * t.weight[0][i];
                line += t.weight[0][i] * v[0];
                along += t.slope[0][i] * v[0];
                for (size_t q = 1; q < n; q++) sum[q] += wx * v[q];
            }
            slope[0] += w * along;
            slope[1] += t.weight[2][k] * t.slope[1][j] * line;
            slope[2] += t.slope[2][k] * t.weight[1][j] * line;
        }
    for (size_t q = 1; q < n; q++) rest[q - 1] = sum[q];
    double along[3];
    for (int a = 0; a < 3; a++) {
        along[a] = slope[a] / f->grid->spacing[a];
        if (f->distance && t.distance > 0) along[a] += t.beyond[a] / t.distance;
    }
    for (int a = 0; a < 3; a++) {
        gradient[a] = 0;
        for (int b = 0; b < 3; b++) gradient[a] += f->grid->dir[3 * a + b] * along[b];
    }
    return sdm_fit_sample(f, x); // the same bits as without derivatives
}
