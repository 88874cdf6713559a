/* Interpolation by piecewise cubic polynomials of 4 x 4 x 4 voxels. */
#include "interpolate.h"

#include <math.h>
#include <string.h>

#include "unknowns.h"

/* The 4 voxels along each axis that contribute to a point, and their weights. */
typedef struct taps {
    /* offset of each voxel along each axis, in voxels of the packed array */
    size_t at[3][4];
    /* weight of each voxel, and its derivative by the voxel index */
    double weight[3][4], slope[3][4];
    /* mm: displacement from the border of the grid to the point along the grid's axes, and its
     * length; 0 inside the grid */
    double beyond[3], distance;
} taps;

// cubic convolution kernel with a = -1/2 (Keys 1981): weights w and derivatives d of 4 voxels at
// the fraction u, 0 .. 1, between the second and the third
static inline void keys(double u, double w[4], double d[4])
{
    const double u2 = u * u, u3 = u2 * u;
    w[0] = -0.5 * u3 + u2 - 0.5 * u, d[0] = -1.5 * u2 + 2 * u - 0.5;
    w[1] = 1.5 * u3 - 2.5 * u2 + 1, d[1] = 4.5 * u2 - 5 * u;
    w[2] = -1.5 * u3 + 2 * u2 + 0.5 * u, d[2] = -4.5 * u2 + 4 * u + 0.5;
    w[3] = 0.5 * u3 - 0.5 * u2, d[3] = 1.5 * u2 - u;
}

// weights w and derivatives d at the fraction u as in keys(), but for cubic B-splines
static inline void spline(double u, double w[4], double d[4])
{
    const double v = 1 - u, u2 = u * u, v2 = v * v;
    w[0] = v2 * v / 6, d[0] = -0.5 * v2;
    w[1] = 2.0 / 3 - u2 + 0.5 * u2 * u, d[1] = 1.5 * u2 - 2 * u;
    w[2] = 2.0 / 3 - v2 + 0.5 * v2 * v, d[2] = 2 * v - 1.5 * v2;
    w[3] = u2 * u / 6, d[3] = 0.5 * u2;
}

static void taps_find(const fit_field *f, const double x[3], taps *t)
{
    const sdm_grid *g = f->grid;
    // point and voxels along each axis, clamped to the grid
    double index[3];
    sdm_grid_index(g, x, index);
    const size_t step[3] = {1, (size_t)g->n[0], (size_t)g->n[0] * (size_t)g->n[1]};
    double beyond2 = 0;
    for (int a = 0; a < 3; a++) {
        const double last = (double)(g->n[a] - 1), c = !(index[a] > 0)   ? 0
                                                       : index[a] < last ? index[a]
                                                                         : last;
        t->beyond[a] = (index[a] - c) * g->spacing[a];
        beyond2 += t->beyond[a] * t->beyond[a];
        // weights of the four voxels
        int64_t first = (int64_t)c;
        if (first > g->n[a] - 2 && first > 0) first--;
        if (f->distance)
            keys(c - (double)first, t->weight[a], t->slope[a]);
        else
            spline(c - (double)first, t->weight[a], t->slope[a]);
        for (int i = 0; i < 4; i++) {
            // offsets are clamped to the grid: beyond it the values of the border continue
            const int64_t k = first - 1 + i;
            t->at[a][i] = step[a] * (size_t)(k < 0 ? 0 : k < g->n[a] ? k : g->n[a] - 1);
            if (t->beyond[a] != 0) t->slope[a][i] = 0; // beyond the border the values are constant
        }
    }
    t->distance = sqrt(beyond2);
}

// sum[4] += w * first field of the four voxels of a row
static inline void add_row(const fit_field *f, const taps *t, const double *row, double w,
                           double sum[4])
{
    double v[4];
    if (f->n_fields == 1 && t->at[0][3] - t->at[0][0] == 3)
        memcpy(v, row + t->at[0][0], sizeof v);
    else
        for (int i = 0; i < 4; i++) v[i] = row[t->at[0][i] * f->n_fields];
    for (int i = 0; i < 4; i++) sum[i] += w * v[i];
}

static inline double dot(const double a[4], const double b[4])
{
    return (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]);
}

static inline const double *row_at(const fit_field *f, const taps *t, int k, int j)
{
    return f->packed + (t->at[2][k] + t->at[1][j]) * f->n_fields;
}

double sdm_fit_interpolate(const fit_field *f, const double x[3])
{
    taps t;
    taps_find(f, x, &t);
    double sum[4] = {0};
    for (int k = 0; k < 4; k++)
        for (int j = 0; j < 4; j++)
            add_row(f, &t, row_at(f, &t, k, j), t.weight[2][k] * t.weight[1][j], sum);
    return f->distance ? dot(t.weight[0], sum) + t.distance : dot(t.weight[0], sum);
}

// rest[n_fields - 1] += w * the other fields, interpolated along a row of four voxels
static inline void add_rest(const fit_field *f, const taps *t, const double *row, double w,
                            double *rest)
{
    const size_t n = f->n_fields;
    const double *a = row + t->at[0][0] * n, *b = row + t->at[0][1] * n, *c = row + t->at[0][2] * n,
                 *d = row + t->at[0][3] * n;
    const double wa = w * t->weight[0][0], wb = w * t->weight[0][1], wc = w * t->weight[0][2],
                 wd = w * t->weight[0][3];
    for (size_t q = 1; q < n; q++) rest[q - 1] += (wa * a[q] + wb * b[q]) + (wc * c[q] + wd * d[q]);
}

double sdm_fit_interpolate_all(const fit_field *f, const double x[3], double gradient[3],
                               double *rest)
{
    taps t;
    taps_find(f, x, &t);
    double sum[4] = {0}, by_y[4] = {0}, by_z[4] = {0}, others[FIT_FIELDS_MAX] = {0};
    for (int k = 0; k < 4; k++)
        for (int j = 0; j < 4; j++) {
            const double *row = row_at(f, &t, k, j), w = t.weight[2][k] * t.weight[1][j];
            add_row(f, &t, row, w, sum); // same operations as in sdm_fit_interpolate(): same bits
            add_row(f, &t, row, t.weight[2][k] * t.slope[1][j], by_y);
            add_row(f, &t, row, t.slope[2][k] * t.weight[1][j], by_z);
            add_rest(f, &t, row, w, others);
        }
    for (size_t q = 1; q < f->n_fields; q++) rest[q - 1] = others[q - 1];
    // gradient along the axes of the grid, then rotated into the coordinates of grid->origin
    double along[3] = {dot(t.slope[0], sum), dot(t.weight[0], by_y), dot(t.weight[0], by_z)};
    for (int a = 0; a < 3; a++) {
        along[a] /= f->grid->spacing[a];
        if (f->distance && t.distance > 0) along[a] += t.beyond[a] / t.distance;
    }
    for (int a = 0; a < 3; a++) {
        gradient[a] = 0;
        for (int b = 0; b < 3; b++) gradient[a] += f->grid->dir[3 * a + b] * along[b];
    }
    return f->distance ? dot(t.weight[0], sum) + t.distance : dot(t.weight[0], sum);
}
