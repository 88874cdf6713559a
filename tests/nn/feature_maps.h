/* Feature maps for tests: memory with a border, random content, looks from outside. */
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

static inline float *test_floats(size_t n, uint64_t stream)
{
    float *v;
    assert_int_equal(SDM_ALLOC(&v, n, "test", NULL), SDM_OK);
    for (size_t i = 0; i < n; i++) v[i] = (float)(sdm_rng_uniform(3, stream, i) - 0.5);
    return v;
}

static inline size_t maps_bytes(const maps *m)
{
    return sdm_fmap_floats(&m->g, m->channels) * sizeof(float);
}

/* Number `voxel` of channel c, counted in map order. */
static inline float *maps_voxel(const maps *m, size_t c, size_t voxel)
{
    const size_t x = voxel % m->g.n[0], y = voxel / m->g.n[0] % m->g.n[1],
                 z = voxel / m->g.n[0] / m->g.n[1];
    return m->at + c * m->g.stride + z * m->g.plane + y * m->g.row + x;
}

static inline size_t maps_voxels(const maps *m) { return m->g.n[0] * m->g.n[1] * m->g.n[2]; }

/* As an operator finds it: rubbish between the voxels, zeros where sdm_fmap_clear_gaps() writes
 * them. */
static inline maps maps_new(const sdm_fmap *g, size_t channels)
{
    maps m = {
        .g = *g, .channels = channels, .memory = test_floats(sdm_fmap_floats(g, channels), 8)};
    m.at = m.memory + g->lead;
    sdm_fmap_clear_gaps(g, channels, m.at);
    return m;
}

static inline maps maps_random(const sdm_fmap *g, size_t channels, uint64_t stream)
{
    maps m = maps_new(g, channels);
    float *map = test_floats(channels * maps_voxels(&m), stream);
    for (size_t c = 0; c < channels; c++)
        sdm_fmap_read(g, map + c * maps_voxels(&m), m.at + c * g->stride);
    sdm_free(map);
    return m;
}

static inline void maps_free(maps *m) { sdm_free(m->memory); }

/* [channels][z][y][x] */
static inline double *maps_to_double(const maps *m)
{
    double *v;
    const size_t n = maps_voxels(m);
    assert_int_equal(SDM_ALLOC(&v, m->channels * n, "test", NULL), SDM_OK);
    for (size_t i = 0; i < m->channels * n; i++) v[i] = (double)*maps_voxel(m, i / n, i % n);
    return v;
}

/* Everything but the voxels is zero. */
static inline void maps_check_zeros(const maps *m)
{
    const size_t n = maps_bytes(m) / sizeof(float);
    float *copy = test_floats(n, 0), *keep = m->memory;
    memcpy(copy, keep, maps_bytes(m));
    maps c = *m;
    c.memory = copy, c.at = copy + m->g.lead;
    for (size_t i = 0; i < m->channels * maps_voxels(m); i++)
        *maps_voxel(&c, i / maps_voxels(m), i % maps_voxels(m)) = 0;
    for (size_t i = 0; i < n; i++) assert_true(copy[i] == 0);
    sdm_free(copy);
}

#endif
