/* Activation functions and their derivatives. */
#include <math.h>

#include "sdm/internal/kernels.h"
#include "sdm/internal/pod.h"

enum { CHUNK = 256 };

static void silu(size_t n, const float *x, float *y, float *dy)
{
    float e[CHUNK];
    for (size_t at = 0; at < n; at += CHUNK) {
        const size_t m = n - at < CHUNK ? n - at : CHUNK;
        for (size_t i = 0; i < m; i++) e[i] = -x[at + i];
        sdm_exp(m, e, e);
        for (size_t i = 0; i < m; i++) {
            const float v = x[at + i], s = 1.0f / (1.0f + e[i]);
            y[at + i] = v * s;
            if (dy) dy[at + i] = s * (1.0f + v * (1.0f - s));
        }
    }
}

static void hyperbolic_tangent(size_t n, const float *x, float *y, float *dy)
{
    for (size_t i = 0; i < n; i++) {
        const float t = tanhf(x[i]);
        y[i] = t;
        if (dy) dy[i] = 1.0f - t * t;
    }
}

static void relu(size_t n, const float *x, float *y, float *dy)
{
    for (size_t i = 0; i < n; i++) {
        const float v = x[i];
        y[i] = v > 0 ? v : 0;
        if (dy) dy[i] = v > 0 ? 1.0f : 0.0f;
    }
}

static void leaky_relu(size_t n, const float *x, float *y, float *dy)
{
    for (size_t i = 0; i < n; i++) {
        const float v = x[i], slope = v > 0 ? 1.0f : 0.02f;
        y[i] = slope * v;
        if (dy) dy[i] = slope;
    }
}

static void algebraic(size_t n, const float *x, float *y, float *dy)
{
    for (size_t i = 0; i < n; i++) {
        const float v = x[i], r = 1 / sqrtf(1 + v * v), s = v * r;
        y[i] = 0.5f * (v + v * s);
        if (dy) dy[i] = 0.5f * ((1 + s) + s * (r * r));
    }
}

void sdm_activate(int kind, size_t n, const float *x, float *y, float *dy)
{
    if (kind == 0)
        silu(n, x, y, dy);
    else if (kind == 1)
        hyperbolic_tangent(n, x, y, dy);
    else if (kind == 2)
        relu(n, x, y, dy);
    else if (kind == 3)
        leaky_relu(n, x, y, dy);
    else
        algebraic(n, x, y, dy);
}
