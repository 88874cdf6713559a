/* Bounding boxes in voxel indices and copies of the voxels in them. */
#include "crop.h"

#include <math.h>
#include <string.h>

/* The block of a box low .. high in continuous voxel indices, enlarged by `pad` mm. */
static cli_block block_of_box(const sdm_grid *g, const double low[3], const double high[3],
                              double pad)
{
    cli_block b;
    for (int a = 0; a < 3; a++) {
        const double last = (double)(g->n[a] - 1), more = pad / g->spacing[a];
        const double from = fmax(floor(low[a] - more), 0), to = fmin(ceil(high[a] + more), last);
        b.from[a] = from <= to ? (int64_t)from : 0;
        b.n[a] = from <= to ? (int64_t)to - b.from[a] + 1 : 0;
    }
    return b;
}

cli_block cli_block_of_mesh(const sdm_grid *g, const sdm_mesh *m, double pad)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < 3 * m->n_tri; i++) {
        double at[3];
        sdm_grid_index(g, m->vert + 3 * (size_t)m->tri[i], at);
        for (int a = 0; a < 3; a++) low[a] = fmin(low[a], at[a]), high[a] = fmax(high[a], at[a]);
    }
    return block_of_box(g, low, high, pad);
}

cli_block cli_block_of_labels(const sdm_grid *g, const float *values, double pad)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++) {
                if (!(*values++ > 0)) continue;
                const double at[3] = {(double)i, (double)j, (double)k};
                for (int a = 0; a < 3; a++)
                    low[a] = fmin(low[a], at[a]), high[a] = fmax(high[a], at[a]);
            }
    return block_of_box(g, low, high, pad);
}

bool cli_block_is_empty(const cli_block *b) { return !b->n[0] || !b->n[1] || !b->n[2]; }

cli_block cli_block_union(const cli_block *a, const cli_block *b)
{
    if (cli_block_is_empty(a)) return *b;
    if (cli_block_is_empty(b)) return *a;
    cli_block all;
    for (int k = 0; k < 3; k++) {
        const int64_t end_a = a->from[k] + a->n[k], end_b = b->from[k] + b->n[k];
        all.from[k] = a->from[k] < b->from[k] ? a->from[k] : b->from[k];
        all.n[k] = (end_a > end_b ? end_a : end_b) - all.from[k];
    }
    return all;
}

sdm_grid cli_block_grid(const sdm_grid *g, const cli_block *b)
{
    sdm_grid part = *g;
    const double from[3] = {(double)b->from[0], (double)b->from[1], (double)b->from[2]};
    sdm_grid_world(g, from, part.origin);
    memcpy(part.n, b->n, sizeof part.n);
    return part;
}

void cli_block_copy(const sdm_grid *g, const float *values, const cli_block *b, float *out)
{
    for (int64_t k = 0; k < b->n[2]; k++)
        for (int64_t j = 0; j < b->n[1]; j++) {
            const int64_t row = (b->from[2] + k) * g->n[1] + b->from[1] + j;
            memcpy(out, values + row * g->n[0] + b->from[0], (size_t)b->n[0] * sizeof *out);
            out += b->n[0];
        }
}
