/* Measures errors, wrong signs and memory of a method. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "bench.h"

#define SIGNS_MAX 1e6 /* largest number of voxels whose winding number is computed */

bool cli_bench_has_row(double share, int64_t r)
{
    // fractional parts of multiples of the golden ratio are evenly spread
    const double multiple = (double)r * 0.6180339887498949;
    return multiple - floor(multiple) < share;
}

sdm_status cli_bench_find_signs(cli_bench_case *c, sdm_error *err)
{
    const sdm_exact_opts opts = {.sign = SDM_SIGN_WINDING, .keep_overlap = true};
    const double share = fmin(1, SIGNS_MAX / (double)c->voxels);
    const sdm_grid *g = &c->grid;
    sdm_exact *engine = NULL;
    sdm_status s = sdm_exact_create(&c->mesh, &opts, &engine, err);
    if (!s && share >= 1) s = sdm_exact_map(engine, g, c->winding, err);
    for (int64_t r = 0; r < g->n[1] * g->n[2] && !s && share < 1; r++) {
        float *values = c->winding + r * g->n[0];
        sdm_grid row = *g;
        row.n[1] = row.n[2] = 1;
        sdm_grid_world(g, (const double[3]){0, (double)(r % g->n[1]), (double)(r / g->n[1])},
                       row.origin);
        for (int64_t i = 0; i < g->n[0]; i++) values[i] = NAN;
        if (cli_bench_has_row(share, r)) s = sdm_exact_map(engine, &row, values, err);
    }
    sdm_exact_free(engine);
    return s;
}

void cli_bench_compare(const cli_bench_case *c, const float *values, cli_bench_row *row)
{
    double sum = 0, max = 0;
    row->compared = row->wrong = row->judged = 0;
    for (size_t i = 0; i < c->voxels; i++) {
        const double v = (double)values[i], e = (double)c->exact[i], w = (double)c->winding[i];
        if (!isfinite(v) || !(fabs(e) < c->band_mm)) continue;
        if (isfinite(w) && w != 0) { // on the surface both signs are right
            row->judged++;
            row->wrong += (v < 0) != (w < 0);
        }
        if ((v < 0) != (e < 0) || (c->unioned && e < 0)) continue;
        row->compared++;
        sum += fabs(v - e);
        max = fmax(max, fabs(v - e));
    }
    row->max_error = row->compared ? max : NAN;
    row->mean_error = row->compared ? sum / (double)row->compared : NAN;
}

/* ---- memory ---- */

/* The number in the line "NAME:  123 kB" of /proc/self/status; -1: no such line. */
static long status_kb(const char *name)
{
    FILE *f = fopen("/proc/self/status", "r");
    char line[256];
    long kb = -1;
    const size_t length = strlen(name);
    while (f && fgets(line, sizeof line, f))
        if (!strncmp(line, name, length) && line[length] == ':')
            kb = strtol(line + length + 1, NULL, 10);
    if (f) fclose(f);
    return kb;
}

long cli_bench_peak_start(void)
{
#ifdef __GLIBC__
    malloc_trim(0); // free memory that is still resident would hide new allocations
#endif
    FILE *f = fopen("/proc/self/clear_refs", "w");
    if (!f) return -1;
    const bool written = fputs("5", f) >= 0;
    return fclose(f) == 0 && written ? status_kb("VmRSS") : -1;
}

double cli_bench_peak_mb(long start)
{
    const long peak = status_kb("VmHWM");
    return start < 0 || peak < 0 ? NAN : fmax(0, (double)(peak - start) / 1024);
}
