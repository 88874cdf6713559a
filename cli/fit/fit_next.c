/* The command that goes on from a fit with finer or exact maps. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "args/shell_word.h"
#include "fit_command.h"

/* Options that say where a fit starts, which maps it takes and what it writes: the command has its
 * own. */
static const char *const LEFT_OUT[] = {
    "param",   "rotation", "translation",  "start-centre", "start-axis", "start-points",
    "turns",   "find",     "turns-sphere", "candidates",   "exact",      "polish",
    "spacing", "output",   "label-out",    "json",         "report",     "returnparameterfile",
    "force",   "quiet"};

/* Before the edge of the voxels that the check of the maps advises, in its text. */
static const char ADVICE[] = "exact maps with voxels of ";

static bool is_left_out(const char *name)
{
    for (size_t i = 0; i < sizeof LEFT_OUT / sizeof *LEFT_OUT; i++)
        if (!strcmp(name, LEFT_OUT[i])) return true;
    return false;
}

/* The finding of this kind where it is doubtful, else NULL. */
static const sdm_fit_finding *doubtful(const cli_fit *f, sdm_fit_check_kind kind)
{
    for (size_t i = 0; i < f->result.verdict.n_findings; i++) {
        const sdm_fit_finding *x = &f->result.verdict.findings[i];
        if (x->kind == kind && x->grade == SDM_FIT_DOUBTFUL) return x;
    }
    return NULL;
}

/* Appends --name=value; a value may begin with a minus. */
static void add_option(sdm_text *t, const char *name, const char *value)
{
    sdm_text_add(t, " --%s=", name);
    cli_add_shell_word(t, value);
}

static void add_three(sdm_text *t, const char *name, const double x[3])
{
    char text[96];
    snprintf(text, sizeof text, "%.7g,%.7g,%.7g", x[0], x[1], x[2]);
    add_option(t, name, text);
}

void cli_fit_print_next(const cli_fit *f)
{
    const cli_args *a = f->args;
    const sdm_fit_result *r = &f->result;
    const sdm_fit_finding *voxels = doubtful(f, SDM_FIT_CHECK_VOXELS);
    if (f->doubt.status || f->other_side || f->n_candidates || a->cohort.cases ||
        (!voxels && !doubtful(f, SDM_FIT_CHECK_NETWORK_ERROR)))
        return;
    sdm_text t = {0};
    char text[96];
    sdm_text_add(&t, "sdmgen fit");
    for (size_t i = 0; i < a->files.n; i++) {
        sdm_text_add(&t, " ");
        cli_add_shell_word(&t, a->files.items[i]);
    }
    for (size_t i = 0; i < a->n_given; i++) {
        const cli_option *o = a->given[i].option;
        if (is_left_out(o->name)) continue;
        if (o->kind == CLI_FLAG) {
            sdm_text_add(&t, " --%s", o->name);
        } else {
            add_option(&t, o->name, a->given[i].value);
        }
    }
    if (f->model_path) sdm_text_add(&t, " --exact");
    const char *advice = voxels ? strstr(voxels->text, ADVICE) : NULL;
    if (advice) {
        snprintf(text, sizeof text, "%g", strtod(advice + strlen(ADVICE), NULL));
        add_option(&t, "spacing", text);
    }
    for (size_t i = 0; i < f->n_params; i++) {
        snprintf(text, sizeof text, "%.60s=%.7g", f->params[i].name, r->params[i]);
        sdm_text_add(&t, " -p ");
        cli_add_shell_word(&t, text);
    }
    add_three(&t, "rotation", r->pose.rotation);
    add_three(&t, "translation", r->pose.translation);
    if (!t.failed) printf("finer maps from here, without a search:\n  %s\n", t.data);
    sdm_text_dispose(&t);
}
