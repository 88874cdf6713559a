/* Layout of feature maps, and copies between feature maps and plain maps. */
#include "fmap.h"

#include <string.h>

static size_t up16(size_t n) { return (n + 15) / 16 * 16; }

enum { OVERRUN = 64 }; // more floats after the last channel: kernels read up to a tile beyond it

sdm_fmap sdm_fmap_layout(const size_t n[3])
{
    sdm_fmap g = {.n = {n[0], n[1], n[2]}, .row = n[0] + 1};
    g.plane = g.row * (n[1] + 1);
    g.count = g.plane * n[2];
    g.lead = up16(g.plane + g.row + 1);
    g.stride = up16(g.count) + g.lead;
    return g;
}

size_t sdm_fmap_floats(const sdm_fmap *g, size_t channels)
{
    return g->lead + channels * g->stride + OVERRUN;
}

void sdm_fmap_clear_gaps(const sdm_fmap *g, size_t channels, float *x)
{
    memset(x - g->lead, 0, g->lead * sizeof *x);
    for (size_t c = 0; c < channels; c++, x += g->stride)
        memset(x + g->count, 0,
               (g->stride - g->count + (c + 1 == channels ? OVERRUN : 0)) * sizeof *x);
}

void sdm_fmap_clear_pads(const sdm_fmap *g, size_t first, size_t last, float *channel)
{
    for (size_t r = first / g->row; r * g->row < last; r++) {
        const size_t begin = r * g->row, end = begin + g->row;
        // clear a whole padding row, or the one padding element of a row of voxels
        size_t from = r % (g->n[1] + 1) == g->n[1] ? begin : end - 1;
        if (from < first) from = first;
        for (size_t i = from; i < end && i < last; i++) channel[i] = 0;
    }
}

void sdm_fmap_read(const sdm_fmap *g, const float *map, float *channel)
{
    for (size_t z = 0; z < g->n[2]; z++)
        for (size_t y = 0; y < g->n[1]; y++)
            memcpy(channel + z * g->plane + y * g->row, map + (z * g->n[1] + y) * g->n[0],
                   g->n[0] * sizeof *map);
    sdm_fmap_clear_pads(g, 0, g->count, channel);
}

void sdm_fmap_write(const sdm_fmap *g, const float *channel, float *map)
{
    for (size_t z = 0; z < g->n[2]; z++)
        for (size_t y = 0; y < g->n[1]; y++)
            memcpy(map + (z * g->n[1] + y) * g->n[0], channel + z * g->plane + y * g->row,
                   g->n[0] * sizeof *map);
}
