/* Opens a template model: reads parts and arrays, and checks every size before it is used. */
#include <math.h>
#include <string.h>

#include "sdm/memory.h"
#include "template_internal.h"

static void read_lattice(sdm_lines *lines, const char *key, uint32_t least, sdm_lattice *l)
{
    double v[7] = {0};
    sdm_lines_reals(lines, key, v, 7);
    for (int a = 0; a < 3; a++) {
        if (!(v[a] >= least && v[a] <= SDM_TEMPLATE_MAX_SIDE && fabs(v[3 + a]) <= 1e9))
            lines->failed = true;
        l->n[a] = lines->failed ? least : (uint32_t)v[a];
        l->origin[a] = v[3 + a];
    }
    if ((uint64_t)l->n[0] * l->n[1] * l->n[2] > SDM_TEMPLATE_MAX_NODES) lines->failed = true;
    l->spacing = v[6];
    if (!(l->spacing > 1e-9 && l->spacing < 1e9)) lines->failed = true;
}

static void read_part(sdm_lines *lines, size_t index, size_t n_numbers, sdm_template_part *p)
{
    p->parent = (int)sdm_lines_int(lines, "part.parent", -1, (int64_t)index - 1);
    p->frame = (sdm_template_frame)sdm_lines_int(lines, "part.frame", 0, SDM_FRAME_AFFINE);
    sdm_lines_reals(lines, "part.pivot", p->pivot, 3);
    p->numbers = (size_t)sdm_lines_int(lines, "part.numbers", 0, 1 << 20);
    p->n_modes = (size_t)sdm_lines_int(lines, "part.modes", 0, SDM_TEMPLATE_MAX_MODES);
    p->amplitudes = (size_t)sdm_lines_int(lines, "part.amplitudes", 0, 1 << 20);
    if (p->n_modes) read_lattice(lines, "part.warp", 4, &p->warp);
    read_lattice(lines, "part.near", 2, &p->near);
    read_lattice(lines, "part.far", 2, &p->far);
    double sag[4] = {0};
    sdm_lines_reals(lines, "part.sag", sag, 4);
    p->sag = sag[0], p->sag_reach = sag[1], p->far_sag = sag[2], p->far_from = sag[3];
    for (int i = 0; i < 4; i++)
        if (!(sag[i] >= 0)) lines->failed = true;
    for (int a = 0; a < 3; a++)
        if (!(fabs(p->pivot[a]) <= 1e9)) lines->failed = true;
    if (p->numbers + sdm_template_frame_numbers(p->frame) > n_numbers ||
        p->amplitudes + p->n_modes > n_numbers)
        lines->failed = true;
}

static template_level level_of(const sdm_lattice *l, const sdm_lattice *near, const float *nodes)
{
    template_level out = {.nodes = nodes,
                          .half = (float)(l->spacing / 2),
                          .scale = (float)(near->spacing / l->spacing)};
    for (int a = 0; a < 3; a++) {
        out.n[a] = (int32_t)l->n[a];
        out.offset[a] = (float)((near->origin[a] - l->origin[a]) / l->spacing);
    }
    return out;
}

// Points the parts to their arrays in the file.
static sdm_status bind_arrays(sdm_model *m, const sdm_section *sections, size_t n, sdm_error *err)
{
    template_network *k = m->network;
    uint64_t modes = 0, nodes = 0;
    for (size_t c = 0; c < k->n_parts; c++) {
        const sdm_template_part *p = &k->parts[c];
        if (p->n_modes) modes += (uint64_t)3 * p->n_modes * sdm_lattice_count(&p->warp);
        nodes += UINT64_C(4) * (sdm_lattice_count(&p->near) + sdm_lattice_count(&p->far));
    }
    k->functions = sdm_model_weights(m, sections, n, "template.functions", SDM_NUMBER_FLOAT64,
                                     (uint64_t)k->n_numbers * k->n_terms, err);
    if (!k->functions) return SDM_E_FORMAT;
    const float *mode =
        sdm_model_weights(m, sections, n, "template.modes", SDM_NUMBER_FLOAT32, modes, err);
    if (!mode) return SDM_E_FORMAT;
    const float *node =
        sdm_model_weights(m, sections, n, "template.nodes", SDM_NUMBER_FLOAT32, nodes, err);
    if (!node) return SDM_E_FORMAT;
    for (size_t c = 0; c < k->n_parts; c++) {
        sdm_template_part *p = &k->parts[c];
        p->modes = mode;
        mode += 3 * p->n_modes * (p->n_modes ? sdm_lattice_count(&p->warp) : 0);
        p->near_nodes = node;
        node += 4 * sdm_lattice_count(&p->near);
        p->far_nodes = node;
        node += 4 * sdm_lattice_count(&p->far);
        k->near[c] = level_of(&p->near, &p->near, p->near_nodes);
        k->far[c] = level_of(&p->far, &p->near, p->far_nodes);
    }
    return SDM_OK;
}

// Opens the correction, a model file of its own within a section.
static sdm_status open_correction(sdm_model *m, const sdm_section *sections, size_t n,
                                  sdm_error *err)
{
    static const sdm_model_kind *const kinds[] = {&sdm_kind_pod, NULL};
    template_network *k = m->network;
    const sdm_section *s = sdm_section_find(sections, n, "template.correction");
    if (!s) return SDM_OK;
    uint8_t *copy = NULL;
    sdm_status status = SDM_ALLOC(&copy, s->size, "model correction", err);
    if (status) return status;
    memcpy(copy, s->data, s->size);
    status = sdm_model_read(copy, s->size, kinds, &k->correction, err);
    if (status) return sdm_fail_in(err, status, "correction");
    const sdm_model_info *i = &k->correction->info;
    bool fits =
        i->n_params == m->info.n_params && k->n_parts == 1 && sdm_grid_count(&i->grid) <= INT32_MAX;
    for (size_t p = 0; p < i->n_params && fits; p++)
        fits =
            i->params[p].min == m->info.params[p].min && i->params[p].max == m->info.params[p].max;
    for (int a = 0; a < 3; a++)
        fits &= i->grid.n[a] >= 2 && i->grid.spacing[a] == i->grid.spacing[0];
    for (int a = 0; a < 9; a++) fits &= i->grid.dir[a] == (a % 4 == 0);
    if (!fits) return sdm_fail(err, SDM_E_FORMAT, "damaged: the correction is for another model");
    m->info.weight_bytes += i->weight_bytes;
    m->info.macs += i->macs;
    template_correction *c = &k->correction_lattice;
    c->scale = (float)(k->parts[0].near.spacing / i->grid.spacing[0]);
    for (int a = 0; a < 3; a++) {
        c->n[a] = (int32_t)i->grid.n[a];
        c->offset[a] =
            (float)((k->parts[0].near.origin[a] - i->grid.origin[a]) / i->grid.spacing[0]);
    }
    return SDM_OK;
}

// Weights of the stations for the voxels between them.
static void expansion_set_up(template_network *k)
{
    for (size_t i = 0; i < SDM_TEMPLATE_STEP; i++) {
        const double t = (double)i / SDM_TEMPLATE_STEP, s = 1 - t;
        k->expansion.cubic[0][i] = (float)(s * s * s / 6);
        k->expansion.cubic[1][i] = (float)((3 * t * t * t - 6 * t * t + 4) / 6);
        k->expansion.cubic[2][i] = (float)((3 * s * s * s - 6 * s * s + 4) / 6);
        k->expansion.cubic[3][i] = (float)(t * t * t / 6);
        k->expansion.linear[i] = (float)t;
    }
}

// Refuses a grid whose stations would not fit into memory together with those of all derivatives.
static sdm_status check_stations(const sdm_model *m, sdm_error *err)
{
    const template_network *k = m->network;
    double bytes = sizeof(template_station) + 12 * sizeof(float) * (1 + (double)m->info.n_params);
    for (int a = 0; a < 3; a++) bytes *= (double)k->stations[a];
    if (bytes * SDM_TEMPLATE_MAX_PARTS < (double)(SIZE_MAX / 4)) return SDM_OK;
    return sdm_fail(err, SDM_E_NOMEM, "the grid has more voxels than memory can hold");
}

// A rough count: per voxel and part the interpolation, per station the inverse of the warp.
static double count_macs(const template_network *k, const sdm_grid *grid)
{
    double n = (double)k->n_numbers * (double)k->n_terms + 60 * (double)sdm_grid_count(grid);
    for (size_t c = 0; c < k->n_parts; c++)
        if (k->parts[c].n_modes)
            n += 3 * (double)k->parts[c].n_modes * (double)sdm_lattice_count(&k->parts[c].warp) +
                 600 * (double)k->stations[0] * (double)k->stations[1] * (double)k->stations[2];
    return n;
}

static sdm_status open_network(sdm_model *m, sdm_lines *lines, const sdm_section *sections,
                               size_t n, sdm_error *err)
{
    template_network *k = NULL;
    sdm_status s = SDM_ALLOC(&k, 1, "model", err);
    if (s) return s;
    m->network = k;
    k->degree = (size_t)sdm_lines_int(lines, "template.degree", 0, 12);
    k->n_numbers = (size_t)sdm_lines_int(lines, "template.numbers", 0, 1 << 20);
    sdm_lines_int(lines, "template.step", SDM_TEMPLATE_STEP, SDM_TEMPLATE_STEP);
    k->n_parts = (size_t)sdm_lines_int(lines, "template.parts", 1, SDM_TEMPLATE_MAX_PARTS);
    for (size_t c = 0; c < k->n_parts && !lines->failed; c++)
        read_part(lines, c, k->n_numbers, &k->parts[c]);
    if ((s = sdm_lines_check(lines, err))) return s;
    k->n_terms = sdm_poly_count(m->info.n_params, k->degree);
    if (k->n_terms > 1u << 20)
        return sdm_fail(err, SDM_E_FORMAT, "damaged: polynomials of degree %zu", k->degree);
    // stations: one before the grid, one after it
    for (int a = 0; a < 3; a++)
        k->stations[a] = ((size_t)m->info.grid.n[a] - 1) / SDM_TEMPLATE_STEP + 4;
    if ((s = check_stations(m, err))) return s;
    if ((s = SDM_ALLOC(&k->exponents, k->n_terms * m->info.n_params, "model polynomials", err)))
        return s;
    sdm_poly_table(m->info.n_params, k->degree, k->exponents);
    expansion_set_up(k);
    if ((s = bind_arrays(m, sections, n, err))) return s;
    m->info.macs = count_macs(k, &m->info.grid);
    return open_correction(m, sections, n, err);
}

static void network_free(void *network)
{
    template_network *k = network;
    if (!k) return;
    sdm_model_free(k->correction);
    sdm_free(k->exponents);
    sdm_free(k);
}

const sdm_model_kind sdm_kind_template = {.name = "template",
                                          .open = open_network,
                                          .dispose = network_free,
                                          .scratch_bytes = sdm_template_scratch_bytes,
                                          .forward = sdm_template_forward,
                                          .jacobian_scratch_bytes =
                                              sdm_template_jacobian_scratch_bytes,
                                          .jacobian = sdm_template_jacobian,
                                          .jvp_scratch_bytes = sdm_template_jvp_scratch_bytes,
                                          .jvp = sdm_template_jvp,
                                          .vjp_scratch_bytes = sdm_template_vjp_scratch_bytes,
                                          .vjp = sdm_template_vjp,
                                          .onnx = sdm_template_onnx};
