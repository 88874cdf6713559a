/* Makes the page of a model, of a run or of a fit: opens the files, makes the pictures, writes. */
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "inputs/setup.h"
#include "page.h"
#include "report/files.h"
#include "report/terminal.h"
#include "sdm/internal/config.h"
#include "sdm/internal/file.h"
#include "sdm/internal/sha256.h"
#include "sdm/memory.h"

enum { METRICS_BYTES_MAX = 1 << 26, FIT_BYTES_MAX = 1 << 26 };

/* What the page is made of. */
typedef struct source {
    char model_path[SDM_PATH_TEXT_MAX + 32], metrics_path[SDM_PATH_TEXT_MAX + 32]; /* "": none */
    uint8_t *bytes, *metrics; /* of these files */
    sdm_model *model;
    sdm_registry *shapes;
    sdm_instance *shape; /* NULL: not known */
    bool of_fit;
    cli_page_fit fit;
    cli_still still;
    sdm_measures measures;
    cli_page_errors errors;
} source;

static void source_dispose(source *s)
{
    cli_still_dispose(&s->still);
    cli_page_fit_dispose(&s->fit);
    sdm_instance_free(s->shape);
    sdm_registry_free(s->shapes);
    sdm_model_free(s->model);
    sdm_free(s->metrics);
    sdm_free(s->bytes);
}

/* Takes the result of a fit, text[size]; it belongs to the source then. */
static sdm_status take_fit(const char *name, char *text, size_t size, bool changed, source *out,
                           sdm_error *err)
{
    out->of_fit = true;
    const sdm_status s = cli_page_fit_take(name, text, size, changed, &out->fit, err);
    snprintf(out->model_path, sizeof out->model_path, "%s", out->fit.model_path);
    return s;
}

/* Finds the files of the model and, in the folder of a run, of its training. */
static sdm_status find_files(const char *path, bool changed, source *out, sdm_error *err)
{
    struct stat st;
    if (strlen(path) >= SDM_PATH_TEXT_MAX)
        return sdm_fail(err, SDM_E_ARG, "%.100s...: the name is too long", path);
    if (cli_ends_with(path, ".json")) {
        char *text = NULL;
        size_t size, lines;
        const sdm_status s = sdm_file_read_text(path, FIT_BYTES_MAX, &text, &size, &lines, err);
        return s ? s : take_fit(path, text, size, changed, out, err);
    }
    if (stat(path, &st) || !S_ISDIR(st.st_mode)) {
        strcpy(out->model_path, path);
        return SDM_OK;
    }
    snprintf(out->model_path, sizeof out->model_path, "%s/model.sdm", path);
    snprintf(out->metrics_path, sizeof out->metrics_path, "%s/metrics.jsonl", path);
    if (stat(out->model_path, &st))
        return sdm_fail(err, SDM_E_IO,
                        "%s: no model.sdm in this folder: it is no run, or its training has not "
                        "come to its end",
                        path);
    if (stat(out->metrics_path, &st)) *out->metrics_path = '\0';
    return SDM_OK;
}

static sdm_status read_files(const cli_args *args, source *s, sdm_error *err)
{
    size_t size;
    char hash[SDM_SHA256_TEXT];
    // the model first: its message is the best one if the file is none
    sdm_status status = cli_open_model(args, s->model_path, &s->model, err);
    if (!status) status = sdm_file_read(s->model_path, SIZE_MAX, &s->bytes, &size, err);
    if (!status && (size != sdm_model_get_info(s->model)->file_bytes ||
                    (args->expect && strcmp(sdm_sha256(s->bytes, size, hash), args->expect))))
        status = sdm_fail(err, SDM_E_IO, "%s: the file has changed meanwhile", s->model_path);
    if (!status && *s->metrics_path)
        status = sdm_file_read(s->metrics_path, METRICS_BYTES_MAX, &s->metrics, &size, err);
    return status;
}

/* Opens the shape of the model for the texts about its parameters, if it is known. */
static sdm_status open_shape(const cli_args *args, source *s, sdm_error *err)
{
    sdm_status status = cli_open_registry(args, &s->shapes, err);
    if (status) return status;
    status = sdm_runtime_instance(s->model, s->shapes, &s->shape, err);
    if (status) s->shape = NULL;
    return status == SDM_E_NOMEM ? status : SDM_OK;
}

/* Measures the shape at p; without a result where the shape refuses. SDM_E_NOMEM. */
static sdm_status measure(source *s, const double *p, sdm_error *err)
{
    if (!s->shape) return SDM_OK;
    const sdm_status status = sdm_shape_measure(s->shape, p, NULL, 0, &s->measures, err);
    if (status) s->measures.n = 0;
    return status == SDM_E_NOMEM ? status : SDM_OK;
}

/* Makes the pictures at the default parameters, and the errors of the network. */
static sdm_status make_still(source *s, sdm_error *err)
{
    const sdm_model_info *m = sdm_model_get_info(s->model);
    double *params = NULL;
    float *values = NULL;
    sdm_status status = SDM_ALLOC(&params, m->n_params, "parameters", err);
    if (!status) status = SDM_ALLOC(&values, sdm_grid_count(&m->grid), "map", err);
    for (size_t i = 0; i < m->n_params && !status; i++) params[i] = m->params[i].def;
    if (!status) status = sdm_generate(s->model, params, NULL, values, NULL, err);
    if (!status) status = cli_still_make(&m->grid, values, &s->still, err);
    if (!status) status = measure(s, params, err);
    if (!status && s->shape) status = cli_page_errors_make(s->model, s->shape, &s->errors, err);
    sdm_free(values);
    sdm_free(params);
    return status;
}

/* Makes the pictures at the estimate of a fit. */
static sdm_status make_fit(source *s, sdm_error *err)
{
    sdm_status status = cli_page_fit_sample(s->model, s->shape, &s->fit, err);
    if (!status) status = measure(s, s->fit.params, err);
    if (status) return status;
    return cli_still_make(&sdm_model_get_info(s->model)->grid, s->fit.map, &s->still, err);
}

static sdm_status write_page(const source *s, bool live, const char *path, sdm_error *err)
{
    const cli_page page = {.info = sdm_model_get_info(s->model),
                           .shape = s->shape,
                           .metrics = (const char *)s->metrics,
                           .fit = s->of_fit ? &s->fit : NULL,
                           .still = &s->still,
                           .measures = &s->measures,
                           .errors = &s->errors,
                           .model = live ? s->bytes : NULL};
    return cli_page_write(&page, path, err);
}

/* Makes the page of a source whose files are found. */
static sdm_status make_page(const cli_args *args, source *s, bool live, const char *path,
                            sdm_error *err)
{
    sdm_status status = read_files(args, s, err);
    if (!status) status = open_shape(args, s, err);
    if (!status) status = s->of_fit ? make_fit(s, err) : make_still(s, err);
    if (!status) status = write_page(s, live, path, err);
    return status;
}

sdm_status cli_page_report(const cli_args *args, const char *source_path, bool live,
                           const char *path, sdm_error *err)
{
    source src = {.model = NULL};
    sdm_status s = find_files(source_path, args->changed_files, &src, err);
    if (!s) s = make_page(args, &src, live, path, err);
    source_dispose(&src);
    return s;
}

sdm_status cli_page_report_fit(const cli_args *args, const sdm_json *fit, const char *path,
                               sdm_error *err)
{
    source src = {.model = NULL};
    char *text = NULL;
    sdm_status s = fit->text.failed ? sdm_fail(err, SDM_E_NOMEM, "page: out of memory")
                                    : SDM_ALLOC(&text, fit->text.size + 1, "page", err);
    if (!s) {
        memcpy(text, fit->text.data, fit->text.size + 1);
        s = take_fit("the fit", text, fit->text.size, false, &src, err);
    }
    if (!s) s = make_page(args, &src, cli_page_has_runtime(), path, err);
    source_dispose(&src);
    return s;
}

sdm_status cli_page_check_option(const cli_args *args, sdm_error *err)
{
    if (!args->report || cli_ends_with_any(args->report, ".html .htm")) return SDM_OK;
    return sdm_fail(err, SDM_E_ARG, "--report '%s': its name must end in .html", args->report);
}
