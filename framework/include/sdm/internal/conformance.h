/* Tests whether a shape keeps the contract of sdm/shape.h, as far as calls can show it. */
#pragma once

#include "sdm/internal/shape_repeat.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_CONFORMANCE_PARAMS_MAX 64

typedef enum sdm_test_outcome {
    SDM_TEST_PASSED = 0,
    SDM_TEST_SKIPPED,  /* the shape has nothing to test */
    SDM_TEST_DOUBTFUL, /* the program works with it, but it is not as it should be */
    SDM_TEST_FAILED
} sdm_test_outcome;

/* The tests, in the order of the results. */
enum {
    SDM_TEST_MESHES = 0, /* mesh() makes a valid mesh all over the ranges; doubtful: vertices belong
                            to no triangle */
    SDM_TEST_CLOSED,     /* every edge has as many triangles one way as the other */
    SDM_TEST_ORIENTED,   /* no part is inside out */
    SDM_TEST_TRIANGLES,  /* the same numbers and the same triangles everywhere */
    SDM_TEST_UNITS, /* the size and the parameters look like mm; every parameter does something;
                       doubtful at most */
    SDM_TEST_CONTINUOUS, /* small steps of a parameter move vertices by small amounts */
    SDM_TEST_VELOCITY,   /* velocity() is the derivative of mesh() */
    SDM_TEST_REPEATS,    /* the same call gives the same bits */
    SDM_TEST_THREADS,    /* many calls at once give the same bits */
    SDM_TEST_OUTSIDE,    /* parameters outside the ranges and NaN do not end the process */
    SDM_TEST_OPTIONS,    /* the ends of every option and every choice give a mesh */
    SDM_N_TESTS
};

typedef struct sdm_test_result {
    const char *name; /* one word */
    sdm_test_outcome outcome;
    double figure; /* what the text says, as a number */
    char text[1024];
    bool has_params; /* the text is about these parameters */
    double p[SDM_CONFORMANCE_PARAMS_MAX];
} sdm_test_result;

typedef struct sdm_conformance {
    size_t n_corners, n_samples;
    sdm_test_result test[SDM_N_TESTS];
} sdm_conformance;

typedef struct sdm_conformance_opts {
    size_t samples; /* random shapes */
    uint64_t seed;
    int n_threads;                 /* of the survey; 0: the OpenMP default */
    bool (*cancelled)(void *user); /* called by any thread; may be NULL */
    void *user;
    sdm_repeat_process process; /* as in sdm_survey_opts */
} sdm_conformance_opts;

/* Tests the shape of the instance, with its options. The tests OUTSIDE and THREADS may end the
 * process that runs the callbacks: isolate the plug-in (isolation.h). OUTSIDE is skipped for shapes
 * that are not isolated. SDM_E_NOMEM, SDM_E_CANCELLED. */
sdm_status sdm_conformance_make(const sdm_instance *shape, const sdm_conformance_opts *opts,
                                sdm_conformance *out, sdm_error *err);

/* SDM_E_MESH: MESHES or CLOSED failed; SDM_E_QUALITY: another test failed; else SDM_OK. */
sdm_status sdm_conformance_verdict(const sdm_conformance *c);

#ifdef __cplusplus
}
#endif
