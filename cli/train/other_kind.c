/* Prints what pod may do better than the template that was trained. */
#include "other_kind.h"

#include <math.h>
#include <stdio.h>

#include "next_command.h"
#include "sdm/internal/text.h"

/* A template saves little time if exact maps take less than this many times as long. */
#define SLOW 3.0

/* A kind whose maps take less than this part of the time of the other kind's is named for it. */
#define FASTER 0.2

/* "0.012 mm, 22 times worse": an error, compared with that of this run's model. */
static void add_error(sdm_text *text, double error, double own)
{
    const double ratio = error / own;
    sdm_text_add(text, "%.2g mm", error);
    if (ratio > 1.05)
        sdm_text_add(text, ", %.2g times worse", ratio);
    else if (ratio < 1 / 1.05)
        sdm_text_add(text, ", %.2g times better", 1 / ratio);
    else
        sdm_text_add(text, ", the same");
}

bool cli_errs_far_alone(const sdm_verdict *v)
{
    return v->limited && v->limit == SDM_CAUSE_FAR && !(v->cut > 0) && !sdm_verdict_broken(v);
}

/* The line `far away`. Returns whether pod may help. */
static bool print_far(const sdm_train_report *r)
{
    const sdm_verdict *v = &r->verdict;
    sdm_text price = {0};
    if (r->compared && !(r->other.rmse_mm < v->rmse_mm)) {
        sdm_text_add(&price, "pod is no better there, as auto has trained it, too: everywhere ");
        add_error(&price, r->other.rmse_mm, v->rmse_mm);
    } else if (r->compared || r->tried) {
        sdm_text_add(&price, "pod; auto has %s it, too: within a voxel of the surface ",
                     r->compared ? "trained" : "tried");
        add_error(&price, r->other_voxel_mm, v->rmse_voxel_mm);
        sdm_text_add(&price, "; everywhere ");
        add_error(&price, r->other.rmse_mm, v->rmse_mm);
        if (!r->compared) sdm_text_add(&price, " (a trial, which training improves)");
    } else {
        sdm_text_add(&price, "pod; this run has not measured it: near the surface it may be worse");
    }
    if (!price.failed)
        printf("  far away    where distances far from the surface matter: %s\n", price.data);
    sdm_text_dispose(&price);
    return !r->compared || r->other.rmse_mm < v->rmse_mm;
}

/* The line `slow` or `faster`. Returns whether pod may help. */
static bool print_slow(const sdm_train_report *r, const cli_timing *times)
{
    const bool known = r->compared || r->tried;
    if (sdm_verdict_broken(&r->verdict)) return false;
    const double other = known ? r->other_ms : NAN;
    const bool slow = times->ms_exact < SLOW * times->ms_network,
               faster = r->compared && r->other_grade != SDM_GRADE_POOR &&
                        other < FASTER * times->ms_network;
    // a little less time is worth no other errors
    if (r->kind != SDM_NETWORK_TEMPLATE || (!slow && !faster) || other > 0.5 * times->ms_network)
        return false;
    if (!slow) {
        printf(
            "  faster      a map of pod takes %.2g ms, %.2g times less than one of this template, "
            "with RMSE %.2g mm, within a voxel of the surface %.2g mm\n",
            other, times->ms_network / other, r->other.rmse_mm, r->other_voxel_mm);
        return true;
    }
    printf(
        "  slow        exact maps take only %.2g times as long as this template: the network saves "
        "little time; pod ",
        times->ms_exact / times->ms_network);
    if (!known)
        printf("may take far less; this run has not measured it\n");
    else
        printf("takes about %.2g ms, with RMSE %.2g mm, within a voxel of the surface %.2g mm%s\n",
               other, r->other.rmse_mm, r->other_voxel_mm,
               r->compared ? "" : " (a trial, which training improves)");
    return true;
}

void cli_print_pod(const cli_args *args, const sdm_train_report *r, const cli_timing *times,
                   double minutes)
{
    // the verdict, with the changes of the other kind: none but the minutes
    const sdm_verdict pod = {.minutes = fmax(minutes, r->pod_minutes)};
    const bool far = cli_errs_far_alone(&r->verdict) && !r->unfinished && print_far(r),
               slow = print_slow(r, times);
    if (!far && !slow) return;
    if (r->compared && r->other_path[0]) {
        printf("              pod is %s (%s)\n", r->other_path, sdm_grade_name(r->other_grade));
        return;
    }
    // the line `next` has the command
    if (!args->files.n || r->unfinished || sdm_verdict_needs_pod(&r->verdict) ||
        !cli_print_training("              ", args, r, &pod, "pod", "-pod"))
        return;
    // the pace of maps was not measured
    if (!r->chosen)
        printf("              (pod needs more maps, and may need more train.minutes: this command "
               "with --plan tells how many)\n");
}
