/* The look at a shape before the trials of network.kind: auto. */
#include "look.h"

#include <math.h>

#include "data/dataset_fill.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "set_up.h"
#include "state/export_model.h"
#include "state/progress.h"
#include "template/template_kind.h"

/* Maps that show the pace: held-out ones, and random ones for each thread. */
enum { FIRST_HOLDOUT = 8, FIRST_EACH = 2 };

/* The design of a template takes as long as this many exact maps (docs/notes/network.md). */
static const double DESIGN_BENDS = 600, DESIGN_RIGID = 40;

/* About the seconds of both trials. Each makes held-out maps and at least FILL_LEAST_RANDOM others
 * (the template of rigid parts has no others), whose bases take about as long. */
static double trials_seconds(const trial_look *l, double holdout, double random)
{
    const double pod = holdout + 2 * random;
    return l->per_map * (l->bends ? DESIGN_BENDS + 2 * pod : DESIGN_RIGID + holdout + pod);
}

static bool look_cancelled(void *user) { return trainer_cancelled(user); }

sdm_status trainer_look(const trainer *t, sdm_config *config, trial_look *out, sdm_error *err)
{
    const int64_t each = FIRST_EACH * (int64_t)t->n_threads * sdm_comm_size(t->hooks.comm),
                  random = config->data.start, holdout = config->data.holdout;
    config->data.start = random < each ? random : each;
    config->data.holdout = holdout < FIRST_HOLDOUT ? holdout : FIRST_HOLDOUT;
    sdm_text metrics = {0}, text = {0};
    trainer r = {.config = config,
                 .shape = t->shape,
                 .kind = trainer_kind_find(SDM_NETWORK_POD),
                 .hooks = {.cancelled = t->hooks.cancelled,
                           .store = t->hooks.store,
                           .comm = t->hooks.comm,
                           .user = t->hooks.user},
                 .n_threads = t->n_threads,
                 .started = sdm_clock(),
                 .metrics = &metrics};
    const fill_hooks hooks = {.cancelled = look_cancelled, .user = &r};
    // a configuration that no model can hold is refused before the maps
    sdm_status s = trainer_export_dump(&r, &text, err);
    sdm_text_dispose(&text);
    if (!s) s = trainer_set_up(&r, err);
    if (!s) {
        s = trainer_template_look(&r, &out->bends, err);
        // the trial of the template tells why it is impossible
        if (s == SDM_E_UNSUPPORTED) s = SDM_OK;
    }
    const double began = trainer_shared_seconds(&r);
    if (!s) s = trainer_dataset_fill(&r.data, r.n_threads, &hooks, err);
    out->per_map =
        (trainer_shared_seconds(&r) - began) / (double)(config->data.holdout + config->data.start);
    out->trials =
        trials_seconds(out, (double)holdout, fmin((double)random, (double)FILL_LEAST_RANDOM));
    out->lacks_time =
        trainer_by_time(t) && out->trials > TRAINER_TRIALS_SHARE * 60 * t->config->train.minutes;
    if (!s && out->bends && out->lacks_time) {
        s = trainer_template_look_parts(&r, &out->divides, err);
        if (s == SDM_E_UNSUPPORTED) s = SDM_OK;
    }
    out->maps = r.data;
    r.data = (dataset){0};
    sdm_free(r.blocks);
    sdm_text_dispose(&metrics);
    return s;
}
