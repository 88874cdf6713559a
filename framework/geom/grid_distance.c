/* The distance map: how the grid is cut into blocks and tiles, and the threads over the blocks. */
#include "grid_distance.h"

#include <math.h>
#include <string.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#include "grid_job.h"
#include "sdm/memory.h"

static int wanted_level = -1;

// the level to use when `level` is wanted; -1: the best of the machine
static int usable(int level)
{
    int best = 0;
#if defined(__x86_64__) && defined(__GNUC__)
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) best = 1;
    if (best && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512dq"))
        best = 2;
#endif
    return level >= 0 && level < best ? level : best;
}

int sdm_grid_kernel_select(int level)
{
    wanted_level = level;
    return usable(level);
}

static sdm_grid_kernel *choose_kernel(void)
{
    switch (usable(wanted_level)) {
#if defined(__x86_64__) && defined(__GNUC__)
    case 2:
        return sdm_grid_kernel_avx512;
    case 1:
        return sdm_grid_kernel_avx2;
#endif
    default:
        return sdm_grid_kernel_generic;
    }
}

int sdm_thread_count(int n_threads)
{
#ifdef _OPENMP
    return n_threads > 0 ? n_threads : omp_get_max_threads();
#else
    (void)n_threads;
    return 1;
#endif
}

static size_t bytes_of(size_t cap)
{
    return cap * (sizeof(sdm_candidate) + 9 * sizeof(float[8]) + 18 * sizeof(uint32_t));
}

sdm_status sdm_grid_scratch_reserve(sdm_grid_scratch *s, size_t cap, size_t limit, sdm_error *err)
{
    if (cap <= s->cap) return SDM_OK;
    if (limit && bytes_of(cap) > limit)
        return sdm_fail(err, SDM_E_NOMEM,
                        "a block of the map needs %zu bytes of scratch, the limit is %zu a thread; raise memory_limit",
                        bytes_of(cap), limit);
    sdm_status st = sdm_grow((void **)&s->candidate, s->cap, cap, sizeof *s->candidate, "candidates", err);
    if (!st) st = sdm_grow((void **)&s->corner, s->cap, cap, sizeof *s->corner, "candidates", err);
    if (!st) st = sdm_grow((void **)&s->slot, s->cap, cap, sizeof *s->slot, "candidates", err);
    if (!st) st = sdm_grow((void **)&s->alive, s->cap, cap, sizeof *s->alive, "candidates", err);
    for (int c = 0; c < 8 && !st; c++)
        st = sdm_grow((void **)&s->list[c], s->cap, cap, sizeof *s->list[c], "candidates", err);
    for (int c = 0; c < 8 && !st; c++)
        st = sdm_grow((void **)&s->tile_corner[c], s->cap, cap, sizeof *s->tile_corner[c], "candidates", err);
    for (int k = 0; k < SDM_KINDS && !st; k++)
        st = sdm_grow((void **)&s->kind[k], s->cap, cap, sizeof *s->kind[k], "candidates", err);
    if (!st && !s->distance) st = SDM_ALLOC(&s->distance, SDM_GRID_CHUNK, "distances of a tile", err);
    if (!st) s->cap = cap;
    return st;
}

void sdm_grid_scratch_dispose(sdm_grid_scratch *s)
{
    sdm_free(s->candidate);
    sdm_free(s->corner);
    sdm_free(s->distance);
    sdm_free(s->slot);
    sdm_free(s->alive);
    for (int c = 0; c < 8; c++) {
        sdm_free(s->list[c]);
        sdm_free(s->tile_corner[c]);
    }
    for (int k = 0; k < SDM_KINDS; k++) sdm_free(s->kind[k]);
    sdm_free(s->corner_seen);
    sdm_free(s->edge_seen);
    *s = (sdm_grid_scratch){0};
}

/* The tile of 64 voxels that is smallest in space, counting voxels outside a thin grid as lost. */
static void choose_tile(sdm_grid_job *job)
{
    double least = INFINITY;
    for (int64_t x = 1; x <= 64; x *= 2) {
        for (int64_t y = 1; x * y <= 64; y *= 2) {
            const int64_t tile[3] = {x, y, 64 / (x * y)};
            double used = 1, size = 0;
            for (int a = 0; a < 3; a++) {
                const double n = (double)(tile[a] < job->n[a] ? tile[a] : job->n[a]);
                double step = 0;
                for (int c = 0; c < 3; c++) step += job->step[a][c] * job->step[a][c];
                used *= n;
                size += (n - 1) * (n - 1) * step;
            }
            const double cost = (size + 1e-300) * (64 / used) * (64 / used);
            if (!(cost < least)) continue;
            least = cost;
            memcpy(job->tile, tile, sizeof tile);
        }
    }
}

/* Position of voxel `at` (may be fractional) relative to voxel (0, 0, 0). */
static void offset(const sdm_grid_job *job, const double at[3], double out[3])
{
    for (int c = 0; c < 3; c++) out[c] = at[0] * job->step[0][c] + at[1] * job->step[1][c] + at[2] * job->step[2][c];
}

/* Corners of a box of voxel middles, relative to its middle, scaled. */
static void corners(const sdm_grid_job *job, const int64_t size[3], sdm_points *out)
{
    for (int k = 0; k < 8; k++) {
        double at[3], x[3];
        for (int a = 0; a < 3; a++) at[a] = (k >> a & 1 ? 0.5 : -0.5) * (double)(size[a] - 1);
        offset(job, at, x);
        for (int c = 0; c < 3; c++) out->x[c][k] = (float)(x[c] * job->surface->scale);
    }
}

static void fill_tables(sdm_grid_job *job)
{
    const double scale = job->surface->scale;
    int64_t tiles[3];
    double x[3];
    for (int a = 0; a < 3; a++) {
        tiles[a] = job->n[a] > job->tile[a] ? 2 : 1;
        job->block[a] = tiles[a] * job->tile[a];
        job->n_block[a] = (job->n[a] + job->block[a] - 1) / job->block[a];
    }
    corners(job, job->block, &job->block_corner);
    corners(job, job->tile, &job->tile_corner);
    job->block_radius = 0;
    double tile_edges = 0;
    for (int a = 0; a < 3; a++) {
        const double *d = job->step[a], step = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        job->block_radius += 0.5 * (double)(job->block[a] - 1) * step;
        tile_edges += (double)(job->tile[a] - 1) * step;
    }
    job->small_tiles = tile_edges < 2 * job->surface->longest;
    for (int64_t z = 0; z < tiles[2]; z++) {
        for (int64_t y = 0; y < tiles[1]; y++) {
            for (int64_t t = 0; t < tiles[0]; t++) {
                const int64_t tile[3] = {t, y, z};
                const int c = job->n_child++;
                double at[3];
                for (int a = 0; a < 3; a++) {
                    job->child_voxel[c][a] = tile[a] * job->tile[a];
                    at[a] = (double)job->child_voxel[c][a] + 0.5 * (double)(job->tile[a] - job->block[a]);
                }
                offset(job, at, job->child[c]);
                for (int a = 0; a < 3; a++) job->child_shift[c][a] = (float)(job->child[c][a] * scale);
            }
        }
    }
    for (int c = 0; c < 8; c++)
        for (int a = 0; a < 3; a++) job->child_middle.x[a][c] = job->child_shift[c < job->n_child ? c : 0][a];
    for (int i = 0; i < 64; i++) {
        const int64_t index[3] = {i % job->tile[0], i / job->tile[0] % job->tile[1], i / (job->tile[0] * job->tile[1])};
        double at[3];
        for (int a = 0; a < 3; a++) at[a] = (double)index[a] - 0.5 * (double)(job->tile[a] - 1);
        offset(job, at, x);
        for (int a = 0; a < 3; a++) job->voxel[a][i] = x[a];
    }
    for (int i = 0; i < 8; i++) {
        for (int a = 0; a < 3; a++) {
            job->voxel_lane.x[a][i] = (float)(job->voxel[a][i] * scale);
            job->vector_shift[i][a] = (float)((job->voxel[a][8 * i] - job->voxel[a][0]) * scale);
        }
    }
}

sdm_status sdm_grid_distance(const sdm_nearest *surface, const sdm_grid *g, const sdm_exact_opts *opts, float *values,
                             sdm_error *err)
{
    sdm_grid_job job = {.surface = surface, .values = values};
    for (int a = 0; a < 3; a++) {
        job.n[a] = g->n[a];
        job.origin[a] = g->origin[a];
        for (int c = 0; c < 3; c++) job.step[a][c] = g->dir[3 * c + a] * g->spacing[a];
    }
    choose_tile(&job);
    fill_tables(&job);
    const int n_threads = sdm_thread_count(opts->n_threads);
    job.limit = opts->memory_limit / (size_t)n_threads;
    if (opts->memory_limit && !job.limit) job.limit = 1;
    sdm_grid_kernel *kernel = choose_kernel();
    const int64_t n_rows = job.n_block[1] * job.n_block[2];
    atomic_int stop = SDM_OK;
    int64_t failed = n_rows;
    sdm_status status = SDM_OK;
#pragma omp parallel num_threads(n_threads)
    {
        sdm_grid_scratch scratch = {0};
        sdm_error local = {0};
        sdm_status ready = sdm_grid_scratch_reserve(&scratch, 512, job.limit, &local);
        if (!ready) ready = SDM_ALLOC(&scratch.corner_seen, surface->n_corner, "corners in use", &local);
        if (!ready) ready = SDM_ALLOC(&scratch.edge_seen, surface->n_edge, "edges in use", &local);
#pragma omp for schedule(dynamic)
        for (int64_t row = 0; row < n_rows; row++) {
            if (atomic_load(&stop)) continue;
            sdm_status s = ready;
            if (!s) s = kernel(&job, &scratch, row % job.n_block[1], row / job.n_block[1], &local);
#ifdef _OPENMP
            const bool ask = omp_get_thread_num() == 0;
#else
            const bool ask = true;
#endif
            if (!s && ask && opts->cancelled && opts->cancelled(opts->user))
                s = sdm_fail(&local, SDM_E_CANCELLED, "map stopped on request");
            if (!s) continue;
            atomic_store(&stop, 1);
#pragma omp critical(sdm_grid_distance_failed)
            if (row < failed) {
                failed = row;
                status = sdm_fail(err, s, "%s", local.text);
            }
        }
        sdm_grid_scratch_dispose(&scratch);
    }
    return status;
}
