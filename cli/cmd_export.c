/* sdmgen export: writes a network as ONNX, or a shape as glTF with morph targets. */
#include "commands.h"
#include "inputs/setup.h"
#include "report/files.h"
#include "report/terminal.h"
#include "sdm/internal/model_onnx.h"
#include "shapes/shape_targets.h"

/* Refuses what cannot be exported, and outputs of another type than the input's. */
static sdm_status check_options(const cli_args *args, sdm_error *err)
{
    const char *type = args->shape ? ".glb" : ".onnx";
    if ((args->shape != NULL) + args->files.n != 1)
        return sdm_fail(err, SDM_E_ARG,
                        "export: either a MODEL (-o FILE.onnx) or --shape NAME (-o FILE.glb) is "
                        "needed");
    if (!args->outputs.n)
        return sdm_fail(err, SDM_E_ARG, "export: an output is needed: -o FILE%s", type);
    if (!args->shape && (args->params.n || args->options.n))
        return sdm_fail(err, SDM_E_ARG, "export: -p and -O need --shape");
    const sdm_status s = args->shape ? SDM_OK : cli_refuse_plugins(args, "a MODEL", err);
    if (s) return s;
    for (size_t i = 0; i < args->outputs.n; i++)
        if (!cli_ends_with(args->outputs.items[i], type))
            return sdm_fail(err, SDM_E_ARG, "export: '%s': %s is written as *%s",
                            args->outputs.items[i], args->shape ? "a shape" : "a model", type);
    return cli_check_files(args, NULL, err);
}

static sdm_status export_model(const cli_args *args, sdm_error *err)
{
    sdm_model *m;
    sdm_status s = cli_open_model(args, args->files.items[0], &m, err);
    if (!s && sdm_model_get_info(m)->fine_width)
        cli_notice("%s: ONNX holds the map on the grid of the model; its fine level is left out",
                   args->files.items[0]);
    for (size_t i = 0; i < args->outputs.n && !s; i++)
        s = sdm_model_write_onnx(m, args->outputs.items[i], err);
    sdm_model_free(m);
    return s;
}

static sdm_status export_shape(const cli_args *args, sdm_error *err)
{
    cli_shape shape = {0};
    sdm_status s = cli_expect_model(args, err);
    if (!s) s = cli_shape_open(args, args->shape, &args->options, &shape, err);
    for (size_t i = 0; i < args->outputs.n && !s; i++)
        s = cli_write_glb(args->outputs.items[i], &shape, err);
    cli_shape_dispose(&shape);
    return s;
}

sdm_status cmd_export(const cli_args *args, sdm_error *err)
{
    const sdm_status s = check_options(args, err);
    if (s) return s;
    return args->shape ? export_shape(args, err) : export_model(args, err);
}
