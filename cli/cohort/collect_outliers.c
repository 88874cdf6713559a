/* Outliers among the parameters of a cohort. */
#include <math.h>

#include "collect.h"
#include "measure/median.h"
#include "sdm/memory.h"

#define LIMIT 3.5
#define NORMAL 0.6745 /* MAD of the standard normal distribution */

enum { FEWEST = 8 };

/* Marks the rows whose value in the column is an outlier. x[rows]: scratch. */
static void mark(cli_collect *t, size_t column, double *x)
{
    size_t n = 0;
    for (size_t i = 0; i < t->ids.n; i++) {
        const double value = t->values[i * t->n_columns + column];
        if (t->rows[i].state == CLI_CASE_ACCEPTED && isfinite(value)) x[n++] = value;
    }
    if (n < FEWEST) return;
    const double middle = cli_median(x, n);
    for (size_t i = 0; i < n; i++) x[i] = fabs(x[i] - middle);
    const double mad = cli_median(x, n);
    for (size_t i = 0; i < t->ids.n && mad > 0; i++) {
        const double z = NORMAL * (t->values[i * t->n_columns + column] - middle) / mad;
        sdm_text *out = &t->rows[i].outliers;
        if (fabs(z) > LIMIT)
            sdm_text_add(out, "%s%s %.1f", out->size ? "; " : "", t->columns[column].name, z);
    }
}

sdm_status cli_collect_outliers(cli_collect *t, sdm_error *err)
{
    double *x = NULL;
    sdm_status s = SDM_ALLOC(&x, t->ids.n, "outliers", err);
    for (size_t k = 0; k < t->n_columns && !s; k++)
        if (t->columns[k].group == CLI_GROUP_PARAM && !t->columns[k].is_sd) mark(t, k, x);
    for (size_t i = 0; i < t->ids.n && !s; i++)
        if (t->rows[i].outliers.failed) s = sdm_fail(err, SDM_E_NOMEM, "out of memory");
    sdm_free(x);
    return s;
}
