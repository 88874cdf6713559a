/* Feature maps in memory: C channels of nz x ny x nx numbers with zeros around them, so that a 3 x
   3 x 3 convolution with "same" padding is a sum over shifts of one flat array.

     voxel (x, y, z) of channel c   at  c * stride + z * plane + y * row + x
     row = nx + 1, plane = row * (ny + 1)   one zero column and one zero row serve both neighbours
     lead = row + plane + 1 zeros or more   before the first channel, between channels and after the
   last

   A pointer to a feature map points to voxel (0, 0, 0) of its first channel. Every operator keeps
   the zeros zero. */
#ifndef SDM_FMAP_H
#define SDM_FMAP_H

#include <stddef.h>

typedef struct sdm_fmap {
    size_t n[3]; /* x, y, z */
    size_t row, plane;
    size_t count;  /* plane * nz: numbers from the first voxel of a channel to the end of its last
                      plane */
    size_t lead;   /* a multiple of 16 */
    size_t stride; /* between channels, a multiple of 16 */
} sdm_fmap;

/* Layout for nx x ny x nz voxels. */
sdm_fmap sdm_fmap_layout(const size_t n[3]);

/* Numbers of a block of memory that holds `channels` channels; its feature map starts at + lead. */
size_t sdm_fmap_floats(const sdm_fmap *g, size_t channels);

/* Zeros before, between and after the channels of x. */
void sdm_fmap_clear_gaps(const sdm_fmap *g, size_t channels, float *x);

/* Zeros in the columns and rows of padding among the numbers first .. last of one channel. */
void sdm_fmap_clear_pads(const sdm_fmap *g, size_t first, size_t last, float *channel);

/* Copies between one channel and a plain map [nz][ny][nx]; reading clears the padding. */
void sdm_fmap_read(const sdm_fmap *g, const float *map, float *channel);
void sdm_fmap_write(const sdm_fmap *g, const float *channel, float *map);

#endif
