/* A run: the choice of the kinds of network, one training or two, the better model. */
#include <math.h>
#include <string.h>

#include "race.h"
#include "sdm/internal/checksum.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/file.h"
#include "sdm/internal/team.h"
#include "sdm/internal/text.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"
#include "state/checkpoint.h"
#include "state/export_model.h"
#include "state/judge.h"
#include "state/progress.h"
#include "train_folder.h"
#include "training.h"

/* Less than this part of the budget is no use for a second kind. */
static const double ENOUGH_LEFT = 0.25;

typedef struct run {
    const sdm_config *asked;
    sdm_config *settled; /* of the present training */
    training_turns turns;
    trial_gain gain[2]; /* of the trials, by turn */
    sdm_text metrics;
    bool resume; /* the present training goes on from its checkpoint */
} run;

/* *t = what all trainings of the run have in common. */
static void trainer_init(run *r, const sdm_instance *shape, const char *folder,
                         const sdm_train_hooks *hooks, trainer *t)
{
    *t = (trainer){.config = r->asked,
                   .shape = shape,
                   .folder = folder,
                   .n_threads = sdm_threads(r->asked->threads),
                   .started = sdm_clock(),
                   .loss = NAN,
                   .heldout_mse = NAN,
                   .evaluated_step = -1,
                   .metrics = &r->metrics,
                   .turns = &r->turns};
    if (hooks) t->hooks = *hooks;
    // rank 0 alone tells and asks
    if (!trainer_writes(t)) t->hooks = (sdm_train_hooks){.comm = hooks->comm};
}

/* Settles which kinds are trained: with network.kind: auto by a race, or as the checkpoint says. */
static sdm_status settle(run *r, trainer *t, sdm_error *err)
{
    sdm_status s = SDM_OK;
    r->turns = (training_turns){.n = 1, .kind = {r->asked->network.kind}, .share = 1};
    if (r->asked->network.kind == SDM_NETWORK_AUTO) {
        bool found = false;
        if (r->resume) s = trainer_checkpoint_turns(t, &r->turns, &found, err);
        // the folder may have been moved
        trainer_export_path(t, r->turns.first.model_path);
        if (!s && !found) {
            if (r->resume) trainer_tell_no_checkpoint(t);
            r->resume = false;
            s = trainer_race(t, r->settled, &r->turns, r->gain, err);
            r->turns.tried = trainer_shared_seconds(t);
        }
    }
    r->turns.budget = trainer_turns_budget(r->asked);
    return s;
}

/* Trains the kind of the present turn. *unfit: as trainer_training() tells. */
static sdm_status train_turn(run *r, const trainer *common, bool *unfit, sdm_train_report *report,
                             sdm_error *err)
{
    trial_gain *gain = &r->gain[r->turns.at];
    trainer t = *common;
    trainer_turn_config(&r->turns, r->asked, r->settled);
    t.config = r->settled;
    t.design = gain->design, t.tried = gain->maps;
    *gain = (trial_gain){0};
    const sdm_status s = trainer_training(&t, r->resume, unfit, report, err);
    r->resume = false;
    return s;
}

/* Adds the figures of the trial of the kind that was not trained. */
static void report_trial(const training_turns *r, sdm_train_report *report)
{
    report->pod_minutes = fmax(report->pod_minutes, r->pod_minutes);
    report->trial_minutes = r->trial_minutes;
    report->template_seconds = r->template_seconds;
    if (r->untried) {
        report->unfinished = true;
        trainer_verdict_unfinished(trainer_turn_name(SDM_NETWORK_TEMPLATE),
                                   trainer_turn_name(SDM_NETWORK_POD), false, &report->verdict);
    }
    if (!r->tried_other) return;
    report->tried = true;
    report->other = (sdm_accuracy){.rmse_mm = r->other.rmse_mm};
    report->other_voxel_mm = r->other.rmse_voxel_mm;
    report->other_ms = r->other.map_ms;
    report->other_kind = r->other.kind;
}

/* Tells and records that the second kind is trained now: it is its turn then. It is not if a good
 * first one suffices, or if hardly any of the budget is left, which *report tells. */
static sdm_status begin_second(run *r, const trainer *t, sdm_train_report *report, sdm_error *err)
{
    const double left = trainer_turns_left(&r->turns, r->asked);
    const char *first = trainer_turn_name(r->turns.kind[0]),
               *second = trainer_turn_name(r->turns.kind[1]);
    if (r->turns.if_good && report->verdict.grade == SDM_GRADE_GOOD) {
        trainer_message(t, "auto: %s is kept without a comparison: it is good", first);
        report_trial(&r->turns, report);
        return SDM_OK;
    }
    if (left < ENOUGH_LEFT) {
        trainer_message(t, "auto: %s is kept: hardly any of the budget is left for %s", first,
                        second);
        report->unfinished = true;
        report_trial(&r->turns, report);
        trainer_verdict_unfinished(first, second, r->turns.tried_other, &report->verdict);
        return SDM_OK;
    }
    const turn_figures figures = trainer_turn_figures(r->turns.kind[0], &r->turns.first);
    const sdm_status s =
        trainer_turns_record(&r->metrics, r->turns.kind[1], NULL, NULL, &figures, 1, err);
    if (s) return s;
    trainer_message(t,
                    "auto: %s leaves %.2g mm within a voxel of the surface, %.2g mm everywhere; %s "
                    "is trained with %.0f %% of the budget",
                    first, figures.rmse_voxel_mm, figures.rmse_mm, second, 100 * left);
    r->turns.at = 1;
    return SDM_OK;
}

/* Compares the two kinds, tells and records which is kept; *report becomes that of the run. */
static sdm_status keep_better(run *r, trainer *t, sdm_train_report *report, sdm_error *err)
{
    const sdm_train_report both[2] = {r->turns.first, *report};
    const int best = trainer_second_wins(&r->turns, &both[1]);
    turn_figures figures[2];
    for (int i = 0; i < 2; i++) {
        figures[i] = trainer_turn_figures(r->turns.kind[i], &both[i]);
        trainer_message(t,
                        "auto: %s leaves %.2g mm within a voxel of the surface, %.2g mm "
                        "everywhere%s",
                        trainer_turn_name(r->turns.kind[i]), figures[i].rmse_voxel_mm,
                        figures[i].rmse_mm, i == best ? ": it is kept" : "");
    }
    *report = both[best];
    report->seconds = both[0].seconds + both[1].seconds;
    report->verdict.saved_seconds = both[1].verdict.saved_seconds;
    report->compared = true;
    report->pod_minutes = fmax(both[0].pod_minutes, both[1].pod_minutes);
    report->other = both[!best].accuracy;
    report->other_voxel_mm = both[!best].verdict.rmse_voxel_mm;
    report->other_ms = both[!best].map_ms;
    report->other_derivative = both[!best].verdict.derivative_error;
    report->other_grade = both[!best].verdict.grade;
    memcpy(report->other_path, both[1].other_path, sizeof report->other_path);
    report->other_kind = r->turns.kind[!best];
    const sdm_status s =
        trainer_turns_record(&r->metrics, r->turns.kind[best], NULL, NULL, figures, 2, err);
    return s ? s : trainer_metrics_write(t, err);
}

/* Trains the second kind in the budget that the first has left. If it cannot be trained, the first
 * is kept; after any other error the checkpoint stays, to go on from. */
static sdm_status train_second(run *r, trainer *t, sdm_train_report *report, sdm_error *err)
{
    sdm_error reason = {0};
    sdm_train_report second = {0};
    bool unfit;
    t->started = sdm_clock();
    const sdm_status s = train_turn(r, t, &unfit, &second, &reason);
    if (!s) {
        const sdm_status kept = keep_better(r, t, &second, err);
        *report = second;
        return kept;
    }
    if (!unfit) {
        if (err) *err = reason;
        return s;
    }
    trainer_warn(t, "auto: %s is kept, because %s failed: %s", trainer_turn_name(r->turns.kind[0]),
                 trainer_turn_name(r->turns.kind[1]), reason.text);
    *report = r->turns.first;
    report_trial(&r->turns, report);
    return trainer_checkpoint_remove(t, err);
}

/* All trainings of the run. */
static sdm_status train_all(run *r, trainer *t, sdm_train_report *report, sdm_error *err)
{
    bool unfit;
    sdm_status s = settle(r, t, err);
    if (!s && r->turns.at == 0) {
        s = train_turn(r, t, &unfit, report, err);
        if (!s && r->turns.n == 1) report_trial(&r->turns, report);
        if (s || r->turns.n == 1) return s;
        r->turns.first = *report;
        s = begin_second(r, t, report, err);
    }
    return s || r->turns.at == 0 ? s : train_second(r, t, report, err);
}

/* Refuses ranks with another program or configuration than rank 0. */
static sdm_status check_same(const trainer *t, sdm_error *err)
{
    sdm_comm *comm = t->hooks.comm;
    sdm_text text = {0};
    if (!comm) return SDM_OK;
    sdm_status s = trainer_export_dump(t, &text, err);
    if (!s) sdm_text_add(&text, "%s", SDM_VERSION_TEXT);
    const uint64_t mine = sdm_crc64(0, text.data, text.size);
    uint64_t first = mine;
    sdm_text_dispose(&text);
    if (!s) s = sdm_comm_broadcast(comm, 0, &first, sizeof first, err);
    if (!s && mine != first)
        s = sdm_fail(err, SDM_E_UNSUPPORTED,
                     "rank %d of %d has another configuration or another version of the program "
                     "than rank 0",
                     sdm_comm_rank(comm), sdm_comm_size(comm));
    return s;
}

sdm_status sdm_train(const sdm_config *config, const sdm_instance *shape, const char *folder,
                     bool resume, const sdm_train_hooks *hooks, sdm_train_report *report,
                     sdm_error *err)
{
    run r = {.asked = config, .resume = resume};
    trainer t;
    sdm_train_report result = {0};
    sdm_team *team = NULL;
    trainer_init(&r, shape, folder, hooks, &t);
    const size_t existing = sdm_folder_existing(folder);
    int lock = -1;
    sdm_status s = check_same(&t, err);
    if (!s && trainer_writes(&t)) s = sdm_make_folder(folder, err);
    if (!s && trainer_writes(&t)) s = trainer_folder_take(folder, &lock, err);
    s = sdm_comm_agree(t.hooks.comm, s, err);
    if (!s) s = SDM_ALLOC(&r.settled, 1, "configuration", err);
    if (!s) s = sdm_team_start(t.n_threads, &team, err);
    if (!s) s = train_all(&r, &t, &result, err);
    trainer_folder_leave(folder, lock);
    if (s && trainer_writes(&t)) sdm_folder_remove_empty(folder, existing);
    if (!s && report) *report = result;
    for (size_t i = 0; i < 2; i++) trainer_dataset_dispose(&r.gain[i].maps);
    sdm_text_dispose(&r.metrics);
    sdm_team_end(team);
    sdm_free(r.settled);
    return s;
}
