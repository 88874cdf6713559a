/* Writes the file of --returnparameterfile. */
#include "results_file.h"

#include <math.h>

#include "sdm/internal/file.h"

void cli_results_text(cli_results *r, const char *name, const char *value)
{
    sdm_text_add(&r->text, "%s = ", name);
    for (; *value; value++) sdm_text_add(&r->text, "%c", *value == '\n' ? ' ' : *value);
    sdm_text_add(&r->text, "\n");
}

void cli_results_real(cli_results *r, const char *name, double value)
{
    char buf[32];
    cli_results_text(r, name, isnan(value) ? "" : sdm_format_real(value, buf));
}

void cli_results_reals(cli_results *r, const char *name, const double *v, size_t n)
{
    char buf[32];
    sdm_text_add(&r->text, "%s = ", name);
    for (size_t i = 0; i < n; i++)
        sdm_text_add(&r->text, "%s%s", i ? "," : "", sdm_format_real(v[i], buf));
    sdm_text_add(&r->text, "\n");
}

void cli_results_params(cli_results *r, const char *name, const sdm_param *params, size_t n,
                        const double *values)
{
    char buf[32];
    sdm_text_add(&r->text, "%s =", name);
    for (size_t i = 0; i < n; i++)
        sdm_text_add(&r->text, " %s=%s", params[i].name, sdm_format_real(values[i], buf));
    sdm_text_add(&r->text, "\n");
}

sdm_status cli_results_write(cli_results *r, const char *path, sdm_error *err)
{
    sdm_status s = SDM_OK;
    if (path && r->text.failed)
        s = sdm_fail(err, SDM_E_NOMEM, "%s: out of memory", path);
    else if (path)
        s = sdm_file_write(path, r->text.data, r->text.size, err);
    cli_results_dispose(r);
    return s;
}

void cli_results_dispose(cli_results *r)
{
    sdm_text_dispose(&r->text);
    *r = (cli_results){0};
}
