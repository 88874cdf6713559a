/* The transpose of the decoder of a pod network: computes the gradient by the latents from the
   gradient by the voxels, slab by slab as in pod_decode.c. Words and letters as in
   pod_internal.h. */
#include <string.h>

#include "pod_decode_scratch.h"

typedef struct back_task {
    const pod_network *m;
    const sdm_grid *grid;
    const pod_slab *slab;
    slab_scratch s;
} back_task;

// x[rank] = gradient by the coefficients of block b, from y[padded V_b], the gradient by its
// outputs; the padding of y is multiplied by zero weights.
static void block_back(const pod_network *m, size_t b, size_t level, const float *y, float *sorted,
                       float *x)
{
    const sdm_pod_block *k = &m->blocks[b];
    if (!sdm_pod_is_integer(m)) {
        sdm_pod_product_back(m->type, m->outputs[b], k->rank, m->basis, m->weights_at[b], y, x);
        return;
    }
    const float *factor = m->factor + m->coefficients_at[level] + k->coefficient;
    sdm_panel_back_i8(m->outputs[b], m->wide[b], k->rank,
                      (const int8_t *)m->basis + m->weights_at[b], y, sorted);
    for (size_t i = 0; i < k->rank; i++) x[i] = factor[i] * sorted[i];
}

// j->s.back = gradient by the coefficients of all leaves of the slab
static void leaves_back(const back_task *j, const float *adjoint, float *sorted)
{
    const pod_network *m = j->m;
    const size_t line = (size_t)j->grid->n[0], plane = line * (size_t)j->grid->n[1];
    float *y = j->s.y[0];
    for (size_t i = j->slab->leaf; i < j->slab->leaf_end; i++) {
        const size_t b = m->leaves[i].block;
        const sdm_pod_block *k = &m->blocks[b];

        // the voxels of the leaf, padded
        const float *from = adjoint + sdm_pod_first_voxel(j->grid, k);
        float *to = y;
        for (size_t z = 0; z < k->size[2]; z++, from += plane)
            for (size_t v = 0; v < k->size[1]; v++, to += k->size[0])
                memcpy(to, from + v * line, k->size[0] * sizeof *to);
        memset(to, 0, (sdm_panel_outputs(m->outputs[b]) - m->outputs[b]) * sizeof *to);
        block_back(m, b, 0, y, sorted, j->s.back + (k->coefficient - j->slab->coefficient));
    }
    memset(j->s.back + j->slab->n_coefficients, 0, SDM_PANEL * sizeof *j->s.back);
}

// x[rank] = gradient by the coefficients of block b of `level`, computed from the gradients by the
// coefficients of its leaves (j->s.back).
static void upper_back(const back_task *j, size_t b, size_t level, float *sorted, float *x)
{
    const pod_network *m = j->m;
    const sdm_pod_block *k = &m->blocks[b];
    if (level == 0) {
        memcpy(x, j->s.back + (k->coefficient - j->slab->coefficient), k->rank * sizeof *x);
        return;
    }
    const uint32_t first = m->blocks[k->child].coefficient;
    float *y = j->s.y[level];
    for (size_t i = k->child; i < k->child + k->n_children; i++)
        upper_back(j, i, level - 1, sorted, y + (m->blocks[i].coefficient - first));
    memset(y + m->outputs[b], 0, (sdm_panel_outputs(m->outputs[b]) - m->outputs[b]) * sizeof *y);
    block_back(m, b, level, y, sorted, x);
}

void sdm_pod_decode_back(const pod_network *m, const sdm_grid *grid, const float *adjoint,
                         const pod_scratch *w, float *dz)
{
    const size_t coefficients = m->arch.n_coefficients, latent = m->arch.n_latent,
                 n = m->arch.levels.n;

    // w->c = gradient by the coefficients of the highest level
    back_task j = {.m = m, .grid = grid};
    sdm_pod_slab_scratch_carve(m, 1, w->threads, &j.s);
    for (size_t i = 0; i < m->n_slabs; i++) {
        j.slab = &m->slabs[i];
        leaves_back(&j, adjoint, w->sorted);
        for (size_t b = j.slab->top; b < j.slab->top_end; b++)
            upper_back(&j, b, n - 1, w->sorted, w->c + m->blocks[b].coefficient);
    }

    // the transpose of the head
    memset(w->c + coefficients, 0, (sdm_panel_outputs(coefficients) - coefficients) * sizeof *w->c);
    if (!sdm_pod_is_integer(m)) {
        sdm_pod_product_back(m->type, coefficients, latent, m->head, 0, w->c, dz);
        return;
    }
    sdm_panel_back_i8(coefficients, sdm_pod_head_wide(m), latent, m->head, w->c, w->sorted);
    for (size_t i = 0; i < latent; i++)
        dz[m->order[i]] = m->factor[m->coefficients_at[n] + i] * w->sorted[i];
}
