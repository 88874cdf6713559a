/* Example for the shape `statistical`: writes a synthetic model in the form of the bony labyrinth
 * of the ear to a folder, as mean.ply and modes.npy.
 *
 *     cc -O2 -o make_labyrinth make_labyrinth.c $(pkg-config --cflags --libs sdmgen) -lm
 *     ./make_labyrinth .
 *
 * The mean is a rounded body with three thin canals, each a handle of it: one closed surface of
 * genus 3, the zero surface of a smooth function. The modes come from a Gaussian process, as in
 * Luethi, Gerig, Jud and Vetter 2018 ("Gaussian process morphable models"): every coordinate of the
 * displacement has the covariance
 *
 *     k(x, y) = DEVIATION^2 exp(-|x - y|^2 / CORRELATION^2)
 *
 * and is independent of the other two. Modes are the leading eigenfunctions of k on the surface, by
 * the method of Nystroem from N_POINTS vertices; each gives one mode along x, y and z. Modes are in
 * mm per standard deviation. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <sdm/image.h>
#include <sdm/isosurface.h>
#include <sdm/meshfile.h>

#define CORRELATION 4.0 /* mm */
#define DEVIATION 0.7   /* mm */
#define N_MODES 24
#define N_FUNCTIONS ((N_MODES + 2) / 3)
#define N_POINTS 600

static void stop(const char *what)
{
    fprintf(stderr, "make_labyrinth: %s\n", what);
    exit(1);
}

static double *numbers(size_t count)
{
    double *x = calloc(count, sizeof *x);
    if (!x) stop("out of memory");
    return x;
}

/* ---- the mean ---- */

/* A canal: a ring of radius `ring` about a centre, in the plane of two perpendicular directions of
 * length 1. The part of the ring inside the body does not show. */
typedef struct canal {
    double centre[3], first[3], second[3], ring;
} canal;

#define CANAL_RADIUS 0.3
static const canal CANALS[3] = {
    {{2.55, 0.1, -0.1}, {1, 0, 0}, {0, 0.9950, 0.0998}, 1.95}, /* lateral */
    {{-0.1, 2.3, 0.1}, {0, 1, 0}, {0.0998, 0, 0.9950}, 1.75},  /* posterior */
    {{0.1, -0.1, 2.4}, {0, 0, 1}, {0.9950, 0.0998, 0}, 1.85},  /* anterior */
};

/* The body: the balls of radius r[] around a[] and b[], and all between them (nearly: the hull). */
static const double A[3] = {0, 0, 0}, B[3] = {-2.4, -1.3, -1.2}, R[2] = {1.25, 0.95};

static double dot(const double x[3], const double y[3])
{
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
}

static double canal_distance(const canal *c, const double x[3])
{
    const double d[3] = {x[0] - c->centre[0], x[1] - c->centre[1], x[2] - c->centre[2]};
    const double u = dot(d, c->first), v = dot(d, c->second), up2 = dot(d, d) - u * u - v * v;
    const double off = hypot(u, v) - c->ring;
    return sqrt(off * off + (up2 > 0 ? up2 : 0)) - CANAL_RADIUS;
}

static double body_distance(const double x[3])
{
    const double ax[3] = {x[0] - A[0], x[1] - A[1], x[2] - A[2]};
    const double ab[3] = {B[0] - A[0], B[1] - A[1], B[2] - A[2]};
    const double t = fmin(fmax(dot(ax, ab) / dot(ab, ab), 0), 1);
    const double d[3] = {ax[0] - t * ab[0], ax[1] - t * ab[1], ax[2] - t * ab[2]};
    return sqrt(dot(d, d)) - (R[0] + t * (R[1] - R[0]));
}

/* Smooth minimum: a fillet where the two surfaces meet. */
static double blend(double a, double b)
{
    const double width = 0.4, h = fmax(width - fabs(a - b), 0) / width;
    return fmin(a, b) - h * h * width / 4;
}

/* Negative inside the labyrinth. */
static double level(const double x[3])
{
    double d = body_distance(x);
    for (int i = 0; i < 3; i++) d = blend(d, canal_distance(&CANALS[i], x));
    return d;
}

/* Moves x along the gradient onto the surface. */
static void project(double x[3])
{
    for (int round = 0; round < 4; round++) {
        const double h = 1e-5, here = level(x);
        double g[3];
        for (int k = 0; k < 3; k++) {
            double y[3] = {x[0], x[1], x[2]};
            y[k] = x[k] + h;
            g[k] = level(y);
            y[k] = x[k] - h;
            g[k] = (g[k] - level(y)) / (2 * h);
        }
        const double step = here / dot(g, g);
        for (int k = 0; k < 3; k++) x[k] -= step * g[k];
    }
}

/* Evens out the triangles: every vertex moves to the mean of its neighbours and back onto the
 * surface. */
static void relax(sdm_mesh *m)
{
    double *sum = numbers(3 * m->n_vert), *count = numbers(m->n_vert);
    for (int round = 0; round < 20; round++) {
        memset(sum, 0, 3 * m->n_vert * sizeof *sum);
        memset(count, 0, m->n_vert * sizeof *count);
        for (size_t i = 0; i < 3 * m->n_tri; i++) { // each edge of a closed mesh in both directions
            const uint32_t from = m->tri[i], to = m->tri[i % 3 == 2 ? i - 2 : i + 1];
            for (size_t k = 0; k < 3; k++) sum[3 * from + k] += m->vert[3 * to + k];
            count[from]++;
        }
        for (size_t v = 0; v < m->n_vert; v++) {
            for (size_t k = 0; k < 3; k++) m->vert[3 * v + k] = sum[3 * v + k] / count[v];
            project(m->vert + 3 * v);
        }
    }
    free(sum);
    free(count);
}

static void make_mean(sdm_mesh *m)
{
    const int64_t n[3] = {52, 46, 46};
    const double centre[3] = {0.5, 0.9, 1.0};
    const sdm_grid grid = sdm_grid_centred(n, 0.2, centre);
    float *values = malloc(sdm_grid_count(&grid) * sizeof *values), *to = values;
    if (!values) stop("out of memory");
    for (int64_t z = 0; z < n[2]; z++)
        for (int64_t y = 0; y < n[1]; y++)
            for (int64_t x = 0; x < n[0]; x++) {
                const double index[3] = {(double)x, (double)y, (double)z};
                double at[3];
                sdm_grid_world(&grid, index, at);
                *to++ = (float)level(at);
            }
    sdm_error err = {0};
    bool cut = false;
    if (sdm_isosurface(&grid, values, 0, m, &cut, &err)) stop(err.text);
    if (cut) stop("the mean leaves its grid");
    free(values);
    relax(m);
}

/* ---- the modes ---- */

static double covariance(const double x[3], const double y[3])
{
    const double d[3] = {x[0] - y[0], x[1] - y[1], x[2] - y[2]};
    return DEVIATION * DEVIATION * exp(-dot(d, d) / (CORRELATION * CORRELATION));
}

/* Chooses vertices that cover the surface evenly: each is as far as possible from those before. */
static void choose_points(const sdm_mesh *m, double (*points)[3])
{
    double *gap = numbers(m->n_vert);
    for (size_t v = 0; v < m->n_vert; v++) gap[v] = INFINITY;
    size_t next = 0;
    for (int i = 0; i < N_POINTS; i++) {
        memcpy(points[i], m->vert + 3 * next, sizeof points[i]);
        for (size_t v = 0; v < m->n_vert; v++) {
            const double *x = m->vert + 3 * v, *p = points[i];
            const double d[3] = {x[0] - p[0], x[1] - p[1], x[2] - p[2]};
            gap[v] = fmin(gap[v], dot(d, d));
        }
        for (size_t v = 0; v < m->n_vert; v++)
            if (gap[v] > gap[next]) next = v;
    }
    free(gap);
}

static double product(const double *a, const double *b)
{
    double sum = 0;
    for (int i = 0; i < N_POINTS; i++) sum += a[i] * b[i];
    return sum;
}

/* Makes the vectors orthonormal one after the other; none depends on those after it. */
static void orthonormalise(double (*vectors)[N_POINTS])
{
    for (int i = 0; i < N_FUNCTIONS; i++) {
        for (int j = 0; j < i; j++) {
            const double share = product(vectors[i], vectors[j]);
            for (int k = 0; k < N_POINTS; k++) vectors[i][k] -= share * vectors[j][k];
        }
        const double length = sqrt(product(vectors[i], vectors[i]));
        for (int k = 0; k < N_POINTS; k++) vectors[i][k] /= length;
    }
}

/* Leading eigenvectors and eigenvalues of the covariance matrix of the points by orthogonal
 * iteration. */
static void eigenvectors(const double (*points)[3], double (*vectors)[N_POINTS], double *values)
{
    double(*matrix)[N_POINTS] = (double(*)[N_POINTS])numbers((size_t)N_POINTS * N_POINTS);
    for (int i = 0; i < N_POINTS; i++)
        for (int j = 0; j < N_POINTS; j++) matrix[i][j] = covariance(points[i], points[j]);
    for (int i = 0; i < N_FUNCTIONS; i++)
        for (int k = 0; k < N_POINTS; k++) vectors[i][k] = cos(1.7 * i * k + i);
    for (int round = 0; round < 300; round++) { // changes are then below 1e-6 mm
        orthonormalise(vectors);
        for (int i = 0; i < N_FUNCTIONS; i++) {
            double was[N_POINTS];
            memcpy(was, vectors[i], sizeof was);
            for (int k = 0; k < N_POINTS; k++) vectors[i][k] = product(matrix[k], was);
            values[i] = product(was, vectors[i]);
        }
    }
    orthonormalise(vectors);
    free(matrix);
}

/* modes[N_MODES][n_vert][3], mm per standard deviation. Nystroem's extension of the eigenvector u
 * to the eigenvalue w: the function x -> sum over points of k(x, point) u(point) / sqrt(w) has the
 * variance that k explains by it. */
static void make_modes(const sdm_mesh *m, float *modes)
{
    static double points[N_POINTS][3], vectors[N_FUNCTIONS][N_POINTS], values[N_FUNCTIONS];
    choose_points(m, points);
    eigenvectors((const double(*)[3])points, vectors, values);
    double explained = 0;
    for (int f = 0; f < N_FUNCTIONS; f++) {
        const double sign = vectors[f][0] < 0 ? -1 : 1; // eigenvectors have no sign of their own
        const int n_axes = f < N_FUNCTIONS - 1 ? 3 : N_MODES - 3 * f;
        for (size_t v = 0; v < m->n_vert; v++) {
            double sum = 0;
            for (int i = 0; i < N_POINTS; i++)
                sum += covariance(m->vert + 3 * v, points[i]) * vectors[f][i];
            const double mode = sign * sum / sqrt(values[f]);
            for (int k = 0; k < n_axes; k++)
                modes[3 * ((size_t)(3 * f + k) * m->n_vert + v) + (size_t)k] = (float)mode;
            explained += n_axes * mode * mode / (3 * (double)m->n_vert * DEVIATION * DEVIATION);
        }
    }
    printf("%d modes have %.0f %% of the variance\n", N_MODES, 100 * explained);
}

int main(int argc, char **argv)
{
    const char *folder = argc > 1 ? argv[1] : ".";
    sdm_mesh mean = {0};
    make_mean(&mean);
    float *modes = calloc((size_t)N_MODES * mean.n_vert * 3, sizeof *modes);
    if (!modes) stop("out of memory");
    make_modes(&mean, modes);

    char path[4096];
    sdm_error err = {0};
    snprintf(path, sizeof path, "%s/mean.ply", folder);
    if (sdm_mesh_write(path, &mean, &err)) stop(err.text);
    snprintf(path, sizeof path, "%s/modes.npy", folder);
    const size_t shape[3] = {N_MODES, mean.n_vert, 3};
    if (sdm_npy_write(path, modes, shape, 3, &err)) stop(err.text);
    printf("%s: mean.ply of %zu vertices and %zu triangles, modes.npy\n", folder, mean.n_vert,
           mean.n_tri);
    free(modes);
    sdm_mesh_dispose(&mean);
    return 0;
}
