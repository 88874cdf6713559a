/* sdmgen mesh: writes the surface mesh of a shape, or audits it. */
#include <stdio.h>

#include "commands.h"
#include "inputs/setup.h"
#include "report/files.h"
#include "report/output.h"
#include "report/report_audit.h"
#include "report/terminal.h"
#include "sdm/meshfile.h"

static sdm_status report_audit(const cli_args *args, const sdm_mesh *mesh, sdm_error *err)
{
    sdm_audit audit;
    if (!args->audit && !args->json) return SDM_OK;
    const sdm_status s = sdm_mesh_audit(mesh, &audit, err);
    if (s) return s;
    if (!args->json) {
        cli_print_audit(&audit);
        return SDM_OK;
    }
    sdm_json json = {0};
    sdm_json_open(&json, NULL, '{');
    sdm_json_text(&json, "shape", args->shape);
    cli_json_audit(&json, &audit);
    sdm_json_close(&json, '}');
    return cli_print_json(&json, err);
}

sdm_status cmd_mesh(const cli_args *args, sdm_error *err)
{
    if (!args->shape) return sdm_fail(err, SDM_E_ARG, "mesh: --shape NAME is needed");
    if (args->outputs.n == 0 && !args->audit && !args->json)
        return sdm_fail(err, SDM_E_ARG, "mesh: an output is needed: -o FILE, or --audit");
    cli_shape shape = {0};
    sdm_mesh mesh = {0};
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < args->outputs.n && !s; i++)
        s = cli_check_type(args->outputs.items[i], true, err);
    if (!s) s = cli_check_files(args, NULL, err);
    if (!s) s = cli_shape_open(args, args->shape, &args->options, &shape, err);
    if (!s) s = sdm_instance_mesh(shape.instance, shape.values, &mesh, err);
    for (size_t i = 0; i < args->outputs.n && !s; i++)
        s = sdm_mesh_write(args->outputs.items[i], &mesh, err);
    if (!s) s = report_audit(args, &mesh, err);
    sdm_mesh_dispose(&mesh);
    cli_shape_dispose(&shape);
    return s;
}
