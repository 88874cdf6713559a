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

// vectors of doubles; the compiler splits them where registers are shorter
typedef double four __attribute__((vector_size(32)));
typedef double two __attribute__((vector_size(16)));

// *v: the first field of the four voxels of a row
static inline void first_field(const fit_field *f, const taps *t, const double *row, four *v)
{
    const size_t n = f->n_fields;
    if (n == 1 && t->at[0][3] - t->at[0][0] == 3)
        memcpy(v, row + t->at[0][0], sizeof *v);
    else
        *v = (four){row[t->at[0][0] * n], row[t->at[0][1] * n], row[t->at[0][2] * n],
                    row[t->at[0][3] * n]};
}

static inline double dot(const double a[4], const four *b)
{
    return (a[0] * (*b)[0] + a[1] * (*b)[1]) + (a[2] * (*b)[2] + a[3] * (*b)[3]);
}

static inline const double *row_at(const fit_field *f, const taps *t, int k, int j)
{
    return f->packed + (t->at[2][k] + t->at[1][j]) * f->n_fields;
}

double sdm_fit_interpolate(const fit_field *f, const double x[3])
{
    taps t;
    taps_find(f, x, &t);
    four sum = {0};
    for (int k = 0; k < 4; k++)
        for (int j = 0; j < 4; j++) {
            four v;
            first_field(f, &t, row_at(f, &t, k, j), &v);
            sum += t.weight[2][k] * t.weight[1][j] * v;
        }
    return f->distance ? dot(t.weight[0], &sum) + t.distance : dot(t.weight[0], &sum);
}

// out[q] = field q for from <= q < n_fields
static inline void fields_sum(const fit_field *f, const taps *t, size_t from, double *out)
{
    // the 16 rows, the offsets of their voxels, and the weights of these
    const size_t n = f->n_fields,
                 at[4] = {t->at[0][0] * n, t->at[0][1] * n, t->at[0][2] * n, t->at[0][3] * n};
    const double *row[16];
    double weight[16][4];
    for (int r = 0; r < 16; r++) {
        row[r] = row_at(f, t, r / 4, r % 4);
        const double w = t->weight[2][r / 4] * t->weight[1][r % 4];
        for (int i = 0; i < 4; i++) weight[r][i] = w * t->weight[0][i];
    }
// adds up as many fields, from q on, as the type holds
#define ADD_FIELDS(type)                                                                           \
    for (; q + sizeof(type) / sizeof(double) <= n; q += sizeof(type) / sizeof(double)) {           \
        type sum = (type){0};                                                                      \
        for (int r = 0; r < 16; r++) {                                                             \
            type v[4];                                                                             \
            for (int i = 0; i < 4; i++) memcpy(&v[i], row[r] + at[i] + q, sizeof v[i]);            \
            sum += (weight[r][0] * v[0] + weight[r][1] * v[1]) +                                   \
                   (weight[r][2] * v[2] + weight[r][3] * v[3]);                                    \
        }                                                                                          \
        memcpy(out + q, &sum, sizeof sum);                                                         \
    }
    size_t q = from;
    ADD_FIELDS(four)
    ADD_FIELDS(two)
    ADD_FIELDS(double)
#undef ADD_FIELDS
}

void sdm_fit_interpolate_fields(const fit_field *f, const double x[3], double *out)
{
    taps t;
    taps_find(f, x, &t);
    fields_sum(f, &t, 0, out);
    if (f->distance) out[0] += t.distance;
}

double sdm_fit_interpolate_all(const fit_field *f, const double x[3], double gradient[3],
                               double *rest)
{
    taps t;
    taps_find(f, x, &t);
    four sum = {0}, by_y = {0}, by_z = {0};
    for (int k = 0; k < 4; k++)
        for (int j = 0; j < 4; j++) {
            four v;
            first_field(f, &t, row_at(f, &t, k, j), &v);
            // the same operations as in sdm_fit_interpolate(): the same bits
            sum += t.weight[2][k] * t.weight[1][j] * v;
            by_y += t.weight[2][k] * t.slope[1][j] * v;
            by_z += t.slope[2][k] * t.weight[1][j] * v;
        }
    if (f->n_fields > 1) {
        double fields[FIT_FIELDS_MAX];
        fields_sum(f, &t, 1, fields);
        memcpy(rest, fields + 1, (f->n_fields - 1) * sizeof *rest);
    }
    // gradient along the axes of the grid, then rotated into the coordinates of grid->origin
    double along[3] = {dot(t.slope[0], &sum), dot(t.weight[0], &by_y), dot(t.weight[0], &by_z)};
    for (int a = 0; a < 3; a++) {
        along[a] /= f->grid->spacing[a];
        if (f->distance && t.distance > 0) along[a] += t.beyond[a] / t.distance;
    }
    for (int a = 0; a < 3; a++) {
        gradient[a] = 0;
        for (int b = 0; b < 3; b++) gradient[a] += f->grid->dir[3 * a + b] * along[b];
    }
    return f->distance ? dot(t.weight[0], &sum) + t.distance : dot(t.weight[0], &sum);
}
