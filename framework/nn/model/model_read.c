/* Reads a model file: finds the kind of network and checks every text and size before it is
   used. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model_kind.h"
#include "sdm/internal/distribution.h"
#include "sdm/internal/near.h"
#include "sdm/memory.h"

#define MODEL_PARAMS_MAX 64

static const sdm_model_kind *kind_find(const sdm_model_kind *const *kinds, const char *name)
{
    for (; *kinds; kinds++)
        if (strcmp((*kinds)->name, name) == 0) return *kinds;
    return NULL;
}

// Returns a NUL-terminated copy of s[n]; NULL if *status is an error or the allocation fails, which
// sets *status.
static char *copy_text(const char *s, size_t n, sdm_error *err, sdm_status *status)
{
    char *out = NULL;
    if (*status) return NULL;
    if ((*status = SDM_ALLOC(&out, n + 1, "model text", err))) return NULL;
    memcpy(out, s, n);
    return out;
}

static void read_accuracy(sdm_lines *r, sdm_accuracy *a)
{
    a->samples = sdm_lines_int(r, "accuracy.samples", 0, INT64_MAX);
    a->mse_mm2 = sdm_lines_real(r, "accuracy.mse_mm2");
    a->rmse_mm = sdm_lines_real(r, "accuracy.rmse_mm");
    a->mae_mm = sdm_lines_real(r, "accuracy.mae_mm");
    a->max_abs_mm = sdm_lines_real(r, "accuracy.max_abs_mm");
    a->rmse_near_mm = sdm_lines_real(r, "accuracy.rmse_near_mm");
    a->near_mm = sdm_lines_next_is(r, "accuracy.near_mm") ? sdm_lines_real(r, "accuracy.near_mm")
                                                          : SDM_NEAR_MM_BEFORE;
    double q[3] = {0};
    sdm_lines_reals(r, "accuracy.quantiles_mm", q, 3);
    a->q50_mm = q[0], a->q90_mm = q[1], a->q99_mm = q[2];
}

// Reads the distribution of a parameter: a line if it is normal, none if it is uniform.
static void read_distribution(sdm_lines *r, sdm_model_param *p)
{
    double normal[2] = {0};
    if (!sdm_lines_next_is(r, "param.normal")) return;
    sdm_lines_reals(r, "param.normal", normal, 2);
    p->distribution = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, normal[0], normal[1]};
    if (sdm_distribution_check(&p->distribution, p->min, p->max, NULL)) r->failed = true;
}

// reads the parameters and options of the shape
static sdm_status read_params(sdm_lines *r, sdm_model *m, sdm_error *err)
{
    m->info.n_params = (size_t)sdm_lines_int(r, "params", 1, MODEL_PARAMS_MAX);
    sdm_status s = SDM_ALLOC(&m->params, m->info.n_params, "model parameters", err);
    if (s) return s;
    m->info.params = m->params;
    for (size_t i = 0; i < m->info.n_params; i++) {
        sdm_model_param *p = &m->params[i];
        double range[3] = {0};
        sdm_lines_text(r, "param.name", p->name, sizeof p->name);
        sdm_lines_text(r, "param.unit", p->unit, sizeof p->unit);
        sdm_lines_reals(r, "param.range", range, 3);
        p->min = range[0], p->max = range[1], p->def = range[2];
        const double unit = 2 / (p->max - p->min); // factor by which networks scale parameters
        if (!(p->min < p->max && unit > 0 && isfinite(unit)) || !p->name[0]) r->failed = true;
        read_distribution(r, p);
    }

    // options
    const size_t n = (size_t)sdm_lines_int(r, "options", 0, 1024);
    if ((s = SDM_ALLOC(&m->option_names, n, "model options", err))) return s;
    if ((s = SDM_ALLOC(&m->option_values, n, "model options", err))) return s;
    for (; m->info.n_options < n && !s && !r->failed; m->info.n_options++) {
        sdm_lines_value(r, "option.name");
        m->option_names[m->info.n_options] = copy_text(r->value, strlen(r->value), err, &s);
        sdm_lines_value(r, "option.value");
        m->option_values[m->info.n_options] = copy_text(r->value, strlen(r->value), err, &s);
    }
    m->info.option_names = (const char *const *)m->option_names;
    m->info.option_values = (const char *const *)m->option_values;
    return s;
}

// Reads the lines with which the description of every kind begins.
static sdm_status read_description(sdm_lines *r, const sdm_model_kind *const *kinds, sdm_model *m,
                                   sdm_error *err)
{
    sdm_model_info *i = &m->info;
    sdm_lines_text(r, "kind", i->kind, sizeof i->kind);
    m->kind = kind_find(kinds, i->kind);
    if (!m->kind)
        return sdm_fail(err, SDM_E_FORMAT,
                        "unknown kind of network '%s': damaged, or made by a newer version",
                        r->failed ? "?" : i->kind);

    // provenance and grid
    sdm_lines_text(r, "version", i->version, sizeof i->version);
    sdm_lines_text(r, "shape", i->shape, sizeof i->shape);
    double n[3] = {0};
    sdm_lines_reals(r, "grid.size", n, 3);
    sdm_lines_reals(r, "grid.origin", i->grid.origin, 3);
    sdm_lines_reals(r, "grid.spacing", i->grid.spacing, 3);
    sdm_lines_reals(r, "grid.direction", i->grid.dir, 9);
    for (int a = 0; a < 3; a++) {
        if (!(n[a] >= 1 && n[a] <= 1048576)) r->failed = true;
        i->grid.n[a] = r->failed ? 1 : (int64_t)n[a];
    }
    sdm_lines_value(r, "unit"); // unit, sign and frame are the same in all files
    sdm_lines_value(r, "sign");
    sdm_lines_value(r, "frame");

    // parameters, options, accuracy, training
    sdm_status s = read_params(r, m, err);
    if (s) return s;
    read_accuracy(r, &i->accuracy);
    char seed[32];
    sdm_lines_text(r, "seed", seed, sizeof seed);
    i->seed = strtoull(seed, NULL, 10);
    i->train_seconds = sdm_lines_real(r, "train.seconds");
    i->train_samples = sdm_lines_int(r, "train.samples", 0, INT64_MAX);
    s = sdm_lines_check(r, err);
    if (!s && sdm_grid_check(&i->grid, err)) s = SDM_E_FORMAT;
    return s;
}

sdm_status sdm_model_read(uint8_t *bytes, size_t size, const sdm_model_kind *const *kinds,
                          sdm_model **out, sdm_error *err)
{
    sdm_model *m = NULL;
    sdm_status s = SDM_ALLOC(&m, 1, "model", err);
    if (s) {
        sdm_free(bytes);
        return s;
    }
    m->file = bytes;
    m->info.file_bytes = size;

    // sections
    sdm_section sections[SDM_CONTAINER_MAX_SECTIONS];
    char names[SDM_CONTAINER_MAX_SECTIONS][24];
    size_t n = 0;
    s = sdm_container_parse(bytes, size, sections, names, &n, &m->info.checksum, err);
    const sdm_section *meta = s ? NULL : sdm_section_find(sections, n, "meta");
    const sdm_section *config = s ? NULL : sdm_section_find(sections, n, "config");
    if (!s && meta && sdm_section_find(sections, n, "checkpoint"))
        s = sdm_fail(err, SDM_E_FORMAT,
                     "a checkpoint, not a finished model: go on with `sdmgen train --resume`");
    if (!s && sdm_section_find(sections, n, "shard"))
        s = sdm_fail(err, SDM_E_FORMAT,
                     "a shard of maps, not a model: `sdmgen train --dataset` takes its folder");
    if (!s && (!meta || !config))
        s = sdm_fail(err, SDM_E_FORMAT, "damaged: a section of a model is missing");

    // description and configuration, then the weights, which depend on the kind of network
    sdm_lines lines = {0};
    if (!s) {
        lines.at = meta->data;
        lines.end = lines.at + meta->size;
        s = read_description(&lines, kinds, m, err);
    }
    if (!s) m->config = copy_text(config->data, config->size, err, &s);
    m->info.config = m->config;
    if (!s) s = m->kind->open(m, &lines, sections, n, err);
    if (!s) s = sdm_fine_open(m, sections, n, err);
    if (!s) s = sdm_quality_read(sdm_section_find(sections, n, "quality"), &m->info.quality, err);
    if (s)
        sdm_model_free(m);
    else
        *out = m;
    return s;
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
    sdm_free(m->folder);
    if (m->kind) m->kind->dispose(m->network);
    sdm_free(m->file);
    sdm_free(m);
}
