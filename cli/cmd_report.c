/* sdmgen report: writes a page of a model or of a run, to be looked at in a browser. */
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "commands.h"
#include "inputs/setup.h"
#include "page/page.h"
#include "report/files.h"
#include "report/terminal.h"
#include "sdm/internal/config.h"
#include "sdm/internal/file.h"
#include "sdm/internal/sha256.h"
#include "sdm/memory.h"

enum { METRICS_BYTES_MAX = 1 << 26 };

/* What the page is made of. */
typedef struct source {
    char model_path[SDM_PATH_TEXT_MAX + 32], metrics_path[SDM_PATH_TEXT_MAX + 32]; /* "": none */
    uint8_t *bytes, *metrics; /* of these files */
    sdm_model *model;
    sdm_registry *shapes;
    sdm_instance *shape; /* NULL: not known */
    cli_still still;
} source;

static void source_dispose(source *s)
{
    cli_still_dispose(&s->still);
    sdm_instance_free(s->shape);
    sdm_registry_free(s->shapes);
    sdm_model_free(s->model);
    sdm_free(s->metrics);
    sdm_free(s->bytes);
}

/* Finds the files of the model and, in the folder of a run, of its training. */
static sdm_status find_files(const char *path, source *out, sdm_error *err)
{
    struct stat st;
    if (strlen(path) >= SDM_PATH_TEXT_MAX)
        return sdm_fail(err, SDM_E_ARG, "%.100s...: the name is too long", path);
    if (cli_ends_with(path, ".json"))
        return sdm_fail(
            err, SDM_E_UNSUPPORTED,
            "%s: there are no pages of fits yet; give a model (.sdm) or the folder of a "
            "run",
            path);
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
    sdm_error unknown = {0};
    const sdm_status status = cli_open_registry(args, &s->shapes, err);
    if (!status && sdm_runtime_instance(s->model, s->shapes, &s->shape, &unknown)) s->shape = NULL;
    return status;
}

static sdm_status write_page(const cli_args *args, const source *s, sdm_error *err)
{
    size_t n;
    const cli_page page = {.info = sdm_model_get_info(s->model),
                           .of_shape = s->shape ? sdm_instance_params(s->shape, &n) : NULL,
                           .summary = s->shape ? sdm_instance_shape(s->shape)->summary : NULL,
                           .metrics = (const char *)s->metrics,
                           .still = &s->still,
                           .model = args->no_model ? NULL : s->bytes};
    return cli_page_write(&page, args->outputs.items[0], err);
}

static sdm_status check_arguments(const cli_args *args, sdm_error *err)
{
    if (args->outputs.n != 1 || !cli_ends_with_any(args->outputs.items[0], ".html .htm"))
        return sdm_fail(err, SDM_E_ARG, "report: need one output: -o FILE.html");
    if (!args->no_model && !cli_page_has_runtime())
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "report: this program was built without WebAssembly, so its pages cannot "
                        "run a model: use --no-model (pictures alone), or install clang-14, "
                        "lld-14, wasi-libc and libclang-rt-14-dev-wasm32 and build again");
    return cli_check_files(args, NULL, err);
}

sdm_status cmd_report(const cli_args *args, sdm_error *err)
{
    source src = {.model = NULL};
    sdm_status s = check_arguments(args, err);
    if (!s) s = find_files(args->files.items[0], &src, err);
    if (!s) s = read_files(args, &src, err);
    if (!s) s = open_shape(args, &src, err);
    if (!s) s = cli_still_make(src.model, &src.still, err);
    if (!s) s = write_page(args, &src, err);
    source_dispose(&src);
    return s;
}
