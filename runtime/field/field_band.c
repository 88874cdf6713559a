/* The narrow band of a field: finds the blocks that can meet the band and evaluates them. */
#include <math.h>
#include <string.h>

#include "field_parts.h"
#include "sdm/internal/heap.h"
#include "spline_slope.h"

/* The work on one band. */
typedef struct job {
    const sdm_field *f;
    const sdm_grid *grid;
    double width;
    float radius; /* mm from the centre of a block to its voxels at the corners */
    bool parallel;
    spline_grid places; /* of the voxels, up to the end of the last blocks; parallel grids only */
    float *rows;        /* of sdm_spline_rows(); parallel grids only */
    float *centre;      /* [blocks] values at the centres of the blocks */
    spline_slope slope;
    uint32_t *candidate; /* [n] blocks that may meet the band */
    uint8_t *kind;       /* [n] of each candidate */
    size_t n;
    sdm_band *out;
} job;

/* What the values of a candidate show. */
enum { BLOCK_OUTSIDE = 0, BLOCK_INSIDE, BLOCK_NEAR };

static void block_position(const sdm_band *b, size_t number, int64_t at[3])
{
    at[0] = (int64_t)(number % (size_t)b->blocks[0]);
    at[1] = (int64_t)(number / (size_t)b->blocks[0] % (size_t)b->blocks[1]);
    at[2] = (int64_t)(number / (size_t)b->blocks[0] / (size_t)b->blocks[1]);
}

/* ---- the centres */

static void turned_centres(job *j)
{
    const size_t n = (size_t)(j->out->blocks[0] * j->out->blocks[1] * j->out->blocks[2]);
#pragma omp parallel for schedule(static) num_threads(j->f->n_threads) if (j->f->n_threads > 1)
    for (size_t i = 0; i < n; i++) {
        int64_t at[3];
        double index[3], world[3];
        block_position(j->out, i, at);
        for (int a = 0; a < 3; a++) index[a] = 8 * (double)at[a] + 3.5;
        sdm_grid_world(j->grid, index, world);
        const field_place p = field_find(j->f, world);
        j->centre[i] = field_value(j->f, &p);
    }
}

static sdm_status find_centres(job *j, sdm_error *err)
{
    const sdm_field *f = j->f;
    if (!j->parallel) {
        turned_centres(j);
        return SDM_OK;
    }
    spline_grid g;
    sdm_status s =
        sdm_spline_grid_create(&f->shape, &f->frame, j->grid, j->out->blocks, 3.5 / 8, 8, &g, err);
    if (!s) s = sdm_spline_map(&f->shape, &g, f->splines, NULL, f->n_threads, j->centre, err);
    if (!s) sdm_field_bound(f, &g, j->centre, NULL);
    sdm_spline_grid_dispose(&g);
    return s;
}

/* ---- the candidates */

/* Bound on the slope in a block: that of the bricks which it meets. */
static float block_slope(const job *j, size_t number)
{
    if (!j->parallel) return j->slope.all;
    int64_t at[3];
    size_t low[3], high[3];
    block_position(j->out, number, at);
    for (int b = 0; b < 3; b++) {
        const spline_axis *x = &j->places.axis[b];
        const int32_t first = x->cell[8 * at[b]], last = x->cell[8 * at[b] + 7];
        low[x->axis] = (size_t)(first < last ? first : last) / SPLINE_BRICK;
        high[x->axis] = (size_t)(first < last ? last : first) / SPLINE_BRICK;
    }
    float most = 0;
    for (size_t z = low[2]; z <= high[2]; z++)
        for (size_t y = low[1]; y <= high[1]; y++)
            for (size_t x = low[0]; x <= high[0]; x++)
                most = fmaxf(most, j->slope.max[(z * j->slope.n[1] + y) * j->slope.n[0] + x]);
    return most;
}

/* Whether no voxel of a block can lie within the band. */
static bool is_far(const job *j, float centre, float slope)
{
    // the bound outside of the box grows by up to 1 mm per mm
    const double change = (double)(fmaxf(slope, 1) * j->radius);
    return (double)fabsf(centre) >= j->width * (1 + 1e-6) + change + 1e-5;
}

static sdm_status find_candidates(job *j, sdm_error *err)
{
    const size_t n = (size_t)(j->out->blocks[0] * j->out->blocks[1] * j->out->blocks[2]);
    sdm_status s =
        sdm_alloc_unset((void **)&j->candidate, n, sizeof *j->candidate, "blocks of a band", err);
    for (size_t i = 0; i < n && !s; i++) {
        const float centre = j->centre[i];
        j->out->block[i] = centre < 0 ? SDM_BAND_INSIDE : SDM_BAND_OUTSIDE;
        if (!is_far(j, centre, j->slope.all) && !is_far(j, centre, block_slope(j, i)))
            j->candidate[j->n++] = (uint32_t)i;
    }
    return s;
}

/* ---- the values */

/* Replaces values at nodes by those of the map. */
static void write_nodes(const job *j, const int64_t first[3], float *values)
{
    const spline_axis *axis = j->places.axis;
    for (int64_t k = 0; k < 8; k++) {
        if (axis[2].node[first[2] + k] < 0) continue;
        for (int64_t y = 0; y < 8; y++) {
            if (axis[1].node[first[1] + y] < 0) continue;
            for (int64_t x = 0; x < 8; x++) {
                const int64_t at =
                    sdm_spline_node(&j->f->shape, &j->places,
                                    (const int64_t[]){first[0] + x, first[1] + y, first[2] + k});
                if (at >= 0) values[(k * 8 + y) * 8 + x] = j->f->maps[at];
            }
        }
    }
}

static void parallel_block(const job *j, const int64_t first[3], float *values)
{
    const spline_axis *axis = j->places.axis;
    const size_t line = axis[0].n, plane = line * j->f->shape.padded[axis[1].axis];
    const spline_block b = {j->rows + first[0],
                            line,
                            plane,
                            {axis[1].cell + first[1], axis[2].cell + first[2]},
                            {(const float(*)[4])axis[1].weight + first[1],
                             (const float(*)[4])axis[2].weight + first[2]}};
    j->f->kernels->block(&b, values);
    write_nodes(j, first, values);
}

/* The value of a voxel of the grid outside of the box: the bound, or if that lies within the band,
   the exact distance or (false) a refusal. */
static bool value_outside(const job *j, const double world[3], const field_place *p, float *value)
{
    *value = field_value(j->f, p);
    if (!((double)*value < j->width) || j->f->opts.outside == SDM_OUTSIDE_BOUND) return true;
    if (j->f->opts.outside == SDM_OUTSIDE_REFUSE) return false;
    *value = (float)sdm_exact_point(j->f->engine, world, NULL, NULL, NULL);
    return true;
}

/* Values by points: those of all voxels of a block (turned grids), or those outside of the box
   (parallel grids). false: a voxel is refused. */
static bool point_block(const job *j, const int64_t first[3], float *values)
{
    for (int64_t i = 0; i < SDM_BAND_VOXELS; i++) {
        const int64_t at[3] = {first[0] + i % 8, first[1] + i / 8 % 8, first[2] + i / 64};
        double world[3];
        sdm_grid_world(j->grid, (const double[]){(double)at[0], (double)at[1], (double)at[2]},
                       world);
        const field_place p = field_find(j->f, world);
        const bool in_grid =
            at[0] < j->grid->n[0] && at[1] < j->grid->n[1] && at[2] < j->grid->n[2];
        if (p.outside && in_grid) {
            if (!value_outside(j, world, &p, &values[i])) return false;
        } else if (!j->parallel)
            values[i] = field_value(j->f, &p);
    }
    return true;
}

/* Whether the values of a block in the grid meet the band, or else their side. */
static uint8_t block_kind(const job *j, const int64_t first[3], const float *values)
{
    int64_t n[3];
    for (int a = 0; a < 3; a++) n[a] = j->grid->n[a] - first[a] < 8 ? j->grid->n[a] - first[a] : 8;
    // all values have the same sign and at least this size, or the block is near
    const float width = (float)j->width;
    size_t low = 0, high = 0;
    for (int64_t k = 0; k < n[2]; k++)
        for (int64_t y = 0; y < n[1]; y++)
            for (int64_t x = 0; x < n[0]; x++) {
                const float v = values[(k * 8 + y) * 8 + x];
                low += v <= -width;
                high += v >= width;
            }
    const size_t all = (size_t)(n[0] * n[1] * n[2]);
    return low == all ? BLOCK_INSIDE : high == all ? BLOCK_OUTSIDE : BLOCK_NEAR;
}

/* Evaluates candidate i. false: a voxel outside of the box is refused. */
static bool evaluate(const job *j, size_t i)
{
    float *values = j->out->values + i * SDM_BAND_VOXELS;
    int64_t first[3];
    block_position(j->out, j->candidate[i], first);
    for (int a = 0; a < 3; a++) first[a] *= 8;
    bool leaves = false;
    if (j->parallel) {
        parallel_block(j, first, values);
        for (int b = 0; b < 3; b++)
            leaves = leaves || j->places.axis[b].beyond[first[b]] > 0 ||
                     j->places.axis[b].beyond[first[b] + 7] > 0;
    }
    if ((!j->parallel || leaves) && !point_block(j, first, values)) return false;
    j->kind[i] = block_kind(j, first, values);
    return true;
}

/* Keeps the blocks that meet the band. */
static void keep_near(job *j)
{
    sdm_band *b = j->out;
    for (size_t i = 0; i < j->n; i++) {
        int32_t *block = &b->block[j->candidate[i]];
        *block = j->kind[i] == BLOCK_INSIDE ? SDM_BAND_INSIDE : SDM_BAND_OUTSIDE;
        if (j->kind[i] != BLOCK_NEAR) continue;
        if (b->n != i)
            memcpy(b->values + b->n * SDM_BAND_VOXELS, b->values + i * SDM_BAND_VOXELS,
                   SDM_BAND_VOXELS * sizeof *b->values);
        *block = (int32_t)b->n++;
    }
}

static sdm_status evaluate_all(job *j, sdm_error *err)
{
    size_t count;
    sdm_status s = sdm_mul(j->n, SDM_BAND_VOXELS, &count, err);
    if (!s)
        s = sdm_alloc_unset((void **)&j->out->values, count, sizeof *j->out->values,
                            "values of a band", err);
    if (!s) s = SDM_ALLOC(&j->kind, j->n, "blocks of a band", err);
    if (s) return s;
    bool refused = false;
#pragma omp parallel for schedule(static, 8) reduction(||                                          \
                                                       : refused)                                  \
    num_threads(j->f->n_threads) if (j->f->n_threads > 1)
    for (size_t i = 0; i < j->n; i++) refused = refused || !evaluate(j, i);
    if (refused) return sdm_field_refuse(j->f, "the band leaves", err);
    keep_near(j);
    return SDM_OK;
}

/* ---- the band */

static sdm_status reserve(job *j, sdm_error *err)
{
    sdm_band *b = j->out;
    double all = 1;
    for (int a = 0; a < 3; a++) {
        b->blocks[a] = (j->grid->n[a] + SDM_BAND_EDGE - 1) / SDM_BAND_EDGE;
        all *= (double)b->blocks[a];
    }
    if (!(all <= INT32_MAX))
        return sdm_fail(err, SDM_E_ARG,
                        "grid of %lld x %lld x %lld voxels: a band has at most 2^31 blocks of 8 x "
                        "8 x 8 voxels; use larger voxels",
                        (long long)j->grid->n[0], (long long)j->grid->n[1],
                        (long long)j->grid->n[2]);
    b->grid = *j->grid;
    b->width = j->width;
    const sdm_status s =
        sdm_alloc_unset((void **)&b->block, (size_t)all, sizeof *b->block, "blocks of a band", err);
    return s ? s
             : sdm_alloc_unset((void **)&j->centre, (size_t)all, sizeof *j->centre,
                               "centres of blocks", err);
}

/* Places and rows for the voxels of a parallel grid. */
static sdm_status prepare_rows(job *j, sdm_error *err)
{
    const sdm_field *f = j->f;
    int64_t n[3];
    for (int a = 0; a < 3; a++) n[a] = j->out->blocks[a] * SDM_BAND_EDGE;
    const sdm_status s =
        sdm_spline_grid_create(&f->shape, &f->frame, j->grid, n, 0, 1, &j->places, err);
    return s ? s : sdm_spline_rows(&f->shape, &j->places, f->splines, f->n_threads, &j->rows, err);
}

static sdm_status make_band(job *j, sdm_error *err)
{
    const sdm_field *f = j->f;
    const double *h = j->grid->spacing;
    j->radius = (float)(3.5 * sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]));
    j->parallel = sdm_spline_is_parallel(&f->frame, j->grid);
    sdm_status s = reserve(j, err);
    if (!s) s = find_centres(j, err);
    if (!s)
        s = sdm_spline_slope_create(&f->shape, f->frame.spacing, f->splines, f->n_threads,
                                    &j->slope, err);
    if (!s && j->parallel) s = prepare_rows(j, err);
    if (!s) s = find_candidates(j, err);
    return s ? s : evaluate_all(j, err);
}

sdm_status sdm_field_band(const sdm_field *f, const sdm_grid *grid, double width, sdm_band *out,
                          sdm_error *err)
{
    if (!f || !grid || !out)
        return sdm_fail(err, SDM_E_ARG,
                        "field: a field, a grid and a place for the band are needed");
    memset(out, 0, sizeof *out);
    sdm_status s = sdm_field_check(f, NULL, err);
    if (!s) s = sdm_grid_check(grid, err);
    if (s) return s;
    const double edge = fmax(grid->spacing[0], fmax(grid->spacing[1], grid->spacing[2]));
    if (!(width >= edge) || !(width <= 1e100))
        return sdm_fail(err, SDM_E_ARG, "band of %g mm, need at least the edge of a voxel, %g mm",
                        width, edge);
    if (field_is_exact(f))
        return sdm_fail(
            err, SDM_E_UNSUPPORTED,
            "parameters outside the trained range: there is no band of exact distances");
    job j = {.f = f, .grid = grid, .width = width, .out = out};
    s = make_band(&j, err);
    sdm_free(j.kind);
    sdm_free(j.candidate);
    sdm_spline_slope_dispose(&j.slope);
    sdm_free(j.centre);
    sdm_free(j.rows);
    sdm_spline_grid_dispose(&j.places);
    if (s) sdm_band_dispose(out);
    return s;
}
