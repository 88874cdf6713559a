/* Prints the result of a fit as text. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit_command.h"

// A component of the pose is that of an open motion, of which the data say nothing, if its standard
// deviation without the open motions is so small beside the largest one of the vector ...
#define OPEN_WITHOUT 0.15
// ... and that with them so large.
#define OPEN_WITH 10.0

// Labels beyond the margin are told from so many voxels on, and from this share of all labels on:
// fewer are specks.
#define BEYOND_MIN 8
#define BEYOND_SHARE 0.002

static void print_params(const cli_fit *f)
{
    const sdm_fit_result *r = &f->result;
    int width = 12; // of the names
    for (size_t i = 0; i < f->n_params; i++) {
        const int length = (int)strlen(f->params[i].name);
        if (length > width) width = length;
    }
    for (size_t i = 0; i < f->n_params; i++) {
        const sdm_param *p = &f->params[i];
        printf("  %-*s %10.5g", width, p->name, r->params[i]);
        if (isnan(r->sd[i])) printf(" +- %-9s", "unknown");
        if (r->sd[i] > 0) printf(" +- %-9.2g", r->sd[i]);
        const bool known = f->truth && isfinite(f->truth[i]);
        printf(known ? " %-4s" : " %s", p->unit);
        if (known) printf("  truth %.5g", f->truth[i]);
        if (known && r->sd[i] > 0)
            printf(", off by %.1f sd", fabs(r->params[i] - f->truth[i]) / r->sd[i]);
        printf("%s%s\n",
               r->at_bound[i] ? "   at the end of its range: the standard deviation is unreliable"
                              : "",
               r->by_prior[i]
                   ? "   not determined: the standard deviation is at least that of the prior"
                   : "");
    }
}

/* sd: without, all_sd: with the motions that the data leave open. */
static void print_vector(const char *name, const double v[3], const double sd[3],
                         const double all_sd[3], const char *unit)
{
    const double most = fmax(sd[0], fmax(sd[1], sd[2]));
    printf("  %-12s %10.5g %10.5g %10.5g", name, v[0], v[1], v[2]);
    if (isnan(sd[0])) printf(" +- unknown");
    if (most > 0) printf(" +-");
    for (int a = 0; a < 3 && most > 0; a++)
        if (sd[a] < OPEN_WITHOUT * most && all_sd[a] > OPEN_WITH * most)
            printf(" open");
        else
            printf(" %.2g", sd[a]);
    printf(" %s\n", unit);
}

static void print_overlap(const cli_fit *f)
{
    const cli_overlap *o = &f->overlap;
    if (!o->measured) return;
    const char *labels = f->reference_is_target ? "labels" : "reference";
    if (isnan(o->dice)) {
        printf("%s: no Dice: none of its voxels lies in the image and in the shape or a label\n",
               labels);
        return;
    }
    printf("%s: Dice %.4f (%zu voxels fitted, %zu labelled", labels, o->dice, o->n_fit,
           o->n_reference);
    if (!isnan(f->args->fit.label_close)) printf(", closed by %g mm", f->args->fit.label_close);
    printf(")\n");
    if (o->has_surface)
        printf("  surfaces     mean %.3g, 95 %% below %.3g, Hausdorff %.3g mm\n", o->mean_mm,
               o->q95_mm, o->hausdorff_mm);
}

/* Labels of other bodies: the check `missing` counts them, and does not know their place. */
static void print_beyond(const cli_fit *f)
{
    const cli_overlap *o = &f->overlap;
    if (!o->measured || !f->reference_is_target || o->n_beyond < BEYOND_MIN ||
        (double)o->n_beyond < BEYOND_SHARE * (double)o->n_reference)
        return;
    printf("  far labels   %zu labelled voxels, %.2g %% of them, lie farther outside than --margin "
           "(%.3g mm), and the shape is not fitted to them; the nearest is %.3g mm away, at %.4g, "
           "%.4g, %.4g mm\n",
           o->n_beyond, 100 * (double)o->n_beyond / (double)o->n_reference, f->opts.margin,
           o->beyond_mm, o->beyond[0], o->beyond[1], o->beyond[2]);
}

static void print_law(const char *side, const sdm_fit_law *law)
{
    printf("  %-12s %.4g (sd %.3g)", side, law->mean, law->sd);
}

/* Least share of outliers that is printed. */
#define OUTLIERS_SHOWN 0.005

/* The standard deviation of the point spread; maps show none below half of their voxels. */
static void print_blur(const cli_fit *f)
{
    const double blur = f->result.blur, voxel = cli_fit_map_voxel(f);
    printf("  point spread %.3g mm", blur);
    if (!f->opts.keep_blur && blur <= 0.5 * voxel * (1 + 1e-6))
        printf(", the smallest that maps with voxels of %.3g mm show; the image may be sharper",
               voxel);
    printf("\n");
}

/* Prints the number of voxels or points used, the values of the tissues and the evidence. */
static void print_target(const cli_fit *f)
{
    const sdm_fit_result *r = &f->result;
    if (f->target.kind == SDM_FIT_POINTS) {
        printf(
            "points: %zu%s, as good as %.0f independent ones, standard deviation %.3g mm about the "
            "surface",
            r->n_used, f->of_surface ? " on the surface of the mesh" : "",
            (double)r->n_used / fmax(r->noise_factor, 1), r->point_sd);
        if (r->outliers >= OUTLIERS_SHOWN) printf(", %.0f %% outliers", 100 * r->outliers);
        printf("\n");
        return;
    }
    // voxels
    printf("%s: %zu voxels near the shape", cli_fit_kind(f), r->n_used);
    if (r->n_nan)
        printf(", %zu ignored because they are NaN%s", r->n_nan,
               r->n_cavity ? " or in wide spaces (--cavity)" : "");
    if (f->opts.open_end) printf(", %zu left out beyond the open end", r->n_beyond);
    if (!isnan(r->inside_share))
        printf(", %.0f %% of the shape in the image", 100 * r->inside_share);
    printf("\n");
    if (f->target.kind != SDM_FIT_IMAGE) return;
    // values of the tissues
    print_law("inside", &r->appearance.inside[0]);
    printf("\n");
    for (size_t i = 0; i < r->appearance.n_outside; i++) {
        if (r->appearance.outside[i].weight < 1e-3) continue; // no such tissue in this image
        print_law("outside", &r->appearance.outside[i]);
        printf(r->appearance.n_outside > 1 ? ", share %.2g\n" : "\n",
               r->appearance.outside[i].weight);
    }
    if (r->blur > 0) print_blur(f);
    if (!isnan(r->evidence))
        printf("  evidence     %.4g (log-likelihood relative to an image without the shape)\n",
               r->evidence);
}

/* The number of maps, and the voxels of exact maps, which points do not need. */
static void print_maps(const cli_fit *f)
{
    const sdm_fit_result *r = &f->result;
    printf("  maps         %zu by the network, %zu by the exact engine", r->n_network, r->n_exact);
    if (!f->source.model && !f->points) printf(", voxels of %.3g mm", cli_fit_map_voxel(f));
    if (f->thinnest > 0) printf(", because the thinnest part is %.2g mm thick", f->thinnest);
    if (f->was_nearly_coarse)
        printf(", because those of %.3g mm at first were nearly too coarse", f->coarse_mm);
    else if (f->coarse_mm > 0)
        printf(", because those of %.3g mm at first were coarse beside %s", f->coarse_mm,
               f->coarse_beside);
    printf("\n");
}

void cli_fit_print(const cli_fit *f)
{
    const sdm_fit_result *r = &f->result;
    const double *pose_sd = r->sd + f->n_params;
    printf("%s fitted to %s%s\n", f->shape_name, f->path,
           f->doubt.status ? ": NOT TO BE TRUSTED" : "");
    print_params(f);
    cli_fit_print_correlated(f);
    print_vector("rotation", r->pose.rotation, r->pose_sd_determined, pose_sd, "rad");
    print_vector("translation", r->pose.translation, r->pose_sd_determined + 3, pose_sd + 3, "mm");
    if (*r->open_motions)
        printf("  not determined by the data: %s; the +- of the pose leaves it out\n",
               r->open_motions);
    cli_fit_print_truth_pose(f);
    if (f->measures.n) cli_print_measures(&f->measures, true);
    print_overlap(f);
    print_target(f);
    print_beyond(f);
    cli_fit_print_verdict(f);
    cli_fit_print_next(f);
    cli_fit_print_candidates(f);
    printf("%s after %zu iterations (%s)\n", r->converged ? "converged" : "NOT CONVERGED",
           r->n_iterations, r->reason);
    if (r->n_restarts)
        printf(
            "  restarts     %zu: a fit that was refused or in doubt went on from a better pose or "
            "value of a parameter\n",
            r->n_restarts);
    print_maps(f);
    printf(
        "  time         %.2f s: search of the start %.2f s; iterations %.2f s; verdict and rivals "
        "%.2f s; in them maps %.2f s\n",
        r->seconds, r->seconds_search, fmax(r->seconds - r->seconds_search - r->seconds_verdict, 0),
        r->seconds_verdict, r->seconds_network + r->seconds_exact);
}
