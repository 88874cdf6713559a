/* The true parameters of a test image, from the file of `sdmgen phantom --truth`, to compare the
 * fitted ones with. */
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "fit_command.h"
#include "sdm/internal/file.h"
#include "sdm/internal/json_read.h"
#include "sdm/memory.h"

enum { TRUTH_BYTES_MAX = 1 << 20 };

/* Is the string at index i the name of a parameter of the shape? */
static bool is_parameter(const cli_fit *f, const sdm_json_document *d, size_t i)
{
    for (size_t k = 0; k < f->n_params; k++)
        if (sdm_json_is(d, i, f->params[k].name)) return true;
    return false;
}

/* f->truth[n_params] = the parameters of the document; those that it lacks are NaN. */
static sdm_status take_truth(cli_fit *f, const char *path, const sdm_json_document *d,
                             sdm_error *err)
{
    const size_t list = sdm_json_member(d, 0, "parameters"), shape = sdm_json_member(d, 0, "shape");
    size_t found = 0;
    if (shape && !sdm_json_is(d, shape, f->shape_name))
        return sdm_fail(err, SDM_E_ARG, "%s: the truth of another shape than '%s': %.*s", path,
                        f->shape_name, (int)d->values[shape].size, d->values[shape].at);
    for (size_t i = 0; i < f->n_params; i++) {
        const size_t at = list ? sdm_json_member(d, list, f->params[i].name) : 0;
        f->truth[i] = NAN;
        found += at && sdm_json_number(d, at, &f->truth[i]);
    }
    const size_t end = list && d->values[list].kind == '{' ? d->values[list].next : 0;
    for (size_t key = list + 1; key < end; key = d->values[key + 1].next)
        if (!is_parameter(f, d, key))
            return sdm_fail(err, SDM_E_ARG, "%s: '%s' has no parameter '%.*s'", path, f->shape_name,
                            (int)d->values[key].size, d->values[key].at);
    return found ? SDM_OK
                 : sdm_fail(err, SDM_E_FORMAT,
                            "%s: no object `parameters` with a parameter of '%s', as `sdmgen "
                            "phantom --truth` and `fit -o FILE.json` write it",
                            path, f->shape_name);
}

sdm_status cli_fit_read_truth(cli_fit *f, sdm_error *err)
{
    const char *path = f->args->fit.truth;
    uint8_t *text = NULL;
    size_t size = 0;
    sdm_json_document d = {0};
    if (!path) return SDM_OK;
    sdm_status s = sdm_file_read(path, TRUTH_BYTES_MAX, &text, &size, err);
    if (!s) s = sdm_json_parse(path, (const char *)text, size, &d, err);
    if (!s) s = SDM_ALLOC(&f->truth, f->n_params, "true parameters", err);
    if (!s) s = take_truth(f, path, &d, err);
    sdm_json_document_dispose(&d);
    sdm_free(text);
    return s;
}
