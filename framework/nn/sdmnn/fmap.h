/* Layout of feature maps in memory: C channels of nz x ny x nx floats with zeros around them, so
   that a 3 x 3 x 3 convolution with zero padding is a sum over shifts of one flat array.

     voxel (x, y, z) of channel c   at  c * stride + z * plane + y * row + x
     row = nx + 1            the one zero after each row pads this row and the next one
     plane = row * (ny + 1)  the one zero row after each plane pads this plane and the next one
     lead >= row + plane + 1 zeros lie before the first channel, at least as many after each channel

   A pointer to a feature map points to voxel (0, 0, 0) of its first channel. Every operator keeps
   the padding zero. No function allocates memory. */
#pragma once

#include <stddef.h>

typedef struct sdm_fmap {
    size_t n[3]; /* voxels along x, y, z */
    size_t row, plane;
    size_t count;  /* plane * nz: positions of a channel, both voxels and padding between them */
    size_t lead;   /* a multiple of 16 */
    size_t stride; /* from one channel to the next, a multiple of 16 */
} sdm_fmap;

/* Layout for n[0] x n[1] x n[2] voxels. */
sdm_fmap sdm_fmap_layout(const size_t n[3]);

/* Number of floats of memory for a feature map of `channels` channels. Its first voxel is `lead`
   floats after the start of the memory. */
size_t sdm_fmap_floats(const sdm_fmap *g, size_t channels);

/* Writes zeros before, between and after the channels of x. */
void sdm_fmap_clear_gaps(const sdm_fmap *g, size_t channels, float *x);

/* Writes zeros to the padding columns and rows among the positions first .. last - 1 of one
 * channel.
 */
void sdm_fmap_clear_pads(const sdm_fmap *g, size_t first, size_t last, float *channel);

/* sdm_fmap_read() copies map[nz][ny][nx] to one channel and clears the padding of the channel;
   sdm_fmap_write() copies one channel to map[nz][ny][nx]. */
void sdm_fmap_read(const sdm_fmap *g, const float *map, float *channel);
void sdm_fmap_write(const sdm_fmap *g, const float *channel, float *map);
