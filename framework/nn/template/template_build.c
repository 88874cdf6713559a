/* Builds the file of a template model. */
#include <string.h>

#include "sdm/memory.h"
#include "template_internal.h"

static void add_lattice(sdm_text *t, const char *key, const sdm_lattice *l)
{
    const double v[7] = {l->n[0],      l->n[1],      l->n[2],   l->origin[0],
                         l->origin[1], l->origin[2], l->spacing};
    sdm_text_add_reals(t, key, v, 7);
}

// the lines that open_network() of template_open.c reads
static void describe(const sdm_template_spec *spec, sdm_text *t)
{
    sdm_model_describe(spec->info, sdm_kind_template.name, t);
    sdm_text_add(t, "template.degree=%zu\ntemplate.numbers=%zu\ntemplate.step=%d\n", spec->degree,
                 spec->n_numbers, SDM_TEMPLATE_STEP);
    sdm_text_add(t, "template.parts=%zu\n", spec->n_parts);
    for (size_t c = 0; c < spec->n_parts; c++) {
        const sdm_template_part *p = &spec->parts[c];
        sdm_text_add(t, "part.parent=%d\npart.frame=%d\n", p->parent, (int)p->frame);
        sdm_text_add_reals(t, "part.pivot", p->pivot, 3);
        sdm_text_add(t, "part.numbers=%zu\npart.modes=%zu\npart.amplitudes=%zu\n", p->numbers,
                     p->n_modes, p->amplitudes);
        if (p->n_modes) add_lattice(t, "part.warp", &p->warp);
        add_lattice(t, "part.near", &p->near);
        add_lattice(t, "part.far", &p->far);
        sdm_text_add_reals(t, "part.sag",
                           (const double[]){p->sag, p->sag_reach, p->far_sag, p->far_from}, 4);
    }
}

static float *append(float *to, const float *from, size_t n)
{
    if (n) memcpy(to, from, n * sizeof *to);
    return to + n;
}

sdm_status sdm_template_build(const sdm_template_spec *spec, uint8_t **bytes, size_t *size,
                              sdm_error *err)
{
    size_t n_modes = 0, n_nodes = 0;
    for (size_t c = 0; c < spec->n_parts; c++) {
        const sdm_template_part *p = &spec->parts[c];
        n_modes += 3 * p->n_modes * (p->n_modes ? sdm_lattice_count(&p->warp) : 0);
        n_nodes += 4 * (sdm_lattice_count(&p->near) + sdm_lattice_count(&p->far));
    }
    sdm_text text = {0};
    float *modes = NULL, *nodes = NULL;
    sdm_status s = SDM_ALLOC(&modes, n_modes, "model warps", err);
    if (!s) s = SDM_ALLOC(&nodes, n_nodes, "model templates", err);
    if (!s) {
        float *mode = modes, *node = nodes;
        for (size_t c = 0; c < spec->n_parts; c++) {
            const sdm_template_part *p = &spec->parts[c];
            if (p->n_modes)
                mode = append(mode, p->modes, 3 * p->n_modes * sdm_lattice_count(&p->warp));
            node = append(node, p->near_nodes, 4 * sdm_lattice_count(&p->near));
            node = append(node, p->far_nodes, 4 * sdm_lattice_count(&p->far));
        }
        describe(spec, &text);
        const sdm_section sections[] = {
            {"template.functions", spec->functions,
             spec->n_numbers * spec->n_terms * sizeof(double)},
            {"template.modes", modes, n_modes * sizeof *modes},
            {"template.nodes", nodes, n_nodes * sizeof *nodes},
            {"template.correction", spec->correction, spec->correction_size}};
        s = sdm_model_pack(spec->info, &text, sections, spec->correction ? 4 : 3, bytes, size, err);
    }
    sdm_text_dispose(&text);
    sdm_free(nodes);
    sdm_free(modes);
    return s;
}
