/* The public functions that evaluate a model, passed on to its kind of network. */
#include "model_kind.h"
#include "sdm/internal/model_threads.h"

bool sdm_model_is_threaded(const sdm_model *m) { return m->kind->threaded; }

size_t sdm_model_scratch_bytes(const sdm_model *m, size_t n)
{
    return m->kind->scratch_bytes(m, n, 1);
}

void sdm_model_forward(const sdm_model *m, const double *params, size_t n, float *values,
                       void *scratch)
{
    m->kind->forward(m, params, n, values, scratch, 1);
}

size_t sdm_model_jacobian_scratch_bytes(const sdm_model *m)
{
    return m->kind->jacobian_scratch_bytes(m, 1);
}

void sdm_model_jacobian(const sdm_model *m, const double *params, float *values, float *jacobian,
                        void *scratch)
{
    m->kind->jacobian(m, params, values, jacobian, scratch, 1);
}

// For kinds without jvp or vjp. The scratch memory begins with the Jacobian, whose bytes, rounded
// up to a multiple of 64, are returned here; the map (vjp only) and the scratch memory of
// jacobian() follow.
static size_t jacobian_bytes(const sdm_model *m)
{
    const size_t bytes = m->info.n_params * sdm_grid_count(&m->info.grid) * sizeof(float);
    return (bytes + 63) / 64 * 64;
}

size_t sdm_model_jvp_scratch_bytes(const sdm_model *m)
{
    if (m->kind->jvp) return m->kind->jvp_scratch_bytes(m, 1);
    return jacobian_bytes(m) + m->kind->jacobian_scratch_bytes(m, 1);
}

void sdm_model_jvp(const sdm_model *m, const double *params, const double *direction, float *values,
                   float *tangent, void *scratch)
{
    if (m->kind->jvp) {
        m->kind->jvp(m, params, direction, values, tangent, scratch, 1);
        return;
    }
    float *jacobian = scratch;
    m->kind->jacobian(m, params, values, jacobian, (uint8_t *)scratch + jacobian_bytes(m), 1);
    sdm_jacobian_times(jacobian, m->info.n_params, sdm_grid_count(&m->info.grid), direction,
                       tangent);
}

size_t sdm_model_vjp_scratch_bytes(const sdm_model *m)
{
    if (m->kind->vjp) return m->kind->vjp_scratch_bytes(m);
    const size_t values = (sdm_grid_count(&m->info.grid) * sizeof(float) + 63) / 64 * 64;
    return jacobian_bytes(m) + values + m->kind->jacobian_scratch_bytes(m, 1);
}

void sdm_model_vjp(const sdm_model *m, const double *params, const float *adjoint, double *gradient,
                   void *scratch)
{
    if (m->kind->vjp) {
        m->kind->vjp(m, params, adjoint, gradient, scratch);
        return;
    }
    const size_t voxels = sdm_grid_count(&m->info.grid),
                 bytes = (voxels * sizeof(float) + 63) / 64 * 64;
    float *jacobian = scratch, *values = (float *)(void *)((uint8_t *)scratch + jacobian_bytes(m));
    m->kind->jacobian(m, params, values, jacobian, (uint8_t *)scratch + jacobian_bytes(m) + bytes,
                      1);
    sdm_jacobian_transposed_times(jacobian, m->info.n_params, voxels, adjoint, gradient);
}

size_t sdm_model_scratch_bytes_threads(const sdm_model *m, size_t n, int n_threads)
{
    return m->kind->scratch_bytes(m, n, n_threads);
}

void sdm_model_forward_threads(const sdm_model *m, const double *params, size_t n, float *values,
                               void *scratch, int n_threads)
{
    m->kind->forward(m, params, n, values, scratch, n_threads);
}

size_t sdm_model_jacobian_scratch_bytes_threads(const sdm_model *m, int n_threads)
{
    return m->kind->jacobian_scratch_bytes(m, n_threads);
}

void sdm_model_jacobian_threads(const sdm_model *m, const double *params, float *values,
                                float *jacobian, void *scratch, int n_threads)
{
    m->kind->jacobian(m, params, values, jacobian, scratch, n_threads);
}
