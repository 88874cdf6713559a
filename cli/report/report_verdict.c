/* Prints the verdict on a training as text. */
#include "report_verdict.h"

#include <math.h>
#include <stdio.h>

#include "report_audit.h"

/* From this share of a surface with edges, or thinner than two voxels, on, and below this number of
   voxels across the thinnest part, volumes are told to be too small: a spanner with half of its
   surface near edges lost 5 % of its volume with 3.6 voxels, 10 % with 1.9, 1 % with 7.3. */
static const double EDGES_MANY = 0.1, VOXELS_MANY = 4;

/* The part of the error with its share of the sum of all parts. */
static void print_part(const sdm_verdict *v, sdm_cause cause, double sum, bool first)
{
    const double part = fmax(0, v->part_mm2[cause]);
    printf("  %-11s %-9s %.5f mm %3.0f %%  %s\n", first ? "error from" : "", sdm_cause_name(cause),
           sqrt(part), 100 * part / sum, sdm_cause_text(cause));
}

static void print_parts(const sdm_verdict *v)
{
    double sum = 0;
    bool first = true;
    for (int i = 0; i < SDM_CAUSE_GRID; i++)
        if (v->part_mm2[i] > 0) sum += v->part_mm2[i];
    for (int i = 0; i < SDM_CAUSE_GRID && sum > 0; i++) {
        if (!isfinite(v->part_mm2[i])) continue;
        print_part(v, (sdm_cause)i, sum, first);
        first = false;
    }
}

/* The error by the distance from the surface. */
static void print_far(const sdm_verdict *v)
{
    printf("  by distance within %g mm of the surface %.5f mm", v->near_mm, v->rmse_near_mm);
    if (isfinite(v->rmse_inside_mm)) printf(", farther inside %.5f", v->rmse_inside_mm);
    if (isfinite(v->rmse_outside_mm)) printf(", farther outside %.5f", v->rmse_outside_mm);
    printf("; the largest error, %.3g mm, lies %.3g mm %s\n", v->largest_mm, fabs(v->largest_at_mm),
           v->largest_at_mm < 0 ? "inside" : "outside");
}

/* Are voxels so large beside parts with edges that surfaces enclose too little? */
static bool is_coarse(const sdm_verdict *v)
{
    return v->thin >= EDGES_MANY && v->thickness_mm < VOXELS_MANY * v->coarse_mm;
}

/* Begins a line: with the label "not for" if it is the first of the list, else with spaces. */
static void not_for(bool *first)
{
    printf("  %-11s ", *first ? "not for" : "");
    *first = false;
}

/* text[16] = an error in per cent: a whole number from 10 on. Returns text. */
static const char *percent(double share, char text[16])
{
    snprintf(text, 16, share >= 0.1 ? "%.0f" : "%.2g", 100 * share);
    return text;
}

/* The purposes for which a model of this grade is not good, a line each. */
static void print_unfit(const sdm_verdict *v, bool cuts)
{
    bool first = true;
    char text[16];
    if (v->inside_out > 0)
        not_for(&first), printf("the parts that are inside out, which are missing\n");
    if (v->cut > 0 && !cuts)
        not_for(&first),
            printf("the %.2g %% of the shapes that the grid cuts\n", fmin(99, 100 * v->cut));
    if (sdm_verdict_errs_far(v))
        not_for(&first),
            printf("distances far from the surface: wrong by up to %.2g mm\n", v->largest_mm);
    if (v->volume_error > SDM_VOLUME_BAD)
        not_for(&first), printf("volumes: off by %s %%\n", percent(v->volume_error, text));
    if (is_coarse(v))
        not_for(&first),
            printf("volumes of surfaces (.stl): voxels of %.3g mm cut the edges of its parts, the "
                   "thinnest of which is %.2g mm thick; grid.spacing %.2g keeps more of them\n",
                   v->coarse_mm, v->thickness_mm, 0.25 * v->thickness_mm);
    if (v->derivative_error > SDM_DERIVATIVE_BAD)
        not_for(&first), printf("derivatives of maps by %s: off by %s %%\n", v->derivative_by,
                                percent(v->derivative_error, text));
    if (v->volume_derivative_error > SDM_DERIVATIVE_BAD)
        not_for(&first), printf("derivatives of the volume by %s: off by %s %%\n",
                                v->volume_derivative_by, percent(v->volume_derivative_error, text));
    if (sdm_too_thin(v->thickness_mm, v->coarse_mm))
        not_for(&first), printf("its thinnest part, which is " CLI_THIN_PART "\n", v->thickness_mm,
                                v->coarse_mm, 0.5 * v->thickness_mm);
}

/* Errors of volumes and derivatives. */
static void print_derivatives(const sdm_verdict *v)
{
    char text[16], largest[16];
    if (isfinite(v->volume_error))
        printf("  volumes     of maps are off by %s %%, at most by %s %%\n",
               percent(v->volume_error, text), percent(v->volume_error_max, largest));
    if (!isfinite(v->derivative_error)) return;
    printf(
        "  derivatives by the parameters: of maps near the surface off by %s %% (by %s, the worst "
        "one)",
        percent(v->derivative_error, text), v->derivative_by);
    if (isfinite(v->volume_derivative_error))
        printf(", of volumes by %s %% (by %s)", percent(v->volume_derivative_error, text),
               v->volume_derivative_by);
    printf("\n");
}

void cli_print_verdict(const sdm_verdict *v)
{
    const double voxel = v->voxel_mm;
    printf("  in voxels   all %.4f, within a voxel of the surface %.4f; Dice %.4f, smallest %.4f\n",
           v->rmse_mm / voxel, v->rmse_voxel_mm / voxel, v->dice, v->dice_min);
    // a network may be poor for this alone
    const bool cuts = v->grade == SDM_GRADE_POOR && v->cut > SDM_CUT_POOR;
    printf("  %-11s ", sdm_grade_name(v->grade));
    if (cuts)
        printf("its grid cuts %.3g %% of the shapes, whose surfaces end open there",
               fmin(v->cut < 1 ? 99 : 100, 100 * v->cut));
    else
        printf("%s", sdm_grade_text(v->grade));
    printf("\n");
    print_unfit(v, cuts);
    print_far(v);
    print_derivatives(v);
    print_parts(v);
    if (isfinite(v->motion_mm))
        printf("  template    at the vertices: frames and amplitudes %.2g mm, warp %.2g mm\n",
               v->motion_mm, v->warp_mm);
    if (isfinite(v->fall))
        printf("  steps       the last third of them lowered what the bases do not explain by "
               "%.0f %%\n",
               100 * v->fall);
    if (isfinite(v->thin)) {
        const double grid = sqrt(v->part_mm2[SDM_CAUSE_GRID]);
        printf(
            "  grid        between its voxels exact maps miss the surface by %.5f mm (%.3f voxels)",
            grid, grid / voxel);
        if (v->thin >= 0.005)
            printf("; %.0f %% of the surface is thinner than two voxels or has an edge",
                   100 * v->thin);
        printf("\n");
    }
    printf("  verdict     %s\n", v->sentence);
}
