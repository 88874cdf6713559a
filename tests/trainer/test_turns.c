/* network.kind: auto trains one kind or two: the better model is kept, with the same bits for any
 * number of threads and after a resume.
 * Tests: look.c race.c train.c training.c turns.c trilinear.c other_model.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/stat.h>

#include <cmocka.h>

#include "data/trilinear.h"
#include "state/history.h"
#include "template_shapes.h"
#include "train_tools.h"

/* A link that turns on a base: two parts that overlap in the joint. */
static const char link_text[] =
    "shape: {name: linkage, options: {links: 1, motion: planar, limit: 0.5, edge: 0.5}}\n"
    "grid: {size: [19, 22, 10], spacing: 0.34, centre: [0.6, 0, 0]}\n"
    "network: {width: 16, modes: 24, rank: 6, degree: 3}\n"
    "data: {static: 0, static_share: 0, start: 60, online: 20, holdout: 12, memory_gb: 0.5}\n"
    "train: {steps: 60, batch: 16, refine_batch: 8}\n";

/* A ring that bends: one part with a warp and a correction. */
static const char ring_text[] =
    "shape: {name: ring}\n"
    "grid: {size: [26, 26, 16], spacing: 0.4}\n"
    "network: {degree: 2, width: 16, modes: 24}\n"
    "data: {static: 0, static_share: 0, start: 40, online: 40, holdout: 4, memory_gb: 0.5}\n"
    "train: {steps: 150, batch: 16}\n";

/* Boxes on joints, one of which bends: rigid parts, and one with a warp. */
static const char mechanism_text[] =
    "shape: {name: mechanism}\n"
    "grid: {size: [48, 44, 40], spacing: 0.4, centre: [1.5, 0, 0]}\n"
    "network: {degree: 2, width: 16, modes: 24}\n"
    "data: {static: 0, static_share: 0, start: 400, online: 40, holdout: 8, memory_gb: 4}\n"
    "train: {steps: 150, batch: 16}\n";

/* Makes pod worse than the template. */
#define FEW_MAPS "shape.options.limit=1", "data.start=20", "data.online=0", "train.steps=10"

static char said[8192];

static void listen(void *user, const char *text)
{
    (void)user;
    strncat(said, text, sizeof said - strlen(said) - 2);
    strcat(said, "\n");
}

static char warned[1024];

static void note_warning(void *user, const char *text)
{
    (void)user;
    snprintf(warned, sizeof warned, "%s", text);
}

/* The phases of the first and of the last report of progress. */
static sdm_phase first_phase, last_phase;
static size_t n_reports;

static void note_phase(void *user, const sdm_progress *p)
{
    (void)user;
    if (n_reports++ == 0) first_phase = p->phase;
    last_phase = p->phase;
}

static sdm_instance *shape_of(const sdm_config *c)
{
    sdm_instance *out;
    sdm_error e = {0};
    const sdm_shape *shape =
        strcmp(c->shape.name, "ring") ? sdm_registry_find(registry, c->shape.name, NULL) : &ring;
    sdm_named_text options[SDM_MAX_OPTIONS];
    for (size_t i = 0; i < c->shape.n_options; i++)
        options[i] = (sdm_named_text){c->shape.options[i].name, c->shape.options[i].value};
    if (sdm_instance_create(shape, options, c->shape.n_options, NULL, &out, &e))
        fail_msg("%s", e.text);
    return out;
}

static sdm_train_report train(const sdm_config *c)
{
    const sdm_train_hooks hooks = {
        .message = listen, .progress = note_phase, .warning = note_warning};
    sdm_error e = {0};
    sdm_train_report r;
    sdm_instance *shape = shape_of(c);
    run_files_remove();
    said[0] = warned[0] = '\0';
    if (sdm_train(c, shape, folder, false, &hooks, &r, &e)) fail_msg("%s", e.text);
    assert_false(exists("checkpoint.sdmc"));
    sdm_instance_free(shape);
    return r;
}

/* Kind of the model and of config.yaml. */
static void assert_kind(const char *kind)
{
    sdm_model *m;
    sdm_config c;
    assert_int_equal(sdm_model_open(in_folder("model.sdm"), &m, NULL), SDM_OK);
    assert_string_equal(sdm_model_get_info(m)->kind, kind);
    sdm_model_free(m);
    assert_int_equal(sdm_config_read(in_folder("config.yaml"), NULL, 0, &c, NULL), SDM_OK);
    assert_int_equal(c.network.kind, strcmp(kind, "pod") ? SDM_NETWORK_TEMPLATE : SDM_NETWORK_POD);
}

/* The model of the other kind is a file beside the one that is kept, with its error. */
static void assert_other(const sdm_train_report *r)
{
    const bool pod = r->other_kind == SDM_NETWORK_POD;
    sdm_model *m;
    assert_string_equal(r->other_path, in_folder(pod ? "model-pod.sdm" : "model-template.sdm"));
    assert_int_equal(sdm_model_open(r->other_path, &m, NULL), SDM_OK);
    const sdm_model_info *info = sdm_model_get_info(m);
    assert_string_equal(info->kind, pod ? "pod" : "template");
    assert_true(info->accuracy.rmse_mm == r->other.rmse_mm);
    // the model file has rounded figures
    if (isnan(info->quality.derivative_error))
        assert_true(isnan(r->other_derivative));
    else
        assert_true(fabs(info->quality.derivative_error / r->other_derivative - 1) < 1e-6);
    assert_string_equal(info->quality.grade, sdm_grade_name(r->other_grade));
    sdm_model_free(m);
    assert_false(exists(pod ? "model-template.sdm" : "model-pod.sdm"));
}

// The model that is kept has the bits of a training of its kind alone: a template without a
// correction leaves all steps to pod. The other kind has the larger error.
static void better_is_kept(void **state)
{
    (void)state;
    static const char *const few[] = {FEW_MAPS, "network.kind=template"};
    static const char *const pod[] = {"network.kind=pod"};
    for (int which = 0; which < 2; which++) {
        const char *const *set = which ? few : pod;
        const size_t n = which ? 4 : 0;
        const sdm_config alone = parse_config(link_text, set, n + 1);
        const sdm_train_report single = train(&alone);
        assert_false(single.compared);
        const uint64_t expected = hash_of("model.sdm");
        uint64_t metrics = 0;
        for (int threads = 1; threads <= 3; threads++) {
            sdm_config c = parse_config(link_text, set, n);
            c.threads = c.data.workers = threads;
            const sdm_train_report r = train(&c);
            if (!strstr(said, "ready, then pod is trained")) fail_msg("%s", said);
            assert_kind(which ? "template" : "pod");
            assert_true(hash_of("model.sdm") == expected);
            if (threads > 1) assert_true(hash_of("metrics.jsonl") == metrics);
            metrics = hash_of("metrics.jsonl");
            assert_true(r.compared && hypot(r.other_voxel_mm, 0.1 * r.other.rmse_mm) >
                                          hypot(r.verdict.rmse_voxel_mm, 0.1 * r.accuracy.rmse_mm));
            assert_int_equal(r.other_kind, which ? SDM_NETWORK_POD : SDM_NETWORK_TEMPLATE);
            assert_other(&r);
            assert_true(r.accuracy.mse_mm2 == single.accuracy.mse_mm2);
            assert_int_equal(r.steps, single.steps);
            assert_string_equal(r.verdict.key, single.verdict.key);
        }
    }
}

// A template that needs training gets a third of the steps, pod the others.
static void budget_is_shared(void **state)
{
    (void)state;
    sdm_config c = parse_config(ring_text, NULL, 0);
    const sdm_train_report r = train(&c);
    if (!r.compared) fail_msg("%s", said);
    sdm_config stored;
    assert_int_equal(sdm_config_read(in_folder("config.yaml"), NULL, 0, &stored, NULL), SDM_OK);
    const bool first = stored.network.kind == SDM_NETWORK_TEMPLATE;
    assert_int_equal(r.steps, first ? 50 : 100);
    assert_int_equal(stored.train.steps, first ? 50 : 100);
}

/* A place at which a run is stopped: `after` calls of cancelled() after a message with the first
   words and, if there are second ones, a later message with those. */
typedef struct stop_place {
    const char *first, *second;
    int after;
    bool model, checkpoint; /* the files that the folder has then */
} stop_place;

static bool stop(void *user)
{
    stop_place *p = user;
    const char *at = strstr(said, p->first);
    if (at && p->second) at = strstr(at, p->second);
    return at && --p->after < 0;
}

// A run may be stopped in either training: it goes on where it was, and ends with the same bits.
static void resume_is_bit_exact(void **state)
{
    (void)state;
    static const char *const few[] = {FEW_MAPS};
    static const stop_place places[2][3] = {
        {{"", NULL, 30, false, false},
         {"pod is trained with", NULL, 5, true, false},
         {"pod is trained with", "a decoder of", 4, true, true}},
        {{"trained with at most a third", NULL, 3, false, false},
         {"a decoder of", NULL, 20, false, true},
         {"pod is trained with", "a decoder of", 70, true, true}}};
    for (int which = 0; which < 3; which++) {
        sdm_config c = parse_config(which == 2 ? ring_text : link_text, few, which == 1 ? 4 : 0);
        c.threads = 1;
        train(&c);
        const uint64_t model = hash_of("model.sdm"), metrics = hash_of("metrics.jsonl"),
                       config = hash_of("config.yaml");
        sdm_instance *shape = shape_of(&c);
        for (int i = 0; i < 3; i++) {
            stop_place p = places[which == 2][i];
            const sdm_train_hooks hooks = {.cancelled = stop, .message = listen, .user = &p};
            sdm_error e = {0};
            run_files_remove();
            said[0] = '\0';
            assert_int_equal(sdm_train(&c, shape, folder, false, &hooks, NULL, &e),
                             SDM_E_CANCELLED);
            if (exists("model.sdm") != p.model || exists("checkpoint.sdmc") != p.checkpoint)
                fail_msg("case %d, stop %d: %s: %s", which, i, e.text, said);
            if (p.model) assert_kind("template");
            if (p.model && !p.checkpoint) assert_non_null(strstr(e.text, "model of kind template"));
            if (!p.checkpoint) continue;
            sdm_train_report r;
            if (sdm_train(&c, shape, folder, true, NULL, &r, &e)) fail_msg("%s", e.text);
            assert_true(hash_of("model.sdm") == model && hash_of("metrics.jsonl") == metrics &&
                        hash_of("config.yaml") == config);
            assert_other(&r);
        }
        sdm_instance_free(shape);
    }
}

// A resume in the second training is refused with another configuration, or where its maps do not
// fit into memory: the checkpoint stays, and the right configuration goes on from it.
static void refused_resume_loses_nothing(void **state)
{
    (void)state;
    static const char *const wrong[] = {"network.width=24", "data.holdout=40000"};
    const sdm_config c = parse_config(link_text, NULL, 0);
    train(&c);
    const uint64_t whole = hash_of("model.sdm");
    sdm_instance *shape = shape_of(&c);
    stop_place p = {"pod is trained with", "a decoder of", 4, true, true};
    sdm_train_hooks hooks = {.cancelled = stop, .message = listen, .user = &p};
    sdm_error e = {0};
    run_files_remove();
    said[0] = '\0';
    assert_int_equal(sdm_train(&c, shape, folder, false, &hooks, NULL, &e), SDM_E_CANCELLED);
    const uint64_t checkpoint = hash_of("checkpoint.sdmc"), model = hash_of("model.sdm");
    hooks.cancelled = NULL;
    for (int i = 0; i < 2; i++) {
        const sdm_config other = parse_config(link_text, &wrong[i], 1);
        said[0] = '\0';
        assert_int_equal(sdm_train(&other, shape, folder, true, &hooks, NULL, &e), SDM_E_CONFIG);
        if (!strstr(e.text,
                    i ? "test.yaml: data.static" : "'width: 16', this configuration 'width: 24'"))
            fail_msg("%s", e.text);
        assert_null(strstr(said, "is kept"));
        assert_true(hash_of("checkpoint.sdmc") == checkpoint && hash_of("model.sdm") == model);
    }
    if (sdm_train(&c, shape, folder, true, NULL, NULL, &e)) fail_msg("%s", e.text);
    assert_true(hash_of("model.sdm") == whole);
    sdm_instance_free(shape);
}

/* Listens; when the second training has made its maps, puts a folder in the place of the file
 * *user. */
static void block_file(void *user, const char *text)
{
    const char *name = in_folder(user);
    listen(NULL, text);
    if (!strstr(text, "a decoder of") || !strstr(said, "pod is trained with")) return;
    assert_int_equal(remove(name), 0);
    assert_int_equal(mkdir(name, 0700), 0);
}

// If the model of the second training or its configuration cannot be written, the run fails, and
// the trained weights are in a checkpoint.
static void second_model_cannot_be_written(void **state)
{
    (void)state;
    static char blocked[2][16] = {"model.sdm", "config.yaml"};
    const sdm_config c = parse_config(link_text, NULL, 0);
    train(&c);
    const uint64_t model = hash_of("model.sdm"), metrics = hash_of("metrics.jsonl"),
                   config = hash_of("config.yaml");
    sdm_instance *shape = shape_of(&c);
    for (int i = 0; i < 2; i++) {
        const sdm_train_hooks hooks = {.message = block_file, .user = blocked[i]};
        sdm_error e = {0};
        run_files_remove();
        said[0] = '\0';
        assert_int_equal(sdm_train(&c, shape, folder, false, &hooks, NULL, &e), SDM_E_IO);
        if (!strstr(e.text, blocked[i])) fail_msg("%s", e.text);
        assert_non_null(strstr(e.text, "go on with --resume"));
        assert_true(exists("checkpoint.sdmc"));
        assert_int_equal(rmdir(in_folder(blocked[i])), 0);
        if (sdm_train(&c, shape, folder, true, NULL, NULL, &e)) fail_msg("%s", e.text);
        assert_true(hash_of("model.sdm") == model && hash_of("metrics.jsonl") == metrics &&
                    hash_of("config.yaml") == config);
        assert_false(exists("checkpoint.sdmc"));
    }
    sdm_instance_free(shape);
}

// If pod cannot be trained, or no time is left for its trial, a template of rigid parts is kept.
static void template_remains(void **state)
{
    (void)state;
    static const char *const much[] = {"data.start=100000", "data.memory_gb=0.004"},
                             *const short_time[] = {"train.steps=0", "train.minutes=0.0001"};
    const sdm_config large = parse_config(link_text, much, 2),
                     brief = parse_config(link_text, short_time, 2);
    sdm_train_report r = train(&large);
    assert_non_null(strstr(warned, "template is kept, because pod failed: test.yaml: data.static"));
    assert_kind("template");
    assert_true(!r.compared && r.tried && !r.unfinished && r.trial_minutes == 0);
    n_reports = 0;
    r = train(&brief);
    assert_true(first_phase == SDM_PHASE_TRIAL && last_phase == SDM_PHASE_EVALUATE);
    assert_kind("template");
    // so short a budget has no trial of pod; before the trial of the template the run tells the
    // minutes that hold the maps of pod, and the time of the trials
    assert_non_null(strstr(said, "network.kind is template: it suits parts that only move"));
    assert_null(strstr(said, "auto: pod leaves"));
    const char *pace = strstr(said, "about 0 fit into their part of train.minutes (0.0001); "),
               *trials = strstr(said, "auto: trials of both kinds would take about ");
    if (!pace || !trials || pace > trials || trials > strstr(said, "auto: template leaves"))
        fail_msg("%s", said);
    // the line before a trial does not deny it
    assert_non_null(strstr(trials, " s: template alone has one (for both raise train.minutes to "));
    assert_true(!r.compared && r.unfinished && !r.tried && r.pod_minutes > 0.0001);
    if (!strstr(r.verdict.sentence, "pod may be better than template, near the surface, too. ") ||
        strstr(r.verdict.sentence, "nothing to change"))
        fail_msg("%s", r.verdict.sentence);
    assert_true(!r.other_path[0] && !exists("model-pod.sdm") && !exists("model-template.sdm"));
}

// A shape of few parameters that bends is trained as pod at once where the trials would take more
// than their part of the time.
static void no_time_for_trials(void **state)
{
    (void)state;
    static const char *const short_time[] = {"train.steps=0", "train.minutes=0.0001"};
    const sdm_config c = parse_config(ring_text, short_time, 2);
    const sdm_train_report r = train(&c);
    assert_kind("pod");
    if (strstr(said, "auto: template leaves") || strstr(said, "template: ") ||
        !strstr(said, " s: pod is taken without trials (for both raise train.minutes to "))
        fail_msg("%s", said);
    assert_true(r.chosen && !r.compared && !r.tried && !r.unfinished);
    // the advice has the minutes that the run has told
    char told[80];
    snprintf(told, sizeof told, "without trials (for both raise train.minutes to %.4g)",
             r.trial_minutes);
    assert_true(r.trial_minutes > 0 && strstr(said, told));
    // a fifth of these minutes holds the trials on a machine that is a fifth slower, too
    const char *seconds = strstr(said, "trials of both kinds would take about ");
    assert_true(60 * r.trial_minutes / 5 > 1.2 * strtod(strpbrk(seconds, "0123456789"), NULL));
}

/* Cancels a run that does not make the template first, or that trains pod after it. */
static bool stop_unless_first(void *user)
{
    (void)user;
    return (strstr(said, "exact maps a second") && !strstr(said, "template is made first")) ||
           strstr(said, "pod is trained with");
}

/* Trains a mechanism with a budget of time that the trials exceed, and of which half holds its
   template: runs that end at once tell the seconds that the trials take here. Returns whether the
   run trains pod, too: it ends there. */
static bool train_in_haste(const char *const *keys, size_t n, sdm_train_report *r)
{
    enum { TRIES = 40, KEYS = 8 };
    const char *set[KEYS] = {"train.steps=0", "train.minutes=0.0001"};
    const sdm_train_hooks hooks = {.cancelled = stop_unless_first, .message = listen};
    char minutes[40];
    sdm_instance *shape = instance_of(&mechanism);
    assert_true(n + 2 <= KEYS);
    if (n) memcpy(set + 2, keys, n * sizeof *keys);
    for (int i = 0; i < TRIES; i++) {
        const sdm_config c = parse_config(mechanism_text, set, n + 2);
        sdm_error e = {0};
        run_files_remove();
        said[0] = '\0';
        const sdm_status s = sdm_train(&c, shape, folder, false, &hooks, r, &e);
        if (s && s != SDM_E_CANCELLED) fail_msg("%s: %s", e.text, said);
        const bool second = strstr(said, "pod is trained with");
        if (!s || second) {
            sdm_instance_free(shape);
            return second;
        }
        const char *at = strstr(said, "trials of both kinds would take about ");
        // the trials take 0.3 of this, the template about 0.13
        if (at)
            snprintf(minutes, sizeof minutes, "train.minutes=%.4g",
                     strtod(strpbrk(at, "0123456789"), NULL) / (0.3 * 60));
        set[1] = at ? minutes : "train.minutes=0.0001";
    }
    fail_msg("the pace of maps changes too much: %s", said);
    return false;
}

// A shape of few parameters that bends: where there is no time for trials but for a template of its
// parts, this is made, and kept if it is good. Else pod is trained with the rest of the time.
static void template_of_seconds_is_made(void **state)
{
    (void)state;
    static const char *const fine[] = {"grid.size=[96, 88, 80]", "grid.spacing=0.2"},
                             *const cuts[] = {"grid.size=[60, 88, 80]", "grid.spacing=0.2"};
    sdm_train_report r = {0};
    mistaken = BEND;
    bool second = train_in_haste(fine, 2, &r);
    if (second || !strstr(said, "auto: template is kept without a comparison: it is good"))
        fail_msg("%s", said);
    assert_kind("template");
    assert_true(r.verdict.grade == SDM_GRADE_GOOD && r.steps == 0 && r.chosen);
    assert_true(!r.compared && !r.tried && !r.unfinished && r.trial_minutes > 0);
    assert_true(r.template_seconds == 0);
    // the grid cuts the shapes: no model is good
    second = train_in_haste(cuts, 2, &r);
    mistaken = NONE;
    assert_kind("template");
    if (!second || strstr(said, "without a comparison")) fail_msg("%s", said);
}

// Cheap maps make the design of a template seem short: it is given up, and pod is trained.
static void long_design_is_given_up(void **state)
{
    (void)state;
    static const char *const coarse[] = {
        "grid={size: [24, 22, 20], spacing: 0.8, centre: [1.5, 0, 0]}"};
    mistaken = BEND;
    sdm_train_report r = {0};
    assert_false(train_in_haste(coarse, 1, &r));
    mistaken = NONE;
    assert_kind("pod");
    if (!strstr(said, "auto: template is left out: its design takes over half of train.minutes"))
        fail_msg("%s", said);
    assert_true(!r.compared && !r.tried && !r.unfinished && r.trial_minutes > 0);
    assert_true(r.template_seconds > 0);
}

// pod is taken without trials: the report has the time of a template only if it needs no training.
// That of a shape of several parts takes less than the trials of both kinds.
static void time_of_a_skipped_template(void **state)
{
    (void)state;
    static const char *const short_time[] = {"train.steps=0", "train.minutes=0.0001"};
    const sdm_train_hooks hooks = {.message = listen};
    const char *texts[] = {mechanism_text, ring_text};
    mistaken = BEND;
    for (int several = 0; several < 2; several++) {
        const sdm_config c = parse_config(texts[!several], short_time, 2);
        sdm_instance *shape = several ? instance_of(&mechanism) : shape_of(&c);
        sdm_train_report r = {0};
        sdm_error e = {0};
        run_files_remove();
        said[0] = '\0';
        if (sdm_train(&c, shape, folder, false, &hooks, &r, &e)) fail_msg("%s", e.text);
        const char *at = strstr(said, "trials of both kinds would take about ");
        if (!at || !strstr(said, "pod is taken without trials")) fail_msg("%s", said);
        assert_kind("pod");
        const double trials = strtod(strpbrk(at, "0123456789"), NULL);
        if (several ? !(r.template_seconds > 0 && r.template_seconds < trials)
                    : r.template_seconds != 0)
            fail_msg("%g s; %s", r.template_seconds, said);
        sdm_instance_free(shape);
    }
    mistaken = NONE;
}

/* Puts a folder in the place of the model before it is written: the run ends with a checkpoint. */
static void block_model(void *user, const sdm_progress *p)
{
    (void)user;
    if (p->phase == SDM_PHASE_EVALUATE) (void)mkdir(in_folder("model.sdm"), 0700);
}

// A run that goes on from a checkpoint advises the same minutes for the trials that it left out.
static void resume_keeps_advice(void **state)
{
    (void)state;
    static const char *const short_time[] = {"train.steps=0", "train.minutes=0.0001"};
    const sdm_config c = parse_config(ring_text, short_time, 2);
    const sdm_train_hooks hooks = {.message = listen, .progress = block_model};
    sdm_instance *shape = shape_of(&c);
    sdm_train_report r;
    sdm_error e = {0};
    char told[80];
    run_files_remove();
    said[0] = '\0';
    assert_int_equal(sdm_train(&c, shape, folder, false, &hooks, NULL, &e), SDM_E_IO);
    assert_int_equal(rmdir(in_folder("model.sdm")), 0);
    assert_true(exists("checkpoint.sdmc"));
    if (sdm_train(&c, shape, folder, true, NULL, &r, &e)) fail_msg("%s", e.text);
    snprintf(told, sizeof told, "(for both raise train.minutes to %.4g)", r.trial_minutes);
    if (!(r.trial_minutes > 0) || !strstr(said, told)) fail_msg("%s: %s", told, said);
    assert_true(r.chosen);
    sdm_instance_free(shape);
}

// Thick parts that overlap: the verdict tells the error far inside from that near the surface, and
// names the remedy, which is no finer grid.
static void overlap_is_named(void **state)
{
    (void)state;
    static const char *const thick[] = {
        "network.kind=template",
        "shape.options.length=1",
        "shape.options.radius=1",
        "shape.options.tip=1",
        "shape.options.joint=1",
        "shape.options.base=1",
        "grid={size: [40, 40, 24], spacing: 0.12, centre: [0.4, 0, 0]}"};
    const sdm_config c = parse_config(link_text, thick, 7);
    const sdm_train_report r = train(&c);
    const double *part = r.verdict.part_mm2;
    assert_int_equal(r.verdict.limit, SDM_CAUSE_FAR);
    assert_true(fabs(part[SDM_CAUSE_FAR] + part[SDM_CAUSE_TEMPLATE] - r.accuracy.mse_mm2) <
                1e-9 * r.accuracy.mse_mm2);
    // the largest error is a bound deep inside; it is told, whatever the grade
    assert_true(r.verdict.largest_mm == r.accuracy.max_abs_mm);
    assert_true(r.verdict.largest_at_mm < -r.verdict.near_mm && sdm_verdict_errs_far(&r.verdict));
    assert_true(r.verdict.rmse_inside_mm > 4 * r.verdict.rmse_near_mm);
    if (!strstr(r.verdict.sentence, "where distances far away matter, set network.kind to pod"))
        fail_msg("%s", r.verdict.sentence);
}

// Budgets of the turns, in all three units: minutes of the trials are nobody's share. The history
// begins anew with each kind.
static void turns_share_the_budget(void **state)
{
    (void)state;
    static const char *const budgets[][2] = {{"train.steps=100", "train.minutes=0"},
                                             {"train.steps=0", "train.samples=1600"},
                                             {"train.steps=0", "train.minutes=3"}};
    for (int i = 0; i < 3; i++) {
        const sdm_config asked = parse_config(link_text, budgets[i], 2);
        training_turns r = {.n = 2,
                            .kind = {SDM_NETWORK_TEMPLATE, SDM_NETWORK_POD},
                            .share = 0.25,
                            .tried = 24,
                            .first = {.steps = 10, .seconds = 60}};
        sdm_config c;
        trainer_turn_config(&r, &asked, &c);
        assert_int_equal(c.network.kind, SDM_NETWORK_TEMPLATE);
        assert_true(c.train.steps == (i ? 0 : 25) && c.train.samples == (i == 1 ? 400 : 0) &&
                    fabs(c.train.minutes - (i == 2 ? 0.4 + 2.6 * 0.25 : 0)) < 1e-12);
        r.at = 1;
        trainer_turn_config(&r, &asked, &c);
        assert_int_equal(c.network.kind, SDM_NETWORK_POD);
        assert_true(c.train.steps == (i ? 0 : 90) && c.train.samples == (i == 1 ? 1440 : 0) &&
                    c.train.minutes == (i == 2 ? 2 : 0));
        assert_true(fabs(trainer_turns_left(&r, &asked) - (i == 2 ? 2 / 3.0 : 0.9)) < 1e-12);
    }
    const sdm_train_report near = {.verdict.rmse_voxel_mm = 3, .accuracy.rmse_mm = 40},
                           far = {.verdict.rmse_voxel_mm = 4, .accuracy.rmse_mm = 10};
    const training_turns r = {.first = near};
    const turn_figures figures = trainer_turn_figures(SDM_NETWORK_TEMPLATE, &near);
    assert_true(trainer_score(&figures) == 5 && trainer_second_wins(&r, &far));
    // the better grade wins with a worse score, too
    sdm_train_report usable = far;
    usable.verdict.grade = SDM_GRADE_USABLE;
    const training_turns good = {.first = near},
                         poor = {.first = {.verdict = {.grade = SDM_GRADE_POOR}}};
    assert_true(!trainer_second_wins(&good, &usable) && trainer_second_wins(&poor, &usable));
    sdm_text metrics = {0};
    const trainer t = {.metrics = &metrics};
    history h;
    sdm_text_add(&metrics, "{\"phase\": \"refine\", \"step\": 7, \"heldout_mse_mm2\": 1}\n");
    assert_int_equal(
        trainer_turns_record(&metrics, SDM_NETWORK_POD, NULL, "why", &figures, 1, NULL), SDM_OK);
    sdm_text_add(&metrics, "{\"phase\": \"fit\", \"step\": 3, \"heldout_mse_mm2\": 1}\n");
    assert_non_null(strstr(metrics.data, "\"reason\": \"why\", \"template_rmse_mm\": 40"));
    assert_non_null(strstr(metrics.data, "\"template_score_mm\": 5}"));
    assert_int_equal(trainer_history_read(&t, &h, NULL), SDM_OK);
    assert_true(h.n == 1 && h.point[0].step == 3);
    trainer_history_dispose(&h);
    sdm_text_dispose(&metrics);
}

// A function that is linear along each axis is reproduced, also at the ends and in a flat grid.
static void interpolation_is_trilinear(void **state)
{
    (void)state;
    for (int flat = 0; flat < 2; flat++) {
        const sdm_grid g = {.n = {4, 3, flat ? 1 : 5}};
        float map[60];
        for (int i = 0; i < 60; i++) {
            const int x = i % 4, y = i / 4 % 3, z = i / 12;
            map[i] = (float)((1 + 2 * x) * (3 - y) * (1 + 4 * z));
        }
        const double points[][3] = {{0, 0, 0}, {3, 2, 4}, {1.25, 0.5, 3.75}, {2.5, 2, 0.5}};
        for (size_t i = 0; i < 4; i++) {
            double p[3] = {points[i][0], points[i][1], flat ? 0 : points[i][2]};
            const double expected = (1 + 2 * p[0]) * (3 - p[1]) * (1 + 4 * p[2]);
            assert_true(fabs(trainer_trilinear(&g, map, p) - expected) < 1e-12);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(better_is_kept),
                                       cmocka_unit_test(budget_is_shared),
                                       cmocka_unit_test(resume_is_bit_exact),
                                       cmocka_unit_test(refused_resume_loses_nothing),
                                       cmocka_unit_test(time_of_a_skipped_template),
                                       cmocka_unit_test(resume_keeps_advice),
                                       cmocka_unit_test(second_model_cannot_be_written),
                                       cmocka_unit_test(template_remains),
                                       cmocka_unit_test(no_time_for_trials),
                                       cmocka_unit_test(template_of_seconds_is_made),
                                       cmocka_unit_test(long_design_is_given_up),
                                       cmocka_unit_test(overlap_is_named),
                                       cmocka_unit_test(turns_share_the_budget),
                                       cmocka_unit_test(interpolation_is_trilinear)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
