/* Why a fit is refused: its maps, its start, or data that do not suffice. */
#include <math.h>
#include <string.h>

#include "fit_command.h"
#include "sdm/internal/fit_finding.h"

bool cli_fit_found(const cli_fit *f, sdm_fit_check_kind kind, sdm_fit_grade grade, double figure)
{
    const sdm_fit_finding *x = sdm_fit_finding_of(&f->result.verdict, kind);
    return x && x->grade >= grade && !(x->figure < figure);
}

/* Does the text of this check contain `words`? */
static bool says(const cli_fit *f, sdm_fit_check_kind kind, const char *words)
{
    const sdm_fit_finding *x = sdm_fit_finding_of(&f->result.verdict, kind);
    return x && strstr(x->text, words);
}

bool cli_fit_is_unfinished(const cli_fit *f)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    size_t failed = 0;
    for (size_t i = 0; i < v->n_findings; i++)
        failed += v->findings[i].grade == SDM_FIT_FAILED &&
                  v->findings[i].kind != SDM_FIT_CHECK_CONVERGED;
    return v->n_findings && !failed && !f->result.converged &&
           f->result.n_iterations >= f->opts.max_iterations;
}

bool cli_fit_lacks_data(const cli_fit *f)
{
    return cli_fit_is_unfinished(f) &&
           says(f, SDM_FIT_CHECK_CONVERGED, "): the data hardly determine");
}

bool cli_fit_swings(const cli_fit *f)
{
    return cli_fit_is_unfinished(f) && says(f, SDM_FIT_CHECK_CONVERGED, "still goes to and fro");
}

bool cli_fit_shows_other(const cli_fit *f)
{
    return cli_fit_found(f, SDM_FIT_CHECK_RESIDUALS, SDM_FIT_FAILED, -INFINITY) &&
           (says(f, SDM_FIT_CHECK_RESIDUALS, ": another shape lies there") ||
            says(f, SDM_FIT_CHECK_RESIDUALS, "the fit is not on the shape of the "));
}

bool cli_fit_voxels_refuse(const cli_fit *f)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    if (v->grade != SDM_FIT_FAILED ||
        !cli_fit_found(f, SDM_FIT_CHECK_VOXELS, SDM_FIT_DOUBTFUL, -INFINITY))
        return false;
    for (size_t i = 0; i < v->n_findings; i++) {
        const sdm_fit_finding *x = &v->findings[i];
        if (x->grade == SDM_FIT_FAILED && x->kind != SDM_FIT_CHECK_VOXELS &&
            x->kind != SDM_FIT_CHECK_RESIDUALS)
            return false;
    }
    return true;
}

bool cli_fit_start_is_suspect(const cli_fit *f)
{
    return f->result.verdict.grade == SDM_FIT_FAILED && !f->exchanged &&
           !cli_fit_voxels_refuse(f) && !cli_fit_lacks_data(f);
}
