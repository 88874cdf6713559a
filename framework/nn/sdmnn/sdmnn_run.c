/* Evaluation of an sdmnn model, one map after another, with derivatives in forward and reverse
   mode. No allocation. */
#include <string.h>

#include "sdm/internal/kernels.h"
#include "sdm/internal/pod.h"
#include "sdmnn_model.h"

static size_t up16(size_t n) { return (n + 15) / 16 * 16; }

// Scratch memory, carved from the caller's block, for R rows: row 0 belongs to a map, the others to
// its derivatives.
typedef struct workspace {
    float *hidden;                 // [R][W]
    float *volume;                 // [R][sdm_panel_outputs(cells)]
    float *activation;             // [W] derivative of the activation of the dense layer
    float *maps, *slope, *tangent; // see passes.h
    float *layer, *transposed;     // reverse mode: layer and `to` of sdm_sdmnn_pack_layers()
} workspace;

static size_t carve(const sdmnn_plan *p, size_t rows, bool reverse, void *memory, workspace *w)
{
    const size_t width = p->arch.width, more = rows > 1 ? p->floats : 0;
    const size_t sizes[] = {rows * width,
                            rows * sdm_panel_outputs(p->cells),
                            width,
                            p->floats,
                            more,
                            more,
                            reverse ? sdm_sdmnn_largest_layer(p) : 0,
                            reverse ? sdm_sdmnn_packed_floats(p, true) : 0};
    float **const fields[] = {&w->hidden, &w->volume,  &w->activation, &w->maps,
                              &w->slope,  &w->tangent, &w->layer,      &w->transposed};
    size_t total = 0;
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        *fields[i] = memory ? (float *)memory + total : NULL;
        total += up16(sizes[i]);
    }
    return total * sizeof(float);
}

// factor by which parameter i is scaled to [-1, 1]
static double unit(const sdm_model *m, size_t i)
{
    return 2 / (m->params[i].max - m->params[i].min);
}

// w->volume = the output of the dense layers. Row 0 is the volume; the other rows are its
// derivatives along direction[P] (rows = 2) or, if direction is NULL, by each parameter (rows = 1 +
// P).
static void dense(const sdm_model *m, const double *params, size_t rows, const double *direction,
                  const workspace *w)
{
    const sdmnn_model *k = m->network;
    const sdm_sdmnn_arch *a = &k->plan.arch;

    // first layer and its derivatives
    for (size_t o = 0; o < a->width; o++) {
        double s = (double)k->b1[o], along = 0;
        for (size_t i = 0; i < a->n_params; i++) {
            const double weight = (double)k->w1[o * a->n_params + i] * unit(m, i);
            s += weight * (params[i] - m->params[i].min - 1 / unit(m, i));
            if (direction)
                along += weight * direction[i];
            else if (rows > 1)
                w->hidden[(1 + i) * a->width + o] = (float)weight;
        }
        w->hidden[o] = (float)s;
        if (direction) w->hidden[a->width + o] = (float)along;
    }
    sdm_activate(a->activation, a->width, w->hidden, w->hidden, w->activation);
    for (size_t r = 1; r < rows; r++)
        for (size_t o = 0; o < a->width; o++) w->hidden[r * a->width + o] *= w->activation[o];

    // second layer; the bias does not enter the derivatives
    const size_t cells = k->plan.cells, ld = sdm_panel_outputs(cells);
    if (k->half)
        sdm_panel_f16(rows, cells, a->width, k->volume, w->hidden, a->width, w->volume, ld);
    else
        sdm_panel_f32(rows, cells, a->width, k->volume, w->hidden, a->width, w->volume, ld);
    for (size_t i = 0; i < cells; i++) w->volume[i] += k->b2[i];
}

size_t sdm_sdmnn_scratch_bytes(const sdm_model *m, size_t n, int n_threads)
{
    const sdmnn_model *k = m->network;
    workspace w;
    (void)n, (void)n_threads;
    return carve(&k->plan, 1, false, NULL, &w);
}

void sdm_sdmnn_model_forward(const sdm_model *m, const double *params, size_t n, float *values,
                             void *scratch, int n_threads)
{
    const sdmnn_model *k = m->network;
    const size_t voxels = sdm_grid_count(&m->info.grid);
    workspace w;
    carve(&k->plan, 1, false, scratch, &w);
    sdm_sdmnn_plan_clear(&k->plan, w.maps);
    for (size_t i = 0; i < n; i++) {
        dense(m, params + i * m->info.n_params, 1, NULL, &w);
        sdm_sdmnn_pass_forward(&k->plan, &k->layers, w.volume, w.maps, NULL, NULL,
                               values + i * voxels, n_threads);
    }
}

static size_t derivative_bytes(const sdm_model *m, size_t rows, bool reverse)
{
    const sdmnn_model *k = m->network;
    workspace w;
    return carve(&k->kept, rows, reverse, NULL, &w);
}

// values = the map; derivatives[rows - 1][voxels] = its derivatives along direction[P] or by each
// parameter, as in dense()
static void forward_mode(const sdm_model *m, const double *params, size_t rows,
                         const double *direction, float *values, float *derivatives, void *scratch,
                         int n_threads)
{
    const sdmnn_model *k = m->network;
    const size_t voxels = sdm_grid_count(&m->info.grid), ld = sdm_panel_outputs(k->kept.cells);
    workspace w;
    carve(&k->kept, rows, false, scratch, &w);
    sdm_sdmnn_plan_clear(&k->kept, w.maps);
    sdm_sdmnn_plan_clear(&k->kept, w.tangent);
    dense(m, params, rows, direction, &w);
    sdm_sdmnn_pass_forward(&k->kept, &k->layers, w.volume, w.maps, w.slope, NULL, values,
                           n_threads);
    for (size_t r = 1; r < rows; r++)
        sdm_sdmnn_pass_tangent(&k->kept, &k->layers, w.maps, w.slope, w.volume + r * ld, w.tangent,
                               derivatives + (r - 1) * voxels, n_threads);
}

size_t sdm_sdmnn_jacobian_scratch_bytes(const sdm_model *m, int n_threads)
{
    (void)n_threads;
    return derivative_bytes(m, 1 + m->info.n_params, false);
}

void sdm_sdmnn_model_jacobian(const sdm_model *m, const double *params, float *values,
                              float *jacobian, void *scratch, int n_threads)
{
    forward_mode(m, params, 1 + m->info.n_params, NULL, values, jacobian, scratch, n_threads);
}

size_t sdm_sdmnn_jvp_scratch_bytes(const sdm_model *m, int n_threads)
{
    (void)n_threads;
    return derivative_bytes(m, 2, false);
}

void sdm_sdmnn_model_jvp(const sdm_model *m, const double *params, const double *direction,
                         float *values, float *tangent, void *scratch, int n_threads)
{
    forward_mode(m, params, 2, direction, values, tangent, scratch, n_threads);
}

size_t sdm_sdmnn_vjp_scratch_bytes(const sdm_model *m) { return derivative_bytes(m, 2, true); }

void sdm_sdmnn_model_vjp(const sdm_model *m, const double *params, const float *adjoint,
                         double *gradient, void *scratch)
{
    const sdmnn_model *k = m->network;
    const sdm_sdmnn_arch *a = &k->kept.arch;
    const size_t cells = k->kept.cells, ld = sdm_panel_outputs(cells);

    // forward pass with slopes
    workspace w;
    carve(&k->kept, 2, true, scratch, &w);
    sdm_sdmnn_plan_clear(&k->kept, w.maps);
    sdm_sdmnn_plan_clear(&k->kept, w.tangent);
    dense(m, params, 1, NULL, &w);
    sdm_sdmnn_pass_forward(&k->kept, &k->layers, w.volume, w.maps, w.slope, NULL, NULL, 1);

    // backward pass; packing its weights in each call takes about 1 % of its time
    sdmnn_layers layers = k->layers;
    sdm_sdmnn_pack_layers(k, true, w.layer, w.transposed, layers.transposed);
    float *dvolume = w.volume + ld, *dhidden = w.hidden + a->width;
    memset(dvolume + cells, 0, (ld - cells) * sizeof *dvolume);
    sdm_sdmnn_pass_backward(&k->kept, &layers, w.maps, w.slope, adjoint, w.tangent, dvolume, NULL,
                            1);

    // dense layers
    if (k->half)
        sdm_panel_back_f16(cells, a->width, k->volume, dvolume, dhidden);
    else
        sdm_panel_back_f32(cells, a->width, k->volume, dvolume, dhidden);
    for (size_t i = 0; i < a->n_params; i++) {
        gradient[i] = 0;
        for (size_t o = 0; o < a->width; o++)
            gradient[i] +=
                unit(m, i) * (double)(k->w1[o * a->n_params + i] * w.activation[o] * dhidden[o]);
    }
}
