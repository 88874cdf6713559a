/* Exact maps against brute force: the 60 x 50 x 50 map at 0.2 mm of a self-overlapping tube of about 3,000 and 40,000 triangles. */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#include "oracle/exact_meshes.h"
#include "sdm/exact.h"

static double now_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

typedef struct timing {
    double build, query;
    sdm_exact_report report;
} timing;

/* Best of several runs: other programs on the machine only ever add time. */
static timing run_engine(const sdm_mesh *m, const sdm_grid *g, int n_threads, float *values)
{
    timing best = {.build = 1e300, .query = 1e300};
    for (int i = 0; i < 15; i++) {
        sdm_exact *e;
        sdm_error err = {0};
        const double start = now_ms();
        sdm_status s = sdm_exact_create(m, &(sdm_exact_opts){.n_threads = n_threads}, &e, &err);
        const double built = now_ms();
        if (!s) s = sdm_exact_map(e, g, values, &err);
        const double done = now_ms();
        if (s) {
            fprintf(stderr, "bench_exact: %s\n", err.text);
            exit(1);
        }
        if (built - start < best.build) best.build = built - start;
        if (done - built < best.query) best.query = done - built;
        best.report = *sdm_exact_get_report(e);
        sdm_exact_free(e);
    }
    return best;
}

/* Brute force over every k-th voxel, times k; the largest difference from the engine on those outside, where the inner surface
   does not matter. */
static double run_naive(const sdm_mesh *m, const sdm_grid *g, size_t k, const float *values, double *difference)
{
    size_t n = 0;
    const double start = now_ms();
    for (size_t i = 0; i < sdm_grid_count(g); i += k, n++) {
        const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
        double x[3];
        sdm_grid_world(g, (const double[3]){(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)}, x);
        const double d = sdm_naive_point(m, x);
        if (d > 0) *difference = fmax(*difference, fabs(d - values[i]));
    }
    return (now_ms() - start) / (double)n * (double)sdm_grid_count(g);
}

int main(void)
{
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){60, 50, 50}, 0.2, (const double[3]){0, 0, 2});
    float *values = malloc(sdm_grid_count(&g) * sizeof *values);
    if (!values) return 1;
    int most = 1;
#ifdef _OPENMP
    most = omp_get_max_threads();
#endif
    printf("%9s %8s %10s %10s %10s %12s %9s %12s\n", "triangles", "threads", "build ms", "map ms", "total ms",
           "naive ms", "ratio", "difference");
    const double edges[2] = {0.365, 0.1};
    for (int i = 0; i < 2; i++) {
        const spiral s = SPIRAL_NOMINAL;
        sdm_mesh m = {0};
        mesh_spiral(&m, &s, edges[i]);
        for (int threads = 1; threads <= most; threads = threads < most ? most : most + 1) {
            const timing t = run_engine(&m, &g, threads, values);
            printf("%9zu %8d %10.2f %10.2f %10.2f", m.n_tri, threads, t.build, t.query, t.build + t.query);
            // brute force on one thread and a sample: it takes the same time for every voxel
            double difference = 0;
            const double naive = threads == 1 ? run_naive(&m, &g, i ? 4999 : 499, values, &difference) : 0;
            if (threads == 1) printf(" %12.0f %9.0f %12.2e", naive, naive / (t.build + t.query), difference);
            putchar('\n');
        }
        sdm_mesh_dispose(&m);
    }
    free(values);
    return 0;
}
