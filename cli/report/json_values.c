/* JSON of values of parameters and of models, and JSON files (json_values.h). */
#include "json_values.h"

#include "sdm/internal/file.h"

void cli_json_params(sdm_json *json, const char *key, const sdm_param *params, size_t n,
                     const double *values)
{
    sdm_json_open(json, key, '{');
    for (size_t i = 0; i < n; i++) sdm_json_real(json, params[i].name, values[i]);
    sdm_json_close(json, '}');
}

void cli_json_model_params(sdm_json *json, const sdm_model_info *m, const sdm_param *of_shape)
{
    sdm_json_open(json, "parameters", '[');
    for (size_t i = 0; i < m->n_params; i++) {
        const sdm_model_param *p = &m->params[i];
        sdm_json_open(json, NULL, '{');
        sdm_json_parameter(json, p->name, p->unit, p->min, p->max, p->def);
        sdm_json_distribution(json, &p->distribution);
        if (of_shape && of_shape[i].help) sdm_json_text(json, "help", of_shape[i].help);
        sdm_json_close(json, '}');
    }
    sdm_json_close(json, ']');
    sdm_json_open(json, "options", '{');
    for (size_t i = 0; i < m->n_options; i++)
        sdm_json_text(json, m->option_names[i], m->option_values[i]);
    sdm_json_close(json, '}');
}

void cli_json_accuracy(sdm_json *json, const sdm_accuracy *a)
{
    sdm_json_real(json, "rmse_mm", a->rmse_mm);
    sdm_json_real(json, "mae_mm", a->mae_mm);
    sdm_json_real(json, "max_abs_mm", a->max_abs_mm);
    sdm_json_real(json, "rmse_near_mm", a->rmse_near_mm);
    sdm_json_real(json, "near_mm", a->near_mm);
    sdm_json_real(json, "q50_mm", a->q50_mm);
    sdm_json_real(json, "q90_mm", a->q90_mm);
    sdm_json_real(json, "q99_mm", a->q99_mm);
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
