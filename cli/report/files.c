/* Checks the output files before any work: an output must be writable and must not overwrite an
 * input or another output. */
#include "files.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "sdm/internal/config.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"

bool cli_ends_with(const char *path, const char *suffix)
{
    const size_t n = strlen(path), k = strlen(suffix);
    return n > k && !strcasecmp(path + n - k, suffix);
}

bool cli_ends_with_any(const char *path, const char *endings)
{
    const size_t n = strlen(path);
    for (; *endings; endings += strspn(endings, " ")) {
        const size_t length = strcspn(endings, " ");
        if (n > length && !strncasecmp(path + n - length, endings, length)) return true;
        endings += length;
    }
    return false;
}

/* Identity of a file: device and inode of an existing file; for a new file device and inode of its
 * folder, and its name. */
typedef struct file_id {
    dev_t device;
    ino_t number;
    const char *name; /* "": the file exists */
} file_id;

static bool file_identify(const char *path, file_id *id)
{
    struct stat st;
    char folder[SDM_PATH_TEXT_MAX] = ".";
    const char *slash = strrchr(path, '/');
    id->name = "";
    if (stat(path, &st)) {
        const size_t length = slash ? (size_t)(slash - path) + 1 : 0;
        if (length >= sizeof folder) return false;
        if (slash) memcpy(folder, path, length), folder[length] = '\0';
        if (stat(folder, &st)) return false;
        id->name = slash ? slash + 1 : path;
    }
    id->device = st.st_dev;
    id->number = st.st_ino;
    return true;
}

static bool is_same_file(const char *a, const char *b)
{
    file_id x, y;
    return file_identify(a, &x) && file_identify(b, &y) && x.device == y.device &&
           x.number == y.number && !strcmp(x.name, y.name);
}

/* All files that a command may read. Shape options may hold paths (mesh=FILE), so the values of all
 * options are included. */
static sdm_status find_inputs(const cli_args *args, cli_list *out, sdm_error *err)
{
    const char *const single[] = {args->mesh,
                                  args->rows,
                                  args->points,
                                  args->like,
                                  args->fit.reference,
                                  args->fit.truth,
                                  args->fit.start_points,
                                  args->import.surface,
                                  args->import.particles};
    const size_t n_single = sizeof single / sizeof *single;
    const sdm_status s =
        SDM_ALLOC(&out->items, args->files.n + args->options.n + n_single, "names of files", err);
    if (s) return s;
    for (size_t i = 0; i < args->files.n; i++) out->items[out->n++] = args->files.items[i];
    for (size_t i = 0; i < args->options.n; i++) {
        const char *equals = strchr(args->options.items[i], '=');
        if (equals) out->items[out->n++] = equals + 1;
    }
    for (size_t i = 0; i < n_single; i++)
        if (single[i]) out->items[out->n++] = single[i];
    return SDM_OK;
}

static sdm_status find_outputs(const cli_args *args, cli_list *out, sdm_error *err)
{
    const char *const single[] = {args->closest,         args->normal,        args->triangle,
                                  args->jacobian,        args->gradient,      args->fit.label_out,
                                  args->report,          args->phantom.label, args->phantom.truth,
                                  args->phantom.surface, args->returns};
    const size_t n_single = sizeof single / sizeof *single;
    const sdm_status s = SDM_ALLOC(&out->items, args->outputs.n + n_single, "names of files", err);
    if (s) return s;
    for (size_t i = 0; i < args->outputs.n; i++) out->items[out->n++] = args->outputs.items[i];
    for (size_t i = 0; i < n_single; i++)
        if (single[i]) out->items[out->n++] = single[i];
    return SDM_OK;
}

static sdm_status check_output(const cli_list *outputs, size_t index, const cli_list *inputs,
                               sdm_error *err)
{
    const char *path = outputs->items[index];
    for (size_t i = 0; i < inputs->n; i++)
        if (is_same_file(path, inputs->items[i]))
            return sdm_fail(err, SDM_E_ARG,
                            "output '%s' would overwrite the input '%s': give it another name",
                            path, inputs->items[i]);
    for (size_t i = 0; i < index; i++)
        if (is_same_file(path, outputs->items[i]))
            return sdm_fail(err, SDM_E_ARG, "output '%s' is given twice, also as '%s'", path,
                            outputs->items[i]);
    // opening the temporary file shows whether the output can be written
    sdm_outfile *trial = NULL;
    const sdm_status s = sdm_outfile_open(path, &trial, err);
    sdm_outfile_discard(&trial);
    return s;
}

sdm_status cli_check_files(const cli_args *args, const cli_list *outputs, sdm_error *err)
{
    cli_list inputs = {0}, all = {0};
    sdm_status s = find_inputs(args, &inputs, err);
    if (!s && !outputs) s = find_outputs(args, &all, err);
    if (!outputs) outputs = &all;
    for (size_t i = 0; i < outputs->n && !s; i++) s = check_output(outputs, i, &inputs, err);
    sdm_free((void *)all.items);
    sdm_free((void *)inputs.items);
    return s;
}
