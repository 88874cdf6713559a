/* The ONNX file of a model: what all kinds of network share. */
#include "sdm/internal/model_onnx.h"

#include <stdio.h>

#include "model_kind.h"
#include "sdm/internal/json_describe.h"

// x[N][P] = the parameters scaled to [-1, 1]: (params - centre) * factor
static sdm_onnx_value scale(const sdm_model *m, sdm_onnx *g, sdm_onnx_value params)
{
    const size_t n = m->info.n_params;
    float *centre = sdm_onnx_memory(g, n, sizeof *centre),
          *factor = sdm_onnx_memory(g, n, sizeof *factor);
    if (!centre || !factor) return params;
    for (size_t i = 0; i < n; i++) {
        const sdm_model_param *p = &m->params[i];
        centre[i] = (float)(p->min + (p->max - p->min) / 2);
        factor[i] = (float)(2 / (p->max - p->min));
    }
    return sdm_onnx_node2(
        g, "Mul",
        sdm_onnx_node2(g, "Sub", params,
                       sdm_onnx_floats(g, "centres of the ranges", 1, &n, centre)),
        sdm_onnx_floats(g, "2 / widths of the ranges", 1, &n, factor));
}

sdm_onnx_value sdm_model_onnx_maps(const sdm_model *m, sdm_onnx *g, sdm_onnx_value rows)
{
    const int64_t *n = m->info.grid.n;
    return sdm_onnx_reshape(g, rows, 4, (const int64_t[]){-1, n[2], n[1], n[0]});
}

static void describe_params(const sdm_model_info *info, sdm_json *j)
{
    sdm_json_open(j, NULL, '[');
    for (size_t i = 0; i < info->n_params; i++) {
        const sdm_model_param *p = &info->params[i];
        sdm_json_open(j, NULL, '{');
        sdm_json_parameter(j, p->name, p->unit, p->min, p->max, p->def);
        sdm_json_close(j, '}');
    }
    sdm_json_close(j, ']');
}

// Adds a line of metadata and frees the JSON.
static bool add_json(sdm_onnx *g, const char *key, sdm_json *j)
{
    const bool done = !j->text.failed && j->text.data;
    if (done) sdm_onnx_metadata(g, key, j->text.data);
    sdm_json_dispose(j);
    return done;
}

static sdm_status describe(const sdm_model *m, sdm_onnx *g, sdm_error *err)
{
    const sdm_model_info *info = &m->info;
    char text[32];
    sdm_json grid = {0}, params = {0};
    sdm_onnx_metadata(g, "shape", info->shape);
    sdm_onnx_metadata(g, "kind", info->kind);
    sdm_onnx_metadata(g, "unit", "mm");
    sdm_onnx_metadata(g, "sign", "negative inside");
    sdm_onnx_metadata(g, "frame", "LPS");
    sdm_onnx_metadata(g, "rmse_mm", sdm_format_real(info->accuracy.rmse_mm, text));
    snprintf(text, sizeof text, "%016llx", (unsigned long long)info->checksum);
    sdm_onnx_metadata(g, "model", text);
    sdm_json_grid(&grid, NULL, &info->grid, true);
    describe_params(info, &params);
    const bool grid_done = add_json(g, "grid", &grid),
               params_done = add_json(g, "parameters", &params);
    return grid_done && params_done ? SDM_OK
                                    : sdm_fail(err, SDM_E_NOMEM, "out of memory for the metadata");
}

sdm_status sdm_model_write_onnx(const sdm_model *m, const char *path, sdm_error *err)
{
    const size_t dims[] = {(size_t)m->info.grid.n[2], (size_t)m->info.grid.n[1],
                           (size_t)m->info.grid.n[0]};
    sdm_onnx *g;
    sdm_onnx_value params;
    sdm_status s = sdm_onnx_create(m->info.n_params, &g, &params, err);
    if (s) return s;
    const sdm_onnx_value maps = m->kind->onnx(m, g, scale(m, g, params));
    s = describe(m, g, err);
    if (!s) s = sdm_onnx_write(g, path, maps, dims, err);
    sdm_onnx_free(g);
    return s;
}
