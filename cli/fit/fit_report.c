/* Prints the result of a fit as text. */
#include <math.h>
#include <stdio.h>

#include "fit_command.h"

static void print_params(const cli_fit *f)
{
    const sdm_fit_result *r = &f->result;
    for (size_t i = 0; i < f->n_params; i++) {
        const sdm_param *p = &f->params[i];
        printf("  %-12s %10.5g", p->name, r->params[i]);
        if (isnan(r->sd[i])) printf(" +- %-9s", "unknown");
        if (r->sd[i] > 0) printf(" +- %-9.2g", r->sd[i]);
        printf(" %s%s%s\n", p->unit,
               r->at_bound[i] ? "   at the end of its range: the standard deviation is unreliable"
                              : "",
               r->by_prior[i]
                   ? "   not determined: the standard deviation is at least that of the prior"
                   : "");
    }
}

static void print_vector(const char *name, const double v[3], const double sd[3], const char *unit)
{
    printf("  %-12s %10.5g %10.5g %10.5g", name, v[0], v[1], v[2]);
    if (isnan(sd[0])) printf(" +- unknown");
    if (sd[0] > 0 || sd[1] > 0 || sd[2] > 0) printf(" +- %.2g %.2g %.2g", sd[0], sd[1], sd[2]);
    printf(" %s\n", unit);
}

static void print_overlap(const cli_fit *f)
{
    const cli_overlap *o = &f->overlap;
    if (!o->measured) return;
    printf("%s: Dice %.4f (%zu voxels fitted, %zu labelled",
           f->reference_is_target ? "labels" : "reference", o->dice, o->n_fit, o->n_reference);
    if (!isnan(f->args->fit.label_close)) printf(", closed by %g mm", f->args->fit.label_close);
    printf(")\n");
    if (o->has_surface)
        printf("  surfaces     mean %.3g, 95 %% below %.3g, Hausdorff %.3g mm\n", o->mean_mm,
               o->q95_mm, o->hausdorff_mm);
}

static void print_law(const char *side, const sdm_fit_law *law)
{
    printf("  %-12s %.4g (sd %.3g)", side, law->mean, law->sd);
}

/* If the voxels of the maps are larger than this factor times the sd of the point spread, the
 * standard deviations of weakly determined parameters come out too small. */
#define VOXEL_OVER_SPREAD_MAX 1.5

/* Labels: the same factor times the voxels of the labels. */
#define VOXEL_OVER_LABEL_MAX 1.5

static void print_spread(const cli_fit *f)
{
    const double blur = f->result.blur, voxel = cli_fit_map_voxel(f);
    printf("  point spread %.3g mm\n", blur);
    if (f->opts.keep_params || !(voxel > VOXEL_OVER_SPREAD_MAX * blur)) return;
    printf(
        "  the voxels of the maps, %.3g mm, are coarse compared with it: standard deviations may "
        "be too small; a fit with %s--spacing %.2g has finer maps\n",
        voxel, f->source.model ? "--exact " : "", blur);
}

/* Shortest gradient of a distance whose details are shown, and largest share of the surface with a
 * shorter one that gives no notice. */
#define GRADIENT_MIN 0.8
#define DETAILS_MAX 0.1

/* Share of the surface beside details that the voxels of the maps do not show: there the gradient
 * of the distance, by differences over two voxels, is clearly shorter than 1. */
static double detail_share(const cli_fit *f)
{
    const sdm_grid *g = &f->map_grid;
    const int64_t step[3] = {1, g->n[0], g->n[0] * g->n[1]};
    double all = 0, bent = 0;
    for (int64_t k = 1; k + 1 < g->n[2]; k++)
        for (int64_t j = 1; j + 1 < g->n[1]; j++)
            for (int64_t i = 1; i + 1 < g->n[0]; i++) {
                const float *d = f->map + k * step[2] + j * step[1] + i;
                double square = 0;
                if (fabs((double)*d) > 0.5 * cli_fit_map_voxel(f)) continue;
                for (int a = 0; a < 3; a++)
                    square +=
                        pow(((double)d[step[a]] - (double)d[-step[a]]) / (2 * g->spacing[a]), 2);
                all++;
                bent += square < GRADIENT_MIN * GRADIENT_MIN;
            }
    return all > 0 ? bent / all : 0;
}

/* A notice where the voxels of the maps are larger than half of the largest ball in the shape, or
 * than those of the labels, or where they do not show the details of much of the surface. */
static void print_coarse(const cli_fit *f)
{
    const double *h = f->target.grid.spacing, voxel = cli_fit_map_voxel(f);
    double fine = INFINITY, inside = 0;
    for (size_t i = 0; i < sdm_grid_count(&f->map_grid); i++)
        inside = fmin(inside, (double)f->map[i]);
    const char *beside = "the details of the shape";
    if (detail_share(f) > DETAILS_MAX) fine = 0.5 * voxel;
    if (voxel > -0.5 * inside) fine = -0.4 * inside, beside = "the thickness of the shape";
    if (f->target.kind == SDM_FIT_LABEL &&
        voxel > VOXEL_OVER_LABEL_MAX * fmax(h[0], fmax(h[1], h[2])) && h[0] < fine)
        fine = fmin(h[0], fmin(h[1], h[2])), beside = "those of the labels";
    if (f->opts.keep_params || !isfinite(fine) || !(fine > 0)) return;
    printf("  the voxels of the maps, %.3g mm, are coarse compared with %s: the estimates are less "
           "exact than they can be; a fit with %s--spacing %.2g has finer maps\n",
           voxel, beside, f->source.model ? "--exact " : "", fine);
}

/* Least share of outliers that is printed. */
#define OUTLIERS_SHOWN 0.005

/* Prints the number of voxels or points used, the values of the tissues and the evidence. */
static void print_target(const cli_fit *f)
{
    const sdm_fit_result *r = &f->result;
    if (f->target.kind == SDM_FIT_POINTS) {
        printf(
            "points: %zu%s, as good as %.3g independent ones, standard deviation %.3g mm about the "
            "surface",
            r->n_used, f->of_surface ? " on the surface of the mesh" : "",
            (double)r->n_used / fmax(r->noise_factor, 1), r->point_sd);
        if (r->outliers >= OUTLIERS_SHOWN) printf(", %.0f %% outliers", 100 * r->outliers);
        printf("\n");
        print_coarse(f);
        return;
    }
    // voxels
    printf("%s: %zu voxels near the shape", cli_fit_kind(f), r->n_used);
    if (r->n_nan)
        printf(", %zu ignored because they are NaN%s", r->n_nan,
               r->n_cavity ? " or in wide spaces (--cavity)" : "");
    if (!isnan(r->inside_share))
        printf(", %.0f %% of the shape in the image", 100 * r->inside_share);
    printf("\n");
    if (f->target.kind != SDM_FIT_IMAGE) {
        print_coarse(f);
        return;
    }
    // values of the tissues
    print_law("inside", &r->appearance.inside[0]);
    printf("\n");
    for (size_t i = 0; i < r->appearance.n_outside; i++) {
        if (r->appearance.outside[i].weight < 1e-3) continue; // no such tissue in this image
        print_law("outside", &r->appearance.outside[i]);
        printf(r->appearance.n_outside > 1 ? ", share %.2g\n" : "\n",
               r->appearance.outside[i].weight);
    }
    if (r->blur > 0) print_spread(f);
    if (!isnan(r->evidence))
        printf("  evidence     %.4g (log-likelihood relative to an image without the shape)\n",
               r->evidence);
}

void cli_fit_print(const cli_fit *f)
{
    const sdm_fit_result *r = &f->result;
    printf("%s fitted to %s%s\n", f->shape_name, f->path,
           f->doubt.status ? ": NOT TO BE TRUSTED" : "");
    print_params(f);
    print_vector("rotation", r->pose.rotation, r->sd + f->n_params, "rad");
    print_vector("translation", r->pose.translation, r->sd + f->n_params + 3, "mm");
    if (*r->open_motions) printf("  not determined by the data: %s\n", r->open_motions);
    if (f->measures.n) cli_print_measures(&f->measures, true);
    print_overlap(f);
    print_target(f);
    cli_fit_print_verdict(f);
    printf("%s after %zu iterations (%s)\n", r->converged ? "converged" : "NOT CONVERGED",
           r->n_iterations, r->reason);
    printf("  maps         %zu by the network, %zu by the exact engine\n", r->n_network,
           r->n_exact);
    printf("  time         %.2f s: maps %.2f s; search of the start %.2f s\n", r->seconds,
           r->seconds_network + r->seconds_exact, r->seconds_search);
}
