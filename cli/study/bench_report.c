/* Prints the results of sdmgen bench exact as tables and JSON. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench.h"

static double total_ms(const cli_bench_row *r) { return r->ms_prepare + r->ms_map; }

/* format_fixed() writes v with `digits` decimals, format_rounded() with `digits` significant
 * digits; "-" if v is not finite. Both return buf. */
static const char *format_fixed(double v, int digits, char buf[32])
{
    snprintf(buf, 32, "-");
    if (isfinite(v)) snprintf(buf, 32, "%.*f", digits, v);
    return buf;
}
static const char *format_rounded(double v, int digits, char buf[32])
{
    snprintf(buf, 32, "-");
    if (isfinite(v)) snprintf(buf, 32, "%.*g", digits, v);
    return buf;
}

static void print_row(const cli_bench_row *r, double reference)
{
    char name[80], ratio[32], peak[32], max[32], mean[32];
    snprintf(name, sizeof name, "%s", r->name);
    if (r->share < 1) snprintf(name, sizeof name, "%s (%.2g %%)", r->name, 100 * r->share);
    printf("  %-20s %10.2f %10.2f %10.2f %8s %8s %10s %10s %8zu\n", name, r->ms_prepare, r->ms_map,
           total_ms(r), format_fixed(total_ms(r) / reference, 2, ratio),
           format_fixed(r->peak_mb, 1, peak), format_rounded(r->max_error, 2, max),
           format_rounded(r->mean_error, 2, mean), r->wrong);
}

void cli_bench_print(const cli_bench_case *c, const cli_bench_rows *rows)
{
    const cli_bench_row *first = &rows->items[0];
    printf("%s; one thread unless stated otherwise, the fastest of %zu runs or of those within 3 s"
           "\n\n",
           c->title, c->repeat);
    printf("  %-20s %10s %10s %10s %8s %8s %10s %10s %8s\n", "", "prepare", "map", "total", "times",
           "memory", "error", "error", "wrong");
    printf("  %-20s %10s %10s %10s %8s %8s %10s %10s %8s\n", "", "ms", "ms", "ms", "exact", "MB",
           "largest mm", "mean mm", "signs");
    for (size_t i = 0; i < rows->n; i++)
        if (rows->items[i].done) print_row(&rows->items[i], total_ms(first));
    printf("\n");
    for (size_t i = 0; i < rows->n; i++)
        printf("  %-20s %s\n", rows->items[i].name, rows->items[i].note);
    printf("\nError: difference from the map of the exact engine, on the %zu voxels%s %s.\n",
           first->compared, isfinite(c->band_mm) ? " of the band" : "",
           c->unioned ? "where both maps are outside (the other methods measure to the surface "
                        "inside the union)"
                      : "where the signs agree");
    printf("Wrong signs: by the winding number of the whole mesh, on at most %zu voxels. Memory: "
           "peak, without mesh and map.\n",
           first->judged);
    printf("(%%): fraction of the rows of voxels that were computed, evenly spread; times are "
           "scaled, errors and signs refer to these rows.\n");
}

static void json_row(sdm_json *j, const cli_bench_row *r, double reference)
{
    sdm_json_open(j, NULL, '{');
    sdm_json_text(j, "name", r->name);
    sdm_json_bool(j, "done", r->done);
    sdm_json_text(j, "note", r->note);
    if (r->done) {
        sdm_json_real(j, "ms_prepare", r->ms_prepare);
        sdm_json_real(j, "ms_map", r->ms_map);
        sdm_json_real(j, "ms_total", total_ms(r));
        sdm_json_real(j, "times_exact", total_ms(r) / reference);
        sdm_json_real(j, "share", r->share);
        sdm_json_real(j, "memory_mb", r->peak_mb);
        sdm_json_real(j, "max_error_mm", r->max_error);
        sdm_json_real(j, "mean_error_mm", r->mean_error);
        sdm_json_int(j, "compared", (int64_t)r->compared);
        sdm_json_int(j, "wrong_signs", (int64_t)r->wrong);
        sdm_json_int(j, "judged_signs", (int64_t)r->judged);
    }
    sdm_json_close(j, '}');
}

void cli_bench_json(sdm_json *j, const cli_bench_case *c, const cli_bench_rows *rows)
{
    sdm_json_open(j, NULL, '{');
    sdm_json_text(j, "title", c->title);
    sdm_json_int(j, "voxels", (int64_t)c->voxels);
    sdm_json_int(j, "triangles", (int64_t)c->mesh.n_tri);
    sdm_json_bool(j, "union", c->unioned);
    sdm_json_real(j, "band_mm", c->band_mm);
    sdm_json_open(j, "rows", '[');
    for (size_t i = 0; i < rows->n; i++) json_row(j, &rows->items[i], total_ms(&rows->items[0]));
    sdm_json_close(j, ']');
    sdm_json_close(j, '}');
}

/* Prints one table: the total time of each method in ms and, in parentheses, ns per voxel
 * or triangle. */
static void print_growth(const cli_bench_case *cases, const cli_bench_rows *rows, size_t n,
                         bool voxels)
{
    printf("  %-20s", voxels ? "voxels" : "triangles");
    for (size_t k = 0; k < n; k++) printf(" %22zu", voxels ? cases[k].voxels : cases[k].mesh.n_tri);
    printf("\n");
    for (size_t i = 0; i < rows[0].n; i++) {
        const char *name = rows[0].items[i].name;
        if (!rows[0].items[i].done) continue;
        printf("  %-20s", name);
        for (size_t k = 0; k < n; k++) {
            const cli_bench_row *r = NULL;
            for (size_t m = 0; m < rows[k].n; m++)
                if (!strcmp(rows[k].items[m].name, name) && rows[k].items[m].done)
                    r = &rows[k].items[m];
            const double units = (double)(voxels ? cases[k].voxels : cases[k].mesh.n_tri);
            char ms[32], unit[32];
            printf(" %11s (%8s)", format_fixed(r ? total_ms(r) : NAN, 2, ms),
                   format_rounded(r ? 1e6 * total_ms(r) / units : NAN, 4, unit));
        }
        printf("\n");
    }
}

void cli_bench_print_growth(const cli_bench_case *cases, const cli_bench_rows *rows, size_t n_grids,
                            size_t n_meshes)
{
    printf("%s, and coarser ones\n\nTotal ms (ns per voxel), the same box and mesh\n\n",
           cases[n_grids - 1].title);
    print_growth(cases, rows, n_grids, true);
    if (n_meshes == 0) return;
    printf("\nTotal ms (ns per triangle), %zu voxels\n\n", cases[n_grids].voxels);
    print_growth(cases + n_grids, rows + n_grids, n_meshes, false);
}
