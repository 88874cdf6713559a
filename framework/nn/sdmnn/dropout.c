/* Drop-out of feature maps. Each block of 128 random bits serves four positions of a channel. */
#include "operators.h"
#include "sdm/internal/rng.h"

static size_t draws_of_channel(const sdm_fmap *g) { return (g->count + 3) / 4; }

size_t sdm_dropout_draws(const sdm_fmap *g, size_t channels)
{
    return channels * draws_of_channel(g);
}

void sdm_dropout(const sdm_fmap *g, size_t channels, double rate, uint64_t seed, uint64_t stream,
                 uint64_t index, float *y, float *slope, int n_threads)
{
    const uint32_t below = (uint32_t)(rate * 0x1p32);
    const float scale = (float)(1 / (1 - rate));
    (void)n_threads;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (long c = 0; c < (long)channels; c++) {
        const uint64_t first = index + (uint64_t)c * draws_of_channel(g);
        for (size_t i = 0; i < g->count; i += 4) {
            uint32_t bits[4];
            sdm_rng_block(seed, stream, first + i / 4, bits);
            for (size_t j = i; j < i + 4 && j < g->count; j++) {
                const float f = bits[j - i] < below ? 0.0f : scale;
                y[(size_t)c * g->stride + j] *= f;
                slope[(size_t)c * g->stride + j] *= f;
            }
        }
    }
}
