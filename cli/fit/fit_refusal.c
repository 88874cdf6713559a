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
    const sdm_fit_finding *x = sdm_fit_finding_of(&f->result.verdict, SDM_FIT_CHECK_CONVERGED);
    return x && cli_fit_is_unfinished(f) && strstr(x->text, "the data hardly determine");
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
