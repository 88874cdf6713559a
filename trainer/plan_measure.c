/* Measures the work of a training by small trainings that write nothing. All times are processor
 * time of all threads: other programs on the machine do not count. */
#include <math.h>
#include <time.h>

#include "data/dataset_fill.h"
#include "pod/mlp.h"
#include "pod/pod_state.h"
#include "race.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/team.h"
#include "sdm/internal/text.h"
#include "sdm/internal/threads.h"
#include "sdm/internal/train_plan.h"
#include "sdm/memory.h"
#include "set_up.h"
#include "state/progress.h"

/* Time that the maps of a measurement and its steps may take: core seconds, seconds. */
static const double MAP_SECONDS = 1, STEP_SECONDS = 2.2;

enum { HOLDOUT = 8, FEWEST = 24, MOST = 192 };

/* Steps of a phase and the time at two reports. */
typedef struct phase_pace {
    int64_t step[2];
    double seconds[2];
    bool seen;
} phase_pace;

typedef struct measurement {
    const sdm_train_hooks *hooks;
    phase_pace pace[SDM_PHASE_EVALUATE + 1];
    sdm_text metrics;
    trainer t;
    double set_up, maps, begin; /* core seconds */
    double ended;               /* processor_seconds() after the steps */
} measurement;

static double processor_seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static bool is_cancelled(void *user)
{
    const measurement *m = user;
    return m->hooks && m->hooks->cancelled && m->hooks->cancelled(m->hooks->user);
}

static void note_progress(void *user, const sdm_progress *p)
{
    phase_pace *pace = &((measurement *)user)->pace[p->phase];
    const int at = pace->seen ? 1 : 0;
    pace->step[at] = p->step;
    pace->seconds[at] = processor_seconds();
    pace->seen = true;
}

/* Seconds of a step in a phase; 0: there was none. */
static double step_seconds(const measurement *m, sdm_phase phase)
{
    const phase_pace *p = &m->pace[phase];
    const double steps = (double)(p->step[1] - p->step[0]);
    if (steps > 0) return (p->seconds[1] - p->seconds[0]) / steps;
    // slow steps: all of the last phase, with the end of the training
    return p->seen && m->t.phase == phase && m->t.phase_step > 0
               ? (m->ended - p->seconds[0]) / (double)m->t.phase_step
               : 0;
}

/* The configuration of a small training on n maps, with network.kind: auto of this kind. */
static void small_config(const sdm_config *from, sdm_network_kind kind, size_t n, sdm_config *c)
{
    *c = *from;
    sdm_config_choose_kind(c, from->network.kind == SDM_NETWORK_AUTO ? kind : from->network.kind);
    c->data.start = (int64_t)n;
    c->data.n_static_counts = 0;
    c->data.online = 0;
    c->data.sampling = SDM_SAMPLING_UNIFORM;
    if (c->data.holdout > HOLDOUT) c->data.holdout = HOLDOUT;
    c->network.fine = 0;
    c->train.steps = c->train.samples = 0;
    c->train.patience = 0;
    if (c->train.refine > 0) c->train.refine = 0.5;
    // the steps get what is left after the preparations
    c->train.minutes = 1e6;
}

static void dispose(measurement *m)
{
    if (m->t.kind) m->t.kind->dispose(&m->t);
    trainer_dataset_dispose(&m->t.data);
    sdm_free(m->t.blocks);
    sdm_text_dispose(&m->metrics);
}

/* Set-up, maps and bases of a small training. */
static sdm_status prepare(measurement *m, const sdm_config *c, const sdm_instance *shape,
                          sdm_error *err)
{
    trainer *t = &m->t;
    const fill_hooks hooks = {.cancelled = is_cancelled, .user = m};
    *t = (trainer){.config = c,
                   .shape = shape,
                   .kind = trainer_kind_find(c->network.kind),
                   .hooks = {.progress = note_progress, .cancelled = is_cancelled, .user = m},
                   .n_threads = sdm_threads(c->threads),
                   .started = sdm_clock(),
                   .loss = NAN,
                   .heldout_mse = NAN,
                   .evaluated_step = -1,
                   .metrics = &m->metrics};
    const double start = processor_seconds();
    sdm_status s = trainer_set_up(t, err);
    const double ready = processor_seconds();
    if (!s) s = trainer_dataset_fill(&t->data, t->n_threads, &hooks, err);
    const double filled = processor_seconds();
    if (!s) s = trainer_check_grid(t, err);
    if (!s) s = t->kind->begin(t, err);
    m->set_up = ready - start, m->maps = filled - ready, m->begin = processor_seconds() - filled;
    return s;
}

/* ---- the sizes of the whole training ---- */

/* Times of the global modes of all maps, by subspace iterations: products of the coefficients and
 * the modes, and orthonormalisations. */
static void modes_times(double flops_per_second, sdm_train_work *w)
{
    const double n = w->n_maps, k = w->coefficients, r = w->modes_kept;
    w->modes_products = 16 * n * k * r / flops_per_second;
    w->modes = w->modes_products + 24 * r * r * (n + k) / flops_per_second;
}

static void pod_sizes(const trainer *t, const sdm_config *c, sdm_train_work *w)
{
    const pod_state *pod = t->state;
    const sdm_pod_arch *a = &pod->arch;
    const size_t n_blocks = a->levels.first[a->levels.n];
    size_t degree = (size_t)c->network.degree;
    // as many terms as the maps before training can determine
    while (degree > 0 && (double)sdm_poly_count(a->n_params, degree) >
                             2 * (w->n_maps - (double)c->data.online) / 3)
        degree--;
    w->coefficients = (double)a->n_coefficients;
    w->latents = (double)sdm_poly_count(a->n_params, degree) + (a->depth ? (double)a->width : 0);
    w->basis = (double)pod->matrix_at[n_blocks];
    w->trees = (double)(n_blocks - a->levels.first[a->levels.n - 1]);
    w->modes_kept = fmin((double)c->network.modes, fmin(w->n_maps, w->coefficients));
    w->depth = (double)a->depth, w->width = (double)a->width;
    w->batch = (double)c->train.batch, w->refine_batch = (double)c->train.refine_batch;
    w->keep = 4.0 * c->network.rank;
    const double mlp = (double)trainer_mlp_count(a);
    w->fit_weights = mlp + w->modes_kept * w->width;
    w->weights = mlp + w->coefficients * w->latents + w->basis + w->n_voxels;
    w->shared = true;
}

/* Numbers of maps and of steps. The steps of a budget of time are those of one node with the cores
 * of the measurement. */
static sdm_status count_maps(const trainer *t, const sdm_config *c, sdm_train_work *w,
                             sdm_error *err)
{
    dataset d = t->data;
    const sdm_status s = trainer_dataset_static(&d, c, err);
    if (s) return s;
    w->n_params = (double)d.n_params;
    w->n_voxels = (double)d.n_voxels;
    w->n_map_voxels = (double)sdm_grid_count(d.grid);
    w->n_holdout = (double)c->data.holdout;
    if (!d.only_holdout) w->n_maps = (double)d.n_static + (double)(c->data.start + c->data.online);
    const double room = c->data.memory_gb * 1e9 / (2 * w->n_voxels) - 2 * w->n_holdout;
    w->n_pool = fmin(w->n_maps, room);
    return SDM_OK;
}

static void count_steps(const sdm_config *c, sdm_train_work *w)
{
    // without a perceptron all steps are those of the refinement
    const double refine = w->shared ? c->train.refine : 0,
                 share = refine > 0 && !(w->fit_step > 0) ? 1 : refine;
    double steps = (double)c->train.steps;
    if (c->train.samples > 0) steps = ceil((double)c->train.samples / (double)c->train.batch);
    if (c->train.minutes > 0) {
        const double before = w->trials + w->design + (w->n_maps + w->n_holdout) * w->map +
                              w->bases + w->modes,
                     left = fmax(0, c->train.minutes * 60 * w->threads - before);
        w->steps = w->fit_step > 0 ? floor(left * (1 - share) / w->fit_step) : 0;
        w->refine_steps = w->refine_step > 0 ? floor(left * share / w->refine_step) : 0;
        return;
    }
    w->steps = w->fit_step > 0 ? floor((1 - share) * steps + 0.5) : 0;
    w->refine_steps = share > 0 ? steps - w->steps : 0;
}

/* Work of the trials of network.kind: auto, where bases of n maps take fixed + per_map n for pod.
 * small: of the template, on n_small maps; small_bases: the bases of pod of as many. The maps of
 * one of the two trials are maps of the training, too. Where the template is refused, pod is not
 * tried. */
static void trials_work(const sdm_config *c, double fixed, double per_map, double small_bases,
                        const measurement *small, sdm_train_work *w)
{
    const dataset *d = &small->t.data;
    const double n = (double)trainer_trial_maps(c, (size_t)w->n_params),
                 holdout = (double)trainer_trial_holdout(c),
                 most = c->train.minutes > 0
                            ? TRAINER_TRIALS_SHARE * 60 * c->train.minutes * w->threads
                            : INFINITY;
    if (c->network.kind != SDM_NETWORK_AUTO) return;
    w->trials = small->set_up;
    if (w->only_pod) return;
    const double n_small = (double)(d->n_start + d->n_holdout), map = small->maps / n_small;
    w->trial_maps = fmin((d->only_holdout ? 0 : n) + holdout, most / map);
    const double bases = fixed + per_map * fmin(n, most / w->map),
                 larger = d->only_holdout ? 1 : fmax(1, bases / fmax(small_bases, 1e-9));
    w->trials += w->trial_maps * map + small->begin * larger + bases;
}

/* Work of a whole training from those of two small ones with few and with more maps, and of a small
 * template for the trials of network.kind: auto. */
static void extrapolate(const measurement *few, measurement *more, const measurement *carried,
                        const sdm_config *c, sdm_train_work *w)
{
    trainer *t = &more->t;
    const double n1 = (double)few->t.data.n_start, n2 = (double)t->data.n_start;
    const bool pod = t->kind != trainer_kind_find(SDM_NETWORK_DEEPSDF) && !t->data.only_holdout;
    w->design = more->set_up;
    w->map = more->maps / (n2 + (double)t->data.n_holdout);
    w->fit_step = step_seconds(more, SDM_PHASE_MODE_FIT);
    w->refine_step = step_seconds(more, SDM_PHASE_REFINE);
    if (!pod) {
        w->weights = w->fit_weights = t->data.only_holdout ? 0 : (double)t->kind->weights(t)->n;
        return;
    }
    pod_sizes(t, c, w);
    // the trial has few modes: the time of its steps is in proportion to its weights
    const pod_state *state = t->state;
    const double small = (double)state->mode_fit.n;
    const double flops_per_second = w->fit_step > 0 ? 6 * w->batch * small / w->fit_step : 1e10;
    w->fit_step *= w->fit_weights / small;
    const double maps = fmin(w->n_maps, 4096),
                 per_map = fmax(0, (more->begin - few->begin) / (n2 - n1)),
                 fixed = fmax(0, more->begin - per_map * n2);
    w->bases = fixed + per_map * maps;
    modes_times(flops_per_second, w);
    trials_work(c, fixed, per_map, more->begin, carried, w);
}

/* Bytes of a weight in the model file. */
static double weight_bytes(const sdm_config *c)
{
    return c->network.weights == SDM_WEIGHT_I8 ? 1.1 : c->network.weights == SDM_WEIGHT_F16 ? 2 : 4;
}

/* Two small trainings; the second also runs steps. */
static sdm_status measure(const sdm_config *config, const sdm_instance *shape, sdm_config *c,
                          measurement m[2], sdm_error *err)
{
    small_config(config, SDM_NETWORK_POD, FEWEST, c);
    sdm_status s = prepare(&m[0], c, shape, err);
    if (s) return s;
    if (m[0].t.data.only_holdout) { // one is enough: there are no steps
        m[1] = m[0];
        m[0] = (measurement){.hooks = m[0].hooks};
        return SDM_OK;
    }
    const double n = MAP_SECONDS * FEWEST / fmax(m[0].maps, 1e-3);
    small_config(config, SDM_NETWORK_POD, (size_t)fmin(MOST, fmax(FEWEST + 8, n)), c);
    s = prepare(&m[1], c, shape, err);
    if (s) return s;
    c->train.minutes = (trainer_seconds(&m[1].t) + STEP_SECONDS) / 60;
    trainer_enter(&m[1].t, SDM_PHASE_MODE_FIT);
    s = m[1].t.kind->run(&m[1].t, false, err);
    m[1].ended = processor_seconds();
    return s;
}

/* The preparation of a small template, on as many maps as that of pod. *refused: the shape does not
 * allow it. */
static sdm_status measure_template(const sdm_config *config, const sdm_instance *shape,
                                   sdm_config *c, const measurement *pod, measurement *m,
                                   bool *refused, sdm_error *err)
{
    sdm_error reason = {0};
    small_config(config, SDM_NETWORK_TEMPLATE, pod->t.data.n_start, c);
    const sdm_status s = prepare(m, c, shape, &reason);
    *refused = s == SDM_E_UNSUPPORTED;
    if (s && !*refused && err) *err = reason;
    return *refused ? SDM_OK : s;
}

sdm_status sdm_train_measure(const sdm_config *config, const sdm_instance *shape,
                             const sdm_train_hooks *hooks, sdm_train_work *out, sdm_error *err)
{
    const double start = sdm_clock();
    sdm_config *c = NULL, *templates = NULL;
    measurement *m = NULL;
    sdm_team *team = NULL;
    *out = (sdm_train_work){.weight_bytes = weight_bytes(config),
                            .threads = sdm_threads(config->threads)};
    sdm_status s = SDM_ALLOC(&c, 1, "configuration", err);
    if (!s) s = SDM_ALLOC(&templates, 1, "configuration", err);
    if (!s) s = SDM_ALLOC(&m, 3, "measurement", err);
    if (!s) s = sdm_team_start(out->threads, &team, err);
    if (!s) {
        m[0].hooks = m[1].hooks = m[2].hooks = hooks;
        s = measure(config, shape, c, m, err);
    }
    if (!s && config->network.kind == SDM_NETWORK_AUTO)
        s = measure_template(config, shape, templates, &m[1], &m[2], &out->only_pod, err);
    if (!s) {
        out->kind = c->network.kind;
        s = count_maps(&m[1].t, config, out, err);
    }
    if (!s) {
        extrapolate(&m[0], &m[1], &m[2], config, out);
        count_steps(config, out);
    }
    for (int i = 0; m && i < 3; i++) dispose(&m[i]);
    sdm_team_end(team);
    sdm_free(m);
    sdm_free(templates);
    sdm_free(c);
    out->measured_seconds = sdm_clock() - start;
    return s;
}
