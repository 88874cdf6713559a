/* Evaluation of a pod network: parameters -> latents -> map, with derivatives in forward and
   reverse mode. No allocation. */
#include "pod_internal.h"

enum { MAPS = 24 }; // number of maps that share one pass over the weights of the MLP and the head

// If all maps of a call have more bytes than this, they are written past the caches: in the caches
// they would evict the weights, and would themselves be evicted before they are read.
#define STREAM_BYTES_MIN 4e6

static size_t min_size(size_t a, size_t b) { return a < b ? a : b; }

// scratch memory, carved from the caller's block
typedef struct workspace {
    pod_latent latent;
    pod_scratch decode;
} workspace;

static size_t carve(const pod_network *m, size_t rows, int n_threads, float *memory, workspace *w)
{
    const size_t latent = sdm_pod_latent_carve(m, rows, memory, &w->latent);
    return (latent + sdm_pod_scratch_carve(m, rows, n_threads, memory ? memory + latent : NULL,
                                           &w->decode)) *
           sizeof(float);
}

size_t sdm_pod_scratch_bytes(const sdm_model *m, size_t n, int n_threads)
{
    workspace w;
    return carve(m->network, min_size(n, MAPS), n_threads, NULL, &w);
}

void sdm_pod_forward(const sdm_model *m, const double *params, size_t n, float *values,
                     void *scratch, int n_threads)
{
    const pod_network *k = m->network;
    const size_t voxels = sdm_grid_count(&m->info.grid);
    const bool stream = (double)n * (double)voxels * sizeof *values > STREAM_BYTES_MIN;
    workspace w;
    carve(k, min_size(n, MAPS), n_threads, scratch, &w);
    for (size_t at = 0; at < n; at += MAPS) {
        const size_t rows = min_size(MAPS, n - at);
        float *maps[MAPS];
        for (size_t r = 0; r < rows; r++) maps[r] = values + (at + r) * voxels;
        sdm_pod_latent(m, params + at * k->arch.n_params, rows, 0, NULL, &w.latent, w.decode.z);
        sdm_pod_decode(k, &m->info.grid, rows, rows, false, stream, maps, &w.decode, n_threads);
    }
}

// values = the map, tangent[n][voxels] = the derivatives of the map along direction[n][P]
static void forward_mode(const sdm_model *m, const double *params, size_t n,
                         const double *direction, float *values, float *tangent, void *scratch,
                         int n_threads)
{
    const pod_network *k = m->network;
    const size_t voxels = sdm_grid_count(&m->info.grid);
    workspace w;
    carve(k, 1 + n, n_threads, scratch, &w);
    sdm_pod_latent(m, params, 1, n, direction, &w.latent, w.decode.z);
    float *maps[1 + SDM_POD_MAX_PARAMS] = {values};
    for (size_t r = 0; r < n; r++) maps[1 + r] = tangent + r * voxels;
    sdm_pod_decode(k, &m->info.grid, 1 + n, 1, true, false, maps, &w.decode, n_threads);
}

size_t sdm_pod_jacobian_scratch_bytes(const sdm_model *m, int n_threads)
{
    const pod_network *k = m->network;
    workspace w;
    return carve(k, 1 + k->arch.n_params, n_threads, NULL, &w);
}

void sdm_pod_jacobian(const sdm_model *m, const double *params, float *values, float *jacobian,
                      void *scratch, int n_threads)
{
    const size_t n = m->info.n_params;
    double unit[SDM_POD_MAX_PARAMS * SDM_POD_MAX_PARAMS] = {0};
    for (size_t i = 0; i < n; i++) unit[i * n + i] = 1;
    forward_mode(m, params, n, unit, values, jacobian, scratch, n_threads);
}

size_t sdm_pod_jvp_scratch_bytes(const sdm_model *m, int n_threads)
{
    workspace w;
    return carve(m->network, 2, n_threads, NULL, &w);
}

void sdm_pod_jvp(const sdm_model *m, const double *params, const double *direction, float *values,
                 float *tangent, void *scratch, int n_threads)
{
    forward_mode(m, params, 1, direction, values, tangent, scratch, n_threads);
}

size_t sdm_pod_vjp_scratch_bytes(const sdm_model *m)
{
    workspace w;
    return carve(m->network, 2, 1, NULL, &w); // the second row of z is the gradient by z
}

void sdm_pod_vjp(const sdm_model *m, const double *params, const float *adjoint, double *gradient,
                 void *scratch)
{
    const pod_network *k = m->network;
    workspace w;
    carve(k, 2, 1, scratch, &w);
    float *dz = w.decode.z + k->arch.n_latent;
    sdm_pod_latent(m, params, 1, 0, NULL, &w.latent, w.decode.z);
    sdm_pod_decode_back(k, &m->info.grid, adjoint, &w.decode, dz);
    sdm_pod_latent_back(m, params, &w.latent, dz, gradient);
}
