/* The narrow band of a field: finds the blocks that can meet the band and evaluates them. */
#include <math.h>
#include <string.h>

#include "band_doubt.h"
#include "field_parts.h"
#include "sdm/internal/heap.h"
#include "spline_change.h"

/* The work on one band. */
typedef struct job {
    const sdm_field *f;
    const sdm_grid *grid;
    double width;
    float radius; /* mm from the centre of a block to its voxels at the corners */
    bool parallel;
    spline_grid places;  /* of the voxels, up to the end of the last blocks; parallel grids only */
    spline_part part;    /* the rows that the candidates of a parallel grid need */
    float *rows;         /* of sdm_spline_rows(), for this part */
    brick_span *span[3]; /* of the blocks along the axes of a parallel grid */
    uint8_t *doubt;      /* [blocks] of sdm_band_doubt(); parallel grids only */
    float *centre;       /* [blocks] values at the centres of the blocks */
    double half[3];      /* mm along the axes of the map from the centre of a block to its voxels */
    spline_change change;
    uint32_t *candidate; /* [n] blocks that may meet the band */
    size_t n;
    sdm_blocks *out;
} job;

/* Candidates that are evaluated before those that meet the band are kept. */
enum { PIECE = 256, PIECE_OF_ONE = 8 };

/* Pieces of rows that fill 4 MB, for which sdm_alloc_unset() takes large pages. */
enum { MANY_PIECES = 1 << 17 };

/* The place of a candidate, judged by its values. */
typedef enum block_kind { BLOCK_OUTSIDE = 0, BLOCK_INSIDE, BLOCK_NEAR, BLOCK_REFUSED } block_kind;

static void block_position(const sdm_blocks *b, size_t number, int64_t at[3])
{
    at[0] = (int64_t)(number % (size_t)b->n[0]);
    at[1] = (int64_t)(number / (size_t)b->n[0] % (size_t)b->n[1]);
    at[2] = (int64_t)(number / (size_t)b->n[0] / (size_t)b->n[1]);
}

/* ---- the centres */

static void turned_centres(job *j)
{
    const size_t n = (size_t)(j->out->n[0] * j->out->n[1] * j->out->n[2]);
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
        sdm_spline_grid_create(&f->shape, &f->frame, j->grid, j->out->n, 3.5 / 8, 8, &g, err);
    if (!s) s = sdm_spline_map(&f->shape, &g, f->splines, NULL, f->n_threads, j->centre, err);
    if (!s) sdm_field_bound(f, &g, j->centre, NULL);
    sdm_spline_grid_dispose(&g);
    return s;
}

/* ---- the candidates */

/* span[3] = those of the block at at[3] (not rounded) of the lattice of blocks. */
static void find_spans(const job *j, const double at[3], brick_span span[3])
{
    const spline_shape *s = &j->f->shape;
    double index[3], world[3], centre[3];
    for (int b = 0; b < 3; b++) index[b] = 8 * at[b] + 3.5;
    sdm_grid_world(j->grid, index, world);
    sdm_spline_index(&j->f->frame, world, centre);
    for (int a = 0; a < 3; a++) {
        const double half = j->half[a] / j->f->frame.spacing[a];
        const spline_place low = sdm_spline_place(centre[a] - half, s->n[a]),
                           high = sdm_spline_place(centre[a] + half, s->n[a]);
        span[a] = (brick_span){.low = (size_t)low.cell / SPLINE_BRICK,
                               .high = (size_t)high.cell / SPLINE_BRICK,
                               .leaves = low.beyond != 0 || high.beyond != 0};
    }
}

/* Whether the value may change by more than `most` from the centre of a block to its voxels;
   span[3] along x, y, z of the map. */
static bool may_change(const job *j, float most, const brick_span *const span[3])
{
    const spline_change *c = &j->change;
    // the bound outside of the box grows by up to 1 mm per mm besides
    if (span[0]->leaves || span[1]->leaves || span[2]->leaves) most -= j->radius;
    for (size_t z = span[2]->low; z <= span[2]->high; z++)
        for (size_t y = span[1]->low; y <= span[1]->high; y++)
            for (size_t x = span[0]->low; x <= span[0]->high; x++)
                if (c->max[(z * c->n[1] + y) * c->n[0] + x] > most) return true;
    return most < 0;
}

/* span: those of the blocks of a parallel grid, along each axis of the grid. */
static sdm_status tabulate_spans(job *j, sdm_error *err)
{
    const int64_t *n = j->out->n;
    brick_span **table = j->span;
    const sdm_status s =
        SDM_ALLOC(&table[0], (size_t)(n[0] + n[1] + n[2]), "bricks of blocks", err);
    if (s) return s;
    table[1] = table[0] + n[0];
    table[2] = table[1] + n[1];
    for (int b = 0; b < 3; b++)
        for (int64_t i = 0; i < n[b]; i++) {
            double at[3] = {0, 0, 0};
            brick_span span[3];
            at[b] = (double)i;
            find_spans(j, at, span);
            table[b][i] = span[j->places.axis[b].axis];
        }
    return SDM_OK;
}

/* How far, in mm, a value lies beyond the band; the margin covers roundings. */
static float beyond_band(const job *j, float value)
{
    return fabsf(value) - (float)(j->width * (1 + 1e-6)) - 1e-5f;
}

/* doubt, for a parallel grid. */
static sdm_status find_doubt(job *j, sdm_error *err)
{
    block_axis axis[3];
    const int64_t *n = j->out->n;
    sdm_status s = tabulate_spans(j, err);
    if (!s)
        s = sdm_alloc_unset((void **)&j->doubt, (size_t)(n[0] * n[1] * n[2]), sizeof *j->doubt,
                            "blocks of a band", err);
    for (int b = 0; b < 3; b++)
        axis[b] = (block_axis){j->places.axis[b].axis, (size_t)n[b], j->span[b]};
    return s ? s
             : sdm_band_doubt(&j->f->shape, j->f->splines, -beyond_band(j, 0), axis,
                              j->f->n_threads, j->doubt, err);
}

/* Adds the bricks that block at[3] of a parallel grid meets. */
static void ask_bricks(const job *j, const int64_t at[3], brick_rows *asked)
{
    const brick_span *span[3];
    for (int b = 0; b < 3; b++) span[j->places.axis[b].axis] = &j->span[b][at[b]];
    for (size_t z = span[2]->low; z <= span[2]->high; z++) {
        brick_rows *rows = &asked[z];
        rows->first = span[1]->low < rows->first ? span[1]->low : rows->first;
        rows->last = span[1]->high + 1 > rows->last ? span[1]->high + 1 : rows->last;
    }
}

/* change, for the blocks of a parallel grid that are in doubt and have their centres beyond the
   band, or for all blocks of a turned one. */
static sdm_status find_change(job *j, sdm_error *err)
{
    const sdm_field *f = j->f;
    const double *h = f->frame.spacing;
    const double reach[3] = {j->half[0] / h[0], j->half[1] / h[1], j->half[2] / h[2]};
    const int64_t *n = j->out->n;
    brick_rows *asked = NULL;
    size_t bricks[3];
    sdm_spline_bricks(&f->shape, bricks);
    sdm_status s = j->parallel ? SDM_ALLOC(&asked, bricks[2], "bricks of blocks", err) : SDM_OK;
    if (!s && asked) {
        for (size_t z = 0; z < bricks[2]; z++) asked[z].first = bricks[1];
        size_t i = 0;
        for (int64_t z = 0; z < n[2]; z++)
            for (int64_t y = 0; y < n[1]; y++)
                for (int64_t x = 0; x < n[0]; x++, i++)
                    if (j->doubt[i] && beyond_band(j, j->centre[i]) >= 0)
                        ask_bricks(j, (const int64_t[]){x, y, z}, asked);
    }
    if (!s)
        s = sdm_spline_change_create(&f->shape, reach, f->splines, asked, f->n_threads, &j->change,
                                     err);
    sdm_free(asked);
    return s;
}

/* Whether the block number at[3] along the axes may meet the band; centre: the value of the field
   at its centre. */
static bool may_meet(const job *j, float centre, const int64_t at[3])
{
    const float beyond = beyond_band(j, centre);
    if (beyond < 0) return true;
    if (beyond >= j->change.all + j->radius) return false;
    const brick_span *span[3];
    brick_span own[3];
    if (!j->parallel)
        find_spans(j, (const double[]){(double)at[0], (double)at[1], (double)at[2]}, own);
    for (int b = 0; b < 3; b++)
        if (j->parallel)
            span[j->places.axis[b].axis] = &j->span[b][at[b]];
        else
            span[b] = &own[b];
    return may_change(j, beyond, span);
}

static sdm_status find_candidates(job *j, sdm_error *err)
{
    const int64_t *n = j->out->n;
    const sdm_status s = sdm_alloc_unset((void **)&j->candidate, (size_t)(n[0] * n[1] * n[2]),
                                         sizeof *j->candidate, "blocks of a band", err);
    uint32_t i = 0;
    for (int64_t z = 0; z < n[2] && !s; z++)
        for (int64_t y = 0; y < n[1]; y++)
            for (int64_t x = 0; x < n[0]; x++, i++) {
                const float centre = j->centre[i];
                j->out->tile[i] = centre < 0 ? SDM_TILE_INSIDE : SDM_TILE_OUTSIDE;
                if ((!j->doubt || j->doubt[i]) && may_meet(j, centre, (const int64_t[]){x, y, z}))
                    j->candidate[j->n++] = i;
            }
    return s;
}

/* The pieces of rows that block at[3] needs: low .. end - 1 along each axis of spline_part. */
static void block_pieces(const job *j, const int64_t at[3], size_t low[3], size_t end[3])
{
    low[0] = (size_t)at[0];
    end[0] = low[0] + 1;
    for (int b = 1; b < 3; b++) {
        const int32_t *cell = j->places.axis[b].cell + 8 * at[b];
        // cells ascend or descend
        low[b] = (size_t)(cell[0] < cell[7] ? cell[0] : cell[7]);
        end[b] = (size_t)(cell[0] > cell[7] ? cell[0] : cell[7]) + 4;
    }
}

/* part, without wanted: the box around what all candidates need. */
static void bound_pieces(job *j)
{
    size_t last[3] = {0}, low[3], end[3];
    int64_t at[3];
    for (size_t i = 0; i < j->n; i++) {
        block_position(j->out, j->candidate[i], at);
        block_pieces(j, at, low, end);
        for (int b = 0; b < 3; b++) {
            size_t *first = &j->part.first[b];
            *first = i == 0 || low[b] < *first ? low[b] : *first;
            last[b] = end[b] > last[b] ? end[b] : last[b];
        }
    }
    for (int b = 0; b < 3; b++) j->part.n[b] = last[b] - j->part.first[b];
}

/* wanted of spline_part. */
static void mark_pieces(const job *j, uint8_t *wanted)
{
    const size_t *first = j->part.first, *n = j->part.n;
    for (size_t i = 0, next; i < j->n; i = next) {
        // the candidates i .. next - 1 are neighbours along x
        size_t low[3], end[3];
        int64_t at[3], other[3];
        block_position(j->out, j->candidate[i], at);
        block_pieces(j, at, low, end);
        for (next = i + 1; next < j->n; next++) {
            block_position(j->out, j->candidate[next], other);
            if (j->candidate[next] != j->candidate[i] + (next - i) || other[1] != at[1]) break;
        }
        for (size_t k = low[2]; k < end[2]; k++)
            for (size_t row = low[1]; row < end[1]; row++)
                memset(wanted + ((k - first[2]) * n[1] + (row - first[1])) * n[0] +
                           (low[0] - first[0]),
                       1, next - i);
    }
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
    const size_t *from = j->part.first, line = SPLINE_PIECE * j->part.n[0],
                 plane = line * j->part.n[1];
    const spline_block b = {j->rows + ((size_t)first[0] - SPLINE_PIECE * from[0]),
                            line,
                            plane,
                            {(int32_t)from[1], (int32_t)from[2]},
                            {axis[1].cell + first[1], axis[2].cell + first[2]},
                            {(const float(*)[4])axis[1].weight + first[1],
                             (const float(*)[4])axis[2].weight + first[2]}};
    j->f->kernels->block(&b, values);
    write_nodes(j, first, values);
}

static bool in_grid(const job *j, const int64_t at[3])
{
    return at[0] < j->grid->n[0] && at[1] < j->grid->n[1] && at[2] < j->grid->n[2];
}

/* Settles the value of voxel at[3] outside of the box, which is the bound: if that lies within the
   band, it becomes the exact distance, or (false) is refused. */
static bool settle_outside(const job *j, const int64_t at[3], float *value)
{
    if (!((double)*value < j->width) || !in_grid(j, at)) return true;
    if (j->f->opts.outside == SDM_OUTSIDE_REFUSE) return false;
    if (j->f->opts.outside == SDM_OUTSIDE_EXACT) {
        double world[3];
        sdm_grid_world(j->grid, (const double[]){(double)at[0], (double)at[1], (double)at[2]},
                       world);
        *value = (float)sdm_exact_point(j->f->surface.engine, world, NULL, NULL, NULL);
    }
    return true;
}

/* The voxels outside of the box of a block of a parallel grid: values are those at the nearest
   points of the box. false: a voxel is refused. */
static bool bound_block(const job *j, const int64_t first[3], float *values)
{
    const spline_axis *axis = j->places.axis;
    for (int64_t i = 0; i < SDM_BLOCK_VOXELS; i++) {
        const int64_t at[3] = {first[0] + i % 8, first[1] + i / 8 % 8, first[2] + i / 64};
        float beyond[3];
        for (int b = 0; b < 3; b++) beyond[axis[b].axis] = axis[b].beyond[at[b]];
        const float square = field_square(beyond);
        if (!(square > 0)) continue;
        values[i] = field_bound(values[i], square);
        if (!settle_outside(j, at, &values[i])) return false;
    }
    return true;
}

/* The values of a block of a turned grid, by points. false: a voxel is refused. */
static bool turned_block(const job *j, const int64_t first[3], float *values)
{
    for (int64_t i = 0; i < SDM_BLOCK_VOXELS; i++) {
        const int64_t at[3] = {first[0] + i % 8, first[1] + i / 8 % 8, first[2] + i / 64};
        double world[3];
        sdm_grid_world(j->grid, (const double[]){(double)at[0], (double)at[1], (double)at[2]},
                       world);
        const field_place p = field_find(j->f, world);
        values[i] = field_value(j->f, &p);
        if (p.outside && !settle_outside(j, at, &values[i])) return false;
    }
    return true;
}

/* Whether voxels of a block of a parallel grid lie outside of the box. */
static bool block_leaves(const job *j, const int64_t first[3])
{
    bool leaves = false;
    for (int b = 0; b < 3; b++) {
        const float *beyond = j->places.axis[b].beyond + first[b];
        leaves = leaves || beyond[0] > 0 || beyond[7] > 0;
    }
    return leaves;
}

/* Cuts the values of a block off at the band. Its kind by its values in the grid; one with values
   of both signs is near too. */
static block_kind cut_block(const job *j, const int64_t first[3], float *values)
{
    const float width = (float)j->width;
    int64_t n[3];
    for (int a = 0; a < 3; a++) n[a] = j->grid->n[a] - first[a] < 8 ? j->grid->n[a] - first[a] : 8;
    const int64_t all = n[0] * n[1] * n[2];
    const int whole = j->f->kernels->cut(width, values);
    if (all == SDM_BLOCK_VOXELS)
        return whole == SPLINE_ALL_LOW    ? BLOCK_INSIDE
               : whole == SPLINE_ALL_HIGH ? BLOCK_OUTSIDE
                                          : BLOCK_NEAR;
    int64_t low = 0, high = 0;
    for (int64_t i = 0; i < all; i++) {
        const int64_t x = i % n[0], y = i / n[0] % n[1], z = i / n[0] / n[1];
        const float v = values[(z * 8 + y) * 8 + x];
        low += v <= -width;
        high += v >= width;
    }
    return low == all ? BLOCK_INSIDE : high == all ? BLOCK_OUTSIDE : BLOCK_NEAR;
}

/* values[8][8][8] = those of a candidate, cut off at the band. */
static block_kind evaluate(const job *j, uint32_t number, float *values)
{
    int64_t first[3];
    block_position(j->out, number, first);
    for (int a = 0; a < 3; a++) first[a] *= 8;
    if (j->parallel) parallel_block(j, first, values);
    const bool done = !j->parallel             ? turned_block(j, first, values)
                      : block_leaves(j, first) ? bound_block(j, first, values)
                                               : true;
    if (!done) return BLOCK_REFUSED;
    return cut_block(j, first, values);
}

/* Enters a candidate as the next block, whose values are in place: outside beyond the grid. */
static void enter_block(const job *j, uint32_t number)
{
    sdm_blocks *b = j->out;
    float *values = b->values[b->n_block];
    int32_t *first = b->first[b->n_block];
    int64_t at[3];
    block_position(b, number, at);
    for (int a = 0; a < 3; a++) first[a] = (int32_t)(SDM_BLOCK_SIZE * at[a]);
    b->tile[number] = (uint32_t)b->n_block++;
    if (first[0] + SDM_BLOCK_SIZE <= j->grid->n[0] && first[1] + SDM_BLOCK_SIZE <= j->grid->n[1] &&
        first[2] + SDM_BLOCK_SIZE <= j->grid->n[2])
        return;
    for (int i = 0; i < SDM_BLOCK_VOXELS; i++)
        if (!in_grid(j,
                     (const int64_t[]){first[0] + i % 8, first[1] + i / 8 % 8, first[2] + i / 64}))
            values[i] = (float)j->width;
}

/* Keeps the candidates of a piece that meet the band; their values lie behind those of the blocks
   so far. false: one is refused. */
static bool keep_near(const job *j, const uint32_t *candidate, const block_kind *kind, size_t n)
{
    sdm_blocks *b = j->out;
    const size_t piece = b->n_block;
    for (size_t i = 0; i < n;) {
        b->tile[candidate[i]] = kind[i] == BLOCK_INSIDE ? SDM_TILE_INSIDE : SDM_TILE_OUTSIDE;
        if (kind[i] == BLOCK_REFUSED) return false;
        size_t near = 0;
        while (i + near < n && kind[i + near] == BLOCK_NEAR) near++;
        if (near && piece + i != b->n_block)
            memmove(b->values[b->n_block], b->values[piece + i], near * sizeof *b->values);
        for (size_t k = 0; k < near; k++) enter_block(j, candidate[i + k]);
        i += near ? near : 1;
    }
    return true;
}

static sdm_status evaluate_all(job *j, sdm_error *err)
{
    block_kind kind[PIECE];
    sdm_blocks *b = j->out;
    // a single thread keeps the values of a piece in the fastest cache
    const size_t piece = j->f->n_threads > 1 ? PIECE : PIECE_OF_ONE;
    sdm_status s =
        sdm_alloc_unset((void **)&b->values, j->n, sizeof *b->values, "values of a band", err);
    if (!s)
        s = sdm_alloc_unset((void **)&b->first, j->n, sizeof *b->first, "places of blocks", err);
    for (size_t first = 0; first < j->n && !s; first += piece) {
        const size_t n = j->n - first < piece ? j->n - first : piece;
        const uint32_t *candidate = j->candidate + first;
        float(*values)[SDM_BLOCK_VOXELS] = b->values + b->n_block;
#pragma omp parallel for schedule(static) num_threads(j->f->n_threads) if (j->f->n_threads > 1)
        for (size_t i = 0; i < n; i++) kind[i] = evaluate(j, candidate[i], values[i]);
        if (!keep_near(j, candidate, kind, n)) s = sdm_field_refuse(j->f, "the band leaves", err);
    }
    return s;
}

/* ---- the band */

static sdm_status reserve(job *j, sdm_error *err)
{
    sdm_blocks *b = j->out;
    double all = 1;
    for (int a = 0; a < 3; a++) {
        b->n[a] = (j->grid->n[a] + SDM_BLOCK_SIZE - 1) / SDM_BLOCK_SIZE;
        all *= (double)b->n[a];
    }
    if (!(all < SDM_TILE_INSIDE))
        return sdm_fail(err, SDM_E_ARG,
                        "grid of %lld x %lld x %lld voxels: a band has at most 2^32 blocks of 8 x "
                        "8 x 8 voxels; use larger voxels",
                        (long long)j->grid->n[0], (long long)j->grid->n[1],
                        (long long)j->grid->n[2]);
    b->grid = *j->grid;
    b->band_mm = j->width;
    const sdm_status s =
        sdm_alloc_unset((void **)&b->tile, (size_t)all, sizeof *b->tile, "blocks of a band", err);
    return s ? s
             : sdm_alloc_unset((void **)&j->centre, (size_t)all, sizeof *j->centre,
                               "centres of blocks", err);
}

/* Places for the voxels of a parallel grid. */
static sdm_status prepare_places(job *j, sdm_error *err)
{
    int64_t n[3];
    for (int a = 0; a < 3; a++) n[a] = j->out->n[a] * SDM_BLOCK_SIZE;
    return sdm_spline_grid_create(&j->f->shape, &j->f->frame, j->grid, n, 0, 1, &j->places, err);
}

/* Rows of a parallel grid for the candidates. */
static sdm_status prepare_rows(job *j, sdm_error *err)
{
    const sdm_field *f = j->f;
    uint8_t *wanted = NULL;
    if (!j->n) return SDM_OK;
    bound_pieces(j);
    const size_t *n = j->part.n, pieces = n[0] * n[1] * n[2];
    // small pages would be handed back after every band, and cost more than all of the rows
    const bool enlarge = pieces > MANY_PIECES / 4 && pieces < MANY_PIECES;
    sdm_status s = SDM_ALLOC(&wanted, pieces, "rows of a band", err);
    if (!s)
        s = sdm_alloc_unset((void **)&j->rows, enlarge ? MANY_PIECES : pieces,
                            SPLINE_PIECE * sizeof *j->rows, "rows of a band", err);
    if (!s) {
        mark_pieces(j, wanted);
        j->part.wanted = wanted;
        s = sdm_spline_rows(&f->shape, &j->places, f->splines, &j->part, f->n_threads, j->rows,
                            err);
        j->part.wanted = NULL;
    }
    sdm_free(wanted);
    return s;
}

/* radius and half: the voxels of a block lie up to 3.5 voxels from its centre along each axis. */
static void measure_block(job *j)
{
    double square = 0;
    for (int b = 0; b < 3; b++) {
        const double along = 3.5 * j->grid->spacing[b];
        square += along * along;
        for (int a = 0; a < 3; a++) {
            double cosine = 0;
            for (int x = 0; x < 3; x++)
                cosine += j->f->frame.dir[3 * x + a] * j->grid->dir[3 * x + b];
            j->half[a] += along * fabs(cosine);
        }
    }
    j->radius = (float)sqrt(square);
}

static sdm_status make_band(job *j, sdm_error *err)
{
    measure_block(j);
    j->parallel = sdm_spline_is_parallel(&j->f->frame, j->grid);
    sdm_status s = reserve(j, err);
    if (!s) s = find_centres(j, err);
    if (!s && j->parallel) s = prepare_places(j, err);
    if (!s && j->parallel) s = find_doubt(j, err);
    if (!s) s = find_change(j, err);
    if (!s) s = find_candidates(j, err);
    if (!s && j->parallel) s = prepare_rows(j, err);
    return s ? s : evaluate_all(j, err);
}

sdm_status sdm_field_band(const sdm_field *f, const sdm_grid *grid, double width, sdm_blocks *out,
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
    if (field_is_exact(f)) return sdm_exact_map_blocks(f->surface.engine, grid, width, out, err);
    job j = {.f = f, .grid = grid, .width = (double)(float)width, .out = out};
    s = make_band(&j, err);
    sdm_free(j.candidate);
    sdm_spline_change_dispose(&j.change);
    sdm_free(j.centre);
    sdm_free(j.doubt);
    sdm_free(j.span[0]);
    sdm_free(j.rows);
    sdm_spline_grid_dispose(&j.places);
    if (s) sdm_blocks_dispose(out);
    return s;
}
