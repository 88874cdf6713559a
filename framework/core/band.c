/* Narrow bands: conversion into a map, end of life. */
#include "sdm/band.h"

#include <string.h>

#include "sdm/memory.h"

/* The part of row (j, k) of the map that lies in the block with the given number, or on its side
   of the surface. */
static void row_part(const sdm_band *b, int32_t number, int64_t j, int64_t k, size_t n, float *row)
{
    const float width = (float)b->width, side = number == SDM_BAND_INSIDE ? -width : width;
    if (number < 0) {
        for (size_t i = 0; i < n; i++) row[i] = side;
        return;
    }
    const float *from =
        b->values + (size_t)number * SDM_BAND_VOXELS +
        (size_t)(k % SDM_BAND_EDGE * SDM_BAND_EDGE + j % SDM_BAND_EDGE) * SDM_BAND_EDGE;
    for (size_t i = 0; i < n; i++)
        row[i] = from[i] > width ? width : from[i] < -width ? -width : from[i];
}

void sdm_band_map(const sdm_band *b, float *values)
{
    const int64_t *n = b->grid.n, edge = SDM_BAND_EDGE;
    for (int64_t k = 0; k < n[2]; k++)
        for (int64_t j = 0; j < n[1]; j++) {
            const int32_t *row = b->block + (k / edge * b->blocks[1] + j / edge) * b->blocks[0];
            float *to = values + (k * n[1] + j) * n[0];
            for (int64_t i = 0; i < n[0]; i += edge)
                row_part(b, row[i / edge], j, k, (size_t)(n[0] - i < edge ? n[0] - i : edge),
                         to + i);
        }
}

void sdm_band_dispose(sdm_band *b)
{
    sdm_free(b->block);
    sdm_free(b->values);
    memset(b, 0, sizeof *b);
}
