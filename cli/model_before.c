/* The model that a training with --force replaces, for a comparison of the errors. */
#include "model_before.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sdm/internal/config.h"

sdm_model *cli_model_before(const char *folder)
{
    char path[SDM_PATH_TEXT_MAX + 16];
    sdm_model *m = NULL;
    snprintf(path, sizeof path, "%s/model.sdm", folder);
    return sdm_model_open(path, &m, NULL) ? NULL : m;
}

/* The options hold the checksums of data files, too. */
static bool same_options(const sdm_model_info *a, const sdm_model_info *b)
{
    bool same = a->n_options == b->n_options;
    for (size_t i = 0; i < a->n_options && same; i++)
        same = !strcmp(a->option_names[i], b->option_names[i]) &&
               !strcmp(a->option_values[i], b->option_values[i]);
    return same;
}

static bool same_distribution(const sdm_distribution *a, const sdm_distribution *b)
{
    return a->kind == b->kind && a->mean == b->mean && a->deviation == b->deviation;
}

static bool same_params(const sdm_model_info *a, const sdm_model_info *b)
{
    bool same = a->n_params == b->n_params;
    for (size_t i = 0; i < a->n_params && same; i++) {
        const sdm_model_param *p = &a->params[i], *q = &b->params[i];
        same = !strcmp(p->name, q->name) && p->min == q->min && p->max == q->max &&
               same_distribution(&p->distribution, &q->distribution);
    }
    return same;
}

static bool same_grid(const sdm_grid *a, const sdm_grid *b)
{
    bool same = true;
    for (int i = 0; i < 3 && same; i++)
        same = a->n[i] == b->n[i] && a->spacing[i] == b->spacing[i] && a->origin[i] == b->origin[i];
    return same;
}

double cli_before_rmse(const sdm_model *before, const char *path)
{
    sdm_model *now = NULL;
    if (!before || sdm_model_open(path, &now, NULL)) return NAN;
    const sdm_model_info *a = sdm_model_get_info(before), *b = sdm_model_get_info(now);
    const bool same = !strcmp(a->shape, b->shape) && same_options(a, b) && same_params(a, b) &&
                      same_grid(&a->grid, &b->grid);
    const double rmse = same && a->accuracy.samples > 0 ? a->accuracy.rmse_mm : NAN;
    sdm_model_free(now);
    return rmse;
}

void cli_print_before(double before_mm, double now_mm)
{
    printf("  before      RMSE %.5f -> %.5f mm (%s)\n", before_mm, now_mm,
           now_mm < before_mm   ? "better"
           : now_mm > before_mm ? "worse"
                                : "equal");
}
