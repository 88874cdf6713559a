/* Makes meshes again, one after the other or on many threads at once, and compares their bits. */
#include "sdm/internal/checksum.h"
#include "sdm/internal/clock.h"
#include "sdm/memory.h"
#include "shape_internal.h"

#define SECONDS 0.25

static uint64_t checksum(const sdm_mesh *m)
{
    const uint64_t sizes[2] = {m->n_vert, m->n_tri};
    uint64_t c = sdm_crc64(0, sizes, sizeof sizes);
    c = sdm_crc64(c, m->vert, 3 * m->n_vert * sizeof *m->vert);
    return sdm_crc64(c, m->tri, 3 * m->n_tri * sizeof *m->tri);
}

static void again(const sdm_instance *s, const double *p, uint64_t first, sdm_mesh *mesh,
                  bool *unlike)
{
    if (!sdm_instance_mesh(s, p, mesh, NULL) && checksum(mesh) == first) return;
#pragma omp atomic write
    *unlike = true;
}

static void repeat_backwards(const sdm_instance *s, const double *p, size_t n,
                             const uint64_t *first, bool *unlike)
{
    sdm_mesh mesh = {0};
    for (size_t i = n; i-- > 0;)
        for (int k = 0; k < 2; k++) again(s, p + i * s->n_params, first[i], &mesh, &unlike[i]);
    sdm_mesh_dispose(&mesh);
}

/* Every thread makes all meshes, each thread another one at first. */
static void repeat_at_once(const sdm_instance *s, const double *p, size_t n, int n_threads,
                           const uint64_t *first, bool *unlike)
{
    const double until = sdm_clock() + SECONDS;
#pragma omp parallel for num_threads(n_threads) schedule(static, 1)
    for (int thread = 0; thread < n_threads; thread++) {
        sdm_mesh mesh = {0};
        do
            for (size_t k = 0; k < n; k++) {
                const size_t i = (k + (size_t)thread) % n;
                again(s, p + i * s->n_params, first[i], &mesh, &unlike[i]);
            }
        while (sdm_clock() < until);
        sdm_mesh_dispose(&mesh);
    }
}

sdm_status sdm_shape_repeat(const sdm_instance *s, const double *p, size_t n, int n_threads,
                            size_t *unlike, size_t *first, sdm_error *err)
{
    if (sdm_is_isolated(s)) return sdm_isolated_repeat(s, p, n, n_threads, unlike, first, err);
    uint64_t *sums = NULL;
    bool *other = NULL;
    sdm_mesh mesh = {0};
    sdm_status status = SDM_ALLOC(&sums, n, "checksums of meshes", err);
    if (!status) status = SDM_ALLOC(&other, n, "repeated meshes", err);
    for (size_t i = 0; i < n && !status; i++) {
        status = sdm_instance_mesh(s, p + i * s->n_params, &mesh, err);
        if (!status) sums[i] = checksum(&mesh);
    }
    sdm_mesh_dispose(&mesh);
    if (!status && n_threads > 1) repeat_at_once(s, p, n, n_threads, sums, other);
    if (!status && n_threads <= 1) repeat_backwards(s, p, n, sums, other);
    *unlike = *first = 0;
    for (size_t i = n; i-- > 0 && !status;)
        if (other[i]) {
            *first = i;
            ++*unlike;
        }
    sdm_free(sums);
    sdm_free(other);
    return status;
}
