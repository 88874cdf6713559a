/* A-posteriori check of a map against exact distances at voxels near the surface. */
#include "sdm/check.h"

#include <math.h>
#include <stdlib.h>

#include "sdm/internal/rng.h"
#include "sdm/memory.h"

enum { SEED = 1, STREAM_PLACE, STREAM_EDGE, STREAM_CORNER };

static const char *const names[] = {"max", "q95", "rmse", "mean"};

const char *sdm_check_stat_name(sdm_check_stat stat)
{
    return (unsigned)stat < sizeof names / sizeof *names ? names[stat] : "unknown";
}

double sdm_check_get(const sdm_check *c, sdm_check_stat stat)
{
    const double figures[] = {c->max_mm, c->q95_mm, c->rmse_mm, c->mean_mm};
    return (unsigned)stat < sizeof figures / sizeof *figures ? figures[stat] : (double)NAN;
}

/* upto[t] = total area of the triangles 0 .. t. */
static void add_areas(const sdm_mesh *m, double *upto)
{
    double sum = 0;
    for (size_t t = 0; t < m->n_tri; t++) {
        const uint32_t *k = m->tri + 3 * t;
        const double *p = m->vert + 3 * (size_t)k[0], *q = m->vert + 3 * (size_t)k[1],
                     *r = m->vert + 3 * (size_t)k[2];
        double squares = 0;
        for (int a = 0; a < 3; a++) {
            const int b = (a + 1) % 3, c = (a + 2) % 3;
            const double n = (q[b] - p[b]) * (r[c] - p[c]) - (q[c] - p[c]) * (r[b] - p[b]);
            squares += n * n;
        }
        upto[t] = sum += 0.5 * sqrt(squares);
    }
}

/* First triangle t with upto[t] > area, by bisection. */
static size_t triangle_find(const double *upto, size_t n, double area)
{
    size_t low = 0, high = n - 1;
    while (low < high) {
        const size_t middle = (low + high) / 2;
        if (upto[middle] > area)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

/* Random point i on the surface: stratified sampling, one uniform point in each of SDM_CHECK_POINTS
   equal shares of the area. */
static void surface_point(const sdm_mesh *m, const double *upto, uint64_t i, double x[3])
{
    const double place = ((double)i + sdm_rng_uniform(SEED, STREAM_PLACE, i)) / SDM_CHECK_POINTS;
    const uint32_t *k = m->tri + 3 * triangle_find(upto, m->n_tri, place * upto[m->n_tri - 1]);
    const double u = sqrt(sdm_rng_uniform(SEED, STREAM_EDGE, i)),
                 v = u * sdm_rng_uniform(SEED, STREAM_CORNER, i);
    for (int a = 0; a < 3; a++)
        x[a] = (1 - u) * m->vert[3 * (size_t)k[0] + (size_t)a] +
               (u - v) * m->vert[3 * (size_t)k[1] + (size_t)a] +
               v * m->vert[3 * (size_t)k[2] + (size_t)a];
}

/* Error of the map at the voxel that contains x; x becomes the centre of the voxel. false if x is
   outside the grid. */
static bool error_at(const sdm_exact *engine, const sdm_grid *g, const float *values, double x[3],
                     double *error)
{
    double index[3];
    sdm_grid_index(g, x, index);
    for (int a = 0; a < 3; a++) {
        index[a] = floor(index[a] + 0.5);
        if (!(index[a] >= 0 && index[a] < (double)g->n[a])) return false;
    }
    sdm_grid_world(g, index, x);
    const size_t voxel = ((size_t)index[2] * (size_t)g->n[1] + (size_t)index[1]) * (size_t)g->n[0] +
                         (size_t)index[0];
    *error = (double)values[voxel] - sdm_exact_point(engine, x, NULL, NULL, NULL);
    return true;
}

static int compare_errors(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    if (isnan(x) || isnan(y))
        // NaN is larger than any number
        return (isnan(x) != 0) - (isnan(y) != 0);
    return (x > y) - (x < y);
}

/* Statistics of c->used errors; overwrites error[] with the sorted absolute values. */
static void errors_reduce(double *error, sdm_check *c)
{
    const size_t n = c->used;
    double sum = 0, sizes = 0, squares = 0;
    for (size_t i = 0; i < n; i++) {
        sum += error[i];
        squares += error[i] * error[i];
        sizes += error[i] = fabs(error[i]);
    }
    qsort(error, n, sizeof *error, compare_errors);
    c->mean_mm = sizes / (double)n; // 0 / 0 = NaN if no point is used
    c->bias_mm = sum / (double)n;
    c->rmse_mm = sqrt(squares / (double)n);
    c->q95_mm = n ? error[(95 * n + 99) / 100 - 1] : (double)NAN;
    c->max_mm = n ? error[n - 1] : (double)NAN;
}

sdm_status sdm_check_map(const sdm_exact *engine, const sdm_grid *grid, const float *values,
                         sdm_check *out, sdm_error *err)
{
    if (!engine || !grid || !values || !out)
        return sdm_fail(err, SDM_E_ARG,
                        "check: an engine, a grid, a map and a place for the result are needed");
    *out = (sdm_check){0};
    sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    const sdm_mesh *m = sdm_exact_surface(engine);
    double *upto = NULL, error[SDM_CHECK_POINTS], x[3];
    s = SDM_ALLOC(&upto, m->n_tri, "areas of triangles", err);
    if (s) return s;
    add_areas(m, upto);
    // errors at the voxels of the points
    for (uint64_t i = 0; i < SDM_CHECK_POINTS; i++) {
        surface_point(m, upto, i, x);
        if (error_at(engine, grid, values, x, &error[out->used]))
            out->used++;
        else
            out->outside++;
    }
    errors_reduce(error, out);
    sdm_free(upto);
    return SDM_OK;
}

sdm_status sdm_check_shape(const sdm_instance *shape, const double *p, const sdm_grid *grid,
                           const float *values, sdm_check *out, sdm_error *err)
{
    if (!shape || !p)
        return sdm_fail(err, SDM_E_ARG, "check: a shape and its parameters are needed");
    sdm_mesh mesh = {0};
    sdm_exact *engine = NULL;
    sdm_status s = sdm_instance_mesh(shape, p, &mesh, err);
    if (!s) s = sdm_exact_create(&mesh, &(sdm_exact_opts){.n_threads = 1}, &engine, err);
    if (!s) s = sdm_check_map(engine, grid, values, out, err);
    sdm_exact_free(engine);
    sdm_mesh_dispose(&mesh);
    return s;
}
