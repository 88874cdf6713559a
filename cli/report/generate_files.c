/* Makes the file names of each row of parameters from the names on the command line. */
#include "generate_files.h"

#include "files.h"
#include "output.h"
#include "sdm/internal/config.h"
#include "sdm/memory.h"

/* Adds the name, numbered with --params, to f->list and stores it in *place unless that is NULL. */
static sdm_status add_name(const cli_args *args, const char *name, size_t row, cli_row_files *f,
                           const char **place, sdm_error *err)
{
    char *numbered = f->text + f->list.n * SDM_PATH_TEXT_MAX;
    if (!args->rows && cli_has_number(name))
        return sdm_fail(err, SDM_E_ARG,
                        "output '%.200s': %%d is the number of a row of --params, which is missing",
                        name);
    const sdm_status s =
        args->rows ? cli_number_path(name, row, numbered, SDM_PATH_TEXT_MAX, err) : SDM_OK;
    f->list.items[f->list.n++] = args->rows ? numbered : name;
    if (place) *place = f->list.items[f->list.n - 1];
    return s;
}

sdm_status cli_row_files_name(const cli_args *args, size_t row, cli_row_files *out, sdm_error *err)
{
    const size_t n_max = args->outputs.n + 2;
    sdm_status s = SDM_ALLOC(&out->text, n_max * SDM_PATH_TEXT_MAX, "names of the outputs", err);
    if (!s) s = SDM_ALLOC(&out->list.items, n_max, "names of the outputs", err);
    for (size_t i = 0; i < args->outputs.n && !s; i++)
        s = add_name(args, args->outputs.items[i], row, out, NULL, err);
    if (!s && args->gradient) s = add_name(args, args->gradient, row, out, &out->gradient, err);
    if (!s && args->jacobian) s = add_name(args, args->jacobian, row, out, &out->jacobian, err);
    return s;
}

void cli_row_files_dispose(cli_row_files *f)
{
    sdm_free((void *)f->list.items);
    sdm_free(f->text);
    *f = (cli_row_files){0};
}

static sdm_status check_array(const char *option, const char *path, sdm_error *err)
{
    if (!path || cli_ends_with(path, ".npy")) return SDM_OK;
    return sdm_fail(err, SDM_E_ARG, "--%s '%s': its name must end in .npy", option, path);
}

sdm_status cli_row_files_check(const cli_args *args, size_t last, sdm_error *err)
{
    cli_row_files f = {0};
    sdm_status s = check_array("gradient", args->gradient, err);
    if (!s) s = check_array("jacobian", args->jacobian, err);
    if (!s) s = cli_row_files_name(args, last, &f, err);
    for (size_t i = 0; i < f.list.n && !s; i++) s = cli_check_type(f.list.items[i], false, err);
    if (!s) s = cli_check_files(args, &f.list, err);
    cli_row_files_dispose(&f);
    return s;
}
