/* The loops of fine_kernels.h, compiled once for each instruction set. Before inclusion, define
   TABLE, the name of the fine_table. Lanes are cells; every sum is made input by input, without
   fused multiply-adds. */
#include <math.h>
#include <string.h>

#include "fine_kernels.h"

typedef float lanes __attribute__((vector_size(64)));

enum { IN = SDM_FINE_INPUTS, OUT = SDM_FINE_OUTPUTS, WIDTH = SDM_FINE_MAX_WIDTH };

/* y[n_out] = bias[n_out] (NULL: 0) + w[n_in][n_out]^T x[n_in]; n_out is a multiple of 4. */
static void layer(size_t n_in, size_t n_out, const float *w, const float *bias, const lanes *x,
                  lanes *y)
{
    const lanes zero = {0};
    for (size_t o = 0; o < n_out; o += 4) {
        lanes a = zero, b = zero, c = zero, d = zero;
        if (bias) a += bias[o], b += bias[o + 1], c += bias[o + 2], d += bias[o + 3];
        const float *row = w + o;
        for (size_t i = 0; i < n_in; i++, row += n_out) {
            a += row[0] * x[i];
            b += row[1] * x[i];
            c += row[2] * x[i];
            d += row[3] * x[i];
        }
        y[o] = a, y[o + 1] = b, y[o + 2] = c, y[o + 3] = d;
    }
}

/* z becomes f(z), and slope = f'(z). */
static void activate(size_t n, lanes *z, lanes *slope)
{
    for (size_t i = 0; i < n; i++) {
        lanes root = 1 + z[i] * z[i];
        for (int l = 0; l < FINE_CELLS; l++) root[l] = sqrtf(root[l]);
        const lanes r = 1 / root, s = z[i] * r;
        slope[i] = 0.5f * ((1 + s) + s * (r * r));
        z[i] = 0.5f * (z[i] + z[i] * s);
    }
}

/* The stencil's index of corner q (0 .. 7) of the cell. */
static size_t corner(size_t q)
{
    return (1 + (q >> 2)) * 16 + (1 + (q >> 1 & 1)) * 4 + 1 + (q & 1);
}

static lanes mean(const lanes *v)
{
    lanes sum = v[corner(0)];
    for (size_t q = 1; q < 8; q++) sum += v[corner(q)];
    return sum * 0.125f;
}

/* The sum of products of second differences of u and v. */
static lanes bend(const lanes *u, const lanes *v)
{
    static const size_t step[3] = {1, 4, 16};
    lanes sum = {0};
    for (size_t q = 0; q < 8; q++)
        for (int a = 0; a < 3; a++) {
            const size_t i = corner(q), s = step[a];
            sum += ((u[i - s] + u[i + s]) - 2 * u[i]) * ((v[i - s] + v[i + s]) - 2 * v[i]);
        }
    return sum;
}

/* What the tangents need of the values. */
typedef struct kept {
    lanes gate, gate_slope, mean_slope; /* derivatives by c, and by m */
    lanes slope[2][WIDTH], out[OUT];
} kept;

/* Sets the gate and its derivative from c and the threshold. */
static void open_gate(lanes c, float threshold, kept *k)
{
    const float low = threshold * threshold, unit = 1 / (3 * low);
    for (int l = 0; l < FINE_CELLS; l++) {
        const float s = fminf(fmaxf((c[l] - low) * unit, 0), 1);
        k->gate[l] = s * s * (3 - 2 * s);
        k->gate_slope[l] = 6 * s * (1 - s) * unit;
    }
}

static void run_values(const sdm_fine *f, float h, const lanes *v, kept *k, lanes *out)
{
    const float *w0 = f->weights, *w1 = w0 + (IN + 1) * f->width,
                *w2 = w1 + (f->width + 1) * f->width;
    const lanes m = mean(v);
    lanes x[IN], y[WIDTH], z[WIDTH];
    lanes root = m * m + h * h;
    for (int l = 0; l < FINE_CELLS; l++) root[l] = sqrtf(root[l]);
    open_gate(bend(v, v) * (1 / (h * h)), f->threshold, k);
    for (size_t i = 0; i < SDM_FINE_STENCIL; i++) x[i] = (v[i] - m) * (1 / h);
    x[SDM_FINE_STENCIL] = m / root;
    k->mean_slope = (h * h) / (root * root * root);
    layer(IN, f->width, w0, w0 + IN * f->width, x, y);
    activate(f->width, y, k->slope[0]);
    layer(f->width, f->width, w1, w1 + f->width * f->width, y, z);
    activate(f->width, z, k->slope[1]);
    layer(f->width, OUT, w2, w2 + f->width * OUT, z, k->out);
    for (size_t o = 0; o < OUT; o++) out[o] = k->gate * (k->out[o] * (0.1f * h));
}

static void run_tangents(const sdm_fine *f, float h, const lanes *v, const lanes *d, const kept *k,
                         lanes *out)
{
    const float *w0 = f->weights, *w1 = w0 + (IN + 1) * f->width,
                *w2 = w1 + (f->width + 1) * f->width;
    const lanes m = mean(d), gate = k->gate_slope * (bend(v, d) * (2 / (h * h)));
    lanes x[IN], y[WIDTH], z[WIDTH];
    for (size_t i = 0; i < SDM_FINE_STENCIL; i++) x[i] = (d[i] - m) * (1 / h);
    x[SDM_FINE_STENCIL] = k->mean_slope * m;
    layer(IN, f->width, w0, NULL, x, y);
    for (size_t i = 0; i < f->width; i++) y[i] *= k->slope[0][i];
    layer(f->width, f->width, w1, NULL, y, z);
    for (size_t i = 0; i < f->width; i++) z[i] *= k->slope[1][i];
    layer(f->width, OUT, w2, NULL, z, out);
    for (size_t o = 0; o < OUT; o++) out[o] = (k->gate * out[o] + gate * k->out[o]) * (0.1f * h);
}

static void cells(const sdm_fine *f, float h, size_t n_tangents, const float *values, float *out)
{
    const lanes *v = (const lanes *)values;
    lanes *to = (lanes *)out;
    kept k;
    run_values(f, h, v, &k, to);
    for (size_t i = 1; i <= n_tangents; i++)
        run_tangents(f, h, v, v + i * SDM_FINE_STENCIL, &k, to + i * OUT);
}

const fine_table TABLE = {.cells = cells};
