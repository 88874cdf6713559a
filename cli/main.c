/* sdmgen: parses the command line, runs one command and turns its status into an exit code. */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#ifdef _OPENMP
#include <omp.h>
#endif

#include "args/help.h"
#include "commands.h"
#include "report/crash_guard.h"
#include "report/terminal.h"
#include "sdm/internal/file.h"
#include "sdm/internal/isolation.h"
#include "sdm/internal/picture_child.h"
#ifdef SDM_HAVE_VDB
#include "sdm/internal/vdb_memory.h"
#endif
#include "slicer/slicer.h"

/* The functions of the commands, by index into cli_commands. */
static sdm_status (*const functions[CLI_N_COMMANDS])(const cli_args *args, sdm_error *err) = {
    [CLI_TRAIN] = cmd_train,           [CLI_DATASET] = cmd_dataset, [CLI_GENERATE] = cmd_generate,
    [CLI_EXACT] = cmd_exact,           [CLI_MESH] = cmd_mesh,       [CLI_EVAL] = cmd_eval,
    [CLI_REPORT] = cmd_report,         [CLI_SHAPES] = cmd_shapes,   [CLI_INFO] = cmd_info,
    [CLI_VERIFY] = cmd_verify,         [CLI_CONFIG] = cmd_config,   [CLI_BENCH] = cmd_bench,
    [CLI_EXPERIMENT] = cmd_experiment, [CLI_PHANTOM] = cmd_phantom, [CLI_FIT] = cmd_fit,
    [CLI_COLLECT] = cmd_collect,       [CLI_EXPORT] = cmd_export,   [CLI_IMPORT] = cmd_import,
    [CLI_SLICER] = cmd_slicer,         [CLI_HELP] = cmd_help};

static int print_help(const cli_command *command)
{
    sdm_text text = {0};
    sdm_error err = {0};
    if (command)
        cli_help_command(command, &text);
    else
        cli_help_all(&text);
    return cli_print_text(&text, &err) ? cli_report(&err) : CLI_EXIT_DONE;
}

static int print_description(const slicer_module *module)
{
    sdm_text text = {0};
    sdm_error err = {0};
    slicer_describe(module, &text);
    return cli_print_text(&text, &err) ? cli_report(&err) : CLI_EXIT_DONE;
}

/* Turns success into failure when a result is missing on stdout, for example on a full disk. */
static int flush_results(int code)
{
    if (fflush(stdout) == 0 && !ferror(stdout) && !cli_is_unprinted()) return code;
    fputs("sdmgen: error: cannot write to standard output\n", stderr);
    return code ? code : CLI_EXIT_FAILED;
}

/* Allocations beyond the limit of --max-memory fail, and failed allocations are errors. */
static void limit_memory(double gb)
{
    const struct rlimit limit = {(rlim_t)(gb * 1e9), (rlim_t)(gb * 1e9)};
    if (gb > 0) setrlimit(RLIMIT_AS, &limit);
}

static int run_command(const cli_args *args)
{
    limit_memory(args->max_memory);
    cli_set_quiet(args->quiet);
#ifdef _OPENMP
    if (args->threads > 0) omp_set_num_threads((int)args->threads);
#endif
    cli_catch_interrupts();
    cli_guard_callbacks(!args->isolate && (args->plugins.n || getenv("SDMGEN_PLUGIN_PATH")));
    sdm_picture_in_child(true);
    sdm_error err = {0};
    const sdm_status s = functions[args->command - cli_commands](args, &err);
    if (!s) return CLI_EXIT_DONE;
    err.status = s;
    fflush(stdout);
    return cli_report(&err);
}

/* Makes malloc() keep freed memory for the next map: for a small mesh, getting every page from the
 * system again would cost a third of the preparation time. */
static void keep_memory(void)
{
#ifdef __GLIBC__
    (void)mallopt(M_MMAP_THRESHOLD, 1 << 26);
    (void)mallopt(M_TRIM_THRESHOLD, 1 << 28);
#endif
}

/* Opens /dev/null for each of stdin, stdout and stderr that is closed: otherwise the first file
 * that is opened would get its number, and messages would go into that file. It is opened the other
 * way round, so that a result that cannot be printed remains an error. */
static void open_standard_files(void)
{
    for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; fd++)
        if (fcntl(fd, F_GETFD) < 0 &&
            open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY) != fd)
            _exit(CLI_EXIT_FAILED);
}

#ifdef SDM_HAVE_VDB
/* The end of the program where OpenVDB has no memory. */
static void end_without_memory(void)
{
    static const char line[] = "sdmgen: error: out of memory in OpenVDB\n";
    const ssize_t put = write(STDERR_FILENO, line, sizeof line - 1);
    (void)put;
    sdm_outfile_remove_temps();
    _exit(CLI_EXIT_FAILED);
}
#endif

int main(int argc, char **argv)
{
    if (argc > 1 && !strcmp(argv[1], SDM_ISOLATION_COMMAND))
        return sdm_isolation_worker(argc - 1, argv + 1);
    open_standard_files();
#ifdef SDM_HAVE_VDB
    sdm_vdb_on_memory_end(end_without_memory);
#endif
    keep_memory();
    if (argc == 2 && !strcmp(argv[1], "--version")) {
        puts("sdmgen " SDM_VERSION_TEXT);
        return flush_results(CLI_EXIT_DONE);
    }
    if (argc == 2 && (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h")))
        return flush_results(print_help(NULL));

    const slicer_module *module = slicer_find_module(argv[0]);
    slicer_line line = {.argc = argc, .argv = argv};
    sdm_error err = {0};
    if (module && argc == 2 && !strcmp(argv[1], "--xml"))
        return flush_results(print_description(module));
    sdm_status s = module ? slicer_translate(module, argc, argv, &line, &err) : SDM_OK;
    cli_args args = {0};
    if (!s) s = cli_parse(line.argc, line.argv, &args, &err);
    cli_set_form(args.progress);
    int code;
    if (s)
        code = cli_report(&err);
    else if (args.help)
        code = print_help(args.command);
    else
        code = run_command(&args);
    if (module) slicer_line_dispose(&line);
    cli_args_dispose(&args);
    return flush_results(code);
}
