/* Finds the tiles of a grid near a surface, triangle by triangle. */
#include "grid_blocks.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/heap.h"

/* Relative slack for grid axes that are orthonormal to 1e-6 only, and in voxels. */
#define SLACK 1e-5
#define SLACK_VOXELS 1e-3
// Ranges of up to FEW tiles are tested tile by tile.
#define FEW 64

/* A range of tiles, lo ... hi - 1. */
typedef struct range {
    int64_t lo[3], hi[3];
} range;

/* Range of the tiles that meet the bounding box of a triangle, in voxels and widened by the band.
 */
static range tiles_around(const sdm_blocks *b, const sdm_frame *f)
{
    const sdm_grid *g = &b->grid;
    range r;
    double lo[3] = {INFINITY, INFINITY, INFINITY}, hi[3] = {-INFINITY, -INFINITY, -INFINITY};
    // the corners in the frame of the triangle
    const double x[3] = {0, 2 * f->half[0], 2 * f->half[0] + 2 * f->half[1] * f->e1x},
                 y[3] = {0, 0, 2 * f->half[1] * f->e1y};
    for (int c = 0; c < 3; c++) {
        double d[3], size = 0;
        for (int i = 0; i < 3; i++) {
            d[i] = f->a[i] + x[c] * f->u[i] + y[c] * f->v[i] - g->origin[i];
            size += fabs(d[i]);
        }
        for (int a = 0; a < 3; a++) {
            const double along = d[0] * g->dir[a] + d[1] * g->dir[3 + a] + d[2] * g->dir[6 + a];
            const double slack = SLACK * size + b->band_mm * (1 + SLACK);
            const double low = (along - slack) / g->spacing[a] - SLACK_VOXELS,
                         high = (along + slack) / g->spacing[a] + SLACK_VOXELS;
            lo[a] = low < lo[a] ? low : lo[a];
            hi[a] = high > hi[a] ? high : hi[a];
        }
    }
    for (int a = 0; a < 3; a++) {
        const double last = (double)(g->n[a] - 1), low = fmax(lo[a], 0), high = fmin(hi[a], last);
        r.lo[a] = low <= high ? (int64_t)ceil(low) / SDM_BLOCK_SIZE : 0;
        r.hi[a] = low <= high ? (int64_t)floor(high) / SDM_BLOCK_SIZE + 1 : 0;
    }
    return r;
}

/* May a voxel of the range lie within the band around the triangle? Compares the distances of the
   centre of the range from the triangle's plane and from the triangle with its extents. */
static bool range_is_near(const sdm_blocks *b, const range *r, const sdm_frame *f)
{
    const sdm_grid *g = &b->grid;
    double index[3], x[3], along[3], radius = 0, extent = 0;
    for (int a = 0; a < 3; a++) {
        const double half = 0.5 * (double)(SDM_BLOCK_SIZE * (r->hi[a] - r->lo[a]) - 1);
        index[a] = (double)(SDM_BLOCK_SIZE * r->lo[a]) + half;
        along[a] = half * g->spacing[a];
        radius += along[a] * along[a];
    }
    sdm_grid_world(g, index, x);
    double height = 0;
    for (int a = 0; a < 3; a++) {
        height += (x[a] - f->a[a]) * f->n[a];
        extent += along[a] *
                  fabs(f->n[0] * g->dir[a] + f->n[1] * g->dir[3 + a] + f->n[2] * g->dir[6 + a]);
    }
    if (f->flat == 0 && fabs(height) > (extent + b->band_mm) * (1 + SLACK) + SLACK * sqrt(radius))
        return false;
    const double far = (sqrt(radius) + b->band_mm) * (1 + SLACK);
    return sdm_frame_distance2(f, x) <= far * far;
}

/* Marks the tiles of a range that are near the triangle: tile = 0. */
static void range_mark(sdm_blocks *b, range r, const sdm_frame *f)
{
    int longest = 0;
    int64_t count = 1;
    for (int a = 0; a < 3; a++) {
        const int64_t length = r.hi[a] - r.lo[a];
        if (length <= 0) return;
        if (length > r.hi[longest] - r.lo[longest]) longest = a;
        count *= length;
    }
    if (count > FEW) {
        if (!range_is_near(b, &r, f)) return;
        range half = r;
        half.hi[longest] = r.lo[longest] = (r.lo[longest] + r.hi[longest]) / 2;
        range_mark(b, half, f);
        range_mark(b, r, f);
        return;
    }
    for (int64_t k = r.lo[2]; k < r.hi[2]; k++)
        for (int64_t j = r.lo[1]; j < r.hi[1]; j++)
            for (int64_t i = r.lo[0]; i < r.hi[0]; i++) {
                uint32_t *tile = &b->tile[(k * b->n[1] + j) * b->n[0] + i];
                const range one = {{i, j, k}, {i + 1, j + 1, k + 1}};
                if (*tile && range_is_near(b, &one, f)) *tile = 0;
            }
}

/* Numbers the marked tiles and allocates their blocks. */
static sdm_status blocks_number(sdm_blocks *b, size_t n_tile, size_t limit, sdm_error *err)
{
    size_t n = 0;
    for (size_t i = 0; i < n_tile; i++)
        if (b->tile[i] == 0) b->tile[i] = (uint32_t)n++;
    const size_t bytes = n * (sizeof *b->first + sizeof *b->values);
    if (n >= SDM_TILE_INSIDE || (limit && bytes > limit))
        return sdm_fail(err, SDM_E_NOMEM,
                        "%zu blocks of voxels within the band need %zu bytes, memory_limit leaves "
                        "%zu",
                        n, bytes, limit);
    sdm_status s = sdm_alloc_unset((void **)&b->first, n, sizeof *b->first, "blocks", err);
    if (!s) s = sdm_alloc_unset((void **)&b->values, n, sizeof *b->values, "blocks", err);
    if (s) return s;
    b->n_block = n;
    for (size_t i = 0; i < n_tile; i++) {
        if (b->tile[i] == SDM_TILE_OUTSIDE) continue;
        const int64_t at = (int64_t)i;
        int32_t *first = b->first[b->tile[i]];
        first[0] = (int32_t)(at % b->n[0] * SDM_BLOCK_SIZE);
        first[1] = (int32_t)(at / b->n[0] % b->n[1] * SDM_BLOCK_SIZE);
        first[2] = (int32_t)(at / b->n[0] / b->n[1] * SDM_BLOCK_SIZE);
    }
    return SDM_OK;
}

sdm_status sdm_grid_blocks_make(const sdm_nearest *surface, const sdm_grid *g, double band_mm,
                                const sdm_exact_opts *opts, sdm_blocks *out, sdm_error *err)
{
    *out = (sdm_blocks){.grid = *g, .band_mm = band_mm};
    size_t n_tile = 1;
    for (int a = 0; a < 3; a++) {
        out->n[a] = (g->n[a] + SDM_BLOCK_SIZE - 1) / SDM_BLOCK_SIZE;
        n_tile *= (size_t)out->n[a];
    }
    const size_t bytes = n_tile * sizeof *out->tile, limit = opts->memory_limit;
    if (limit && bytes >= limit)
        return sdm_fail(err, SDM_E_NOMEM, "%zu tiles need %zu bytes, memory_limit leaves %zu",
                        n_tile, bytes, limit);
    sdm_status s = sdm_alloc_unset((void **)&out->tile, n_tile, sizeof *out->tile, "tiles", err);
    if (s) return s;
    memset(out->tile, 0xff, bytes); // SDM_TILE_OUTSIDE
    for (uint32_t slot = 0; slot < surface->features.edge_base; slot++)
        range_mark(out, tiles_around(out, &surface->frames[slot]), &surface->frames[slot]);
    return blocks_number(out, n_tile, limit ? limit - bytes : 0, err);
}

/* The tile of block i. */
static uint32_t *tile_of(const sdm_blocks *b, size_t i)
{
    const int64_t s = SDM_BLOCK_SIZE;
    const int32_t *at = b->first[i];
    return &b->tile[(at[2] / s * b->n[1] + at[1] / s) * b->n[0] + at[0] / s];
}

/* Does block i have a value within the band, or, where the band is narrower than a voxel, values of
   both signs? Voxels beyond the grid do not count. */
static bool is_needed(const sdm_blocks *b, size_t i)
{
    const float band = (float)b->band_mm;
    const bool inside = b->values[i][0] < 0; // the first voxel lies inside the grid
    unsigned needed = 0;
    int64_t end[3];
    for (int a = 0; a < 3; a++) {
        end[a] = b->grid.n[a] - b->first[i][a];
        if (end[a] > SDM_BLOCK_SIZE) end[a] = SDM_BLOCK_SIZE;
    }
    for (int64_t z = 0; z < end[2] && !needed; z++)
        for (int64_t y = 0; y < end[1]; y++) {
            const float *row = &b->values[i][(z * SDM_BLOCK_SIZE + y) * SDM_BLOCK_SIZE];
            for (int64_t x = 0; x < end[0]; x++)
                needed |= (fabsf(row[x]) < band) | ((row[x] < 0) != inside);
        }
    return needed != 0;
}

void sdm_grid_blocks_prune(sdm_blocks *b)
{
    for (size_t i = 0; i < b->n_block;) {
        if (is_needed(b, i)) {
            i++;
            continue;
        }
        // the last block takes the place of this one
        *tile_of(b, i) = b->values[i][0] < 0 ? SDM_TILE_INSIDE : SDM_TILE_OUTSIDE;
        if (i == --b->n_block) break;
        memcpy(b->values[i], b->values[b->n_block], sizeof b->values[i]);
        memcpy(b->first[i], b->first[b->n_block], sizeof b->first[i]);
        *tile_of(b, i) = (uint32_t)i;
    }
}

size_t sdm_blocks_bytes(const sdm_blocks *b)
{
    return (size_t)(b->n[0] * b->n[1] * b->n[2]) * sizeof *b->tile +
           b->n_block * (sizeof *b->first + sizeof *b->values);
}
