/* Common helpers for tests of the exact engine. Include after cmocka.h. */
#ifndef SDM_TEST_EXACT_TOOLS_H
#define SDM_TEST_EXACT_TOOLS_H

#include <stdlib.h>

#include "sdm/exact.h"

/* The engine of m; the test fails if it cannot be created. */
static inline sdm_exact *engine(const sdm_mesh *m, const sdm_exact_opts *o)
{
    sdm_exact *e = NULL;
    sdm_error err = {0};
    if (sdm_exact_create(m, o, &e, &err)) fail_msg("%s", err.text);
    return e;
}

/* n zeroed elements; aborts if there is no memory (caller frees). */
static inline void *room(size_t n, size_t size)
{
    void *p = calloc(n, size);
    if (!p) abort();
    return p;
}

/* Position of voxel i of a map values[nz][ny][nx]. */
static inline void position(const sdm_grid *g, size_t i, double x[3])
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
    const double index[3] = {(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)};
    sdm_grid_world(g, index, x);
}

#endif
