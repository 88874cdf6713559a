/* sdmgen info: describes the content of a model, level set, image, mesh file or shape model. */
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "inputs/model_grade.h"
#include "inputs/setup.h"
#include "inputs/vdb_child.h"
#include "report/files.h"
#include "report/json_values.h"
#include "report/report_audit.h"
#include "report/report_image.h"
#include "report/report_verdict.h"
#include "report/terminal.h"
#include "sdm/internal/distribution.h"
#include "sdm/internal/file.h"
#include "sdm/internal/model_hash.h"
#include "sdm/memory.h"
#include "sdm/model.h"
#include "ssm/report_ssm.h"

/* A template without a correction learns from meshes, and carries maps of the parts. */
static void print_training(const sdm_model_info *m)
{
    cli_print("training     %.1f s, ", m->train_seconds);
    if (m->train_samples || strcmp(m->kind, "template") != 0)
        cli_print("%lld exact maps", (long long)m->train_samples);
    else
        cli_print("from meshes and exact maps of the parts");
    cli_print(", seed %llu, sdmgen %s\n", (unsigned long long)m->seed, m->version);
}

static void print_model(const char *path, const sdm_model *model)
{
    char hash[SDM_SHA256_TEXT];
    const sdm_model_info *m = sdm_model_get_info(model);
    const sdm_grid *g = &m->grid;
    const sdm_accuracy *a = &m->accuracy;
    cli_print("%s: network '%s' of shape '%s'\n\n", path, m->kind, m->shape);
    cli_print("grid         %lld x %lld x %lld voxels of %g x %g x %g mm, origin %g %g %g (LPS)\n",
              (long long)g->n[0], (long long)g->n[1], (long long)g->n[2], g->spacing[0],
              g->spacing[1], g->spacing[2], g->origin[0], g->origin[1], g->origin[2]);
    // parameters and options
    for (size_t i = 0; i < m->n_params; i++) {
        const sdm_model_param *p = &m->params[i];
        char buf[80];
        cli_print("%s %-18s %.6g .. %.6g%s%s, default %.6g, %s\n",
                  i ? "            " : "parameters  ", p->name, p->min, p->max, *p->unit ? " " : "",
                  p->unit, p->def, sdm_distribution_text(&p->distribution, buf));
    }
    for (size_t i = 0; i < m->n_options; i++)
        cli_print("%s %-18s %s\n", i ? "            " : "options     ", m->option_names[i],
                  m->option_values[i]);
    cli_print(
        "accuracy     on %lld held-out shapes: MSE %.3g mm^2, RMSE %.5f mm, mean %.5f mm, largest "
        "%.5f mm\n",
        (long long)a->samples, a->mse_mm2, a->rmse_mm, a->mae_mm, a->max_abs_mm);
    cli_print("             RMSE within two voxels (%g mm) of the surface %.5f mm\n", a->near_mm,
              a->rmse_near_mm);
    cli_print(
        "             RMSE of single maps: 50 %% below %.5f mm, 90 %% below %.5f mm, 99 %% below "
        "%.5f mm\n",
        a->q50_mm, a->q90_mm, a->q99_mm);
    cli_print_quality(m);
    cli_print_unfit(m->quality.unfit, "not for", 12);
    print_training(m);
    if (m->fine_width) cli_print("fine level   %zu units a layer (docs/grids.md)\n", m->fine_width);
    cli_print("file         %zu bytes, weights %zu bytes, checksum %016llx\n", m->file_bytes,
              m->weight_bytes, (unsigned long long)m->checksum);
    cli_print("SHA-256      %s\n", sdm_model_sha256(model, hash));
}

/* Adds the verdict of the training. */
static void json_quality(sdm_json *j, const sdm_model_quality *q)
{
    sdm_json_open(j, "quality", '{');
    sdm_json_text(j, "grade", q->grade);
    sdm_json_real(j, "cut", q->cut);
    sdm_json_real(j, "between_mm", q->between_mm);
    sdm_json_real(j, "thickness_mm", q->thickness_mm);
    sdm_json_real(j, "volume_error", q->volume_error);
    sdm_json_real(j, "derivative_error", q->derivative_error);
    sdm_json_real(j, "volume_derivative_error", q->volume_derivative_error);
    sdm_json_real(j, "surface_volume_error", q->surface_volume_error);
    sdm_json_real(j, "far_error_mm", q->far_error_mm);
    sdm_json_text(j, "unfit", q->unfit);
    sdm_json_close(j, '}');
}

static sdm_status json_model(const char *path, const sdm_model *model, sdm_error *err)
{
    char checksum[32], hash[SDM_SHA256_TEXT];
    const sdm_model_info *m = sdm_model_get_info(model);
    snprintf(checksum, sizeof checksum, "%016llx", (unsigned long long)m->checksum);
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "file", path);
    sdm_json_text(&j, "type", "model");
    sdm_json_text(&j, "kind", m->kind);
    sdm_json_text(&j, "shape", m->shape);
    sdm_json_text(&j, "version", m->version);
    sdm_json_grid(&j, "grid", &m->grid, false);
    cli_json_model_params(&j, m, NULL);
    // accuracy, training and file
    sdm_json_open(&j, "accuracy", '{');
    sdm_json_int(&j, "samples", m->accuracy.samples);
    sdm_json_real(&j, "mse_mm2", m->accuracy.mse_mm2);
    cli_json_accuracy(&j, &m->accuracy);
    sdm_json_close(&j, '}');
    json_quality(&j, &m->quality);
    sdm_json_uint(&j, "seed", m->seed);
    sdm_json_real(&j, "train_seconds", m->train_seconds);
    sdm_json_int(&j, "train_samples", m->train_samples);
    sdm_json_int(&j, "file_bytes", (int64_t)m->file_bytes);
    sdm_json_int(&j, "weight_bytes", (int64_t)m->weight_bytes);
    sdm_json_int(&j, "fine_width", (int64_t)m->fine_width);
    sdm_json_text(&j, "checksum", checksum);
    sdm_json_text(&j, "sha256", sdm_model_sha256(model, hash));
    sdm_json_text(&j, "config", m->config ? m->config : "");
    sdm_json_close(&j, '}');
    return cli_print_json(&j, err);
}

static sdm_status info_model(const cli_args *args, const char *path, sdm_error *err)
{
    sdm_model *model = NULL;
    sdm_status s = cli_open_unknown(args, path, &model, err);
    if (s) return s;
    if (args->json)
        s = json_model(path, model, err);
    else
        print_model(path, model);
    sdm_model_free(model);
    return s;
}

static sdm_status info_mesh(const cli_args *args, const char *path, sdm_error *err)
{
    sdm_mesh mesh = {0};
    sdm_part_audit audit = {0};
    sdm_status s = cli_read_mesh(path, &mesh, err);
    if (!s) s = sdm_part_audit_make(&mesh, SDM_AUDIT_WALLS | SDM_AUDIT_UNION, NULL, &audit, err);
    if (!s && args->json) {
        sdm_json j = {0};
        sdm_json_open(&j, NULL, '{');
        sdm_json_text(&j, "file", path);
        sdm_json_text(&j, "type", "mesh");
        cli_json_audit(&j, &audit.mesh);
        cli_json_parts(&j, &audit);
        sdm_json_close(&j, '}');
        s = cli_print_json(&j, err);
    } else if (!s) {
        cli_print("%s: triangle mesh\n\n", path);
        cli_print_audit(&audit);
    }
    sdm_part_audit_dispose(&audit);
    sdm_mesh_dispose(&mesh);
    return s;
}

static sdm_status info_image(const cli_args *args, const char *path, sdm_error *err)
{
    sdm_volume volume = {0};
    sdm_status s = sdm_volume_read(path, &volume, err);
    if (!s && args->json) {
        sdm_json j = {0};
        sdm_json_open(&j, NULL, '{');
        cli_json_volume(&j, path, &volume);
        sdm_json_close(&j, '}');
        s = cli_print_json(&j, err);
    } else if (!s) {
        cli_print_volume(path, &volume);
    }
    sdm_volume_dispose(&volume);
    return s;
}

static sdm_status info_vdb(const cli_args *args, const char *path, sdm_error *err)
{
#ifdef SDM_HAVE_VDB
    char *text = NULL;
    sdm_status s = cli_vdb_verify(path, &text, err);
    if (!s && args->json) {
        sdm_json j = {0};
        sdm_json_open(&j, NULL, '{');
        sdm_json_text(&j, "file", path);
        sdm_json_text(&j, "type", "vdb");
        sdm_json_text(&j, "text", text);
        sdm_json_close(&j, '}');
        s = cli_print_json(&j, err);
    } else if (!s) {
        cli_print("%s: %s%s", path, text, text[0] && text[strlen(text) - 1] == '\n' ? "" : "\n");
    }
    sdm_free(text);
    return s;
#else
    (void)args;
    return sdm_fail(err, SDM_E_UNSUPPORTED, "%s: built without OpenVDB", path);
#endif
}

static sdm_status info_ssm(const cli_args *args, const char *path, sdm_error *err)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    sdm_ssm model = {0};
    sdm_status s = sdm_file_read(path, UINT64_C(1) << 32, &bytes, &size, err);
    if (!s) s = sdm_ssm_parse(path, bytes, size, &model, err);
    if (!s && args->json)
        s = cli_json_ssm(path, &model, err);
    else if (!s)
        cli_print_ssm(path, &model);
    sdm_ssm_dispose(&model);
    sdm_free(bytes);
    return s;
}

sdm_status cmd_info(const cli_args *args, sdm_error *err)
{
    const char *path = args->files.items[0];
    const bool mesh = cli_ends_with_any(path, CLI_MESH_ENDINGS), vdb = cli_ends_with(path, ".vdb");
    const bool image = sdm_volume_knows(path), ssm = cli_ends_with(path, ".ssm");
    const sdm_status s = mesh || vdb || image || ssm ? cli_expect_model(args, err) : SDM_OK;
    if (s) return s;
    return mesh    ? info_mesh(args, path, err)
           : ssm   ? info_ssm(args, path, err)
           : image ? info_image(args, path, err)
           : vdb   ? info_vdb(args, path, err)
                   : info_model(args, path, err);
}
