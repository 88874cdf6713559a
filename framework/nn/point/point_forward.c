/* Evaluation of a point network at all voxels of a map, with derivatives by forward mode. No
   allocation. Letters as in sdm/internal/point_network.h.

   The parameters are the same for all points of a map: their part of W_l u is added to the bias
   once, so that only the three coordinates q enter at each point. R points pass through all layers
   together. With derivatives there are (1 + P) R rows: first the values of all R points, then for
   each parameter the tangents of all R points. */
#include <math.h>
#include <string.h>

#include "point_internal.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/pod.h"
#include "sdm/internal/threads.h"

// rounded up to whole panels
static size_t pad(size_t n) { return sdm_panel_outputs(n); }

// The biases of one map, data[1 + P][stride]. Set 0 holds for each layer the bias plus the part of
// W_l u that comes from the parameters; sets 1 .. P hold its derivatives by each parameter. Layer l
// begins at index at[l] of a set.
typedef struct map_bias {
    size_t at[SDM_POINT_MAX_DEPTH], stride;
    float *data;
} map_bias;

// scratch memory of one thread
typedef struct workspace {
    float *h[2];  // [rows][pad(max width)]
    float *slope; // [R][max width] derivative of the activation
} workspace;

// sets b->at and b->stride; returns the number of floats of `sets` sets
static size_t bias_floats(const point_network *k, size_t sets, map_bias *b)
{
    b->stride = 0;
    for (size_t l = 0; l < k->arch.depth; l++) {
        b->at[l] = b->stride;
        b->stride += pad(k->arch.width[l]);
    }
    return sets * b->stride;
}

// sets the pointers into memory[] (NULL: none) for `rows` rows; returns the floats needed
static size_t carve(const point_network *k, size_t rows, float *memory, workspace *w)
{
    const size_t width = pad(k->max_width);
    const size_t sizes[] = {rows * width, rows * width, k->rows * width};
    float **const fields[] = {&w->h[0], &w->h[1], &w->slope};
    size_t total = 0;
    for (size_t i = 0; i < 3; i++) {
        *fields[i] = memory ? memory + total : NULL;
        total += sizes[i];
    }
    return total; // a multiple of 16 floats
}

// fills b->data at the parameters p[P]; sets 1 .. P only with `tangents`
static void bias_set(const sdm_model *m, const double *p, bool tangents, map_bias *b)
{
    const point_network *k = m->network;
    const sdm_point_arch *a = &k->arch;
    for (size_t l = 0; l < a->depth; l++) {
        const size_t width = a->width[l];
        float *sum = b->data + b->at[l];
        memcpy(sum, k->bias[l], width * sizeof *sum);
        for (size_t i = 0; i < a->n_params; i++) {
            const sdm_model_param *q = &m->params[i];
            const double unit = 2 / (q->max - q->min);
            const float x = (float)((p[i] - q->min) * unit - 1);
            const float *column = k->input[l] ? k->input[l] + i * width : NULL;
            for (size_t o = 0; column && o < width; o++) sum[o] += x * column[o];
            float *slope = sum + (1 + i) * b->stride;
            for (size_t o = 0; tangents && o < width; o++)
                slope[o] = column ? (float)unit * column[o] : 0;
        }
    }
}

void sdm_point_coordinates(const sdm_grid *g, const sdm_point_arch *a, size_t first, size_t n,
                           float *q)
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
    for (size_t v = first; v < first + n; v++, q += 3) {
        double world[3];
        sdm_grid_world(
            g, (const double[3]){(double)(v % nx), (double)(v / nx % ny), (double)(v / nx / ny)},
            world);
        for (int r = 0; r < 3; r++) q[r] = (float)((world[r] - a->centre[r]) / a->radius);
    }
}

// y[n][ldy] = x[n][ldx] times the part of W_l that multiplies h_(l-1), for a layer l > 0
static void layer_multiply(const point_network *k, size_t l, size_t n, const float *x, size_t ldx,
                           float *y, size_t ldy)
{
    const size_t before = k->arch.width[l - 1], at = k->hidden_at[l];
    if (k->half)
        sdm_panel_f16(n, k->arch.width[l], before, (const uint16_t *)k->hidden + at, x, ldx, y,
                      ldy);
    else
        sdm_panel_f32(n, k->arch.width[l], before, (const float *)k->hidden + at, x, ldx, y, ldy);
}

// y[n][ldy] += bias[width] + columns[3][width]^T q[n][3], or only the bias if `columns` is NULL.
// clear: y is set to zero first.
static void add_input(size_t n, size_t width, const float *bias, const float *columns,
                      const float *q, bool clear, float *y, size_t ldy)
{
    for (size_t i = 0; i < n; i++, y += ldy) {
        const float *x = columns, *b = bias;
        if (clear) memset(y, 0, width * sizeof *y);
        if (x && q) {
            const float q0 = q[3 * i], q1 = q[3 * i + 1], q2 = q[3 * i + 2];
            for (size_t o = 0; o < width; o++)
                y[o] += b[o] + q0 * x[o] + q1 * x[width + o] + q2 * x[2 * width + o];
        } else {
            for (size_t o = 0; o < width; o++) y[o] += b[o];
        }
    }
}

static float dot(const float *a, const float *b, size_t n)
{
    float part[16] = {0}, sum = 0;
    size_t i = 0;
    for (; i + 16 <= n; i += 16)
        for (size_t j = 0; j < 16; j++) part[j] += a[i + j] * b[i + j];
    for (; i < n; i++) sum += a[i] * b[i];
    for (size_t j = 0; j < 16; j++) sum += part[j];
    return sum;
}

// values[n] at n <= R points q[n][3], and, unless NULL, jacobian[P][n], whose rows are `voxels`
// floats apart.
static void points_forward(const point_network *k, const map_bias *b, size_t n, const float *q,
                           const workspace *w, float *values, float *jacobian, size_t voxels)
{
    const sdm_point_arch *a = &k->arch;
    const size_t sets = jacobian ? 1 + a->n_params : 1, ld = pad(k->max_width);

    // hidden layers; set 0: values, sets 1 .. P: derivatives
    float *in = w->h[0], *out = w->h[1];
    for (size_t l = 0; l < a->depth; l++) {
        const size_t width = a->width[l];
        const float *columns = k->input[l] ? k->input[l] + a->n_params * width : NULL;
        if (l) layer_multiply(k, l, sets * n, in, ld, out, ld);
        for (size_t s = 0; s < sets; s++) {
            float *y = out + s * n * ld;
            add_input(n, width, b->data + s * b->stride + b->at[l], s ? NULL : columns, q, l == 0,
                      y, ld);
            for (size_t i = 0; i < n; i++) {
                float *slope = w->slope + i * width, *row = y + i * ld;
                if (s == 0) sdm_activate(a->activation, width, row, row, jacobian ? slope : NULL);
                for (size_t o = 0; s && o < width; o++) row[o] *= slope[o];
            }
        }
        float *swap = in;
        in = out, out = swap;
    }

    // output layer
    const size_t last = a->width[a->depth - 1];
    for (size_t i = 0; i < n; i++) {
        const float sum = dot(in + i * ld, k->last, last) + k->last[last],
                    g = a->tanh_output ? tanhf(sum) : sum;
        values[i] = (float)a->scale * g;
        const float slope = (float)a->scale * (a->tanh_output ? 1 - g * g : 1);
        for (size_t s = 1; s < sets; s++)
            jacobian[(s - 1) * voxels + i] = slope * dot(in + (s * n + i) * ld, k->last, last);
    }
}

// Computes one map, with its Jacobian unless NULL. The voxels are divided into chunks of R, which
// are distributed over the threads; the chunks do not depend on the number of threads.
static void map_forward(const sdm_model *m, const double *p, float *values, float *jacobian,
                        void *scratch, int n_threads)
{
    const point_network *k = m->network;
    const size_t voxels = sdm_grid_count(&m->info.grid), sets = jacobian ? 1 + k->arch.n_params : 1;
    map_bias b = {.data = scratch};
    workspace unused;
    float *memory = (float *)scratch + bias_floats(k, sets, &b);
    const size_t each = carve(k, sets * k->rows, NULL, &unused);
    bias_set(m, p, jacobian != NULL, &b);
    (void)n_threads;
#pragma omp parallel for schedule(dynamic) num_threads(n_threads) if (n_threads > 1)
    for (size_t first = 0; first < voxels; first += k->rows) {
        const size_t n = voxels - first < k->rows ? voxels - first : k->rows;
        float q[3 * 192];
        workspace w;
        carve(k, sets * k->rows, memory + (size_t)sdm_thread() * each, &w);
        sdm_point_coordinates(&m->info.grid, &k->arch, first, n, q);
        points_forward(k, &b, n, q, &w, values + first, jacobian ? jacobian + first : NULL, voxels);
    }
}

static size_t scratch_bytes(const point_network *k, size_t sets, int n_threads)
{
    map_bias b;
    workspace w;
    return (bias_floats(k, sets, &b) + (size_t)n_threads * carve(k, sets * k->rows, NULL, &w)) *
           sizeof(float);
}

size_t sdm_point_scratch_bytes(const sdm_model *m, size_t n, int n_threads)
{
    (void)n;
    return scratch_bytes(m->network, 1, n_threads);
}

void sdm_point_forward(const sdm_model *m, const double *params, size_t n, float *values,
                       void *scratch, int n_threads)
{
    const size_t voxels = sdm_grid_count(&m->info.grid);
    for (size_t i = 0; i < n; i++)
        map_forward(m, params + i * m->info.n_params, values + i * voxels, NULL, scratch,
                    n_threads);
}

size_t sdm_point_jacobian_scratch_bytes(const sdm_model *m, int n_threads)
{
    return scratch_bytes(m->network, 1 + m->info.n_params, n_threads);
}

void sdm_point_jacobian(const sdm_model *m, const double *params, float *values, float *jacobian,
                        void *scratch, int n_threads)
{
    map_forward(m, params, values, jacobian, scratch, n_threads);
}
