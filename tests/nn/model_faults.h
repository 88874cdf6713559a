/* Faults of model files of any kind of network: damaged bytes, and allocations that fail. Include
 * cmocka.h first. */
#ifndef TEST_MODEL_FAULTS_H
#define TEST_MODEL_FAULTS_H

#include "sdm/internal/heap.h"
#include "sdm/memory.h"
#include "sdm/model.h"

/* Fails unless the bytes are refused as a damaged file. `what` and `at` say what is damaged. */
static inline void expect_damaged(const uint8_t *bytes, size_t size, const char *what, size_t at)
{
    sdm_model *m = NULL;
    sdm_error e = {0};
    const sdm_status s = sdm_model_open_memory("damaged", bytes, size, &m, &e);
    if (s != SDM_E_FORMAT) fail_msg("%s at %zu gives status %d", what, at, s);
    assert_null(m);
    assert_memory_equal(e.text, "damaged: ", 9);
}

/* Builds a model file in memory, as sdm_pod_build() does. */
typedef sdm_status (*model_build)(const void *spec, uint8_t **bytes, size_t *size, sdm_error *err);

/* Builds a model file and opens it, while the first allocation fails, then the second, and so on;
 * each step must fail for lack of memory until all its allocations, more than built - 1 and
 * opened - 1, succeed. Returns the model. */
static inline sdm_model *open_with_failing_allocations(model_build build, const void *spec,
                                                       unsigned long built, unsigned long opened)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    sdm_model *m = NULL;
    for (int step = 0; step < 2; step++) {
        sdm_status s = SDM_E_NOMEM;
        unsigned long n = 1;
        for (; s; n++) {
            sdm_error e;
            sdm_alloc_fail_after(n);
            s = step ? sdm_model_open_memory("toy", bytes, size, &m, &e)
                     : build(spec, &bytes, &size, &e);
            sdm_alloc_fail_after(0);
            if (s) assert_int_equal(s, SDM_E_NOMEM);
            assert_true(n < 100);
        }
        assert_true(n > (step ? opened : built));
    }
    sdm_free(bytes);
    return m;
}

#endif
