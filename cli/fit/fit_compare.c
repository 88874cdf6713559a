/* Compares a fitted shape with labels: overlap of the voxels inside, and distances between the
 * surfaces, within the field of view of the image. */
#include <math.h>
#include <string.h>

#include "fit_command.h"
#include "measure/median.h"
#include "report/crop.h"
#include "sdm/exact.h"
#include "sdm/isosurface.h"
#include "sdm/memory.h"

sdm_status cli_fit_read_reference(cli_fit *f, sdm_error *err)
{
    const cli_fit_args *a = &f->args->fit;
    if (!a->reference && a->reference_labels.n)
        return sdm_fail(err, SDM_E_ARG, "fit: --reference-label needs --reference FILE");
    if (!a->reference && !a->labels.n && !isnan(a->label_close))
        return sdm_fail(err, SDM_E_ARG,
                        "fit: --label-close needs labels: give --label or --reference");
    if (!a->reference) {
        f->reference_grid = f->target.grid;
        f->reference = f->mask;
        f->reference_is_target = true;
        return SDM_OK;
    }
    sdm_volume v = {0};
    sdm_status s = sdm_volume_read(a->reference, &v, err);
    if (s == SDM_E_UNSUPPORTED && !sdm_volume_knows(a->reference)) {
        s = SDM_E_ARG;
        if (err) err->status = s;
    }
    f->reference_grid = v.grid;
    if (!s) s = SDM_ALLOC(&f->reference, sdm_grid_count(&v.grid), "labels", err);
    bool many = false;
    if (!s) s = cli_fit_many_values(&v, &many, err);
    if (many)
        cli_fit_warn_many_values(a->reference, "--reference needs labels, not an image or a map");
    if (!s) s = cli_fit_label_mask(a->reference, &v, &a->reference_labels, f->reference, err);
    if (!s) s = cli_fit_close_labels(f, &v.grid, f->reference, err);
    sdm_volume_dispose(&v);
    return s;
}

/* True for points of the world that lie in a voxel of the image; for all points when the target is
 * a list of points, because there is no image. */
static bool is_in_view(const cli_fit *f, const double world[3])
{
    double at[3];
    if (f->target.kind == SDM_FIT_POINTS) return true;
    sdm_grid_index(&f->target.grid, world, at);
    for (int a = 0; a < 3; a++)
        if (!(at[a] >= -0.5 && at[a] <= (double)f->target.grid.n[a] - 0.5)) return false;
    return true;
}

/* Counts a labelled voxel that the fit has not seen, because it lies beyond the margin. */
static void count_beyond(cli_overlap *o, const double world[3], double distance)
{
    if (!o->n_beyond++ || distance < o->beyond_mm) {
        o->beyond_mm = distance;
        memcpy(o->beyond, world, sizeof o->beyond);
    }
}

/* Counts the voxels inside map[g] (below 0) and labels[g] (above 0) and computes Dice. */
static void count_voxels(cli_fit *f, const sdm_grid *g, const float *map, const float *labels)
{
    cli_overlap *o = &f->overlap;
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++, map++, labels++) {
                const bool fit = *map<0, reference = *labels> 0;
                const double index[3] = {(double)i, (double)j, (double)k};
                double world[3];
                if (!fit && !reference) continue;
                sdm_grid_world(g, index, world);
                if (!is_in_view(f, world)) continue;
                o->n_fit += fit;
                o->n_reference += reference;
                o->n_both += fit && reference;
                if (reference && *map > f->opts.margin) count_beyond(o, world, *map);
            }
    const size_t both = o->n_fit + o->n_reference;
    o->dice = both ? 2 * (double)o->n_both / (double)both : NAN;
}

/* Appends to list[*n] the distances of the vertices of `from` in the field of view to the
 * surface of `to`. */
static sdm_status add_distances(const cli_fit *f, const sdm_mesh *from, const sdm_mesh *to,
                                double *list, size_t *n, sdm_error *err)
{
    const sdm_exact_opts opts = {.keep_overlap = true, .n_threads = f->opts.n_threads};
    sdm_exact *engine = NULL;
    const sdm_status s = sdm_exact_create(to, &opts, &engine, err);
    if (s) return s;
    for (size_t i = 0; i < from->n_vert; i++) {
        const double *x = from->vert + 3 * i;
        if (is_in_view(f, x)) list[(*n)++] = sdm_exact_distance(engine, x);
    }
    sdm_exact_free(engine);
    return SDM_OK;
}

/* Distances between the surfaces in both directions: mean, 95 % quantile, largest. */
static sdm_status compare_surfaces(cli_fit *f, const sdm_mesh *reference, sdm_error *err)
{
    cli_overlap *o = &f->overlap;
    double *list = NULL;
    size_t n = 0, of_fit;
    sdm_status s =
        SDM_ALLOC(&list, f->surface.n_vert + reference->n_vert, "distances of surfaces", err);
    if (!s) s = add_distances(f, &f->surface, reference, list, &n, err);
    of_fit = n;
    if (!s) s = add_distances(f, reference, &f->surface, list, &n, err);
    o->has_surface = !s && of_fit > 0 && n > of_fit;
    if (o->has_surface) {
        cli_sort(list, n);
        for (size_t i = 0; i < n; i++) o->mean_mm += list[i] / (double)n;
        o->q95_mm = list[(size_t)ceil(0.95 * (double)n) - 1]; // nearest rank
        o->hausdorff_mm = list[n - 1];
    }
    sdm_free(list);
    return s;
}

sdm_status cli_fit_compare(cli_fit *f, sdm_error *err)
{
    if (!f->reference || !f->surface.n_tri) return SDM_OK;
    // the part of the reference's grid that holds both shapes
    const sdm_grid *whole = &f->reference_grid;
    const double pad = 2 * fmax(whole->spacing[0], fmax(whole->spacing[1], whole->spacing[2]));
    const cli_block of_labels = cli_block_of_labels(whole, f->reference, pad),
                    of_fit = cli_block_of_mesh(whole, &f->surface, pad),
                    block = cli_block_union(&of_labels, &of_fit);
    const sdm_grid g = cli_block_grid(whole, &block);
    const size_t n = sdm_grid_count(&g);
    // copy the labels, and sample the map, on this grid
    float *labels = NULL, *map = NULL;
    sdm_mesh reference = {0};
    sdm_status s = SDM_ALLOC(&labels, n, "labels", err);
    if (!s) s = SDM_ALLOC(&map, n, "distance map", err);
    if (!s) cli_block_copy(whole, f->reference, &block, labels);
    if (!s)
        s = sdm_fit_map(&f->map_source, f->result.params, &f->result.pose, &g, f->opts.n_threads,
                        map, err);
    // overlap and distances
    if (!s) count_voxels(f, &g, map, labels);
    for (size_t i = 0; i < n && !s; i++)
        labels[i] = 0.5f - labels[i]; // 0 half-way between voxels inside and outside
    if (!s) s = sdm_isosurface(&g, labels, 0.0f, &reference, NULL, err);
    if (!s && reference.n_tri) s = compare_surfaces(f, &reference, err);
    f->overlap.measured = !s;
    sdm_mesh_dispose(&reference);
    sdm_free(map);
    sdm_free(labels);
    return s;
}
