/* Prints the verdict on a training as text. */
#include "report_verdict.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "terminal.h"

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
    printf("  by distance within two voxels (%g mm) of the surface %.5f mm", v->near_mm,
           v->rmse_near_mm);
    if (isfinite(v->rmse_inside_mm)) printf(", farther inside %.5f", v->rmse_inside_mm);
    if (isfinite(v->rmse_outside_mm)) printf(", farther outside %.5f", v->rmse_outside_mm);
    printf("; the largest error, %.3g mm, lies %.3g mm %s\n", v->largest_mm, fabs(v->largest_at_mm),
           v->largest_at_mm < 0 ? "inside" : "outside");
}

const char *cli_percent(double share, char text[16])
{
    snprintf(text, 16, share >= 0.1 ? "%.0f" : "%.2g", 100 * share);
    return text;
}

void cli_print_unfit(const char *lines, const char *label, int width)
{
    for (const char *at = lines; *at; at += strcspn(at, "\n") + 1)
        cli_print("%-*s %.*s\n", width, at == lines ? label : "", (int)strcspn(at, "\n"), at);
}

/* Two figures of an error that differ by less than this factor are printed as one. */
#define SAME_ERROR 0.95

/* Errors of volumes and derivatives. */
static void print_derivatives(const sdm_verdict *v)
{
    char text[16], largest[16];
    if (isfinite(v->volume_error))
        printf("  volumes     of maps are off by %s %%, at most by %s %%",
               cli_percent(v->volume_error, text), cli_percent(v->volume_error_max, largest));
    if (isfinite(v->surface_volume_error))
        printf("; of their surfaces (.stl) by %s %%, at most by %s %%",
               cli_percent(v->surface_volume_error, text),
               cli_percent(v->surface_volume_error_max, largest));
    if (isfinite(v->volume_error)) printf("\n");
    if (!isfinite(v->derivative_error)) return;
    printf(
        "  derivatives by the parameters, of %d shapes: of maps near the surface off by %s %% (by "
        "%s, the worst one)",
        (int)v->derivative_shapes, cli_percent(v->derivative_error, text), v->derivative_by);
    if (v->volume_derivatives_bad[0] || v->volume_derivatives_small[0])
        printf("; of volumes: see `not for`");
    else if (isfinite(v->volume_own_error)) {
        printf(", of volumes by %s %% (by %s)", cli_percent(v->volume_own_error, text),
               v->volume_own_by);
        if (v->volume_derivative_error < SAME_ERROR * v->volume_own_error)
            printf("; `info` states %s %%, because it counts a derivative as at least 5 %% of the "
                   "volume over the range",
                   cli_percent(v->volume_derivative_error, text));
    }
    printf("\n");
}

/* Parameters of which derivatives near the surface cannot be compared. */
static void print_still(const sdm_verdict *v)
{
    if (v->still_params[0])
        printf("  no effect   %s %s no part of the surface that the maps show: only vertices "
               "inside of "
               "other parts, or by far less than a voxel\n",
               v->still_params, strchr(v->still_params, ',') ? "move" : "moves");
}

void cli_print_measurements(const sdm_verdict *v)
{
    print_far(v);
    print_derivatives(v);
    print_still(v);
    print_parts(v);
    if (isfinite(v->motion_mm))
        printf("  template    at the vertices: frames and amplitudes %.2g mm, warp %.2g mm\n",
               v->motion_mm, v->warp_mm);
    if (isfinite(v->fall))
        printf("  steps       the last third of the steps lowered the error of the network by "
               "%.0f %%\n",
               100 * v->fall);
    if (!isfinite(v->thin)) return;
    const double grid = sqrt(v->part_mm2[SDM_CAUSE_GRID]);
    printf("  grid        between its voxels exact maps miss the surface by %.5f mm (%.3f voxels)",
           grid, grid / v->voxel_mm);
    if (v->thin >= 0.005)
        printf("; %.0f %% of the surface is thinner than two voxels or has an edge", 100 * v->thin);
    printf("\n");
}

void cli_print_verdict(const sdm_verdict *v)
{
    char text[SDM_GRADE_TEXT], few[SDM_GRADE_FEW], grade[48], unfit[SDM_MODEL_UNFIT];
    snprintf(grade, sizeof grade, "%s%s", sdm_grade_name(v->grade), sdm_grade_few(v->heldout, few));
    printf("  %-11s %s\n", grade, sdm_grade_text(v, text));
    sdm_verdict_unfit(v, unfit);
    cli_print_unfit(unfit, "  not for", 13);
    printf("  verdict     %s%s\n",
           v->grade == SDM_GRADE_POOR ? "The model is poor, not for use. " : "", v->sentence);
}
