/* Compares the model that a training has made with one of before. */
#include "model_before.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sdm/field.h"
#include "sdm/fit.h"
#include "sdm/internal/config.h"
#include "sdm/memory.h"
#include "study/evaluate.h"

enum { SHAPES = 16, POINTS = 500 };

// ratios of errors of models that are as good as each other
static const double SAME = 1.02;

sdm_status cli_before_open(const char *compare, const char *folder, const sdm_instance *shape,
                           sdm_model **out, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX + 16];
    *out = NULL;
    snprintf(path, sizeof path, "%s/model.sdm", folder);
    if (!compare) {
        if (sdm_model_open(path, out, NULL)) *out = NULL;
        return SDM_OK;
    }
    const sdm_status s = sdm_model_open(compare, out, err);
    const char *name = sdm_instance_shape(shape)->name;
    if (s || !strcmp(sdm_model_get_info(*out)->shape, name)) return s;
    sdm_fail(err, SDM_E_ARG, "--compare %s: it is a model of the shape '%s', not of '%s'", compare,
             sdm_model_get_info(*out)->shape, name);
    sdm_model_free(*out);
    *out = NULL;
    return SDM_E_ARG;
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

/* The first parameter whose name, range or distribution differs; NULL: none. */
static const char *other_param(const sdm_model_info *a, const sdm_model_info *b)
{
    const size_t n = a->n_params < b->n_params ? a->n_params : b->n_params;
    for (size_t i = 0; i < n; i++) {
        const sdm_model_param *p = &a->params[i], *q = &b->params[i];
        if (strcmp(p->name, q->name) || p->min != q->min || p->max != q->max ||
            !same_distribution(&p->distribution, &q->distribution))
            return q->name;
    }
    return a->n_params > n ? a->params[n].name : b->n_params > n ? b->params[n].name : NULL;
}

static bool same_grid(const sdm_grid *a, const sdm_grid *b)
{
    bool same = true;
    for (int i = 0; i < 3 && same; i++)
        same = a->n[i] == b->n[i] && a->spacing[i] == b->spacing[i] && a->origin[i] == b->origin[i];
    return same;
}

/* text = why two models cannot be compared; "": they can. */
static void find_difference(const sdm_model_info *a, const sdm_model_info *b, char text[160])
{
    const char *param = other_param(a, b);
    *text = '\0';
    if (strcmp(a->shape, b->shape))
        snprintf(text, 160, "it is of another shape, '%.60s'", a->shape);
    else if (!same_options(a, b))
        snprintf(text, 160, "the options of its shape are others");
    else if (param)
        snprintf(text, 160, "its range of '%.60s' is another", param);
    else if (a->n_params > SDM_MAX_PARAMS)
        snprintf(text, 160, "it has more than %d parameters", SDM_MAX_PARAMS);
}

/* Adds the squares of the distances that both models give at points of one surface. x, values: room
 * for POINTS of them. */
static sdm_status add_surface(const sdm_model *const models[2], const sdm_instance *shape,
                              size_t index, double *x, float *values, double square[2],
                              sdm_error *err)
{
    double p[SDM_MAX_PARAMS];
    sdm_mesh mesh = {0};
    cli_eval_params(models[1], 0, index, p);
    sdm_status s = sdm_instance_mesh(shape, p, &mesh, err);
    if (!s) s = sdm_fit_surface_points(&mesh, POINTS, 0, x, err);
    for (int k = 0; k < 2 && !s; k++) {
        s = sdm_generate_points(models[k], p, NULL, x, POINTS, values, NULL, NULL, NULL, err);
        for (size_t i = 0; i < POINTS && !s; i++)
            square[k] += (double)values[i] * (double)values[i];
    }
    sdm_mesh_dispose(&mesh);
    return s;
}

sdm_status cli_before_measure(const sdm_model *before, const char *path, const sdm_instance *shape,
                              cli_before *out, sdm_error *err)
{
    sdm_model *now = NULL;
    double *x = NULL, square[2] = {0};
    float *values = NULL;
    *out = (cli_before){"", NAN, NAN, NAN, NAN};
    if (!before) return SDM_OK;
    sdm_status s = sdm_model_open(path, &now, err);
    if (s) return s;
    const sdm_model_info *a = sdm_model_get_info(before), *b = sdm_model_get_info(now);
    find_difference(a, b, out->why_not);
    if (!out->why_not[0]) {
        const sdm_model *const models[2] = {before, now};
        s = SDM_ALLOC(&x, 3 * POINTS, "comparison", err);
        if (!s) s = SDM_ALLOC(&values, POINTS, "comparison", err);
        for (size_t i = 0; i < SHAPES && !s; i++)
            s = add_surface(models, shape, i, x, values, square, err);
        if (!s) {
            out->surface_was_mm = sqrt(square[0] / (SHAPES * POINTS));
            out->surface_mm = sqrt(square[1] / (SHAPES * POINTS));
        }
        if (!s && same_grid(&a->grid, &b->grid) && a->accuracy.samples > 0)
            out->rmse_was_mm = a->accuracy.rmse_mm, out->rmse_mm = b->accuracy.rmse_mm;
    }
    sdm_free(values);
    sdm_free(x);
    sdm_model_free(now);
    return s;
}

/* "3 times better": the ratio of two errors in words. */
static const char *ratio_text(double was, double now, char text[48])
{
    const double ratio = now / was;
    if (ratio < SAME && ratio > 1 / SAME)
        strcpy(text, "the same");
    else
        snprintf(text, 48, "%.2g times %s", ratio < 1 ? 1 / ratio : ratio,
                 ratio < 1 ? "better" : "worse");
    return text;
}

void cli_before_print(const cli_before *b)
{
    char ratio[48];
    if (b->why_not[0])
        printf("  before      not compared with the model of before: %s\n", b->why_not);
    if (!isfinite(b->surface_was_mm)) return;
    printf("  before      distances at points of %d exact surfaces, which are 0: %.2g -> %.2g mm "
           "(%s)",
           SHAPES, b->surface_was_mm, b->surface_mm,
           ratio_text(b->surface_was_mm, b->surface_mm, ratio));
    if (isfinite(b->rmse_was_mm))
        printf("; RMSE of all voxels %.2g -> %.2g mm (%s)", b->rmse_was_mm, b->rmse_mm,
               ratio_text(b->rmse_was_mm, b->rmse_mm, ratio));
    printf("\n");
}

void cli_before_json(const cli_before *b, sdm_json *j)
{
    if (isfinite(b->rmse_was_mm)) sdm_json_real(j, "before_rmse_mm", b->rmse_was_mm);
    if (!isfinite(b->surface_was_mm)) return;
    sdm_json_real(j, "before_surface_mm", b->surface_was_mm);
    sdm_json_real(j, "surface_mm", b->surface_mm);
}
