/* Opens the mesh and the grid of a benchmark from the command line. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench.h"
#include "inputs/setup.h"
#include "report/terminal.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

/* Above LARGE_MAP voxels, slow programs compute only the fraction LARGE_SHARE of them. */
#define LARGE_MAP 1e6
#define LARGE_SHARE 0.01

/* Makes the mesh of a shape; --edge and `refine` set its option "edge". */
static sdm_status make_shape_mesh(const cli_args *args, double refine, const char *name,
                                  cli_bench_case *c, sdm_error *err)
{
    char number[32], edge[64];
    cli_list options = {0};
    cli_shape shape = {0};
    const double wanted = (args->edge > 0 ? args->edge : 0.3) / refine;
    snprintf(edge, sizeof edge, "edge=%s", sdm_format_real(wanted, number));
    sdm_status s = SDM_ALLOC(&options.items, args->options.n + 1, "shape options", err);
    for (size_t i = 0; i < args->options.n && !s; i++)
        options.items[options.n++] = args->options.items[i];
    if (!s && (args->edge > 0 || refine != 1)) options.items[options.n++] = edge;
    if (!s) s = cli_shape_open(args, name, &options, &shape, err);
    if (!s) s = cli_check_range(shape.params, shape.n_params, shape.values, err);
    if (!s) s = sdm_instance_mesh(shape.instance, shape.values, &c->mesh, err);
    cli_shape_dispose(&shape);
    sdm_free((void *)options.items);
    return s;
}

/* Makes the grid of --grid, --size, --spacing and --origin; by default 60 x 50 x 50 voxels. In a
 * preset grid the cochlea has the same position as in the grid of its networks. */
static sdm_status make_grid(const cli_args *args, bool cochlea, const sdm_audit *audit,
                            sdm_grid *out, sdm_error *err)
{
    const bool g2 = args->grid && !strcmp(args->grid, "g2");
    cli_args a = *args;
    if (a.grid && (a.size[0] > 0 || a.spacing[0] > 0))
        return sdm_fail(
            err, SDM_E_ARG,
            "bench: --grid %s has a size and a spacing: give either --grid or --size and --spacing",
            a.grid);
    const bool preset = a.grid || (cochlea && a.size[0] == 0 && !(a.spacing[0] > 0));
    const int64_t size[3] = {g2 ? 256 : 60, g2 ? 256 : 50, g2 ? 192 : 50};
    for (int i = 0; i < 3 && (preset || (args->size[0] == 0 && !(args->spacing[0] > 0))); i++)
        a.size[i] = size[i];
    for (int i = 0; i < 3 && preset; i++) a.spacing[i] = g2 ? 0.047 : 0.2;
    if (preset && cochlea && !isfinite(a.origin[0])) {
        *out = sdm_grid_centred(a.size, a.spacing[0], (const double[3]){0.5, 0.4, 1.2});
        return SDM_OK;
    }
    return cli_grid_for_box(&a, audit->min, audit->max, out, err);
}

/* Changes the number of voxels by the factor `scale` along each axis. The box, bounded by the
 * faces of the outermost voxels, stays the same. */
static void grid_rescale(sdm_grid *g, double scale)
{
    for (int i = 0; i < 3; i++) {
        const double wall = g->origin[i] - 0.5 * g->spacing[i], old = (double)g->n[i];
        g->n[i] = (int64_t)fmax(1, round(scale * old));
        g->spacing[i] *= old / (double)g->n[i];
        g->origin[i] = scale == 1 ? g->origin[i] : wall + 0.5 * g->spacing[i];
    }
}

static void write_title(cli_bench_case *c, const char *name)
{
    char spacing[64];
    const double *h = c->grid.spacing;
    if (h[0] == h[1] && h[0] == h[2])
        snprintf(spacing, sizeof spacing, "%.4g", h[0]);
    else
        snprintf(spacing, sizeof spacing, "%.4g x %.4g x %.4g", h[0], h[1], h[2]);
    snprintf(c->title, sizeof c->title, "%.300s, %zu triangles, %lld x %lld x %lld voxels of %s mm",
             name, c->mesh.n_tri, (long long)c->grid.n[0], (long long)c->grid.n[1],
             (long long)c->grid.n[2], spacing);
}

sdm_status cli_bench_case_open(const cli_args *args, double refine, double scale, cli_bench_case *c,
                               sdm_error *err)
{
    if (args->shape && args->mesh)
        return sdm_fail(err, SDM_E_ARG, "bench exact: either --shape NAME or --mesh FILE");
    if (args->mesh && (args->params.n > 0 || args->options.n > 0 || args->edge > 0))
        return sdm_fail(
            err, SDM_E_ARG,
            "bench exact: -p, -O and --edge belong to --shape; a mesh file has no parameters");
    // mesh and grid
    const char *name = args->mesh ? args->mesh : args->shape ? args->shape : "cochlea";
    sdm_audit audit;
    sdm_status s = args->mesh ? cli_read_mesh(args->mesh, &c->mesh, err)
                              : make_shape_mesh(args, refine, name, c, err);
    if (!s) s = sdm_mesh_audit(&c->mesh, &audit, err);
    if (!s) s = make_grid(args, !strcmp(name, "cochlea"), &audit, &c->grid, err);
    if (s) return s;
    grid_rescale(&c->grid, scale);
    s = sdm_grid_check(&c->grid, err);
    if (s) return s;
    // settings and memory of the maps
    c->voxels = sdm_grid_count(&c->grid);
    c->band_mm = args->band > 0 ? args->band * fmin(c->grid.spacing[0],
                                                    fmin(c->grid.spacing[1], c->grid.spacing[2]))
                                : INFINITY;
    c->share = args->share > 0 ? args->share : (double)c->voxels > LARGE_MAP ? LARGE_SHARE : 1;
    c->repeat = args->repeat > 0 ? (size_t)args->repeat : 9;
    c->threads = sdm_threads((int)args->threads);
    write_title(c, name);
    s = SDM_ALLOC(&c->exact, c->voxels, "distance map", err);
    return s ? s : SDM_ALLOC(&c->winding, c->voxels, "signs by the winding number", err);
}

void cli_bench_case_dispose(cli_bench_case *c)
{
    sdm_mesh_dispose(&c->mesh);
    sdm_free(c->exact);
    sdm_free(c->winding);
    memset(c, 0, sizeof *c);
}
