/* The findings of a verdict: names of the checks, and the list in the order of their kinds. */
#include "finding.h"

#include <stdarg.h>
#include <stdio.h>

const char *sdm_fit_check_name(sdm_fit_check_kind kind)
{
    static const char *const names[SDM_FIT_N_CHECKS] = {[SDM_FIT_CHECK_CONVERGED] = "convergence",
                                                        [SDM_FIT_CHECK_NO_SHAPE] = "no shape",
                                                        [SDM_FIT_CHECK_CONTRAST] = "contrast",
                                                        [SDM_FIT_CHECK_CAVITY] = "cavity",
                                                        [SDM_FIT_CHECK_IN_IMAGE] = "in the image",
                                                        [SDM_FIT_CHECK_RESIDUALS] = "residuals",
                                                        [SDM_FIT_CHECK_BESIDE] = "beside",
                                                        [SDM_FIT_CHECK_EMPTY] = "empty",
                                                        [SDM_FIT_CHECK_MISSING] = "missing",
                                                        [SDM_FIT_CHECK_INSIDE] = "inside",
                                                        [SDM_FIT_CHECK_OUTSIDE] = "outside",
                                                        [SDM_FIT_CHECK_GIVEN] = "given values",
                                                        [SDM_FIT_CHECK_BOUNDS] = "bounds",
                                                        [SDM_FIT_CHECK_BLOB] = "blob",
                                                        [SDM_FIT_CHECK_KEPT_POSE] = "kept pose",
                                                        [SDM_FIT_CHECK_MIRROR] = "mirror image",
                                                        [SDM_FIT_CHECK_GRID] = "grid",
                                                        [SDM_FIT_CHECK_NETWORK] = "network",
                                                        [SDM_FIT_CHECK_DATA] = "data",
                                                        [SDM_FIT_CHECK_SIZE] = "size",
                                                        [SDM_FIT_CHECK_VOXELS] = "map voxels",
                                                        [SDM_FIT_CHECK_NEXT_POSE] = "next pose",
                                                        [SDM_FIT_CHECK_PATCH] = "patch",
                                                        [SDM_FIT_CHECK_COVERED] = "covered",
                                                        [SDM_FIT_CHECK_NETWORK_ERROR] =
                                                            "network bias",
                                                        [SDM_FIT_CHECK_KEPT_PARAMS] = "kept value",
                                                        [SDM_FIT_CHECK_OFFSET] = "offset"};
    return kind >= 0 && kind < SDM_FIT_N_CHECKS ? names[kind] : NULL;
}

void sdm_fit_verdict_add(sdm_fit_verdict *v, const sdm_fit_finding *finding)
{
    size_t at = 0;
    while (at < v->n_findings && v->findings[at].kind < finding->kind) at++;
    if (at == v->n_findings || v->findings[at].kind != finding->kind) {
        for (size_t i = v->n_findings++; i > at; i--) v->findings[i] = v->findings[i - 1];
    }
    v->findings[at] = *finding;
    v->grade = SDM_FIT_PASSED;
    for (size_t i = 0; i < v->n_findings; i++)
        if (v->findings[i].grade > v->grade) v->grade = v->findings[i].grade;
}

void sdm_fit_judge_add(sdm_fit_verdict *v, sdm_fit_check_kind kind, bool passed,
                       sdm_fit_grade grade, double figure, double limit, const char *fmt, ...)
{
    sdm_fit_finding f = {
        .kind = kind, .grade = passed ? SDM_FIT_PASSED : grade, .figure = figure, .limit = limit};
    va_list args;
    va_start(args, fmt);
    if (!passed) vsnprintf(f.text, sizeof f.text, fmt, args);
    va_end(args);
    sdm_fit_verdict_add(v, &f);
}

const char *sdm_fit_name_place(const fit_state *s, const double x[3], char text[FIT_PLACE_NAME])
{
    double y[3];
    sdm_fit_to_shape(s, x, y);
    snprintf(text, FIT_PLACE_NAME, "(%.3g, %.3g, %.3g) mm, in the shape's frame (%.3g, %.3g, %.3g)",
             x[0], x[1], x[2], y[0], y[1], y[2]);
    return text;
}
