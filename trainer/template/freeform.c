/* Fits free-form deformations to displacements of points. */
#include "freeform.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/threads.h"
#include "sdm/memory.h"

/* Weight of the bending energy, relative to the mean weight of the data at a control point. */
static const double BENDING = 1e-4;

sdm_lattice trainer_freeform_lattice(const double min[3], const double max[3], double spacing)
{
    sdm_lattice l = {.spacing = spacing};
    for (int a = 0; a < 3; a++) {
        const double cells = fmax(1, ceil((max[a] - min[a]) / spacing - 1e-9));
        l.n[a] = (uint32_t)cells + 3;
        l.origin[a] = 0.5 * (min[a] + max[a]) - spacing * (0.5 * cells + 1);
    }
    return l;
}

// The 64 control points around a point: index of the first along each axis, and weights.
typedef struct support {
    size_t first[3];
    double w[3][4];
} support;

static support support_of(const sdm_lattice *l, const double x[3])
{
    support s;
    for (int a = 0; a < 3; a++) {
        double u = (x[a] - l->origin[a]) / l->spacing;
        u = fmin(fmax(u, 1), (double)l->n[a] - 2);
        size_t i = (size_t)u;
        if (i > l->n[a] - 3u) i = l->n[a] - 3u;
        const double t = u - (double)i, r = 1 - t;
        s.first[a] = i - 1;
        s.w[a][0] = r * r * r / 6;
        s.w[a][1] = (3 * t * t * t - 6 * t * t + 4) / 6;
        s.w[a][2] = (3 * r * r * r - 6 * r * r + 4) / 6;
        s.w[a][3] = t * t * t / 6;
    }
    return s;
}

static size_t node_of(const sdm_lattice *l, const support *s, size_t k, double *w)
{
    const size_t i = k & 3, j = k >> 2 & 3, m = k >> 4;
    *w = s->w[0][i] * s->w[1][j] * s->w[2][m];
    return ((s->first[2] + m) * l->n[1] + s->first[1] + j) * l->n[0] + s->first[0] + i;
}

/* A symmetric band matrix: row i holds columns i - width .. i. */
typedef struct band {
    size_t n, width;
    double *a; /* [n][width + 1]; element (i, j) at a[i (width + 1) + j - i + width] */
} band;

static double *band_at(const band *b, size_t i, size_t j)
{
    return &b->a[i * (b->width + 1) + j + b->width - i];
}

// Adds weight * (d . c)^2 for the stencil d over the nodes at[n].
static void add_square(band *b, double weight, const size_t *at, const double *d, size_t n)
{
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            if (at[j] <= at[i]) *band_at(b, at[i], at[j]) += weight * d[i] * d[j];
}

// Adds the squares of all second differences of the control points.
static void add_bending(const sdm_lattice *l, double weight, band *b)
{
    const size_t step[3] = {1, l->n[0], (size_t)l->n[0] * l->n[1]};
    for (size_t z = 0; z < l->n[2]; z++)
        for (size_t y = 0; y < l->n[1]; y++)
            for (size_t x = 0; x < l->n[0]; x++) {
                const size_t here = (z * l->n[1] + y) * l->n[0] + x, at[3] = {x, y, z};
                for (int p = 0; p < 3; p++) {
                    if (at[p] + 2 < l->n[p]) {
                        const size_t nodes[3] = {here, here + step[p], here + 2 * step[p]};
                        add_square(b, weight, nodes, (const double[]){1, -2, 1}, 3);
                    }
                    for (int q = p + 1; q < 3; q++)
                        if (at[p] + 1 < l->n[p] && at[q] + 1 < l->n[q]) {
                            const size_t nodes[4] = {here, here + step[p], here + step[q],
                                                     here + step[p] + step[q]};
                            add_square(b, 2 * weight, nodes, (const double[]){1, -1, -1, 1}, 4);
                        }
                }
            }
}

// Overwrites the band with its Cholesky factor; false if it is not positive definite.
static bool band_cholesky(band *b)
{
    for (size_t i = 0; i < b->n; i++) {
        double *row = b->a + i * (b->width + 1);
        const size_t low = i > b->width ? i - b->width : 0;
        for (size_t j = low; j <= i; j++) {
            const double *other = b->a + j * (b->width + 1);
            const size_t from = j > b->width && j - b->width > low ? j - b->width : low;
            const double *p = row + from + b->width - i, *q = other + from + b->width - j;
            double sum[4] = {0};
            const size_t count = j - from;
            size_t k = 0;
            for (; k + 4 <= count; k += 4)
                for (size_t e = 0; e < 4; e++) sum[e] += p[k + e] * q[k + e];
            for (; k < count; k++) sum[0] += p[k] * q[k];
            const double v = row[j + b->width - i] - ((sum[0] + sum[1]) + (sum[2] + sum[3]));
            if (j < i) {
                row[j + b->width - i] = v / other[b->width];
            } else {
                if (!(v > 0)) return false;
                row[b->width] = sqrt(v);
            }
        }
    }
    return true;
}

static void band_solve(const band *b, double *x)
{
    for (size_t i = 0; i < b->n; i++) {
        const double *row = b->a + i * (b->width + 1);
        const size_t low = i > b->width ? i - b->width : 0;
        double v = x[i];
        for (size_t j = low; j < i; j++) v -= row[j + b->width - i] * x[j];
        x[i] = v / row[b->width];
    }
    for (size_t i = b->n; i-- > 0;) {
        const double *row = b->a + i * (b->width + 1);
        const size_t low = i > b->width ? i - b->width : 0;
        x[i] /= row[b->width];
        for (size_t j = low; j < i; j++) x[j] -= row[j + b->width - i] * x[i];
    }
}

// Solves for one component of one field; returns the sum of squared residuals.
static double fit_component(const sdm_lattice *l, const band *b, size_t n, const double *x,
                            const float *values, int component, double *c, float *control)
{
    memset(c, 0, b->n * sizeof *c);
    for (size_t i = 0; i < n; i++) {
        const support s = support_of(l, x + 3 * i);
        for (size_t k = 0; k < 64; k++) {
            double w;
            const size_t node = node_of(l, &s, k, &w);
            c[node] += w * (double)values[3 * i + (size_t)component];
        }
    }
    band_solve(b, c);
    double sum = 0;
    for (size_t i = 0; i < n; i++) {
        const support s = support_of(l, x + 3 * i);
        double v = -(double)values[3 * i + (size_t)component];
        for (size_t k = 0; k < 64; k++) {
            double w;
            const size_t node = node_of(l, &s, k, &w);
            v += w * c[node];
        }
        sum += v * v;
    }
    for (size_t i = 0; i < b->n; i++) control[3 * i + (size_t)component] = (float)c[i];
    return sum;
}

sdm_status trainer_freeform_fit(const sdm_lattice *l, size_t n, const double *x, size_t n_fields,
                                const float *values, int n_threads, float *control, double *error,
                                sdm_error *err)
{
    const size_t nodes = sdm_lattice_count(l);
    band b = {.n = nodes, .width = 3 * ((size_t)l->n[0] * l->n[1] + l->n[0] + 1)};
    if (b.width >= nodes) b.width = nodes - 1;
    double *squares = NULL;
    sdm_status s = SDM_ALLOC(&b.a, nodes * (b.width + 1), "deformation", err);
    if (!s) s = SDM_ALLOC(&squares, 3 * n_fields, "deformation", err);
    // normal equations
    double trace = 0;
    size_t reached = 0;
    for (size_t i = 0; i < n && !s; i++) {
        const support p = support_of(l, x + 3 * i);
        size_t at[64];
        double w[64];
        for (size_t k = 0; k < 64; k++) at[k] = node_of(l, &p, k, &w[k]);
        add_square(&b, 1, at, w, 64);
    }
    for (size_t i = 0; i < nodes && !s; i++) {
        const double d = *band_at(&b, i, i);
        trace += d, reached += d > 0;
    }
    if (!s) {
        add_bending(l, BENDING * trace / (double)(reached ? reached : 1), &b);
        for (size_t i = 0; i < nodes; i++) *band_at(&b, i, i) += 1e-12 * trace;
        if (!band_cholesky(&b))
            s = sdm_fail(err, SDM_E_INTERNAL, "the deformation has no least squares solution");
    }
    // fields
    bool short_of_memory = false;
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (long k = 0; k < (long)(s ? 0 : 3 * n_fields); k++) {
        double *c = NULL;
        const size_t field = (size_t)k / 3;
        if (SDM_ALLOC(&c, nodes, "deformation", NULL)) {
#pragma omp atomic write
            short_of_memory = true;
            continue;
        }
        squares[k] = fit_component(l, &b, n, x, values + 3 * n * field, (int)(k % 3), c,
                                   control + 3 * nodes * field);
        sdm_free(c);
    }
    if (!s && short_of_memory) s = sdm_fail(err, SDM_E_NOMEM, "no memory for the deformation");
    *error = 0;
    for (size_t f = 0; f < n_fields && !s; f++)
        *error = fmax(*error,
                      sqrt((squares[3 * f] + squares[3 * f + 1] + squares[3 * f + 2]) / (double)n));
    sdm_free(squares);
    sdm_free(b.a);
    return s;
}
