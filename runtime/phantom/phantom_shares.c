/* Computes the shares of the tissues in the voxels: converts exact distances at sub-voxels to
   shares, and filters these with the box of the voxel and the point spread along x, y and z. */
#include <math.h>
#include <string.h>

#include "phantom_parts.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

#define BLOCK_VOXELS ((size_t)1 << 24) // sub-voxels computed at a time
enum { EDGE_MAX = 32 };                // most sub-voxels along a long edge of a voxel

/* Inputs and filters of one computation. */
typedef struct shares_job {
    const sdm_exact *engine;
    const sdm_phantom_opts *o;
    const sdm_grid *grid;
    phantom_filter filter[3];
    sdm_grid fine; /* sub-voxels of the grid, with the margin that the filters need, in the world */
    sdm_grid shape_fine; /* the same in coordinates of the shape */
    double edge;         /* mean of the three edges of a sub-voxel, mm */
    phantom_balls balls;
    int threads;
} shares_job;

sdm_grid phantom_shape_grid(const sdm_grid *grid, const sdm_pose *pose)
{
    sdm_grid g = *grid;
    double r[9];
    sdm_pose_matrix(pose, r);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            g.dir[3 * a + b] = 0;
            for (int c = 0; c < 3; c++) g.dir[3 * a + b] += r[3 * c + a] * grid->dir[3 * c + b];
        }
    sdm_pose_apply_inverse(pose, grid->origin, g.origin);
    return g;
}

/* The part of grid g that has its planes first .. first + n - 1 along z. */
static sdm_grid planes_of(const sdm_grid *g, size_t first, size_t n)
{
    const double start[3] = {0, 0, (double)first};
    sdm_grid part = *g;
    sdm_grid_world(g, start, part.origin);
    part.n[2] = (int64_t)n;
    return part;
}

/* Chooses the sub-voxels, nearly cubes, and makes the filters. */
static sdm_status make_fine_grid(shares_job *j, const sdm_pose *pose, sdm_error *err)
{
    const sdm_grid *g = j->grid;
    const double shortest = fmin(g->spacing[0], fmin(g->spacing[1], g->spacing[2]));
    double start[3];
    j->fine = *g;
    j->edge = 0;
    for (int a = 0; a < 3; a++) {
        const double wanted = round(j->o->supersampling * g->spacing[a] / shortest);
        const size_t sub = (size_t)fmin(wanted, fmax(EDGE_MAX, j->o->supersampling));
        j->fine.spacing[a] = g->spacing[a] / (double)sub;
        j->edge += j->fine.spacing[a] / 3;
        const sdm_status s =
            phantom_filter_make(j->o->blur[a] / j->fine.spacing[a], sub, &j->filter[a], err);
        if (s) return s;
        const double margin = (double)(j->filter[a].n - sub) / 2;
        start[a] = (0.5 - margin) / (double)sub - 0.5;
        j->fine.n[a] = (int64_t)phantom_filter_samples(&j->filter[a], (size_t)g->n[a]);
    }
    sdm_grid_world(g, start, j->fine.origin);
    const sdm_status s = sdm_grid_check(&j->fine, err);
    if (s) return sdm_fail_in(err, s, "sub-voxels of the phantom");
    j->shape_fine = phantom_shape_grid(&j->fine, pose);
    return SDM_OK;
}

/* Lists the air cells (balls of air) that intersect the bounding box of the sub-voxels. */
static sdm_status make_balls(shares_job *j, sdm_error *err)
{
    double min[3] = {INFINITY, INFINITY, INFINITY}, max[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int corner = 0; corner < 8; corner++) {
        double index[3], x[3];
        for (int a = 0; a < 3; a++) index[a] = corner >> a & 1 ? (double)(j->fine.n[a] - 1) : 0;
        sdm_grid_world(&j->fine, index, x);
        for (int a = 0; a < 3; a++) min[a] = fmin(min[a], x[a]), max[a] = fmax(max[a], x[a]);
    }
    return phantom_balls_make(j->o, min, max, &j->balls, err);
}

/* Share of a cube on the negative side of a plane at signed distance d from its centre; exact for
   planes perpendicular to an axis. */
static float cube_share(float d, float edge)
{
    const float s = 0.5f - d / edge;
    return s < 0 ? 0 : s > 1 ? 1 : s;
}

/* Converts inside[n] and air[n] (may be NULL) of one plane of sub-voxels from distances to shares.
   Air keeps the distance air_clear_mm from the surface and takes no more than the inside leaves
   over. */
static void plane_to_shares(const shares_job *j, size_t n, float *inside, float *air)
{
    const float edge = (float)j->edge, clear = (float)j->o->air_clear_mm;
    for (size_t i = 0; i < n; i++) {
        const float d = inside[i];
        inside[i] = cube_share(d, edge);
        if (air) air[i] = fminf(cube_share(fmaxf(air[i], clear - d), edge), 1 - inside[i]);
    }
}

/* Filters a plane of sub-voxels to voxels along x and y, in place. */
static void reduce_plane(const shares_job *j, float *plane)
{
    const size_t nx = (size_t)j->grid->n[0], ny = (size_t)j->grid->n[1], row = (size_t)j->fine.n[0];
    phantom_filter_rows(&j->filter[1], plane, ny, row, row);
    for (size_t y = 0; y < ny; y++) phantom_filter_line(&j->filter[0], plane + y * row, nx);
}

/* Adds planes first .. first + n - 1, already filtered along x and y, to the voxels out[nz][ny][nx]
   with the weights along z; always in the order of the planes, so that the block size does not
   change the sums. */
static void add_planes(const shares_job *j, const float *planes, size_t first, size_t n, float *out)
{
    const size_t nx = (size_t)j->grid->n[0], ny = (size_t)j->grid->n[1], nz = (size_t)j->grid->n[2];
    const size_t row = (size_t)j->fine.n[0], plane = row * (size_t)j->fine.n[1];
    const phantom_filter *f = &j->filter[2];
#pragma omp parallel for num_threads(j->threads) schedule(static)
    for (size_t k = 0; k < nz; k++) {
        const size_t start = k * f->step, from = start > first ? start : first;
        const size_t end = start + f->n < first + n ? start + f->n : first + n;
        for (size_t p = from; p < end; p++)
            for (size_t y = 0; y < ny; y++) {
                const float weight = f->weight[p - start],
                            *in = planes + (p - first) * plane + y * row;
                float *to = out + (k * ny + y) * nx;
                for (size_t x = 0; x < nx; x++) to[x] += weight * in[x];
            }
    }
}

/* Computes distances and shares on planes first .. first + n - 1 of the sub-voxels, filters them,
   and adds them to inside and air. */
static sdm_status add_block(const shares_job *j, size_t first, size_t n, float *buffer,
                            float *air_buffer, float *inside, float *air, sdm_error *err)
{
    const size_t plane = (size_t)j->fine.n[0] * (size_t)j->fine.n[1];
    const sdm_grid here = planes_of(&j->shape_fine, first, n);
    const sdm_exact_layers layers = {.values = buffer,
                                     .band_mm = j->edge + (air ? j->o->air_clear_mm : 0)};
    const sdm_status s = sdm_exact_map_layers(j->engine, &here, &layers, err);
    if (s) return s;
#pragma omp parallel for num_threads(j->threads) schedule(dynamic)
    for (size_t k = 0; k < n; k++) {
        if (phantom_check_cancelled(j->o, NULL)) continue;
        float *d = buffer + k * plane, *b = air ? air_buffer + k * plane : NULL;
        if (b) phantom_balls_plane(&j->balls, &j->fine, first + k, j->edge, b);
        plane_to_shares(j, plane, d, b);
        reduce_plane(j, d);
        if (b) reduce_plane(j, b);
    }
    const sdm_status stopped = phantom_check_cancelled(j->o, err);
    if (stopped) return stopped;
    add_planes(j, buffer, first, n, inside);
    if (air) add_planes(j, air_buffer, first, n, air);
    return SDM_OK;
}

/* Adds all planes, one block after another to limit the memory. */
static sdm_status add_blocks(const shares_job *j, float *inside, float *air, sdm_error *err)
{
    const size_t plane = (size_t)j->fine.n[0] * (size_t)j->fine.n[1], planes = (size_t)j->fine.n[2];
    const size_t max = BLOCK_VOXELS / plane + 1, block = max < planes ? max : planes;
    float *buffer = NULL, *air_buffer = NULL;
    sdm_status s = SDM_ALLOC(&buffer, block * plane, "sub-voxels", err);
    if (!s && air) s = SDM_ALLOC(&air_buffer, block * plane, "sub-voxels", err);
    for (size_t first = 0; first < planes && !s; first += block) {
        const size_t n = planes - first < block ? planes - first : block;
        s = add_block(j, first, n, buffer, air_buffer, inside, air, err);
    }
    sdm_free(air_buffer);
    sdm_free(buffer);
    return s;
}

sdm_status phantom_shares(const sdm_exact *engine, const sdm_pose *pose, const sdm_phantom_opts *o,
                          const sdm_grid *grid, float *inside, float *air, sdm_error *err)
{
    shares_job j = {.engine = engine, .o = o, .grid = grid, .threads = sdm_threads(o->n_threads)};
    const size_t bytes = sdm_grid_count(grid) * sizeof *inside;
    memset(inside, 0, bytes);
    if (air) memset(air, 0, bytes);
    sdm_status s = make_fine_grid(&j, pose, err);
    if (!s && air) s = make_balls(&j, err);
    if (!s) s = add_blocks(&j, inside, air, err);
    phantom_balls_dispose(&j.balls);
    for (int a = 0; a < 3; a++) phantom_filter_dispose(&j.filter[a]);
    return s;
}
