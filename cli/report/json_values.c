/* Adds vectors, parameters and grids to JSON texts, and writes JSON files. */
#include "json_values.h"

#include "sdm/internal/file.h"

void cli_json_reals(sdm_json *json, const char *key, const double *v, size_t n)
{
    sdm_json_open(json, key, '[');
    for (size_t i = 0; i < n; i++) sdm_json_real(json, NULL, v[i]);
    sdm_json_close(json, ']');
}

void cli_json_params(sdm_json *json, const char *key, const sdm_param *params, size_t n,
                     const double *values)
{
    sdm_json_open(json, key, '{');
    for (size_t i = 0; i < n; i++) sdm_json_real(json, params[i].name, values[i]);
    sdm_json_close(json, '}');
}

void cli_json_distribution(sdm_json *json, const sdm_distribution *d)
{
    const bool normal = d->kind == SDM_DISTRIBUTION_NORMAL;
    sdm_json_text(json, "distribution", normal ? "normal" : "uniform");
    if (!normal) return;
    sdm_json_real(json, "mean", d->mean);
    sdm_json_real(json, "deviation", d->deviation);
}

void cli_json_grid(sdm_json *json, const char *key, const sdm_grid *g, bool with_direction)
{
    sdm_json_open(json, key, '{');
    sdm_json_open(json, "size", '[');
    for (int i = 0; i < 3; i++) sdm_json_int(json, NULL, g->n[i]);
    sdm_json_close(json, ']');
    cli_json_reals(json, "spacing", g->spacing, 3);
    cli_json_reals(json, "origin", g->origin, 3);
    if (with_direction) cli_json_reals(json, "direction", g->dir, 9);
    sdm_json_close(json, '}');
}

sdm_status cli_json_write(const sdm_json *json, const char *path, sdm_error *err)
{
    if (json->text.failed) return sdm_fail(err, SDM_E_NOMEM, "%s: out of memory", path);
    sdm_outfile *file = NULL;
    sdm_status s = sdm_outfile_open(path, &file, err);
    if (!s) s = sdm_outfile_printf(file, err, "%s\n", json->text.data);
    if (!s) return sdm_outfile_commit(&file, err);
    sdm_outfile_discard(&file);
    return s;
}
