/* sdmgen mesh: writes the mesh of a shape or of a file, or audits it. */
#include <stdio.h>

#include "commands.h"
#include "inputs/setup.h"
#include "report/files.h"
#include "report/output.h"
#include "report/report_audit.h"
#include "report/terminal.h"
#include "sdm/meshfile.h"

/* Prints the audit, or JSON, and returns the verdict; without both, only warns. */
static sdm_status report_audit(const cli_args *args, const sdm_mesh *mesh, sdm_error *err)
{
    const char *mend = args->shape ? CLI_MEND_SHAPE : CLI_MEND_FILE;
    sdm_part_audit audit;
    if (!args->audit && !args->json) {
        cli_warn_mesh(mesh, 0, mend);
        return SDM_OK;
    }
    sdm_status s = sdm_part_audit_make(mesh, SDM_AUDIT_WALLS | SDM_AUDIT_UNION, NULL, &audit, err);
    if (s) return s;
    if (args->json) {
        sdm_json json = {0};
        sdm_json_open(&json, NULL, '{');
        sdm_json_text(&json, args->shape ? "shape" : "mesh",
                      args->shape ? args->shape : args->mesh);
        cli_json_audit(&json, &audit.mesh);
        cli_json_parts(&json, &audit);
        sdm_json_close(&json, '}');
        s = cli_print_json(&json, err);
    } else {
        cli_print_audit(&audit);
    }
    if (!s) s = cli_audit_verdict(&audit, mend, err);
    sdm_part_audit_dispose(&audit);
    return s;
}

/* Makes the mesh of the shape, or reads the file; turns parts if asked to. */
static sdm_status make_mesh(const cli_args *args, sdm_mesh *mesh, sdm_error *err)
{
    cli_shape shape = {0};
    sdm_status s = SDM_OK;
    if (args->shape) {
        s = cli_shape_open(args, args->shape, &args->options, &shape, err);
        if (!s) s = sdm_instance_mesh(shape.instance, shape.values, mesh, err);
        cli_shape_dispose(&shape);
    } else {
        s = cli_read_mesh(args->mesh, mesh, err);
    }
    return s || !args->turn_parts ? s : cli_turn_parts(mesh, err);
}

sdm_status cmd_mesh(const cli_args *args, sdm_error *err)
{
    if (!args->shape == !args->mesh)
        return sdm_fail(err, SDM_E_ARG, "mesh: either --shape NAME or --mesh FILE is needed");
    if (args->outputs.n == 0 && !args->audit && !args->json)
        return sdm_fail(err, SDM_E_ARG, "mesh: an output is needed: -o FILE, or --audit");
    if (args->mesh && (args->params.n > 0 || args->options.n > 0))
        return sdm_fail(err, SDM_E_ARG, "mesh: -p and -O need --shape");
    sdm_mesh mesh = {0};
    sdm_status s = args->mesh ? cli_refuse_plugins(args, "a mesh file", err) : SDM_OK;
    for (size_t i = 0; i < args->outputs.n && !s; i++)
        s = cli_check_type(args->outputs.items[i], true, err);
    if (!s) s = cli_check_files(args, NULL, err);
    if (!s) s = make_mesh(args, &mesh, err);
    for (size_t i = 0; i < args->outputs.n && !s; i++)
        s = sdm_mesh_write(args->outputs.items[i], &mesh, err);
    if (!s) s = report_audit(args, &mesh, err);
    sdm_mesh_dispose(&mesh);
    return s;
}
