/* The fine level of a model: its map between the voxels.

   A map of n voxels along an axis becomes one of 2 n - 1 voxels of half the spacing. Halfway
   between two voxels the polynomial through the six nearest ones is taken (Deslauriers and Dubuc
   1989), and where the map has a crease, a small network corrects it. A polynomial rounds creases
   off, and bases err there; both errors look alike everywhere, so one network learns them for all
   places.

     cell      a voxel and the new voxels in front of it: at 0 or 1/2 along x, y and z, x fastest
     stencil   the 4 x 4 x 4 voxels around a cell, from one before it to two behind it
     x         (stencil - m) / h and m / sqrt(h^2 + m^2): m is the mean of the eight corners of the
               cell, h the smallest spacing
     c         sum of the squared second differences along x, y and z at the eight corners, / h^2
     gate      smooth step from 0 at c = t^2 to 1 at c = 4 t^2; t is the threshold
     change    gate h / 10 (W2 f(W1 f(W0 x + b0) + b1) + b2), f(z) = z / 2 (1 + z / sqrt(1 + z^2))

   The voxels of the map itself keep their values, and so do cells whose stencil leaves the map. */
#pragma once

#include "sdm/grid.h"
#include "sdm/model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_FINE_STENCIL 64
#define SDM_FINE_INPUTS 65
#define SDM_FINE_OUTPUTS 8 /* the first one, that of the voxel itself, is not used */
#define SDM_FINE_MAX_WIDTH 256

/* The network of a fine level. */
typedef struct sdm_fine {
    size_t width;    /* units of each hidden layer, a multiple of 4 */
    float threshold; /* t */
    const float
        *weights; /* [sdm_fine_count()]: W0, b0, W1, b1, W2, b2; matrices [inputs][outputs] */
} sdm_fine;

/* Number of weights. */
size_t sdm_fine_count(size_t width);

/* The grid of the fine map of a map on g. [any thread] */
sdm_grid sdm_fine_grid(const sdm_grid *g);

/* fine[1 + n_tangents][voxels of sdm_fine_grid()] = the fine map of maps[0][nz][ny][nx], and its
   derivatives where maps[1 + i] are derivatives of the map. f NULL: without corrections. The same
   bits for any number of threads and on every instruction set. SDM_E_NOMEM. [any thread] */
sdm_status sdm_fine_map(const sdm_fine *f, const sdm_grid *g, size_t n_tangents, const float *maps,
                        int n_threads, float *fine, sdm_error *err);

/* *cells = new array of the cells of a map with a gate above 0, ascending: the indices of their
   voxels; free with sdm_free(). SDM_E_NOMEM. [any thread] */
sdm_status sdm_fine_cells(const sdm_grid *g, float threshold, const float *map, uint32_t **cells,
                          size_t *n, sdm_error *err);

/* The inputs of a cell (of sdm_fine_cells()), and its gate. [any thread] */
void sdm_fine_inputs(const sdm_grid *g, float threshold, const float *map, uint32_t cell,
                     float x[SDM_FINE_INPUTS], float *gate);

/* The unit of the network's outputs: mm for a gate of 1. */
static inline float sdm_fine_unit(const sdm_grid *g)
{
    double h = g->spacing[0];
    for (int a = 1; a < 3; a++) h = g->spacing[a] < h ? g->spacing[a] : h;
    return (float)(h / 10);
}

/* The fine level of a model; NULL: it has none. */
const sdm_fine *sdm_model_fine(const sdm_model *m);

/* *out = the model file bytes[size] (64-byte aligned) with this fine level, in place of one that it
   has; to be freed with sdm_free(). SDM_E_FORMAT: not a model file. SDM_E_NOMEM. [any thread] */
sdm_status sdm_fine_attach(const uint8_t *bytes, size_t size, const sdm_fine *f, uint8_t **out,
                           size_t *out_size, sdm_error *err);

#ifdef __cplusplus
}
#endif
