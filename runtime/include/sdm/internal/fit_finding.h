/* The finding of one check in the verdict of a fit. */
#pragma once

#include "sdm/fit.h"

/* A verdict has at most one finding of each kind. NULL: it has none of this kind. */
static inline const sdm_fit_finding *sdm_fit_finding_of(const sdm_fit_verdict *v,
                                                        sdm_fit_check_kind kind)
{
    for (size_t i = 0; i < v->n_findings; i++)
        if (v->findings[i].kind == kind) return &v->findings[i];
    return NULL;
}
