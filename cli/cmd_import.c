/* sdmgen import: turns a statistical shape model of other programs into a file of this one. */
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "commands.h"
#include "report/files.h"
#include "report/terminal.h"
#include "sdm/internal/ssm.h"
#include "ssm/import_ssm.h"
#include "ssm/report_ssm.h"

/* The shape 'statistical' has at most so many parameters. */
#define MODES_DEFAULT 64

/* Lengths become mm and the frame LPS: turning RAS around z by half a turn keeps the orientation of
 * triangles. */
static void convert(const cli_args *args, sdm_ssm *m)
{
    static const struct {
        const char *name;
        double mm;
    } units[] = {{"mm", 1}, {"cm", 10}, {"m", 1000}, {"um", 1e-3}};
    double unit = 1;
    for (size_t i = 0; args->import.unit && i < sizeof units / sizeof *units; i++)
        if (!strcmp(args->import.unit, units[i].name)) unit = units[i].mm;
    const double turn = args->import.frame && !strcmp(args->import.frame, "ras") ? -1 : 1;
    for (size_t i = 0; i < 3 * m->n_vert; i++) m->mean[i] *= i % 3 < 2 ? turn * unit : unit;
    for (size_t i = 0; i < 3 * m->n_vert * m->n_modes; i++)
        m->modes[i] *= i % 3 < 2 ? turn * unit : unit;
    for (size_t i = 0; i < m->n_modes; i++) m->variance[i] *= unit * unit;
    m->noise *= unit * unit;
    m->total *= unit * unit;
}

/* Keeps the modes that --modes or --variance ask for. */
static sdm_status choose_modes(const cli_args *args, sdm_ssm *m, sdm_error *err)
{
    size_t n = m->n_modes < MODES_DEFAULT ? m->n_modes : MODES_DEFAULT;
    if (args->import.modes > 0 && args->import.variance > 0)
        return sdm_fail(err, SDM_E_ARG, "import: --modes and --variance exclude each other");
    if (args->import.modes > (int64_t)m->n_modes)
        return sdm_fail(err, SDM_E_ARG,
                        "import: --modes %lld, the source has %zu modes with variance",
                        (long long)args->import.modes, m->n_modes);
    if (args->import.modes > 0) n = (size_t)args->import.modes;
    if (args->import.variance > 0) {
        double sum = m->variance[0];
        for (n = 1; n < m->n_modes && sum < args->import.variance * m->total;)
            sum += m->variance[n++];
    }
    if (n == MODES_DEFAULT && n < m->n_modes && args->import.modes == 0)
        cli_notice("the first %zu of %zu modes are kept; --modes or --variance choose others", n,
                   m->n_modes);
    m->n_modes = n;
    return SDM_OK;
}

/* Reads the source by its kind. */
static sdm_status read_source(const cli_args *args, const char *path, sdm_ssm *m, sdm_error *err)
{
    struct stat info;
    if (stat(path, &info) == 0 && S_ISDIR(info.st_mode)) {
        if (args->import.model)
            return sdm_fail(err, SDM_E_ARG, "import: --model does nothing with a folder");
        if (cli_ssm_has_particles(path)) return cli_ssm_particles(args, path, m, err);
        if (args->import.surface || args->import.particles)
            return sdm_fail(err, SDM_E_ARG,
                            "import: --surface and --particles do nothing with a folder of meshes");
        return cli_ssm_meshes(args, path, m, err);
    }
    if (args->import.scale || args->import.particles)
        return sdm_fail(err, SDM_E_ARG, "import: --scale and --particles need a folder");
    if (!cli_ends_with_any(path, ".h5 .hdf5 .h5.json"))
        return sdm_fail(err, SDM_E_ARG,
                        "import: source '%s': need a model .h5 or .h5.json, or a folder of meshes "
                        "or particles",
                        path);
    return cli_ends_with(path, ".json") ? cli_ssm_statismo(args, path, m, err)
                                        : cli_ssm_hdf5(args, path, m, err);
}

sdm_status cmd_import(const cli_args *args, sdm_error *err)
{
    const char *path = args->files.items[1];
    sdm_ssm m = {0};
    if (strcmp(args->files.items[0], "ssm") != 0)
        return sdm_fail(err, SDM_E_ARG, "import: unknown kind '%s', known is ssm",
                        args->files.items[0]);
    if (args->outputs.n != 1 || !cli_ends_with(args->outputs.items[0], ".ssm"))
        return sdm_fail(err, SDM_E_ARG, "import: one output is needed: -o FILE.ssm");
    sdm_status s = cli_check_files(args, NULL, err);
    if (!s) s = read_source(args, path, &m, err);
    if (!s && m.n_modes == 0) s = sdm_fail(err, SDM_E_FORMAT, "%s: no mode has a variance", path);
    if (!s) s = sdm_ssm_check(path, &m, err);
    if (!s) s = choose_modes(args, &m, err);
    if (!s) {
        convert(args, &m);
        snprintf(m.about, sizeof m.about, "source: %.200s\nframe: %s\nunit: %s\n", path,
                 args->import.frame ? args->import.frame : "lps",
                 args->import.unit ? args->import.unit : "mm");
        s = sdm_ssm_write(args->outputs.items[0], &m, err);
    }
    if (!s && args->json)
        s = cli_json_ssm(args->outputs.items[0], &m, err);
    else if (!s && !args->quiet)
        cli_print_ssm(args->outputs.items[0], &m);
    sdm_ssm_dispose(&m);
    return s;
}
