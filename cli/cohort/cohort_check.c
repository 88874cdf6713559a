/* Checks the values of a table as the command line of one fit is checked, before any work. */
#include <string.h>

#include "cohort.h"
#include "fit/fit_command.h"

/* The files of a case lie in its own folder, beside those that every case has. */
static sdm_status check_output(const char *name, sdm_error *err)
{
    static const char *const own[] = {CLI_CASE_FIT, CLI_CASE_RECORD, CLI_CASE_LOG};
    if (strchr(name, '/'))
        return sdm_fail(err, SDM_E_ARG,
                        "output '%s': with --cases an output is a file name without a folder: it "
                        "is written into the folder of the case",
                        name);
    for (size_t i = 0; i < sizeof own / sizeof *own; i++)
        if (!strcmp(name, own[i]))
            return sdm_fail(err, SDM_E_ARG, "output '%s': every case has this file already", name);
    if (!strncmp(name, CLI_CASE_LEASE, strlen(CLI_CASE_LEASE)) || *name == '.')
        return sdm_fail(err, SDM_E_ARG, "output '%s': need another name", name);
    return SDM_OK;
}

/* Checks what can be checked without opening a file. */
static sdm_status check_args(const cli_args *args, const cli_words *w, sdm_error *err)
{
    if ((args->files.n == 2) == (args->shape != NULL))
        return sdm_fail(err, SDM_E_ARG,
                        args->shape
                            ? "a model and --shape %s: need one of them"
                            : "no model: need MODEL or --shape NAME on the command line, or "
                              "a column model or shape%s",
                        args->shape ? args->shape : "");
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < w->outputs.n && !s; i++) s = check_output(w->outputs.items[i], err);
    for (size_t i = 0; i < w->outputs.n && !s; i++)
        for (size_t k = 0; k < i && !s; k++)
            if (!strcmp(w->outputs.items[i], w->outputs.items[k]))
                s = sdm_fail(err, SDM_E_ARG, "output '%s' is given twice", w->outputs.items[i]);
    return s ? s : cli_fit_check_types(args, err);
}

sdm_status cli_cohort_check(const cli_cohort *c, sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < c->cells.n_rows && !s; i++) {
        cli_words w = {0};
        cli_args args = {0};
        s = cli_words_make(c, i, &w, err);
        if (!s) s = cli_parse(w.argc, w.argv, &args, err);
        if (!s) s = check_args(&args, &w, err);
        if (s && s != SDM_E_NOMEM)
            s = sdm_fail_in(err, SDM_E_FORMAT, "%s:%d", c->csv, c->cells.line[i + 1]);
        cli_args_dispose(&args);
        cli_words_dispose(&w);
    }
    return s;
}
