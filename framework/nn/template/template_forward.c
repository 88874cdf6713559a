/* Maps of a template network. No allocation. */
#include <math.h>
#include <string.h>

#include "sdm/internal/processor.h"
#include "template_rows.h"

const template_table *sdm_template_kernels(void)
{
#if defined(__x86_64__)
    const int level = sdm_processor_level();
    if (level >= SDM_PROCESSOR_AVX512) return &sdm_template_avx512;
    if (level >= SDM_PROCESSOR_AVX2) return &sdm_template_avx2;
#endif
    return &sdm_template_generic;
}

static size_t correction_bytes(const template_network *k)
{
    return k->correction ? k->correction->kind->scratch_bytes(k->correction, 1, 1) : 0;
}

size_t sdm_template_scratch_bytes(const sdm_model *m, size_t n, int n_threads)
{
    (void)n, (void)n_threads;
    template_work w;
    return sdm_template_carve(m, false, 1, correction_bytes(m->network), NULL, &w);
}

// values = the minimum over the parts
static void fill_map(template_work *w, float *values)
{
    const template_network *k = w->k;
    const size_t nx = (size_t)w->grid->n[0], ny = (size_t)w->grid->n[1], nz = (size_t)w->grid->n[2];
    for (size_t z = 0; z < nz; z++) {
        for (size_t c = 0; c < k->n_parts; c++)
            if (k->parts[c].n_modes)
                sdm_template_plane(k, w->warp[c].points, w->warp[c].metric, z, w->warp[c].plane);
        for (size_t y = 0; y < ny; y++) {
            float *to = values + (z * ny + y) * nx;
            if (k->n_parts == 1) {
                sdm_template_run(w, 0, 0, y, z, nx);
                memcpy(to, w->row.value, nx * sizeof *to);
                continue;
            }
            for (size_t x = 0; x < nx; x++) to[x] = INFINITY;
            for (size_t c = 0; c < k->n_parts; c++)
                for (size_t x = 0; x < nx;) {
                    const size_t n = sdm_template_active(w, c, x, y, z);
                    if (n == 0) {
                        x = (x / SDM_TEMPLATE_BLOCK + 1) * SDM_TEMPLATE_BLOCK;
                        continue;
                    }
                    sdm_template_run(w, c, x, y, z, n);
                    for (size_t i = 0; i < n; i++)
                        to[x + i] = w->row.value[i] < to[x + i] ? w->row.value[i] : to[x + i];
                    x += n;
                }
        }
    }
}

void sdm_template_forward(const sdm_model *m, const double *params, size_t n, float *values,
                          void *scratch, int n_threads)
{
    (void)n_threads;
    const template_network *k = m->network;
    template_work w;
    sdm_template_carve(m, false, 1, correction_bytes(k), scratch, &w);
    for (size_t i = 0; i < n; i++) {
        const double *p = params + i * m->info.n_params;
        sdm_template_begin(&w, p, false);
        if (k->correction)
            k->correction->kind->forward(k->correction, p, 1, w.correction, w.correction_scratch,
                                         1);
        fill_map(&w, values + i * sdm_grid_count(&m->info.grid));
    }
}

