/* Warns of a grid that cuts a shape, by its mesh or by its map, and of voxels that
 * are too large for it. */
#include "grid_cut.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "report/terminal.h"
#include "sdm/internal/shape_box.h"

/* beyond[axis][side]: how far the shape reaches beyond the first and the last voxel, mm; least:
 * these are lower bounds. */
static void warn(const char *where, const sdm_grid *g, double beyond[3][2], bool least,
                 const char *mend)
{
    char faces[240] = "";
    for (int a = 0; a < 3; a++)
        for (int side = 0; side < 2; side++) {
            const size_t used = strlen(faces);
            if (beyond[a][side] > 0 && g->n[a] > 1) // a slice cuts every shape
                snprintf(faces + used, sizeof faces - used, "%s%c%c (%s%.2g mm)", used ? ", " : "",
                         side ? '+' : '-', "xyz"[a], least ? "at least " : "", beyond[a][side]);
        }
    if (*faces)
        cli_warn("%sthe surface leaves the grid and ends open there; it reaches beyond %s; %s",
                 where, faces, mend);
}

void cli_warn_cut_shape(const sdm_grid *g, const sdm_mesh *mesh, const char *mend)
{
    double beyond[3][2] = {{0}};
    sdm_grid_mesh_beyond(g, mesh, beyond);
    warn("", g, beyond, false, mend);
}

void cli_warn_cut_map(const char *where, const sdm_grid *g, const float *values, const char *mend)
{
    double beyond[3][2] = {{0}};
    for (int a = 0; a < 3; a++)
        for (int side = 0; side < 2; side++) {
            // the voxels of one face
            const int u = (a + 1) % 3, v = (a + 2) % 3;
            int64_t at[3];
            at[a] = side ? g->n[a] - 1 : 0;
            for (at[u] = 0; at[u] < g->n[u]; at[u]++)
                for (at[v] = 0; at[v] < g->n[v]; at[v]++) {
                    const double d = (double)values[sdm_grid_voxel(g, at[0], at[1], at[2])];
                    beyond[a][side] = fmax(beyond[a][side], -d);
                }
        }
    warn(where, g, beyond, true, mend);
}

/* a torn place is told from this share of the voxels on the surface on, and from this number; fewer
 * are the tips of shapes (an octahedron has six) */
#define TORN_SHARE 0.005
enum { TORN_MIN = 7 };

/* A tip or an edge without a voxel inside reaches so far from the last ones inside, voxels. */
enum { TIP_VOXELS = 3 };

/* A map: an array of values or blocks. */
typedef struct map {
    const sdm_grid *grid;
    const float *values; /* NULL: the blocks */
    const sdm_blocks *blocks;
} map;

/* Voxels on the surface of a map, and those of them that have no neighbour inside. */
typedef struct tally {
    size_t n, alone;
    /* of those alone: between voxels inside or far from all of them, where a neck or a wall is
     * torn; the others lie beyond a tip or an edge */
    size_t torn;
    double first[3]; /* the first place at which it is torn, mm */
} tally;

/* Half of the shortest edge of a voxel, mm. */
static float half_voxel(const sdm_grid *g)
{
    return (float)(0.5 * fmin(g->spacing[0], fmin(g->spacing[1], g->spacing[2])));
}

static bool warn_torn(const char *where, const sdm_grid *g, const tally *t, const char *mend)
{
    if (!t->torn || t->alone < TORN_MIN || (double)t->alone < TORN_SHARE * (double)t->n)
        return false;
    cli_warn("%sthe surface is torn: at %zu of the %zu voxels on it no voxel is inside (the first "
             "at %.4g %.4g %.4g mm): the shape is thinner than a voxel there, %.3g mm; %s",
             where, t->alone, t->n, t->first[0], t->first[1], t->first[2], sdm_grid_coarsest(g),
             mend);
    return true;
}

/* The distance at a voxel of the grid of b, mm. */
static float block_value(const sdm_blocks *b, int64_t i, int64_t j, int64_t k)
{
    const int64_t size = SDM_BLOCK_SIZE;
    const uint32_t tile = b->tile[((k / size) * b->n[1] + j / size) * b->n[0] + i / size];
    if (tile == SDM_TILE_OUTSIDE) return (float)b->band_mm;
    if (tile == SDM_TILE_INSIDE) return (float)-b->band_mm;
    return b->values[tile][(k % size * size + j % size) * size + i % size];
}

static bool is_inside(const map *m, const int64_t at[3])
{
    for (int d = 0; d < 3; d++)
        if (at[d] < 0 || at[d] >= m->grid->n[d]) return false;
    return (m->values ? m->values[sdm_grid_voxel(m->grid, at[0], at[1], at[2])]
                      : block_value(m->blocks, at[0], at[1], at[2])) < 0;
}

/* Voxels inside that lie within `reach` voxels of another one along each axis. */
typedef struct around {
    size_t n;
    int sum[3];  /* of their offsets */
    bool behind; /* the offset of one does not point along a given direction */
} around;

static around look_around(const map *m, const int64_t at[3], int reach, const int along[3])
{
    around found = {0};
    for (int k = -reach; k <= reach; k++)
        for (int j = -reach; j <= reach; j++)
            for (int i = -reach; i <= reach; i++) {
                if (!is_inside(m, (int64_t[]){at[0] + i, at[1] + j, at[2] + k})) continue;
                found.n++;
                found.sum[0] += i, found.sum[1] += j, found.sum[2] += k;
                found.behind |= i * along[0] + j * along[1] + k * along[2] <= 0;
            }
    return found;
}

/* Counts a voxel on the surface. */
static void tally_voxel(tally *t, const map *m, const int64_t at[3])
{
    t->n++;
    if (is_inside(m, at) || look_around(m, at, 1, (int[3]){0}).n) return;
    t->alone++;
    const around near = look_around(m, at, TIP_VOXELS, (int[3]){0});
    if (near.n && !look_around(m, at, TIP_VOXELS, near.sum).behind) return;
    if (!t->torn++)
        sdm_grid_world(m->grid, (double[3]){(double)at[0], (double)at[1], (double)at[2]}, t->first);
}

bool cli_warn_torn_map(const char *where, const sdm_grid *g, const float *values, const char *mend)
{
    const map m = {.grid = g, .values = values};
    const float half = half_voxel(g);
    tally t = {0};
    int64_t at[3];
    for (at[2] = 1; at[2] + 1 < g->n[2]; at[2]++)
        for (at[1] = 1; at[1] + 1 < g->n[1]; at[1]++)
            for (at[0] = 1; at[0] + 1 < g->n[0]; at[0]++)
                if (fabsf(values[sdm_grid_voxel(g, at[0], at[1], at[2])]) < half)
                    tally_voxel(&t, &m, at);
    return warn_torn(where, g, &t, mend);
}

bool cli_warn_torn_blocks(const char *where, const sdm_blocks *b, const char *mend)
{
    const map m = {.grid = &b->grid, .blocks = b};
    const int64_t *n = b->grid.n;
    const float half = half_voxel(&b->grid);
    tally t = {0};
    for (size_t block = 0; block < b->n_block; block++)
        for (int64_t v = 0; v < SDM_BLOCK_VOXELS; v++) {
            const int32_t *first = b->first[block];
            const int64_t at[3] = {first[0] + v % 8, first[1] + v / 8 % 8, first[2] + v / 64};
            if (fabsf(b->values[block][v]) < half && at[0] >= 1 && at[1] >= 1 && at[2] >= 1 &&
                at[0] + 1 < n[0] && at[1] + 1 < n[1] && at[2] + 1 < n[2])
                tally_voxel(&t, &m, at);
        }
    return warn_torn(where, &b->grid, &t, mend);
}
