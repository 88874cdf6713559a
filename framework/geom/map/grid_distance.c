/* Computes a distance map: divides the grid into boxes, blocks, tiles and vectors (defined in
   map.inc), tabulates their offsets, chooses the kernel, and distributes rows of boxes to
   threads. */
#include "grid_distance.h"

#include <math.h>
#include <stdatomic.h>
#include <string.h>

#include "grid_scratch.h"
#include "memory/cancel.h"
#include "sdm/internal/processor.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

// Largest grid_reach() for the kernels (unit: 1 to 2 longest edges): beyond it float cannot tell
// features apart.
#define REACH_MAX 1e5

// Bands below this multiple of the radius of a block do without reference points: measured.
#define NARROW 1.5f

static sdm_grid_kernel *kernel_choose(void)
{
#if defined(__x86_64__) && defined(__GNUC__)
    const int level = sdm_processor_level();
    if (level >= SDM_PROCESSOR_AVX512) return sdm_grid_kernel_avx512;
    if (level >= SDM_PROCESSOR_AVX2) return sdm_grid_kernel_avx2;
#endif
    return sdm_grid_kernel_generic;
}

/* out: vector in mm from voxel (0, 0, 0) to voxel `at`, whose indices may be fractional. */
static void voxel_offset(const sdm_grid_job *job, const double at[3], double out[3])
{
    for (int c = 0; c < 3; c++)
        out[c] = at[0] * job->step[0][c] + at[1] * job->step[1][c] + at[2] * job->step[2][c];
}

static double step_length(const sdm_grid_job *job, int a)
{
    const double *d = job->step[a];
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

/* Doubles a part of size[3] voxels along one axis and returns this axis. It is the axis along which
   the part is shortest in mm; axes along which the part is smaller than the grid come first. */
static int part_double(const sdm_grid_job *job, int64_t size[3])
{
    int best = -1;
    bool best_smaller = false;
    for (int a = 0; a < 3; a++) {
        const bool smaller = size[a] < job->n[a]; // than the grid
        const bool shorter = best < 0 || (double)size[a] * step_length(job, a) <
                                             (double)size[best] * step_length(job, best);
        if (smaller < best_smaller || (smaller == best_smaller && !shorter)) continue;
        best = a;
        best_smaller = smaller;
    }
    size[best] *= 2;
    return best;
}

/* Fills q with the eight parts of size[3] voxels of a whole of whole[3] voxels. along[3]: the axes
   along which three doublings lead from the part to the whole; bit b of a part's number selects its
   half along axis along[b]. */
static void parts_set(const sdm_grid_job *job, const int64_t size[3], const int along[3],
                      const int64_t whole[3], sdm_grid_parts *q)
{
    const double scale = job->features->scale;
    double radius = 0;
    // extents
    for (int a = 0; a < 3; a++) {
        const double half = 0.5 * (double)(size[a] - 1), length = half * step_length(job, a);
        q->size[a] = size[a];
        q->half[a] = (float)(length * scale);
        for (int c = 0; c < 3; c++) q->half_axis[a][c] = (float)(half * job->step[a][c] * scale);
        radius += length * length;
    }
    // the factor 1 + 1e-5 allows for grid axes that are orthogonal only up to 1e-6
    q->radius = (float)(sqrt(radius) * scale * (1 + 1e-5));
    // first voxels and centres
    for (int i = 0; i < 8; i++) {
        int64_t doubled[3] = {size[0], size[1], size[2]};
        double at[3];
        memset(q->first[i], 0, sizeof q->first[i]);
        for (int b = 0; b < 3; b++) {
            if (i >> b & 1) q->first[i][along[b]] += doubled[along[b]];
            doubled[along[b]] *= 2;
        }
        for (int a = 0; a < 3; a++)
            at[a] = (double)q->first[i][a] + 0.5 * (double)(size[a] - whole[a]);
        voxel_offset(job, at, q->centre_mm[i]);
        for (int c = 0; c < 3; c++) q->centre.x[c][i] = (float)(q->centre_mm[i][c] * scale);
    }
}

/* Upper bound on abs(x - sdm_features.centre) over the boxes of the grid, plus the radius of the
   surface, scaled. */
static double grid_reach(const sdm_grid_job *job)
{
    double reach = 0;
    for (int k = 0; k < 8; k++) {
        double at[3], x[3], d = 0;
        for (int a = 0; a < 3; a++) at[a] = (double)((k >> a & 1) * job->n_box[a] * job->box[a]);
        voxel_offset(job, at, x);
        for (int c = 0; c < 3; c++) {
            const double r = job->origin[c] + x[c] - job->features->centre[c];
            d += r * r;
        }
        reach = fmax(reach, sqrt(d));
    }
    return (reach + job->features->radius) * job->features->scale;
}

/* Index of voxel `at` within a part of size[3] voxels, x fastest. */
static int64_t voxel_index_in(const int64_t size[3], const int64_t at[3])
{
    return (at[2] * size[1] + at[1]) * size[0] + at[0];
}

/* Fills the tables vector, voxel, voxel_in_tile, voxel_mm and voxel_store of the job. in_vector:
   the eight voxels of a vector. */
static void voxel_tables_set(sdm_grid_job *job, const sdm_grid_parts *in_vector)
{
    const sdm_grid_parts *tiles = &job->part[SDM_TILES], *vectors = &job->part[SDM_VECTORS];
    const int64_t stored[2] = {job->blocks ? SDM_BLOCK_SIZE : job->n[0],
                               job->blocks ? SDM_BLOCK_SIZE : job->n[1]};
    job->paired = in_vector->first[1][0] == 1;
    for (int v = 0; v < 8; v++) {
        for (int i = 0; i < 8; i++) {
            int64_t in_tile[3];
            double at[3], x[3];
            for (int a = 0; a < 3; a++) {
                in_tile[a] = vectors->first[v][a] + in_vector->first[i][a];
                at[a] = (double)in_tile[a];
            }
            // within the tile, mm
            const int64_t index = voxel_index_in(tiles->size, in_tile);
            voxel_offset(job, at, x);
            job->voxel_in_tile[v][i] = (uint8_t)index;
            for (int c = 0; c < 3; c++) job->voxel_mm[c][v][i] = x[c];
            job->voxel_store[v][i] = (in_tile[2] * stored[1] + in_tile[1]) * stored[0] + in_tile[0];
            // within the block, scaled
            for (int t = 0; t < 8; t++) {
                for (int c = 0; c < 3; c++) {
                    const double centre = tiles->centre_mm[t][c] + vectors->centre_mm[v][c];
                    job->vector[t].x[c][v] = (float)(centre * job->features->scale);
                    job->voxel[t][v].x[c][i] =
                        (float)((centre + in_vector->centre_mm[i][c]) * job->features->scale);
                }
            }
        }
    }
}

/* Fills all members of the job that depend on the division of the grid; returns grid_reach(). */
static double job_set_tables(sdm_grid_job *job)
{
    // sizes of a voxel, a vector, a tile, a block and a box
    int64_t size[SDM_PART_LEVELS + 2][3] = {{1, 1, 1}};
    int along[SDM_PART_LEVELS + 1][3];
    for (int i = 0; i <= SDM_PART_LEVELS; i++) {
        memcpy(size[i + 1], size[i], sizeof size[i]);
        for (int b = 0; b < 3; b++) along[i][b] = part_double(job, size[i + 1]);
    }
    for (int i = 0; i < SDM_PART_LEVELS; i++) {
        const int k = SDM_PART_LEVELS - i;
        parts_set(job, size[k], along[k], size[k + 1], &job->part[i]);
    }
    // 0 / 0 along an axis where a block has one voxel: fmaxf() ignores the NaN
    for (int i = 0; i < SDM_PART_LEVELS; i++)
        for (int a = 0; a < 3; a++)
            job->extent_ratio[i] =
                fmaxf(job->extent_ratio[i], job->part[i].half[a] / job->part[SDM_BLOCKS].half[a]);
    sdm_grid_parts in_vector;
    parts_set(job, size[0], along[0], size[1], &in_vector);
    // are the offsets of vectors and tiles 2 and 4 times those of voxels?
    job->to_voxel = in_vector.centre;
    job->self_similar = true;
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < 8; i++)
            job->self_similar &=
                job->part[SDM_VECTORS].centre.x[c][i] == 2 * job->to_voxel.x[c][i] &&
                job->part[SDM_TILES].centre.x[c][i] == 4 * job->to_voxel.x[c][i];
    voxel_tables_set(job, &in_vector);
    // boxes over the grid
    job->aligned = true;
    for (int a = 0; a < 3; a++) {
        job->box[a] = size[SDM_PART_LEVELS + 1][a];
        job->n_box[a] = (job->n[a] + job->box[a] - 1) / job->box[a];
        for (int c = 0; c < 3; c++) job->aligned &= c == a || job->step[a][c] == 0;
    }
    // error of a linear function: 17 roundings (2^-24 each) of the largest coordinate, doubled
    const double reach = grid_reach(job);
    job->error = (float)(2e-6 * reach);
    for (int mask = 0; mask < 256; mask++)
        for (int i = 0, n = 0; i < 8; i++)
            if (mask >> i & 1) job->lanes_of[mask][n++] = (uint16_t)i;
    return reach;
}

/* Where the value of voxel (i, j, k) is stored; NULL: it is not wanted. */
static float *value_at(const sdm_grid_job *job, int64_t i, int64_t j, int64_t k)
{
    const int64_t s = SDM_BLOCK_SIZE;
    const sdm_blocks *b = job->blocks;
    if (!b) return &job->values[(k * job->n[1] + j) * job->n[0] + i];
    const uint32_t number = b->tile[(k / s * b->n[1] + j / s) * b->n[0] + i / s];
    return number < SDM_TILE_INSIDE ? &b->values[number][(k % s * s + j % s) * s + i % s] : NULL;
}

/* Does the work of sdm_grid_distance() voxel by voxel in double, for grids so far away or so large
   that float cannot tell features apart. */
static sdm_status distance_by_points(const sdm_grid_job *job, const sdm_grid *g,
                                     const sdm_exact_opts *opts, int n_threads, sdm_error *err)
{
    const int64_t n_rows = job->n[1] * job->n[2];
    atomic_int stop = 0;
    (void)n_threads; // unused without OpenMP
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (int64_t row = 0; row < n_rows; row++) {
        if (sdm_cancelled(opts)) atomic_store(&stop, 1);
        for (int64_t i = 0; i < job->n[0] && !atomic_load(&stop); i++) {
            const double index[3] = {(double)i, (double)(row % job->n[1]),
                                     (double)(row / job->n[1])};
            float *value = value_at(job, i, row % job->n[1], row / job->n[1]);
            double x[3], d2;
            if (!value) continue;
            sdm_grid_world(g, index, x);
            const uint32_t number = sdm_nearest_least(job->surface, x, &d2);
            const float d = (float)sqrt(d2);
            const bool near = d < (float)job->band_mm || !(job->band_mm < INFINITY);
            *value = near ? d : (float)job->band_mm;
            if (job->slot)
                job->slot[row * job->n[0] + i] = near ? job->features->owner[number] : SDM_NONE;
        }
    }
    return atomic_load(&stop) ? sdm_fail(err, SDM_E_CANCELLED, "map stopped on request") : SDM_OK;
}

/* Computes the map that *job describes so far: its surface and its outputs. */
static sdm_status job_run(const sdm_grid_job *j, const sdm_grid *g, const sdm_exact_opts *opts,
                          double band_mm, sdm_error *err)
{
    sdm_grid_job job = *j;
    job.features = &job.surface->features;
    job.band = (float)(band_mm * job.features->scale);
    job.band_mm = band_mm;
    for (int a = 0; a < 3; a++) {
        job.n[a] = g->n[a];
        job.origin[a] = g->origin[a];
        for (int c = 0; c < 3; c++)
            job.step[a][c] = g->n[a] > 1 ? g->dir[3 * c + a] * g->spacing[a] : 0;
    }
    const double reach = job_set_tables(&job);
    job.narrow = job.band < NARROW * job.part[SDM_BLOCKS].radius;
    const int n_threads = sdm_threads(opts->n_threads);
    if (!(reach < REACH_MAX)) return distance_by_points(&job, g, opts, n_threads, err);
    // each thread gets an equal share of the memory limit; 0 would mean no limit
    job.limit = opts->memory_limit / (size_t)n_threads;
    if (opts->memory_limit && !job.limit) job.limit = 1;
    sdm_grid_kernel *kernel = kernel_choose();
    const int64_t n_rows = job.n_box[1] * job.n_box[2];
    atomic_int stop = SDM_OK;
    // of several errors the one in the lowest row is reported
    int64_t failed = n_rows;
    sdm_status status = SDM_OK;
#pragma omp parallel num_threads(n_threads)
    {
        sdm_grid_scratch scratch = {0};
        sdm_error local = {0};
        const sdm_status ready = sdm_grid_scratch_start(&scratch, &local);
#pragma omp for schedule(dynamic)
        for (int64_t row = 0; row < n_rows; row++) {
            if (atomic_load(&stop)) continue;
            sdm_status s =
                ready ? ready
                      : kernel(&job, &scratch, row % job.n_box[1], row / job.n_box[1], &local);
            if (!s && sdm_cancelled(opts))
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

sdm_status sdm_grid_distance(const sdm_nearest *surface, const sdm_grid *g,
                             const sdm_exact_opts *opts, double band_mm, float *values,
                             uint32_t *slot, sdm_error *err)
{
    const sdm_grid_job job = {.surface = surface, .values = values, .slot = slot};
    return job_run(&job, g, opts, band_mm, err);
}

/* Sets the voxels of the blocks that lie beyond the grid to the band. */
static void beyond_fill(const sdm_blocks *b)
{
    for (size_t i = 0; i < b->n_block; i++) {
        bool whole = true;
        for (int a = 0; a < 3; a++) whole &= b->first[i][a] + SDM_BLOCK_SIZE <= b->grid.n[a];
        for (int v = 0; v < SDM_BLOCK_VOXELS && !whole; v++) b->values[i][v] = (float)b->band_mm;
    }
}

sdm_status sdm_grid_distance_blocks(const sdm_nearest *surface, const sdm_exact_opts *opts,
                                    const sdm_blocks *blocks, sdm_error *err)
{
    const sdm_grid_job job = {.surface = surface, .blocks = blocks};
    beyond_fill(blocks);
    return job_run(&job, &blocks->grid, opts, blocks->band_mm, err);
}
