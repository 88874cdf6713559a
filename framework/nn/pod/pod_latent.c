/* The latents of a pod network: polynomials and MLP, with derivatives in forward and reverse
   mode. */
#include <string.h>

#include "pod_internal.h"
#include "sdm/internal/kernels.h"

static size_t max_size(size_t a, size_t b) { return a > b ? a : b; }
// T, the number of polynomials that the latents and the MLP need
static size_t n_poly(const pod_network *m)
{
    return max_size(m->arch.n_terms, 1 + m->arch.n_inputs);
}
// Floats of memory for each row of pod_latent.h[]: room for the outputs of a layer, and in the
// backward pass for the gradient by the inputs of a layer; one more than the polynomials, because
// sdm_panel_back_i8() writes whole pairs.
static size_t row_floats(const pod_network *m)
{
    return max_size(sdm_panel_outputs(m->arch.width), n_poly(m) + 1);
}

void sdm_pod_product(sdm_pod_type type, size_t rows, size_t outputs, size_t k, const void *weights,
                     size_t at, const float *x, size_t ldx, float *y, size_t ldy)
{
    if (type == SDM_POD_F16)
        sdm_panel_f16(rows, outputs, k, (const uint16_t *)weights + at, x, ldx, y, ldy);
    else
        sdm_panel_f32(rows, outputs, k, (const float *)weights + at, x, ldx, y, ldy);
}

void sdm_pod_product_back(sdm_pod_type type, size_t outputs, size_t k, const void *weights,
                          size_t at, const float *y, float *x)
{
    if (type == SDM_POD_F16)
        sdm_panel_back_f16(outputs, k, (const uint16_t *)weights + at, y, x);
    else
        sdm_panel_back_f32(outputs, k, (const float *)weights + at, y, x);
}

void sdm_pod_quantise_rows(size_t rows, size_t n, const float *y, size_t ldy, const float *factor,
                           int limit, int16_t *x, size_t ldx, float *scale)
{
    sdm_quantise(rows, n, y, ldy, factor, limit, x, ldx, scale);
    for (size_t r = 0; r < rows; r++) x[r * ldx + n] = 0;
}

void sdm_pod_quantise_residual(size_t n, const float *y, const float *factor, int limit, int16_t *x,
                               float *scale, int16_t *residual, float *residual_scale)
{
    sdm_quantise_residual(n, y, factor, limit, x, scale, residual, residual_scale);
    x[n] = residual[n] = 0;
}

size_t sdm_pod_latent_carve(const pod_network *m, size_t rows, float *memory, pod_latent *w)
{
    const sdm_pod_arch *a = &m->arch;
    const bool integer = m->type == SDM_POD_I8;
    w->ld = sdm_panel_outputs(row_floats(m) + 1);
    float *integers;
    const size_t sizes[] = {rows * n_poly(m),           (rows + 1) * row_floats(m),
                            (rows + 1) * row_floats(m), a->depth * sdm_panel_outputs(a->width),
                            a->n_params * n_poly(m),    integer ? (rows + 1) * w->ld / 2 : 0,
                            integer ? rows + 1 : 0};
    float **const fields[] = {&w->phi,  &w->h[0],  &w->h[1], &w->slope,
                              &w->dphi, &integers, &w->scale};
    size_t total = 0;
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        *fields[i] = memory ? memory + total : NULL;
        total += (sizes[i] + 15) / 16 * 16;
    }
    w->integers = (int16_t *)integers;
    return total;
}

// phi[T] = the polynomials at p[P]; with `slopes` also w->dphi = their derivatives by each
// parameter.
static void polynomials(const sdm_model *model, const double *p, bool slopes, const pod_latent *w,
                        float *phi)
{
    const pod_network *m = model->network;
    const sdm_pod_arch *a = &m->arch;
    const size_t total = n_poly(m);
    double x[SDM_POD_MAX_PARAMS], unit[SDM_POD_MAX_PARAMS];
    for (size_t i = 0; i < a->n_params; i++) {
        const sdm_model_param *q = &model->params[i];
        unit[i] = 2 / (q->max - q->min);
        x[i] = (p[i] - q->min) * unit[i] - 1;
    }
    sdm_poly_eval(m->exponents, total, a->n_params, max_size(a->degree, a->input_degree), x, phi,
                  slopes ? w->dphi : NULL);
    for (size_t i = 0; i < a->n_params && slopes; i++)
        for (size_t t = 0; t < total; t++) w->dphi[i * total + t] *= (float)unit[i];
}

// Rows 1 .. n_directions of w->phi = the derivatives of the polynomials along direction[][P].
static void directional_derivatives(const pod_network *m, size_t n_directions,
                                    const double *direction, const pod_latent *w)
{
    const size_t total = n_poly(m), n_params = m->arch.n_params;
    for (size_t d = 0; d < n_directions; d++) {
        float *to = w->phi + (1 + d) * total;
        memset(to, 0, total * sizeof *to);
        for (size_t i = 0; i < n_params; i++) {
            const float f = (float)direction[d * n_params + i];
            if (f == 0) continue;
            for (size_t t = 0; t < total; t++) to[t] += f * w->dphi[i * total + t];
        }
    }
}

// out[rows][padded W] = the weights of a layer times in[rows][stride], without the bias. smooth
// (for integer weights): the product of the weights and the residual of the first row is computed
// as one more row and added to the first row.
static void layer_products(const pod_network *m, size_t layer, size_t rows, bool smooth,
                           const float *in, size_t stride, const pod_latent *w, float *out)
{
    const size_t n = sdm_pod_layer_inputs(&m->arch, layer),
                 width = sdm_panel_outputs(m->arch.width);
    if (m->type != SDM_POD_I8) {
        sdm_pod_product(m->type, rows, m->arch.width, n, m->layer[layer], 0, in, stride, out,
                        width);
        return;
    }
    const sdm_panel_out to = {.y = out, .ld = width, .line = SDM_PANEL_ROW};
    const int limit = m->layer_limit[layer];
    sdm_pod_quantise_rows(rows, n, in, stride, NULL, limit, w->integers, w->ld, w->scale);
    if (smooth)
        sdm_pod_quantise_residual(n, in, NULL, limit, w->integers, w->scale,
                                  w->integers + rows * w->ld, w->scale + rows);
    sdm_panel_i8(rows + smooth, m->arch.width, n, n, m->layer[layer], w->integers, w->ld, w->scale,
                 &to);
    for (size_t o = 0; o < width && smooth; o++) out[o] += out[rows * width + o];
    for (size_t r = 0; r < rows; r++)
        for (size_t o = 0; o < m->arch.width; o++) out[r * width + o] *= m->layer_scale[layer][o];
}

void sdm_pod_latent(const sdm_model *model, const double *p, size_t n, size_t n_directions,
                    const double *direction, const pod_latent *w, float *z)
{
    const pod_network *m = model->network;
    const sdm_pod_arch *a = &m->arch;

    // polynomials
    const size_t rows = n + n_directions, total = n_poly(m), width = sdm_panel_outputs(a->width);
    for (size_t r = 0; r < n; r++)
        polynomials(model, p + r * a->n_params, n_directions > 0, w, w->phi + r * total);
    directional_derivatives(m, n_directions, direction, w);
    for (size_t r = 0; r < rows; r++)
        memcpy(z + r * a->n_latent, w->phi + r * total, a->n_terms * sizeof *z);
    if (!a->depth) return;

    // The MLP's inputs are the polynomials of degree 1 and more. Derivatives pass through the same
    // weights, without bias, and are multiplied by the slope of the activation.
    float *in = w->phi + 1;
    size_t stride = total;
    for (size_t layer = 0; layer < a->depth; layer++) {
        float *out = w->h[layer % 2], *slope = w->slope + layer * width;
        layer_products(m, layer, rows, n_directions > 0, in, stride, w, out);
        for (size_t r = 0; r < n; r++) {
            for (size_t o = 0; o < a->width; o++) out[r * width + o] += m->bias[layer][o];
            sdm_activate(a->activation, a->width, out + r * width, out + r * width, slope);
        }
        for (size_t r = n; r < rows; r++)
            for (size_t o = 0; o < a->width; o++) out[r * width + o] *= slope[o];
        in = out, stride = width;
    }
    for (size_t r = 0; r < rows; r++)
        memcpy(z + r * a->n_latent + a->n_terms, in + r * width, a->width * sizeof *z);
}

void sdm_pod_latent_back(const sdm_model *model, const double *p, const pod_latent *w,
                         const float *dz, double *gradient)
{
    const pod_network *m = model->network;
    const sdm_pod_arch *a = &m->arch;
    const size_t total = n_poly(m), width = sdm_panel_outputs(a->width);
    polynomials(model, p, true, w, w->phi);
    float *dphi = w->phi; // gradient by the polynomials; it overwrites their values
    memset(dphi, 0, total * sizeof *dphi);
    if (a->depth) {
        // dh[padded W] = gradient by the outputs of a layer, zero in the padding
        float *dh = w->h[0], *below = w->h[1];
        memcpy(dh, dz + a->n_terms, a->width * sizeof *dh);
        for (size_t layer = a->depth; layer-- > 0;) {
            for (size_t o = 0; o < a->width; o++) dh[o] *= w->slope[layer * width + o];
            memset(dh + a->width, 0, (width - a->width) * sizeof *dh);
            const size_t inputs = sdm_pod_layer_inputs(a, layer);
            if (m->type == SDM_POD_I8) {
                for (size_t o = 0; o < a->width; o++) dh[o] *= m->layer_scale[layer][o];
                sdm_panel_back_i8(a->width, inputs, inputs, m->layer[layer], dh, below);
            } else
                sdm_pod_product_back(m->type, a->width, inputs, m->layer[layer], 0, dh, below);
            float *const swap = dh;
            dh = below, below = swap;
        }
        memcpy(dphi + 1, dh, a->n_inputs * sizeof *dphi);
    }

    // add the gradient by the polynomials that are latents themselves, then apply the chain rule
    for (size_t t = 0; t < a->n_terms; t++) dphi[t] += dz[t];
    for (size_t i = 0; i < a->n_params; i++) {
        gradient[i] = 0;
        for (size_t t = 0; t < total; t++) gradient[i] += (double)dphi[t] * w->dphi[i * total + t];
    }
}
