/* JSON members that several commands print alike: values of parameters, models; and JSON files. */
#pragma once

#include "sdm/internal/json_describe.h"
#include "sdm/model.h"
#include "sdm/shape.h"

/* Adds an object with one member for each parameter: its name and values[i]. */
void cli_json_params(sdm_json *json, const char *key, const sdm_param *params, size_t n,
                     const double *values);

/* Adds what a model says about its parameters and options: the array "parameters" and the object
 * "options". of_shape[parameters]: adds their help; NULL: without. */
void cli_json_model_params(sdm_json *json, const sdm_model_info *m, const sdm_param *of_shape);

/* Adds the errors of a model on held-out shapes, mm, to the open object. */
void cli_json_accuracy(sdm_json *json, const sdm_accuracy *a);

/* Writes the finished text and a line feed to the file `path`. SDM_E_NOMEM when the text is
 * incomplete, SDM_E_IO. */
sdm_status cli_json_write(const sdm_json *json, const char *path, sdm_error *err);
