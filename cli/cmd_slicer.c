/* sdmgen slicer: writes the modules of 3D Slicer, or the description of one. */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "commands.h"
#include "report/terminal.h"
#include "sdm/internal/file.h"
#include "slicer/slicer.h"

static sdm_status describe(const char *name, sdm_error *err)
{
    const slicer_module *m = slicer_find_module(name);
    sdm_text text = {0};
    if (!m || strchr(name, '/'))
        return sdm_fail(err, SDM_E_ARG, "slicer: no module '%s', need one of %s, %s, %s", name,
                        slicer_modules[0].name, slicer_modules[1].name, slicer_modules[2].name);
    slicer_describe(m, &text);
    return cli_print_text(&text, err);
}

/* DIR/NAME becomes a link to the program. A link that exists is replaced; a file is not. */
static sdm_status write_link(const char *path, const char *program, sdm_error *err)
{
    struct stat st;
    sdm_text temporary = {0};
    if (!lstat(path, &st) && !S_ISLNK(st.st_mode))
        return sdm_fail(err, SDM_E_IO, "%s: there is a file of this name that is no link", path);
    sdm_text_add(&temporary, "%s.%ld", path, (long)getpid());
    sdm_status s = SDM_OK;
    if (temporary.failed)
        s = sdm_fail(err, SDM_E_NOMEM, "out of memory");
    else if (symlink(program, temporary.data) || rename(temporary.data, path)) {
        s = sdm_fail(err, SDM_E_IO, "%s: cannot make the link: %s", path, strerror(errno));
        (void)unlink(temporary.data);
    }
    sdm_text_dispose(&temporary);
    return s;
}

static sdm_status write_description(const slicer_module *m, const char *path, sdm_error *err)
{
    sdm_text text = {0};
    slicer_describe(m, &text);
    const sdm_status s = text.failed ? sdm_fail(err, SDM_E_NOMEM, "%s: out of memory", path)
                                     : sdm_file_write(path, text.data, text.size, err);
    sdm_text_dispose(&text);
    return s;
}

/* Writes the module's link and its description. The description comes first: Slicer runs a module
 * without one to ask for it. */
static sdm_status write_module(const slicer_module *m, const char *folder, const char *program,
                               sdm_error *err)
{
    sdm_text link = {0}, xml = {0};
    sdm_text_add(&link, "%s/%s", folder, m->name);
    sdm_text_add(&xml, "%s/%s.xml", folder, m->name);
    sdm_status s = link.failed || xml.failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory")
                                             : write_description(m, xml.data, err);
    if (!s) s = write_link(link.data, program, err);
    sdm_text_dispose(&link);
    sdm_text_dispose(&xml);
    return s;
}

static sdm_status install(const char *folder, sdm_error *err)
{
    char program[4096];
    const ssize_t n = readlink("/proc/self/exe", program, sizeof program - 1);
    if (n < 0 || (size_t)n == sizeof program - 1)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "slicer: cannot find the path of this program (/proc is needed)");
    program[n] = '\0';
    sdm_status s = sdm_make_folder(folder, err);
    for (size_t i = 0; i < SLICER_N_MODULES && !s; i++)
        s = write_module(&slicer_modules[i], folder, program, err);
    if (s) return s;
    cli_notice("add %s to Slicer's additional module paths (Edit, Application Settings, Modules) "
               "and start Slicer again",
               folder);
    return SDM_OK;
}

sdm_status cmd_slicer(const cli_args *args, sdm_error *err)
{
    if (!args->files.n == !args->install)
        return sdm_fail(err, SDM_E_ARG,
                        "slicer: either --install DIR or the name of a module is needed");
    return args->install ? install(args->install, err) : describe(args->files.items[0], err);
}
