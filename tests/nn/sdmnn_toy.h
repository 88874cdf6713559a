/* A small sdmnn network with random weights, and the model file made from it. Include cmocka.h
 * first. */
#ifndef TEST_SDMNN_TOY_H
#define TEST_SDMNN_TOY_H

#include <stdio.h>

#include "sdm/internal/kernels.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/sdmnn.h"
#include "sdm/memory.h"
#include "toy_params.h"

enum { P = 3, VOXELS = 11 * 6 * 7 };

static const sdm_sdmnn_arch ARCH = {.n_params = P,
                                    .n = {11, 6, 7},
                                    .depth = 2,
                                    .channels = 4,
                                    .width = 70,
                                    .block = 3,
                                    .dropout = 0.2};

typedef struct toy {
    sdm_model_param params[P];
    sdm_model_info info;
    sdm_sdmnn_spec spec;
    float *weights;
    size_t n;
} toy;

/* Fills *t. `half`: weights are values of half precision. The caller frees t->weights. */
static inline void toy_make(toy *t, bool half, int activation)
{
    *t = (toy){0};
    toy_params_fill(t->params, P);
    t->info = (sdm_model_info){
        .n_params = P,
        .params = t->params,
        .grid = sdm_grid_centred((const int64_t[]){11, 6, 7}, 0.2, (const double[]){1, 2, 3}),
        .config = "seed: 7\n"};
    snprintf(t->info.shape, sizeof t->info.shape, "toy");
    t->spec = (sdm_sdmnn_spec){.info = &t->info, .arch = ARCH, .half = half};
    t->spec.arch.activation = activation;
    t->n = sdm_sdmnn_count(&t->spec.arch);
    assert_int_equal(SDM_ALLOC(&t->weights, t->n, "toy", NULL), SDM_OK);
    sdm_sdmnn_init(&t->spec.arch, NULL, 1, 2, t->weights);
    for (size_t i = 0; i < t->n; i++) {
        t->weights[i] += 0.02f * (float)sdm_rng_normal(3, 5, i);
        // the file stores halves: round now, so that saving loses nothing
        if (half) t->weights[i] = sdm_half_to_float(sdm_half_from_float(t->weights[i]));
    }
    t->spec.weights = t->weights;
}

/* Writes the network to memory and opens it as a model, which the caller frees. */
static inline sdm_model *toy_open(const toy *t)
{
    uint8_t *bytes;
    size_t size;
    sdm_model *m;
    assert_int_equal(sdm_sdmnn_build(&t->spec, &bytes, &size, NULL), SDM_OK);
    assert_int_equal(sdm_model_open_memory("toy", bytes, size, &m, NULL), SDM_OK);
    sdm_free(bytes);
    return m;
}

#endif
