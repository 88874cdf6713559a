/* The trainings of a run: their order, their budgets, their comparison. */
#include "turns.h"

#include <math.h>
#include <stdio.h>

/* The used part of a budget in the unit of each of its three keys. */
static double used_of(const training_turns *r, const sdm_config *asked)
{
    if (asked->train.minutes > 0) return r->first.seconds / 60;
    const double steps = (double)r->first.steps;
    return asked->train.steps > 0 ? steps : steps * asked->train.batch;
}

double trainer_turns_budget(const sdm_config *c)
{
    return c->train.minutes > 0 ? c->train.minutes
           : c->train.steps > 0 ? (double)c->train.steps
                                : (double)c->train.samples;
}

void trainer_turn_config(const training_turns *r, const sdm_config *asked, sdm_config *out)
{
    *out = *asked;
    // a kind that the configuration names has its keys already
    if (asked->network.kind == SDM_NETWORK_AUTO) sdm_config_choose_kind(out, r->kind[r->at]);
    const double all = trainer_turns_budget(asked);
    double mine = all;
    if (r->at) {
        mine = all - used_of(r, asked);
    } else if (r->n > 1) {
        const double tried = asked->train.minutes > 0 ? fmin(r->tried / 60, all) : 0;
        mine = tried + (all - tried) * r->share;
    }
    if (asked->train.minutes > 0)
        out->train.minutes = mine;
    else if (asked->train.steps > 0)
        out->train.steps = (int64_t)ceil(mine);
    else
        out->train.samples = (int64_t)ceil(mine);
}

double trainer_turns_left(const training_turns *r, const sdm_config *asked)
{
    return 1 - used_of(r, asked) / trainer_turns_budget(asked);
}

const char *trainer_turn_name(sdm_network_kind kind)
{
    return kind == SDM_NETWORK_POD ? "pod" : "template";
}

const char *trainer_turn_file(sdm_network_kind kind)
{
    return kind == SDM_NETWORK_POD ? "model-pod.sdm" : "model-template.sdm";
}

turn_figures trainer_turn_figures(sdm_network_kind kind, const sdm_train_report *r)
{
    return (turn_figures){kind, r->accuracy.rmse_mm, r->verdict.rmse_voxel_mm, r->map_ms};
}

double trainer_score(const turn_figures *f) { return hypot(f->rmse_voxel_mm, 0.1 * f->rmse_mm); }

bool trainer_second_wins(const training_turns *r, const sdm_train_report *second)
{
    const int before = (int)r->first.verdict.grade, now = (int)second->verdict.grade;
    if (now != before) return now < before;
    const turn_figures a = trainer_turn_figures(r->kind[0], &r->first),
                       b = trainer_turn_figures(r->kind[1], second);
    return trainer_score(&b) < trainer_score(&a);
}

sdm_status trainer_turns_record(sdm_text *metrics, sdm_network_kind kind,
                                const sdm_network_kind *then, const char *reason,
                                const turn_figures *e, size_t n, sdm_error *err)
{
    char key[64];
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "phase", "auto");
    sdm_json_text(&j, "kind", trainer_turn_name(kind));
    if (then) sdm_json_text(&j, "then", trainer_turn_name(*then));
    if (reason) sdm_json_text(&j, "reason", reason);
    for (size_t i = 0; i < n; i++) {
        const char *name = trainer_turn_name(e[i].kind);
        snprintf(key, sizeof key, "%s_rmse_mm", name);
        sdm_json_real(&j, key, e[i].rmse_mm);
        snprintf(key, sizeof key, "%s_rmse_voxel_mm", name);
        sdm_json_real(&j, key, e[i].rmse_voxel_mm);
        snprintf(key, sizeof key, "%s_score_mm", name);
        sdm_json_real(&j, key, trainer_score(&e[i]));
    }
    sdm_json_close(&j, '}');
    if (!j.text.failed) sdm_text_add(metrics, "%s\n", j.text.data);
    const bool failed = j.text.failed || metrics->failed;
    sdm_json_dispose(&j);
    return failed ? sdm_fail(err, SDM_E_NOMEM, "no memory for the metrics") : SDM_OK;
}
