/* Shows the verdict of a fit: what was checked, with its figure and its limit. */
#include <math.h>
#include <stdio.h>

#include "fit_command.h"

static const char *const GRADES[] = {
    [SDM_FIT_PASSED] = "passed", [SDM_FIT_DOUBTFUL] = "doubtful", [SDM_FIT_FAILED] = "FAILED"};

const char *cli_fit_grade_name(sdm_fit_grade grade)
{
    static const char *const words[] = {
        [SDM_FIT_PASSED] = "passed", [SDM_FIT_DOUBTFUL] = "doubtful", [SDM_FIT_FAILED] = "failed"};
    return words[grade];
}

void cli_fit_print_verdict(const cli_fit *f)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    if (!v->n_findings) return;
    printf("verdict: %s\n", cli_fit_grade_name(v->grade));
    for (size_t i = 0; i < v->n_findings; i++) {
        const sdm_fit_finding *x = &v->findings[i];
        // + 0: no negative zero
        printf("  %-12s %-9s", sdm_fit_check_name(x->kind), GRADES[x->grade]);
        if (!isnan(x->figure)) printf(" %.3g", x->figure + 0);
        if (!isnan(x->limit)) printf(", limit %.3g", x->limit);
        printf("%s%s\n", !*x->text ? "" : isnan(x->figure) ? " " : ": ", x->text);
    }
    if (v->grade == SDM_FIT_FAILED && f->opts.turns == SDM_FIT_TURNS_NONE &&
        !isnan(f->args->pose.rotation[0]))
        printf("  --rotation gives one start: without it the fit tries 60 rotations\n");
}

void cli_fit_json_verdict(const cli_fit *f, sdm_json *j)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    sdm_json_open(j, "verdict", '{');
    sdm_json_text(j, "grade", cli_fit_grade_name(v->grade));
    sdm_json_open(j, "checks", '[');
    for (size_t i = 0; i < v->n_findings; i++) {
        const sdm_fit_finding *x = &v->findings[i];
        sdm_json_open(j, NULL, '{');
        sdm_json_text(j, "name", sdm_fit_check_name(x->kind));
        sdm_json_text(j, "grade", cli_fit_grade_name(x->grade));
        sdm_json_real(j, "figure", x->figure + 0);
        sdm_json_real(j, "limit", x->limit);
        sdm_json_text(j, "text", x->text);
        sdm_json_close(j, '}');
    }
    sdm_json_close(j, ']');
    sdm_json_close(j, '}');
    if (!f->mirror) return;
    sdm_json_open(j, "mirror", '{');
    sdm_json_text(j, "option", f->mirror);
    if (*f->side) sdm_json_text(j, "value", f->side);
    sdm_json_real(j, "better_by", f->better);
    sdm_json_close(j, '}');
}
