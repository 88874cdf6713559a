/* Tells the findings of a survey of shapes, in the order in which they become known. */
#include "report_survey.h"

#include <math.h>

#include "report/terminal.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/train.h"
#include "teller.h"

/* AUDIT_SECONDS: for the audits of the shapes that lines name. */
enum { NOTICE_SAMPLES = 32, AUDIT_SECONDS = 10 };

/* Appends ", 3 of 4 THINGS" if some were left out. */
static void add_untested(size_t untested, size_t n, const char *things, sdm_text *text)
{
    if (untested)
        sdm_text_add(text, "%s%zu of %zu %s", text->data ? ", " : "", untested, n, things);
}

void cli_survey_untested(const cli_survey *s, sdm_text *text)
{
    const sdm_shape_survey *f = &s->found;
    add_untested(f->untested, f->n, "shapes", text);
    add_untested(f->unions_untested, f->n, "volumes of the union", text);
    add_untested(f->fold_untested, f->fold_tested + f->fold_untested,
                 "ways on which walls may pass through each other", text);
    add_untested(f->lines_untested, f->lines, "lines along a parameter, for jumps", text);
    if (f->velocity_untested)
        sdm_text_add(text, "%svelocity() at some shapes", text->data ? ", " : "");
    if (f->still_untested)
        sdm_text_add(text, "%sparameters that move no surface", text->data ? ", " : "");
    if (f->box_untested)
        sdm_text_add(text, "%sthe search for the largest shape", text->data ? ", " : "");
    if (s->grid && f->untested) sdm_text_add(text, ", flat faces on planes of voxel centres");
}

/* What was left out for want of time. */
static void tell_untested(teller *t)
{
    sdm_text left = {0}, text = {0};
    if (!t->s->found.cancelled) cli_survey_untested(t->s, &left);
    if (left.data) {
        sdm_text_add(&text,
                     "not tested for want of time: %s; --samples N tests N random shapes, however "
                     "long it takes",
                     left.data);
        teller_tell(t, SDM_OK, &text);
    }
    t->failed = t->failed || left.failed;
    sdm_text_dispose(&left);
}

static void tell_no_process(teller *t)
{
    const sdm_error *why = &t->s->found.process_untested;
    sdm_text text = {0};
    if (!why->status || t->s->brief) return;
    sdm_text_add(&text,
                 "not tested: meshes in another process, which show a static variable that keeps "
                 "what the first call of mesh() set; %s",
                 why->text);
    teller_tell(t, SDM_OK, &text);
}

sdm_status cli_survey_tell(const cli_survey *s, unsigned stages, cli_tell *tell_line, void *user,
                           sdm_error *err)
{
    teller t = {.s = s, .tell = tell_line, .user = user, .end = sdm_clock() + AUDIT_SECONDS};
    if (stages & SDM_SURVEY_MESHES) {
        tell_causes(&t);
        tell_sizes(&t);
        tell_params(&t);
    }
    if (stages & SDM_SURVEY_PARTS) {
        tell_parts(&t);
        tell_walls(&t);
        tell_unit(&t);
    }
    if (stages & SDM_SURVEY_REST) {
        tell_walls_closer(&t);
        tell_motion(&t);
    }
    if (stages & CLI_STAGE_GRID) tell_grid(&t);
    if (stages & SDM_SURVEY_REST) {
        tell_overlaps(&t);
        tell_groups(&t);
        tell_untested(&t);
        tell_no_process(&t);
    }
    teller_dispose(&t);
    return t.failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory for the findings") : SDM_OK;
}

static void notice(void *user, sdm_status weight, const char *line)
{
    (void)user;
    if (weight)
        cli_warn("%s", line);
    else
        cli_notice("%s", line);
}

size_t cli_notice_survey(const sdm_config *c, const sdm_instance *shape, sdm_repeat_process process,
                         double *thin_spacing)
{
    if (thin_spacing) *thin_spacing = NAN;
    double min[SDM_MAX_PARAMS], max[SDM_MAX_PARAMS], range[SDM_MAX_PARAMS][2];
    sdm_distribution distribution[SDM_MAX_PARAMS];
    size_t n;
    sdm_instance_params(shape, &n);
    if (n > SDM_MAX_PARAMS || sdm_train_ranges(c, shape, min, max, NULL) ||
        sdm_train_distributions(c, shape, min, max, distribution, NULL))
        return 0;
    for (size_t i = 0; i < n; i++) {
        range[i][0] = min[i];
        range[i][1] = max[i];
    }
    const sdm_survey_opts opts = {.range = (const double(*)[2])range,
                                  .distribution = distribution,
                                  .samples = sdm_survey_samples(shape, NOTICE_SAMPLES),
                                  .seed = c->seed,
                                  .grid = &c->grid,
                                  .brief = true,
                                  .process = process,
                                  .mend_first = true,
                                  .n_threads = (int)c->threads,
                                  .cancelled = cli_interrupted};
    cli_survey s = {.shape = shape, .grid = &c->grid, .config = c, .brief = true};
    if (sdm_shape_survey_make(shape, &opts, &s.found, NULL)) return 0;
    const size_t before = cli_warnings();
    if (!s.found.cancelled)
        (void)cli_survey_tell(&s, CLI_ALL_STAGES & ~CLI_STAGE_GRID, notice, NULL, NULL);
    const size_t warnings = cli_warnings() - before;
    if (thin_spacing && !s.found.cancelled) *thin_spacing = cli_survey_thin_spacing(&s);
    if (!s.found.cancelled) (void)cli_survey_tell(&s, CLI_STAGE_GRID, notice, NULL, NULL);
    sdm_shape_survey_dispose(&s.found);
    return warnings;
}
