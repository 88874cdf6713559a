/* Many maps from many threads: soak NETWORK EXACT THREADS computes NETWORK maps of a small network
 * and EXACT maps of a mesh of 12 triangles, whose engine is made anew for each. Every map must have
 * the bits of the one that was computed first with the same parameters, and the memory of the
 * process must be the same at a tenth of the maps and at the end. Prints the figures. Tests:
 * generate.c model_open.c exact.c */
#include <limits.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sdm/exact.h"
#include "sdm/internal/checksum.h"
#include "sdm/internal/clock.h"
#include "sdm/runtime.h"

enum { KINDS = 16, VOXELS_MAX = 1000, THREADS_MAX = 64, PARAMS_MAX = 8 };

/* Memory may grow by this much: the heaps of threads differ by what they happened to hold.
 * Sanitizers keep freed memory. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define GROWTH_KB LONG_MAX
#elif defined(__has_feature)
#define GROWTH_KB                                                                                  \
    (__has_feature(address_sanitizer) || __has_feature(thread_sanitizer) ? LONG_MAX : 2048)
#else
#define GROWTH_KB 2048
#endif

static sdm_model *model;
static uint64_t expected[2][KINDS];

static void require(bool holds, const char *what)
{
    if (holds) return;
    fprintf(stderr, "soak: %s\n", what);
    exit(1);
}

/* Checksum of the map of the network at the k-th parameters. */
static uint64_t network_map(unsigned k)
{
    float values[VOXELS_MAX];
    double p[PARAMS_MAX];
    const sdm_model_info *info = sdm_model_get_info(model);
    const sdm_generate_opts opts = {.n_threads = 1};
    const double share = k / (KINDS - 1.0);
    for (size_t i = 0; i < info->n_params; i++)
        p[i] = info->params[i].min * (1 - share) + info->params[i].max * share;
    require(!sdm_generate(model, p, &opts, values, NULL, NULL), "a map of the network failed");
    return sdm_crc64(0, values, sdm_grid_count(&info->grid) * sizeof *values);
}

/* Checksum of the exact map of the k-th box, on 8 x 8 x 8 voxels. */
static uint64_t exact_map(unsigned k)
{
    static const uint32_t triangles[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6},
                                              {0, 1, 4}, {1, 5, 4}, {2, 6, 3}, {3, 6, 7},
                                              {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    const sdm_grid grid = sdm_grid_centred((const int64_t[3]){8, 8, 8}, 0.7, (double[3]){0});
    const sdm_exact_opts opts = {.n_threads = 1};
    float values[512];
    sdm_mesh box = {0};
    sdm_exact *engine = NULL;
    require(!sdm_mesh_reserve(&box, 8, 12, NULL), "no memory for a mesh");
    for (unsigned i = 0; i < 24; i++)
        box.vert[i] = (1 + 0.05 * k) * ((i / 3) >> (i % 3) & 1 ? 1 : -1);
    memcpy(box.tri, triangles, sizeof triangles);
    require(!sdm_exact_create(&box, &opts, &engine, NULL), "an engine could not be made");
    require(!sdm_exact_map(engine, &grid, values, NULL), "an exact map failed");
    sdm_exact_free(engine);
    sdm_mesh_dispose(&box);
    return sdm_crc64(0, values, sizeof values);
}

static uint64_t (*const maps[2])(unsigned k) = {network_map, exact_map};
static const char *const names[2] = {"network", "exact"};

/* The maps that are left to compute, shared by the threads. */
static atomic_long left, wrong;
static int which;

static void *work(void *unused)
{
    for (long i; (i = atomic_fetch_sub(&left, 1)) > 0;) {
        const unsigned k = (unsigned)i % KINDS;
        if (maps[which](k) != expected[which][k]) atomic_fetch_add(&wrong, 1);
    }
    return unused;
}

static void compute(long n, int n_threads)
{
    pthread_t threads[THREADS_MAX];
    atomic_store(&left, n);
    for (int i = 0; i < n_threads; i++)
        require(!pthread_create(&threads[i], NULL, work, NULL), "a thread could not be made");
    for (int i = 0; i < n_threads; i++) pthread_join(threads[i], NULL);
}

/* Memory of the process in kB. */
static long resident_kb(void)
{
    long pages = 0;
    FILE *f = fopen("/proc/self/statm", "r");
    require(f && fscanf(f, "%*s %ld", &pages) == 1, "/proc/self/statm cannot be read");
    fclose(f);
    return pages * (sysconf(_SC_PAGESIZE) / 1024);
}

int main(int argc, char **argv)
{
    require(argc == 4, "usage: soak NETWORK EXACT THREADS");
    const int n_threads = atoi(argv[3]);
    require(n_threads > 0 && n_threads <= THREADS_MAX, "between 1 and 64 threads");
    require(!sdm_model_open(SDM_SOURCE_FOLDER "/tests/golden/imnet.sdm", &model, NULL) &&
                sdm_grid_count(&sdm_model_get_info(model)->grid) <= VOXELS_MAX &&
                sdm_model_get_info(model)->n_params <= PARAMS_MAX,
            "the model cannot be opened");
    for (which = 0; which < 2; which++) {
        const long n = atol(argv[1 + which]);
        for (unsigned k = 0; k < KINDS; k++) expected[which][k] = maps[which](k);
        const double start = sdm_clock();
        compute(n / 10, n_threads);
        const long early = resident_kb();
        compute(n - n / 10, n_threads);
        const long late = resident_kb();
        printf("%-8s %8ld maps, %d threads, %.1f s, %ld kB at a tenth, %ld kB at the end\n",
               names[which], n, n_threads, sdm_clock() - start, early, late);
        require(!wrong, "a map has other bits");
#ifndef SDM_EMULATED
        require(late - early <= GROWTH_KB, "the memory grows");
#endif
    }
    sdm_model_free(model);
    return 0;
}
