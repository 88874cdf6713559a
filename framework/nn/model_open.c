/* Opening of a model file: every text and size is checked before it is used. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model_internal.h"
#include "sdm/container.h"
#include "sdm/file.h"
#include "sdm/kernels.h"
#include "sdm/memory.h"
#include "sdm/text.h"

#define MODEL_BYTES_MAX ((size_t)16 << 30)

// reads the "key=value" lines of the meta section in their fixed order; after a failure every further read fails
typedef struct reader {
    const char *at, *end;
    char value[1100];
    bool failed;
    char wanted[64];
} reader;

static const char *next(reader *r, const char *key)
{
    const size_t n = strlen(key);
    if (r->failed) return "";
    snprintf(r->wanted, sizeof r->wanted, "%s", key);
    const char *line_end = r->at < r->end ? memchr(r->at, '\n', (size_t)(r->end - r->at)) : NULL;
    r->failed = !line_end || (size_t)(line_end - r->at) < n + 1 || memcmp(r->at, key, n) || r->at[n] != '=' ||
                (size_t)(line_end - r->at) - n - 1 >= sizeof r->value;
    if (r->failed) return "";
    const size_t length = (size_t)(line_end - r->at) - n - 1;
    memcpy(r->value, r->at + n + 1, length);
    r->value[length] = '\0';
    r->at = line_end + 1;
    return r->value;
}

static void next_reals(reader *r, const char *key, double *out, size_t n)
{
    next(r, key);
    char *word = r->value;
    for (size_t i = 0; i < n && !r->failed; i++) {
        char *space = strchr(word, ' ');
        if (space) *space = '\0';
        r->failed = (i + 1 < n) != (space != NULL) || !sdm_parse_real(word, &out[i]);
        word = space ? space + 1 : word;
    }
}

static double next_real(reader *r, const char *key)
{
    double v = 0;
    next_reals(r, key, &v, 1);
    return v;
}

static int64_t next_int(reader *r, const char *key, int64_t min, int64_t max)
{
    int64_t v = min;
    next(r, key);
    if (!r->failed) r->failed = !sdm_parse_int(r->value, &v) || v < min || v > max;
    return r->failed ? min : v;
}

static void next_text(reader *r, const char *key, char *out, size_t size)
{
    next(r, key);
    if (!r->failed) r->failed = strlen(r->value) >= size;
    snprintf(out, size, "%.*s", (int)size - 1, r->failed ? "" : r->value);
}

static char *copy_text(const char *s, size_t n, sdm_error *err, sdm_status *status)
{
    char *out = NULL;
    if (*status) return NULL;
    if ((*status = SDM_ALLOC(&out, n + 1, "model text", err))) return NULL;
    memcpy(out, s, n);
    return out;
}

static void read_accuracy(reader *r, sdm_accuracy *a)
{
    a->samples = next_int(r, "accuracy.samples", 0, INT64_MAX);
    a->mse_mm2 = next_real(r, "accuracy.mse_mm2");
    a->rmse_mm = next_real(r, "accuracy.rmse_mm");
    a->mae_mm = next_real(r, "accuracy.mae_mm");
    a->max_abs_mm = next_real(r, "accuracy.max_abs_mm");
    a->rmse_near_mm = next_real(r, "accuracy.rmse_near_mm");
    double q[3] = {0};
    next_reals(r, "accuracy.quantiles_mm", q, 3);
    a->q50_mm = q[0], a->q90_mm = q[1], a->q99_mm = q[2];
}

static sdm_status read_params(reader *r, sdm_model *m, sdm_error *err)
{
    m->info.n_params = (size_t)next_int(r, "params", 1, SDM_POD_MAX_PARAMS);
    sdm_status s = SDM_ALLOC(&m->params, m->info.n_params, "model parameters", err);
    if (s) return s;
    m->info.params = m->params;
    for (size_t i = 0; i < m->info.n_params; i++) {
        sdm_model_param *p = &m->params[i];
        double range[3] = {0};
        next_text(r, "param.name", p->name, sizeof p->name);
        next_text(r, "param.unit", p->unit, sizeof p->unit);
        next_reals(r, "param.range", range, 3);
        p->min = range[0], p->max = range[1], p->def = range[2];
        if (!(p->min < p->max)) r->failed = true;
    }
    const size_t n = (size_t)next_int(r, "options", 0, 1024);
    if ((s = SDM_ALLOC(&m->option_names, n, "model options", err))) return s;
    if ((s = SDM_ALLOC(&m->option_values, n, "model options", err))) return s;
    for (; m->info.n_options < n && !s && !r->failed; m->info.n_options++) {
        next(r, "option.name");
        m->option_names[m->info.n_options] = copy_text(r->value, strlen(r->value), err, &s);
        next(r, "option.value");
        m->option_values[m->info.n_options] = copy_text(r->value, strlen(r->value), err, &s);
    }
    m->info.option_names = (const char *const *)m->option_names;
    m->info.option_values = (const char *const *)m->option_values;
    return s;
}

static sdm_status read_meta(const sdm_section *meta, sdm_model *m, sdm_error *err)
{
    sdm_model_info *i = &m->info;
    reader r = {.at = meta->data, .end = (const char *)meta->data + meta->size};
    next_text(&r, "kind", i->kind, sizeof i->kind);
    if (r.failed || strcmp(i->kind, "pod") != 0)
        return sdm_fail(err, SDM_E_FORMAT, "not a model of kind 'pod' but '%s'", r.failed ? "?" : i->kind);
    next_text(&r, "version", i->version, sizeof i->version);
    next_text(&r, "shape", i->shape, sizeof i->shape);
    double n[3] = {0};
    next_reals(&r, "grid.size", n, 3);
    next_reals(&r, "grid.origin", i->grid.origin, 3);
    next_reals(&r, "grid.spacing", i->grid.spacing, 3);
    next_reals(&r, "grid.direction", i->grid.dir, 9);
    for (int a = 0; a < 3; a++) {
        if (!(n[a] >= 1 && n[a] <= 1048576)) r.failed = true;
        i->grid.n[a] = r.failed ? 1 : (int64_t)n[a];
    }
    next(&r, "unit");
    next(&r, "sign");
    next(&r, "frame");
    sdm_status s = read_params(&r, m, err);
    if (s) return s;
    read_accuracy(&r, &i->accuracy);
    char seed[32];
    next_text(&r, "seed", seed, sizeof seed);
    i->seed = strtoull(seed, NULL, 10);
    i->train_seconds = next_real(&r, "train.seconds");
    i->train_samples = next_int(&r, "train.samples", 0, INT64_MAX);
    sdm_pod_arch *a = &m->arch;
    a->n_params = i->n_params;
    a->degree = (size_t)next_int(&r, "pod.degree", 0, 12);
    a->input_degree = (size_t)next_int(&r, "pod.input_degree", 1, 12);
    a->depth = (size_t)next_int(&r, "pod.depth", 0, SDM_POD_MAX_DEPTH);
    a->width = (size_t)next_int(&r, "pod.width", 1, 65536);
    a->activation = (int)next_int(&r, "pod.activation", 0, 2);
    m->half = next_int(&r, "pod.half", 0, 1) != 0;
    a->block = (size_t)next_int(&r, "pod.block", 1, 64);
    if (r.failed) return sdm_fail(err, SDM_E_FORMAT, "damaged: the description lacks a valid '%s'", r.wanted);
    return SDM_OK;
}

// blocks from grid and ranks; sizes that follow from the architecture
static sdm_status set_up(const sdm_section *ranks, sdm_model *m, sdm_error *err)
{
    sdm_pod_arch *a = &m->arch;
    sdm_status s = sdm_grid_check(&m->info.grid, err);
    if (s) return SDM_E_FORMAT;
    const size_t terms = sdm_poly_count(a->n_params, a->degree), inputs = sdm_poly_count(a->n_params, a->input_degree);
    a->n_blocks = sdm_pod_block_count(&m->info.grid, a->block);
    if (terms > 1u << 20 || inputs > 1u << 20 || ranks->size / 4 != a->n_blocks || ranks->size % 4)
        return sdm_fail(err, SDM_E_FORMAT, "damaged: %zu ranks of blocks, the grid has %zu blocks", ranks->size / 4,
                        a->n_blocks);
    a->n_terms = terms;
    a->n_inputs = inputs - 1;
    a->n_latent = terms + (a->depth ? a->width : 0);
    a->n_voxels = sdm_grid_count(&m->info.grid);
    if ((s = SDM_ALLOC(&m->blocks, a->n_blocks, "model blocks", err))) return s;
    sdm_pod_blocks(&m->info.grid, a->block, m->blocks);
    const uint8_t *p = ranks->data;
    for (size_t b = 0; b < a->n_blocks; b++, p += 4) {
        sdm_pod_block *k = &m->blocks[b];
        k->rank = (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
        const size_t voxels = sdm_pod_block_voxels(k);
        if (k->rank > voxels)
            return sdm_fail(err, SDM_E_FORMAT, "damaged: rank %u of a block of %zu voxels", k->rank, voxels);
        k->coefficient = (uint32_t)a->n_coefficients;
        a->n_coefficients += k->rank;
        if (voxels > m->max_block_voxels) m->max_block_voxels = voxels;
        if (k->rank > m->max_rank) m->max_rank = k->rank;
    }
    if (a->n_coefficients < 1 || a->n_coefficients > 1u << 30)
        return sdm_fail(err, SDM_E_FORMAT, "damaged: %zu coefficients", a->n_coefficients);
    const size_t poly = inputs > terms ? inputs : terms;
    const size_t degree = a->degree > a->input_degree ? a->degree : a->input_degree;
    if ((s = SDM_ALLOC(&m->exponents, poly * a->n_params, "model polynomials", err))) return s;
    sdm_poly_table(a->n_params, degree, m->exponents);
    return SDM_OK;
}

static const sdm_section *find(const sdm_section *sections, size_t n, const char *name)
{
    for (size_t i = 0; i < n; i++)
        if (strcmp(sections[i].name, name) == 0) return &sections[i];
    return NULL;
}

static sdm_status bind_weights(const sdm_section *sections, size_t n, sdm_model *m, sdm_error *err)
{
    const sdm_pod_arch *a = &m->arch;
    const size_t weight = m->half ? sizeof(uint16_t) : sizeof(float);
    const struct {
        const char *name;
        size_t size;
    } need[] = {
        {"pod.mlp", sdm_pod_mlp_floats(a) * sizeof(float)},
        {"pod.head", sdm_tiled_count(a->n_coefficients, a->n_latent) * weight},
        {"pod.basis", sdm_pod_basis_count(m->blocks, a->n_blocks) * weight},
        {"pod.mean", a->n_voxels * sizeof(float)},
    };
    const void *data[4];
    for (int i = 0; i < 4; i++) {
        const sdm_section *s = find(sections, n, need[i].name);
        if (!s) return sdm_fail(err, SDM_E_FORMAT, "damaged: it has no section '%s'", need[i].name);
        if (s->size != need[i].size)
            return sdm_fail(err, SDM_E_FORMAT, "damaged: section '%s' has %zu bytes, need %zu", need[i].name, s->size,
                            need[i].size);
        data[i] = s->data;
        m->info.weight_bytes += s->size;
    }
    const float *mlp = data[0];
    for (size_t l = 0; l < a->depth; l++) {
        m->layer[l] = mlp;
        mlp += sdm_tiled_count(a->width, sdm_pod_layer_inputs(a, l));
        m->bias[l] = mlp;
        mlp += sdm_tiled_count(a->width, 1);
    }
    m->head = data[1];
    m->basis = data[2];
    m->mean = data[3];
    return SDM_OK;
}

// takes over `bytes`
static sdm_status open_bytes(uint8_t *bytes, size_t size, sdm_model **out, sdm_error *err)
{
    sdm_model *m = NULL;
    sdm_status s = SDM_ALLOC(&m, 1, "model", err);
    if (s) {
        sdm_free(bytes);
        return s;
    }
    m->file = bytes;
    m->info.file_bytes = size;
    sdm_section sections[SDM_CONTAINER_MAX_SECTIONS];
    char names[SDM_CONTAINER_MAX_SECTIONS][24];
    size_t n = 0;
    s = sdm_container_parse(bytes, size, sections, names, &n, &m->info.checksum, err);
    const sdm_section *meta = s ? NULL : find(sections, n, "meta"), *config = s ? NULL : find(sections, n, "config");
    const sdm_section *ranks = s ? NULL : find(sections, n, "pod.ranks");
    if (!s && meta && find(sections, n, "checkpoint"))
        s = sdm_fail(err, SDM_E_FORMAT, "a checkpoint, not a finished model: go on with `sdmgen train --resume`");
    if (!s && (!meta || !config || !ranks)) s = sdm_fail(err, SDM_E_FORMAT, "damaged: a section of a model is missing");
    if (!s) s = read_meta(meta, m, err);
    if (!s) m->config = copy_text(config->data, config->size, err, &s);
    m->info.config = m->config;
    if (!s) s = set_up(ranks, m, err);
    if (!s) s = bind_weights(sections, n, m, err);
    if (s)
        sdm_model_free(m);
    else
        *out = m;
    return s;
}

sdm_status sdm_model_open_memory(const char *name, const uint8_t *bytes, size_t size, sdm_model **out, sdm_error *err)
{
    *out = NULL;
    uint8_t *copy = NULL;
    sdm_status s = SDM_ALLOC(&copy, size, "model file", err);
    if (s) return s;
    memcpy(copy, bytes, size);
    s = open_bytes(copy, size, out, err);
    return s ? sdm_fail_in(err, s, "%s", name) : SDM_OK;
}

sdm_status sdm_model_open(const char *path, sdm_model **out, sdm_error *err)
{
    *out = NULL;
    uint8_t *bytes;
    size_t size;
    sdm_status s = sdm_file_read(path, MODEL_BYTES_MAX, &bytes, &size, err);
    if (s) return s;
    s = open_bytes(bytes, size, out, err);
    return s ? sdm_fail_in(err, s, "%s", path) : SDM_OK;
}

void sdm_model_free(sdm_model *m)
{
    if (!m) return;
    for (size_t i = 0; i < m->info.n_options; i++) {
        sdm_free(m->option_names[i]);
        sdm_free(m->option_values[i]);
    }
    sdm_free(m->option_names);
    sdm_free(m->option_values);
    sdm_free(m->params);
    sdm_free(m->config);
    sdm_free(m->blocks);
    sdm_free(m->exponents);
    sdm_free(m->file);
    sdm_free(m);
}

const sdm_model_info *sdm_model_get_info(const sdm_model *m) { return &m->info; }
