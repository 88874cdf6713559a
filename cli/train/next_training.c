/* Prints the command that follows the advice of a finished training. */
#include "next_training.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "next_command.h"
#include "other_kind.h"

/* A smaller error at the surface than this part of a voxel is worth no training. */
#define SMALL 0.02

/* A finer grid has at most this many times the voxels, or it is not advised for a use alone. */
#define FINER 16.0

/* A longer training of a kind that errs by more than this multiple of another makes it no better
   than the other. */
#define MUCH_WORSE 1.5
// bytes of the part of a note about a command that leaves the kind open
#define OPEN_NOTE 320
// the reason for a command that trains a template; its time, s
#define SKIPPED                                                                                    \
    "auto had no time to try template, which takes about %.3g s and is mostly the better kind "    \
    "for a shape of several parts"

/* The command of the lines `next` and `better`. Returns whether it was printed. */
static bool print_command(const char *begin, const cli_args *args, const sdm_train_report *r,
                          const sdm_verdict *changes, const char *kind)
{
    return cli_print_training(begin, args, r, changes, kind, "-2");
}

void cli_show_part_first(sdm_train_report *r, double thin_spacing, double minutes)
{
    sdm_verdict *v = &r->verdict;
    const double factor = pow(v->coarse_mm / thin_spacing, 3);
    char time[80] = "";
    if (!(factor > 1) || sdm_verdict_broken(v) || sdm_verdict_lacks_part(v)) return;
    v->limited = true, v->limit = SDM_CAUSE_GRID, v->at_best_mm = NAN;
    strcpy(v->key, "grid.spacing");
    v->from = v->coarse_mm, v->to = thin_spacing;
    v->minutes = r->steps > 0 ? ceil(2 * factor * minutes) / 2 : 0;
    if (v->minutes > 0)
        snprintf(time, sizeof time, ", and train.minutes from %.3g to %.6g for more voxels",
                 minutes, v->minutes);
    snprintf(v->sentence, sizeof v->sentence,
             "The grid is too coarse for the thinnest part of some shapes, as a warning at the "
             "beginning says: lower grid.spacing from %.6g to %.6g (and raise grid.size in "
             "proportion, if it is given)%s.",
             v->from, v->to, time);
}

/* The line `next` of a template that errs near the surface. */
static void print_next_pod(const cli_args *args, const sdm_train_report *r, double minutes)
{
    const double ratio = r->other_voxel_mm / r->verdict.rmse_voxel_mm;
    // auto has given pod a part of the minutes
    const sdm_verdict pod = {.minutes = fmax(r->compared ? 2 * minutes : minutes, r->pod_minutes)};
    // with too few maps pod shows nothing of what it can do
    if (r->compared && ratio > MUCH_WORSE && !(r->pod_minutes > minutes)) {
        printf(
            "  next        no training is known to help near the surface: pod, which auto has "
            "trained, too, is %.2g times worse there; exact maps (sdmgen exact, fit --exact) have "
            "no such error\n",
            ratio);
        return;
    }
    if (args->files.n) print_command("  next        ", args, r, &pod, "pod");
}

/* *use = the first use in `not for` that a finer grid gives back, NULL: none. Returns the spacing
 * of this grid. */
static double finer_use(const sdm_verdict *v, const char **use)
{
    const double volumes = sdm_verdict_spacing(v), fits = sdm_verdict_fit_spacing(v);
    *use = isfinite(volumes) ? "volumes of surfaces"
           : isfinite(fits)  ? "fits by the network alone"
                             : NULL;
    return isfinite(volumes) ? volumes : fits;
}

/* The key that the sentence of the verdict names, without a number too; "": none. */
static const char *named_key(const sdm_verdict *v)
{
    return !v->key[0] && v->limited && v->limit == SDM_CAUSE_ROUNDING ? "network.weights" : v->key;
}

/* Has network.kind: auto left the other kind without a trial and a training? Then no command names
 * the kind that was trained. */
static bool is_open(const sdm_train_report *r)
{
    return r->trial_minutes > 0 && !r->tried && !r->compared && !sdm_verdict_broken(&r->verdict);
}

/* Does a command that changes this key leave the kind to auto? With voxels of another size a
 * template that needs no training takes far less time than the trials. */
static bool leaves_open(const sdm_train_report *r, const char *key)
{
    const bool cheap = r->kind == SDM_NETWORK_TEMPLATE && !r->steps;
    return is_open(r) && !(cheap && !strncmp(key, "grid.", 5));
}

/* Did auto take pod because it had no time for a template that most likely needs no training? */
static bool skipped_template(const sdm_train_report *r)
{
    return is_open(r) && r->kind == SDM_NETWORK_POD && r->template_seconds > 0;
}

/* train.minutes that hold the trials of both kinds. factor: by which a map takes longer on the grid
 * of the training. */
static double least_minutes(const sdm_train_report *r, double factor)
{
    return ceil(10 * factor * r->trial_minutes - 1e-6) / 10;
}

/* Returns the changes of keys, with train.minutes raised so that they hold the trials of both
 * kinds. factor: by which a map takes longer on the grid of the changes. */
static sdm_verdict with_trials(const sdm_train_report *r, const sdm_verdict *changes, double factor)
{
    sdm_verdict v = *changes;
    const double least = least_minutes(r, factor);
    if (!strcmp(v.key, "train.minutes"))
        v.to = fmax(v.to, least);
    else
        v.minutes = fmax(v.minutes, least);
    return v;
}

/* How many times as long a map takes on the grid of a key that makes its voxels smaller. */
static double finer_factor(const sdm_verdict *v)
{
    return strcmp(v->key, "grid.spacing") ? 1 : fmax(1, pow(v->from / v->to, 3));
}

/* The changes of a verdict for the grid alone, and train.minutes. */
static sdm_verdict grid_changes(const sdm_verdict *v, double minutes)
{
    sdm_verdict changes = {.minutes = minutes, .cut = v->cut, .from = v->from, .to = v->to};
    if (!strncmp(v->key, "grid.", 5)) memcpy(changes.key, v->key, sizeof changes.key);
    return changes;
}

/* The line `next` or `better`, after `begin`, of a run of auto that has kept a template because its
 * budget did not reach for pod: trains pod, on the grid that the verdict asks for; if pod had no
 * trial, with minutes for the trials of both, which cost less than a training in vain. */
static void print_pod_too(const char *begin, const cli_args *args, const sdm_train_report *r,
                          double minutes)
{
    const sdm_verdict *v = &r->verdict;
    const double alone = fmax(fmax(minutes, r->pod_minutes), v->minutes);
    const bool open = is_open(r);
    sdm_verdict changes = grid_changes(v, open ? minutes : alone);
    if (open) changes = with_trials(r, &changes, finer_factor(&changes));
    if (!args->files.n || !print_command(begin, args, r, &changes, open ? NULL : "pod")) return;
    if (open) {
        printf("              (auto had no time for pod: this train.minutes is enough to try both "
               "kinds");
        if (alone > changes.minutes) printf("; a training of pod alone asks for %.6g", alone);
        printf(")\n");
        return;
    }
    printf("              (auto had no time left for pod");
    if (r->tried)
        printf(": its trial left %.2g mm within a voxel of the surface, %.2g mm everywhere, which "
               "training improves",
               r->other_voxel_mm, r->other.rmse_mm);
    // trials and first training used one half
    if (minutes > 0)
        printf("; train.minutes=%.6g with auto compares both",
               ceil(10 * (alone + fmax(minutes, r->seconds / 60))) / 10);
    printf(")\n");
}

/* The line `next` or `better`, after `begin`, of a run of auto that took pod because it had no time
 * for a trial of the template: trains the template, which takes little. Returns whether it is
 * printed. */
static bool print_template_first(const char *begin, const cli_args *args, const sdm_train_report *r)
{
    const sdm_verdict changes = grid_changes(&r->verdict, 0);
    if (!print_command(begin, args, r, &changes, "template")) return false;
    printf("              (" SKIPPED "; if its line `before` says worse, change the key that "
           "`verdict` names here)\n",
           r->template_seconds * finer_factor(&changes));
    return true;
}

/* The part of a note about a command that leaves the kind open. minutes: train.minutes that are
 * enough for the kind of this run alone; 0: not known. factor: by which a map takes longer on the
 * grid of the command. */
static const char *open_note(const sdm_train_report *r, double minutes, double factor,
                             char text[OPEN_NOTE])
{
    const bool pod = r->kind == SDM_NETWORK_POD;
    char alone[80] = "";
    if (minutes > 0 && minutes < least_minutes(r, factor))
        snprintf(alone, sizeof alone, "; with network.kind=%s %.3g are enough",
                 pod ? "pod" : "template", minutes);
    snprintf(text, OPEN_NOTE,
             "network.kind stays auto: this run had no time to try %s; at its pace the "
             "train.minutes of this command are enough for both kinds%s; ",
             pod ? "template" : "pod", alone);
    return text;
}

/* Is the model good, with a small error at the surface and no key of the grid to change? */
static bool errs_little(const sdm_verdict *v)
{
    return v->grade == SDM_GRADE_GOOD && v->rmse_voxel_mm / v->voxel_mm < SMALL &&
           strncmp(v->key, "grid.", 5) != 0;
}

/* The line `better` of a model that errs little and has no line `not for`: that nothing needs to
 * change. Returns whether it is printed. */
static bool print_enough(const sdm_verdict *v)
{
    const char *named = named_key(v);
    char unfit[SDM_MODEL_UNFIT], wait[80];
    sdm_verdict_unfit(v, unfit);
    if (!errs_little(v) || unfit[0]) return false;
    snprintf(wait, sizeof wait, "%s can wait", named);
    printf("  better      %s: the error at the surface is %.2g voxels, and there is no line "
           "`not for`\n",
           *named ? wait : "nothing needs to change", v->rmse_voxel_mm / v->voxel_mm);
    return true;
}

/* The line `better` of a model that errs little: a grid for the first use that it leaves out for
 * its voxels. Returns whether it is printed. */
static bool print_finer(const cli_args *args, const sdm_train_report *r, const char *kind,
                        double minutes)
{
    const sdm_verdict *v = &r->verdict;
    const char *use, *named = named_key(v);
    const double voxels = v->rmse_voxel_mm / v->voxel_mm, spacing = finer_use(v, &use),
                 factor = pow(v->coarse_mm / spacing, 3);
    char wait[80] = "nothing else needs to change";
    if (!errs_little(v)) return false;
    if (*named) snprintf(wait, sizeof wait, "%s can wait", named);
    if (!use || !(factor > 1 && factor <= FINER) || !args->files.n || args->dataset) return false;
    char open[OPEN_NOTE] = "";
    sdm_verdict finer = {.to = spacing,
                         .minutes = r->steps > 0 ? ceil(2 * factor * minutes) / 2 : 0};
    strcpy(finer.key, "grid.spacing");
    if (skipped_template(r)) {
        kind = "template", finer.minutes = 0;
        snprintf(open, sizeof open, SKIPPED "; ", r->template_seconds * factor);
    } else if (leaves_open(r, finer.key)) {
        kind = NULL;
        open_note(r, finer.minutes, factor, open);
        finer = with_trials(r, &finer, factor);
    }
    if (!print_command("  better      ", args, r, &finer, kind)) return false;
    printf(
        "              (%sthe finer grid is for %s, see `not for`%s; it has %.2g times the voxels; "
        "%s, because the error at the surface is only %.2g voxels)\n",
        open, use, strstr(use, "fits") ? ": sdmgen fit --shape needs no network" : "", factor, wait,
        voxels);
    return true;
}

/* The note below the command: which kind it trains, and whether it mends what `not for` names. */
static void print_note(const sdm_train_report *r, const char *kind, double ms_map)
{
    const sdm_verdict *v = &r->verdict;
    char open[OPEN_NOTE], unfit[SDM_MODEL_UNFIT], time[60] = "";
    sdm_text note = {0};
    sdm_verdict_unfit(v, unfit);
    // the maps of another grid take another time
    if (strncmp(v->key, "grid.", 5))
        snprintf(time, sizeof time, ", whose maps take %.3g ms", ms_map);
    if (leaves_open(r, v->key))
        sdm_text_add(&note, "%s",
                     open_note(r, strcmp(v->key, "train.minutes") ? v->minutes : v->to,
                               finer_factor(v), open));
    else if (kind && isfinite(ms_map))
        sdm_text_add(&note, "the kind stays %s%s; without network.kind=%s auto chooses again; ",
                     kind, time, kind);
    if (unfit[0] && strncmp(v->key, "grid.", 5))
        sdm_text_add(&note, "this change makes distances better; the uses in `not for` may need "
                            "another change; ");
    else if (v->derivatives_bad[0])
        sdm_text_add(&note, "derivatives of maps may need another change; ");
    if (!note.failed && note.size > 2)
        printf("              (%.*s)\n", (int)(note.size - 2), note.data);
    sdm_text_dispose(&note);
}

void cli_print_next(const cli_args *args, const sdm_train_report *r, const char *kind,
                    double ms_map, double minutes)
{
    const sdm_verdict *v = &r->verdict;
    const char *begin = v->grade == SDM_GRADE_GOOD ? "  better      " : "  next        ";
    // the maps of another grid are not in --dataset
    const bool other_maps = args->dataset && (v->cut > 0 || !strncmp(v->key, "grid.", 5));
    const bool open = is_open(r);
    if (r->kind == SDM_NETWORK_TEMPLATE && !sdm_verdict_broken(v) && !other_maps &&
        (r->unfinished || (open && sdm_verdict_needs_pod(v)))) {
        print_pod_too(begin, args, r, minutes);
        return;
    }
    if (sdm_verdict_needs_pod(v)) {
        print_next_pod(args, r, minutes);
        return;
    }
    if (print_enough(v)) return;
    if (print_finer(args, r, kind, minutes)) return;
    if (skipped_template(r) && !other_maps && args->files.n && print_template_first(begin, args, r))
        return;
    // no key helps a good template that errs far away alone; the line `far away` has its command
    const bool enough = cli_errs_far_alone(v) && v->grade == SDM_GRADE_GOOD;
    if ((!v->key[0] && !(v->cut > 0) && (!open || enough)) || !args->files.n || other_maps) return;
    const bool leaves = leaves_open(r, v->key);
    const sdm_verdict changes = leaves ? with_trials(r, v, finer_factor(v)) : *v;
    if (print_command(begin, args, r, &changes, leaves ? NULL : kind)) print_note(r, kind, ms_map);
}
