/* Maps of a template network. No allocation. */
#include <string.h>

#include "template_rows.h"

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
    template_patch p = {.count = 0};
    while (sdm_template_next(w, &p)) {
        sdm_template_values(w, &p, w->value, NULL);
        const float *from = w->value;
        for (size_t z = 0; z < p.n[2]; z++)
            for (size_t y = 0; y < p.n[1]; y++, from += p.n[0])
                memcpy(values + sdm_template_line_at(w, &p, y, z), from, p.n[0] * sizeof *from);
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
