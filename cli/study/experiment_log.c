/* Writes the log of an experiment: version, machine, settings and command, then the steps with
 * their times. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

#include "experiment_command.h"
#include "report/terminal.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/threads.h"

/* buf = the name of the first processor, from the line "model name : NAME" of /proc/cpuinfo. */
static void find_processor(char *buf, size_t size)
{
    char line[256];
    FILE *f = fopen("/proc/cpuinfo", "r");
    snprintf(buf, size, "unknown processor");
    while (f && fgets(line, sizeof line, f)) {
        const char *colon = strchr(line, ':');
        if (strncmp(line, "model name", 10) != 0 || !colon) continue;
        snprintf(buf, size, "%.*s", (int)strcspn(colon + 2, "\n"), colon + 2);
        break;
    }
    if (f) fclose(f);
}

void cli_experiment_describe_machine(char *buf, size_t size)
{
    struct utsname name;
    char processor[128];
    find_processor(processor, sizeof processor);
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    if (uname(&name))
        snprintf(buf, size, "%s, %ld cores", processor, cores);
    else
        snprintf(buf, size, "%s, %ld cores, %s %s", processor, cores, name.sysname, name.machine);
}

/* Opens the log for appending. NULL: it cannot be written; the experiment continues without it. */
static FILE *open_log(const cli_experiment_run *run)
{
    char path[SDM_PATH_TEXT_MAX + 16];
    snprintf(path, sizeof path, "%s/log.txt", run->folder);
    return fopen(path, "a");
}

void cli_experiment_log(const cli_experiment_run *run, const char *fmt, ...)
{
    char text[SDM_ERROR_TEXT_MAX];
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    cli_notice("%s", text);
    FILE *f = open_log(run);
    if (!f) return;
    fprintf(f, "%9.1f s  %s\n", sdm_clock() - run->start, text);
    fclose(f);
}

void cli_experiment_log_start(const cli_experiment_run *run)
{
    char date[64] = "", machine[256];
    const time_t now = time(NULL);
    struct tm utc;
    FILE *f = open_log(run);
    if (!f) return;
    if (gmtime_r(&now, &utc)) strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%SZ", &utc);
    cli_experiment_describe_machine(machine, sizeof machine);
    fprintf(f,
            "%s  sdmgen " SDM_VERSION_TEXT
            "  %s\n  %d threads, seed %llu, %lld shapes, budget %g min\n",
            date, machine, sdm_threads((int)run->args->threads),
            (unsigned long long)run->e->experiment.seed, (long long)run->e->experiment.samples,
            run->e->experiment.minutes);
    fprintf(f, "  sdmgen experiment");
    for (size_t i = 0; i < run->args->files.n; i++) fprintf(f, " '%s'", run->args->files.items[i]);
    fprintf(f, " --out '%s'%s\n", run->folder, run->args->force ? " --force" : "");
    fclose(f);
}
