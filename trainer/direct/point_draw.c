/* Draws random voxels of a map by rejection. */
#include "point_draw.h"

#include <math.h>

#include "data/streams.h"
#include "sdm/internal/rng.h"

size_t trainer_point_draw(const sdm_config *c, const dataset *d, size_t slot, uint64_t index)
{
    // largest number of voxels tried for one draw; if all are rejected, which is rare, the last one
    // is drawn
    enum { TRIES = 256 };
    const int16_t *map = trainer_dataset_values(d, slot, 0);
    const double keep = 1 / (1 + c->train.near_weight);
    size_t voxel = 0;
    for (uint64_t i = 0; i < TRIES; i++) {
        uint32_t random[4];
        sdm_rng_block(c->seed, STREAM_POINTS, index * TRIES + i, random);
        voxel = (size_t)(((uint64_t)random[0] * d->n_voxels) >> 32);
        if (random[1] * 0x1p-32 < keep ||
            fabs((double)d->scale[slot] * map[voxel]) < c->train.near_mm)
            break;
    }
    return voxel;
}

size_t trainer_point_with_neighbours(const sdm_grid *g, size_t voxel)
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1], nz = (size_t)g->n[2];
    if (voxel % nx == nx - 1) voxel--;
    if (voxel / nx % ny == ny - 1) voxel -= nx;
    if (voxel / nx / ny == nz - 1) voxel -= nx * ny;
    return voxel;
}
