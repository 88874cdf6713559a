/* Opens the source of the maps of a fit: a network, the exact engine, or both. */
#include <math.h>
#include <string.h>

#include "fit_command.h"
#include "inputs/model_grade.h"
#include "inputs/setup.h"
#include "report/report_audit.h"
#include "report/terminal.h"
#include "sdm/memory.h"

/* Finds the shape of the model, if it is a built-in one or a plug-in that is loaded, for the checks
 * that compare the network with it. Warns if the shape was changed after the
 * training: the fit takes the network alone and would not notice. */
static void find_shape(cli_fit *f)
{
    sdm_error why = {0};
    if (cli_open_registry(f->args, &f->judge_registry, &why) ||
        sdm_runtime_instance(f->model, f->judge_registry, &f->judge_shape, &why) != SDM_E_PLUGIN)
        return;
    cli_warn("%s", why.text);
    const char *name = sdm_model_get_info(f->model)->shape;
    f->shape_changed = sdm_registry_find(f->judge_registry, name, NULL) != NULL;
}

static sdm_status open_model(cli_fit *f, sdm_error *err)
{
    const cli_args *args = f->args;
    if (args->options.n)
        return sdm_fail(err, SDM_E_ARG, "fit: -O belongs to --shape; a model has its own options");
    sdm_status s = cli_open_model(args, f->model_path, &f->model, err);
    if (s) return s;
    const sdm_model_info *info = sdm_model_get_info(f->model);
    if (!args->fit.exact) cli_warn_quality(f->model_path, info);
    f->shape_name = info->shape;
    if (args->fit.exact || args->fit.polish || args->measure || args->fit.open_end ||
        f->source.policy == SDM_RANGE_EXACT) {
        s = cli_open_registry(args, &f->registry, err);
        if (!s) s = sdm_runtime_instance(f->model, f->registry, &f->shape, err);
        if (s)
            return sdm_fail_in(err, s, "--%s needs the exact shape",
                               args->fit.exact      ? "exact"
                               : args->fit.polish   ? "polish"
                               : args->measure      ? "measure"
                               : args->fit.open_end ? "open-end"
                                                    : "policy exact");
    }
    if (!f->registry) find_shape(f);
    if (!args->fit.exact) {
        f->source.model = f->model;
        f->n_params = info->n_params;
        return cli_model_params(info, &f->params, err);
    }
    return SDM_OK;
}

static sdm_status open_shape(cli_fit *f, sdm_error *err)
{
    sdm_status s = cli_expect_model(f->args, err);
    if (!s) s = cli_open_registry(f->args, &f->registry, err);
    if (!s) s = cli_create_shape(f->registry, f->args->shape, &f->args->options, &f->shape, err);
    if (!s) f->shape_name = f->args->shape;
    return s;
}

static sdm_status shape_params(cli_fit *f, sdm_error *err)
{
    const sdm_param *params = sdm_instance_params(f->shape, &f->n_params);
    const sdm_status s = SDM_ALLOC(&f->params, f->n_params, "parameters", err);
    if (!s) memcpy(f->params, params, f->n_params * sizeof *params);
    return s;
}

/* Checks the start parameters, or clamps them, according to --policy. */
static sdm_status check_start(cli_fit *f, sdm_error *err)
{
    bool finite = true;
    for (size_t i = 0; i < f->n_params; i++) finite = finite && isfinite(f->start[i]);
    if (f->source.policy == SDM_RANGE_REFUSE || !finite)
        return f->source.model ? cli_check_trained(f->args, f->model, f->params, f->start, err)
                               : cli_check_range(f->params, f->n_params, f->start, err);
    if (f->source.policy == SDM_RANGE_EXACT) return sdm_instance_check(f->shape, f->start, err);
    f->start_clamped = cli_clamp("the start parameters were clamped to their range: ", f->params,
                                 f->n_params, f->start);
    return SDM_OK;
}

/* Warns of defects of the shape's mesh at the start, if the fit makes exact maps of it. */
static void warn_shape(const cli_fit *f)
{
    sdm_mesh mesh = {0};
    if (f->shape && !sdm_instance_mesh(f->shape, f->start, &mesh, NULL))
        cli_warn_mesh(&mesh, 0, CLI_MEND_SHAPE);
    sdm_mesh_dispose(&mesh);
}

sdm_status cli_fit_open_source(cli_fit *f, sdm_error *err)
{
    f->source.policy = cli_policy(f->args);
    const bool network = f->model_path && !f->args->fit.exact;
    if (network && f->args->spacing[0] > 0)
        return sdm_fail(
            err, SDM_E_ARG,
            "fit: --spacing applies to exact maps (--exact, --shape); a model has its own grid%s: "
            "for "
            "finer maps fit again with --exact from the parameters and the pose of its result",
            f->args->fit.polish ? ", which the exact maps of --polish take, too" : "");
    if (!network && f->args->fit.polish)
        return sdm_fail(
            err, SDM_E_ARG,
            "fit: --polish follows the fit of a network; this fit is exact from the start");
    sdm_status s = f->model_path ? open_model(f, err) : open_shape(f, err);
    if (!s && !f->params) s = shape_params(f, err);
    if (!s) s = SDM_ALLOC(&f->start, f->n_params, "parameters", err);
    if (!s) s = cli_read_params(f->params, f->n_params, &f->args->params, f->start, err);
    if (!s) s = check_start(f, err);
    if (s) return s;
    f->source.shape = f->shape ? f->shape : f->judge_shape;
    warn_shape(f);
    return SDM_OK;
}
