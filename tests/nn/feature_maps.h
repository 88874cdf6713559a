/* Feature maps for tests: allocation with gaps between the rows, random content, access by
 * voxel, and a check that the gaps stay zero. */
#ifndef TEST_FEATURE_MAPS_H
#define TEST_FEATURE_MAPS_H

#include <string.h>

#include "sdm/internal/rng.h"
#include "sdm/memory.h"
#include "sdmnn/fmap.h"

typedef struct maps {
    sdm_fmap g;
    size_t channels;
    float *memory, *at;
} maps;

/* n random numbers in -0.5 .. 0.5, the same for the same stream. The caller frees them with
 * sdm_free(). */
static inline float *floats_random(size_t n, uint64_t stream)
{
    float *v;
    assert_int_equal(SDM_ALLOC(&v, n, "test", NULL), SDM_OK);
    for (size_t i = 0; i < n; i++) v[i] = (float)(sdm_rng_uniform(3, stream, i) - 0.5);
    return v;
}

/* Bytes of the allocation, gaps between rows, planes and channels included. */
static inline size_t maps_bytes(const maps *m)
{
    return sdm_fmap_floats(&m->g, m->channels) * sizeof(float);
}

/* Address of a voxel of channel c; voxels count in map order (x fastest, without gaps). */
static inline float *maps_voxel(const maps *m, size_t c, size_t voxel)
{
    const size_t x = voxel % m->g.n[0], y = voxel / m->g.n[0] % m->g.n[1],
                 z = voxel / m->g.n[0] / m->g.n[1];
    return m->at + c * m->g.stride + z * m->g.plane + y * m->g.row + x;
}

/* Voxels of one channel. */
static inline size_t maps_voxels(const maps *m) { return m->g.n[0] * m->g.n[1] * m->g.n[2]; }

/* New maps in the state that an operator expects of its output: random values everywhere, except
 * zeros in the gaps that sdm_fmap_clear_gaps() clears. */
static inline maps maps_new(const sdm_fmap *g, size_t channels)
{
    maps m = {
        .g = *g, .channels = channels, .memory = floats_random(sdm_fmap_floats(g, channels), 8)};
    m.at = m.memory + g->lead;
    sdm_fmap_clear_gaps(g, channels, m.at);
    return m;
}

/* New maps with random voxels and cleared gaps. */
static inline maps maps_random(const sdm_fmap *g, size_t channels, uint64_t stream)
{
    maps m = maps_new(g, channels);
    float *map = floats_random(channels * maps_voxels(&m), stream);
    for (size_t c = 0; c < channels; c++)
        sdm_fmap_read(g, map + c * maps_voxels(&m), m.at + c * g->stride);
    sdm_free(map);
    return m;
}

static inline void maps_free(maps *m) { sdm_free(m->memory); }

/* A copy without gaps: v[channels][z][y][x]. The caller frees it with sdm_free(). */
static inline double *maps_to_double(const maps *m)
{
    double *v;
    const size_t n = maps_voxels(m);
    assert_int_equal(SDM_ALLOC(&v, m->channels * n, "test", NULL), SDM_OK);
    for (size_t i = 0; i < m->channels * n; i++) v[i] = (double)*maps_voxel(m, i / n, i % n);
    return v;
}

/* Fails the test unless all floats outside of the voxels (lead, gaps, tail) are zero. */
static inline void maps_check_zeros(const maps *m)
{
    const size_t n = maps_bytes(m) / sizeof(float);
    float *copy = floats_random(n, 0), *keep = m->memory;
    memcpy(copy, keep, maps_bytes(m));
    maps c = *m;
    c.memory = copy, c.at = copy + m->g.lead;
    for (size_t i = 0; i < m->channels * maps_voxels(m); i++)
        *maps_voxel(&c, i / maps_voxels(m), i % maps_voxels(m)) = 0;
    for (size_t i = 0; i < n; i++) assert_true(copy[i] == 0);
    sdm_free(copy);
}

#endif
