/* Maps of a template network. No allocation. */
#include "template_work.h"

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

void sdm_template_forward(const sdm_model *m, const double *params, size_t n, float *values,
                          void *scratch, int n_threads)
{
    (void)n_threads;
    const template_network *k = m->network;
    template_work w;
    sdm_template_carve(m, false, 1, correction_bytes(k), scratch, &w);
    for (size_t i = 0; i < n; i++, values += sdm_grid_count(&m->info.grid)) {
        const double *p = params + i * m->info.n_params;
        if (k->correction)
            k->correction->kind->forward(k->correction, p, 1, w.correction, w.correction_scratch,
                                         1);
        sdm_template_begin(&w, p, false);
        template_block b = sdm_template_first_block(&w);
        do {
            sdm_template_values(&w, &b, w.value, NULL);
            sdm_template_store(&w, &b, w.value, values);
        } while (sdm_template_next_block(&w, &b));
    }
}
