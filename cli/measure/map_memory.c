/* Checks the memory for a map before the work, and tells what a large map takes. */
#ifdef __linux__
#define _DEFAULT_SOURCE // for the limits of a process
#endif
#include "map_memory.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>

#include "report/terminal.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/heap.h"

/* A map of LARGE bytes or more is told, with its time. A map that does not fit is refused, with a
 * spacing that makes one of at most PROPOSED_MAX bytes. The notice about a large map proposes a
 * spacing that makes one of SMALL bytes. */
static const double LARGE = 1e9, PROPOSED_MAX = 4e9, SMALL = 2e8;

/* Voxels of the planes that measure the time. */
static const double MEASURED = 4e6;

/* Free memory of the machine, without that on disk; 0: not known. */
static double machine_memory(void)
{
    static const char *const key = "MemAvailable:";
    char line[128];
    double kb = 0;
    FILE *f = fopen("/proc/meminfo", "r");
    if (!f) return 0;
    while (!(kb > 0) && fgets(line, sizeof line, f))
        if (!strncmp(line, key, strlen(key))) sscanf(line + strlen(key), "%lf", &kb);
    fclose(f);
    return 1024 * kb;
}

double cli_free_memory(void)
{
    struct rlimit limit;
    const double machine = machine_memory();
    if (getrlimit(RLIMIT_AS, &limit) || limit.rlim_cur == RLIM_INFINITY) return machine;
    const double left = fmax(1, (double)limit.rlim_cur - (double)sdm_address_space());
    return machine > 0 ? fmin(machine, left) : left;
}

/* A map on the grid takes `bytes`. Appends a spacing, rounded up to two digits, with which it takes
 * at most `wanted`: "; the same box with --spacing 0.36 needs 2.1 GB". */
static void add_coarser(const sdm_grid *g, double bytes, double wanted, sdm_text *text)
{
    const bool uniform = g->spacing[1] == g->spacing[0] && g->spacing[2] == g->spacing[0];
    const double times = cbrt(bytes / wanted);
    sdm_text_add(text, "; the same box with --spacing ");
    for (int a = 0; a < 3; a++) {
        const double least = g->spacing[a] * times, unit = pow(10, floor(log10(least)) - 1),
                     spacing = ceil(least / unit) * unit;
        bytes *= g->spacing[a] / spacing;
        if (!uniform || a == 0) sdm_text_add(text, "%s%.2g", a ? "," : "", spacing);
    }
    sdm_text_add(text, " needs %.2g GB", 1e-9 * bytes);
}

sdm_status cli_check_map_memory(const sdm_grid *g, double bytes, sdm_error *err)
{
    const double left = cli_free_memory();
    if (bytes < LARGE || !(left > 0) || bytes <= left) return SDM_OK;
    sdm_text more = {0};
    add_coarser(g, bytes, fmin(PROPOSED_MAX, 0.25 * left), &more);
    const sdm_status s = sdm_fail(
        err, SDM_E_NOMEM,
        "no memory for a map of %lld x %lld x %lld voxels: it needs %.3g GB, and %.3g GB are free; "
        "a larger --spacing or a smaller --size makes fewer%s",
        (long long)g->n[0], (long long)g->n[1], (long long)g->n[2], 1e-9 * bytes, 1e-9 * left,
        more.failed ? "" : more.data);
    sdm_text_dispose(&more);
    return s;
}

sdm_status cli_allocate_map(const sdm_grid *grid, float **values, sdm_error *err)
{
    const size_t n = sdm_grid_count(grid);
    sdm_status s = cli_check_map_memory(grid, (double)n * sizeof **values, err);
    if (s) return s;
    s = sdm_alloc_unset((void **)values, n, sizeof **values, "distance map", NULL);
    if (!s) return SDM_OK;
    return sdm_fail(err, s,
                    "no memory for a map of %lld x %lld x %lld voxels, %.3g GB: a larger --spacing "
                    "or a smaller --size makes fewer",
                    (long long)grid->n[0], (long long)grid->n[1], (long long)grid->n[2],
                    1e-9 * (double)n * sizeof **values);
}

/* *seconds = what the map takes, from planes in the middle of the grid. */
static sdm_status measure(const sdm_exact *engine, const sdm_grid *grid, double *seconds,
                          sdm_error *err)
{
    const double area = (double)grid->n[0] * (double)grid->n[1];
    const int64_t all = grid->n[2], some = (int64_t)fmin((double)all, fmax(1, MEASURED / area));
    sdm_grid planes = *grid;
    const double first[3] = {0, 0, (double)((all - some) / 2)};
    sdm_grid_world(grid, first, planes.origin);
    planes.n[2] = some;
    float *values = NULL;
    sdm_status s = sdm_alloc_unset((void **)&values, sdm_grid_count(&planes), sizeof *values,
                                   "planes of a map", err);
    const double start = sdm_clock();
    if (!s) s = sdm_exact_map(engine, &planes, values, err);
    *seconds = (sdm_clock() - start) * (double)all / (double)some;
    sdm_free(values);
    return s;
}

sdm_status cli_forecast_map(const sdm_exact *engine, const sdm_grid *g, double bytes,
                            sdm_text *text, sdm_error *err)
{
    double seconds;
    char count[32], time[32];
    const double n = (double)sdm_grid_count(g);
    const sdm_status s = measure(engine, g, &seconds, err);
    if (s) return s;
    sdm_text_add(text,
                 "a large map: %lld x %lld x %lld = %s voxels, %.2g GB; it takes about %s, writing "
                 "it more",
                 (long long)g->n[0], (long long)g->n[1], (long long)g->n[2],
                 cli_format_count((int64_t)n, count), 1e-9 * n * bytes,
                 cli_format_seconds(seconds, time));
    add_coarser(g, n * bytes, SMALL, text);
    return SDM_OK;
}

sdm_status cli_tell_large_map(const sdm_exact *engine, const sdm_grid *grid, double bytes,
                              sdm_error *err)
{
    sdm_text text = {0};
    if ((double)sdm_grid_count(grid) * bytes < LARGE || cli_is_quiet()) return SDM_OK;
    const sdm_status s = cli_forecast_map(engine, grid, bytes, &text, err);
    if (!s && !text.failed) cli_notice("%s", text.data);
    sdm_text_dispose(&text);
    return s;
}
