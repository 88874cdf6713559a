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

/* Is none of the 26 neighbours of an inner voxel inside? */
static bool is_alone(const float *v, int64_t line, int64_t plane)
{
    for (int k = -1; k <= 1; k++)
        for (int j = -1; j <= 1; j++)
            for (int i = -1; i <= 1; i++)
                if (v[k * plane + j * line + i] < 0) return false;
    return true;
}

/* Voxels on the surface of a map, and those of them at which it is torn. */
typedef struct tally {
    size_t n, torn;
    double first[3]; /* the first place at which it is torn, mm */
} tally;

static void tally_torn(tally *t, const sdm_grid *g, int64_t i, int64_t j, int64_t k)
{
    if (!t->torn++) sdm_grid_world(g, (double[3]){(double)i, (double)j, (double)k}, t->first);
}

/* Half of the shortest edge of a voxel, mm. */
static float half_voxel(const sdm_grid *g)
{
    return (float)(0.5 * fmin(g->spacing[0], fmin(g->spacing[1], g->spacing[2])));
}

static bool warn_torn(const char *where, const sdm_grid *g, const tally *t, const char *mend)
{
    if (t->torn < TORN_MIN || (double)t->torn < TORN_SHARE * (double)t->n) return false;
    cli_warn("%sthe surface is torn: at %zu of the %zu voxels on it no voxel is inside (the first "
             "at %.4g %.4g %.4g mm): the shape is thinner than a voxel there, %.3g mm; %s",
             where, t->torn, t->n, t->first[0], t->first[1], t->first[2], sdm_grid_coarsest(g),
             mend);
    return true;
}

bool cli_warn_torn_map(const char *where, const sdm_grid *g, const float *values, const char *mend)
{
    const int64_t line = g->n[0], plane = g->n[0] * g->n[1];
    const float half = half_voxel(g);
    tally t = {0};
    for (int64_t k = 1; k + 1 < g->n[2]; k++)
        for (int64_t j = 1; j + 1 < g->n[1]; j++)
            for (int64_t i = 1; i + 1 < g->n[0]; i++) {
                const float *v = values + k * plane + j * line + i;
                if (!(fabsf(*v) < half)) continue;
                t.n++;
                if (*v >= 0 && is_alone(v, line, plane)) tally_torn(&t, g, i, j, k);
            }
    return warn_torn(where, g, &t, mend);
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

static bool is_alone_in_blocks(const sdm_blocks *b, int64_t i, int64_t j, int64_t k)
{
    for (int64_t z = k - 1; z <= k + 1; z++)
        for (int64_t y = j - 1; y <= j + 1; y++)
            for (int64_t x = i - 1; x <= i + 1; x++)
                if (block_value(b, x, y, z) < 0) return false;
    return true;
}

bool cli_warn_torn_blocks(const char *where, const sdm_blocks *b, const char *mend)
{
    const int64_t *n = b->grid.n;
    const float half = half_voxel(&b->grid);
    tally t = {0};
    for (size_t block = 0; block < b->n_block; block++)
        for (int64_t v = 0; v < SDM_BLOCK_VOXELS; v++) {
            const int32_t *first = b->first[block];
            const int64_t i = first[0] + v % 8, j = first[1] + v / 8 % 8, k = first[2] + v / 64;
            const float value = b->values[block][v];
            if (!(fabsf(value) < half) || i < 1 || j < 1 || k < 1 || i + 1 >= n[0] ||
                j + 1 >= n[1] || k + 1 >= n[2])
                continue;
            t.n++;
            if (value >= 0 && is_alone_in_blocks(b, i, j, k)) tally_torn(&t, &b->grid, i, j, k);
        }
    return warn_torn(where, &b->grid, &t, mend);
}
