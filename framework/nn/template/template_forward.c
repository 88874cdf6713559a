/* Maps of a template network: the parts for one parameter vector, then the blocks. No allocation.
 */
#include <math.h>

#include "template_work.h"

enum { BLOCK = SDM_TEMPLATE_STEP };

// from[3], by[3][3] of a part_state
static void affine_index(const template_work *w, size_t c, double u[3], double by[3][3])
{
    const part_pose *pose = &w->pose[c];
    const sdm_lattice *l = &w->k->parts[c].near;
    const sdm_grid *g = w->grid;
    const double *m = pose->inverse;
    double x[3];
    for (int i = 0; i < 3; i++) x[i] = g->origin[i] - pose->b[i];
    for (int i = 0; i < 3; i++) {
        u[i] = (m[3 * i] * x[0] + m[3 * i + 1] * x[1] + m[3 * i + 2] * x[2] - l->origin[i]) /
               l->spacing;
        for (int a = 0; a < 3; a++)
            by[a][i] = (m[3 * i] * g->dir[a] + m[3 * i + 1] * g->dir[3 + a] +
                        m[3 * i + 2] * g->dir[6 + a]) *
                       g->spacing[a] / l->spacing;
    }
}

static void begin_part(template_work *w, size_t c)
{
    const template_network *k = w->k;
    const sdm_template_part *part = &k->parts[c];
    part_state *s = &w->part[c];
    *s = (part_state){.warped = part->n_modes > 0, .rigid = sdm_template_is_rigid(k, c)};
    if (s->warped) {
        warp_scratch *warp = &w->warp[c];
        sdm_template_control(part, w->g + part->amplitudes, warp->control);
        sdm_template_invert(k, part, &w->pose[c], w->grid, warp);
        sdm_template_corners(w, c);
        sdm_template_prefilter(k, warp->points);
        w->lines[c].plane_of = w->lines[c].line_of = SIZE_MAX;
    } else {
        affine_index(w, c, s->from, s->by);
        for (int i = 0; i < 3; i++)
            for (int a = 0; a < 3; a++) s->extent[i] += fabs(s->by[a][i]) * 0.5 * (BLOCK - 1);
        sdm_template_corners(w, c);
    }
    if (k->n_parts > 1) sdm_template_centres(w, c);
}

void sdm_template_begin(template_work *w, const double *p, bool slopes)
{
    const template_network *k = w->k;
    sdm_template_numbers(w->model, p, w->phi, w->g, slopes ? w->dg : NULL);
    sdm_template_frames(k, w->g, w->pose);
    for (size_t v = 0; v < SDM_TEMPLATE_BLOCK_VOXELS; v++) {
        w->offset[0][v] = (float)(v % BLOCK);
        w->offset[1][v] = (float)(v / BLOCK % BLOCK);
        w->offset[2][v] = (float)(v / BLOCK / BLOCK);
    }
    for (size_t c = 0; c < k->n_parts; c++) begin_part(w, c);
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
