/* sdmgen verify: checks that a model, level set or image file is complete, and that a model is as
 * accurate as it states. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "inputs/model_grade.h"
#include "inputs/setup.h"
#include "inputs/vdb_child.h"
#include "report/files.h"
#include "report/terminal.h"
#include "sdm/memory.h"
#include "sdm/volume.h"
#include "study/evaluate.h"

enum { DEFAULT_SAMPLES = 20 };
/* Largest allowed ratio of measured to stated RMSE. */
#define TOLERANCE 1.25

/* The text between two facts about a file. Where several files are verified, all facts about one
 * stand in one line. */
static const char *next_fact(const cli_args *args) { return args->files.n > 1 ? "; " : "\n"; }

static sdm_status verify_vdb(const cli_args *args, const char *path, sdm_error *err)
{
#ifdef SDM_HAVE_VDB
    char *text = NULL;
    const sdm_status s = cli_vdb_verify(path, &text, err);
    if (s) return s;
    const bool whole = strstr(text, "whole map") != NULL;
    sdm_free(text);
    if (!args->json) {
        cli_print("%s: %s\n", path,
                  whole ? "hash is right (a whole map, no level set)"
                        : "hash and level set are right");
        return SDM_OK;
    }
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "file", path);
    sdm_json_text(&j, "type", "vdb");
    sdm_json_bool(&j, "ok", true);
    sdm_json_close(&j, '}');
    return cli_print_json(&j, err);
#else
    (void)args;
    return sdm_fail(err, SDM_E_UNSUPPORTED, "%s: built without OpenVDB", path);
#endif
}

/* Image files hold no hash of the values: only the structure is checked, and the checksum of gzip
 * or zlib where the voxels are compressed. */
static sdm_status verify_image(const cli_args *args, const char *path, sdm_error *err)
{
    sdm_volume v = {0};
    sdm_status s = sdm_volume_read(path, &v, err);
    if (!s && args->json) {
        sdm_json j = {0};
        sdm_json_open(&j, NULL, '{');
        sdm_json_text(&j, "file", path);
        sdm_json_text(&j, "type", "image");
        sdm_json_bool(&j, "ok", true);
        sdm_json_bool(&j, "checksum", v.checked);
        sdm_json_close(&j, '}');
        s = cli_print_json(&j, err);
    } else if (!s) {
        cli_print("%s: complete: %lld x %lld x %lld %s voxels, %s", path, (long long)v.grid.n[0],
                  (long long)v.grid.n[1], (long long)v.grid.n[2], sdm_voxel_name(v.stored),
                  v.checked ? "the checksum of the compressed data is right"
                            : "no checksum: changed voxels cannot be detected");
        if (v.n_nan > 0 || v.n_inf > 0)
            cli_print("%s%zu values are NaN, %zu infinite", next_fact(args), v.n_nan, v.n_inf);
        cli_print("\n");
    }
    sdm_volume_dispose(&v);
    return s;
}

/* Standard error of the mean square error over the shapes, mm^2, from their scatter. */
static double standard_error(const cli_eval *e)
{
    double sum = 0;
    if (e->n < 2) return INFINITY;
    for (size_t i = 0; i < e->n; i++) {
        const double off = e->sample[i].mse_mm2 - e->mse_mm2;
        sum += off * off;
    }
    return sqrt(sum / (double)(e->n - 1) / (double)e->n);
}

/* Is the mean square error above the allowed one by more than `errors` standard errors? */
static bool is_worse(const cli_eval *e, double stated, double errors)
{
    const double allowed = TOLERANCE * TOLERANCE * stated * stated;
    if (e->n == 0 || e->mse_mm2 <= allowed) return false;
    return errors == 0 || !(e->mse_mm2 - errors * standard_error(e) <= allowed); // a NaN is worse
}

/* How the measured error compares with the stated one, in words. */
static const char *compared(const cli_eval *e, double stated)
{
    const double off = e->mse_mm2 - stated * stated;
    if (is_worse(e, stated, 0)) return "";
    if (e->n < 2) return ": in order, though one shape tells little";
    if (fabs(off) <= 2 * standard_error(e))
        return ": in order, the difference is within the scatter between these shapes";
    return off < 0 ? ": in order, these shapes are more exact than stated"
                   : ": in order, up to 25 % more than stated is allowed";
}

static sdm_status report_model(const cli_args *args, const char *path, const sdm_model_info *info,
                               const cli_eval *e, const cli_timing *times, sdm_error *err)
{
    const double stated = info->accuracy.rmse_mm;
    const bool good = !is_worse(e, stated, 2);
    sdm_status s = SDM_OK;
    if (args->json) {
        sdm_json j = {0};
        sdm_json_open(&j, NULL, '{');
        sdm_json_text(&j, "file", path);
        sdm_json_text(&j, "type", "model");
        sdm_json_bool(&j, "ok", good);
        sdm_json_int(&j, "samples", (int64_t)e->n);
        sdm_json_real(&j, "stated_rmse_mm", stated);
        if (e->n > 0) {
            sdm_json_real(&j, "rmse_mm", e->rmse_mm);
            sdm_json_real(&j, "ms_network", times->ms_network);
            sdm_json_real(&j, "ms_exact", times->ms_exact);
        }
        sdm_json_close(&j, '}');
        s = cli_print_json(&j, err);
    } else {
        const char *next = next_fact(args);
        cli_print("%s: every checksum is right", path);
        if (e->n > 0)
            cli_print("%sRMSE %.5f mm on %zu random shapes, stated %.5f mm%s", next, e->rmse_mm,
                      e->n, stated, compared(e, stated));
        if (e->n > 0 && good && is_worse(e, stated, 0))
            cli_print("%sit is more than 25 %% worse, which may be due to the choice of these "
                      "shapes: --samples %zu tells",
                      next, 10 * e->n);
        cli_print("\n");
        if (e->n > 0 && args->files.n == 1) cli_print_two("", times);
    }
    if (!s && !good)
        s = sdm_fail(err, SDM_E_QUALITY,
                     "%s: RMSE %.5f mm on %zu random shapes, stated %.5f mm: more than 25 %% "
                     "worse, and by more than the scatter between the shapes (--samples %zu "
                     "measures it more exactly)",
                     path, e->rmse_mm, e->n, stated, 10 * e->n);
    return s;
}

static sdm_status verify_model(const cli_args *args, const char *path, sdm_error *err)
{
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    sdm_model *model = NULL;
    cli_eval e = {0};
    cli_timing times;
    sdm_status s = cli_open_registry(args, &registry, err);
    if (!s) s = cli_open_unknown(args, path, &model, err); // verifies every checksum
    const sdm_model_info *info = s ? NULL : sdm_model_get_info(model);
    if (!s) cli_warn_quality(path, info);
    const bool known = !s && sdm_registry_find(registry, info->shape, NULL);
    if (!s && known) s = sdm_runtime_instance(model, registry, &shape, err);
    if (!s && known)
        s = cli_evaluate(model, shape, args->seed < 0 ? 1 : (uint64_t)args->seed,
                         args->samples < 0 ? DEFAULT_SAMPLES : (size_t)args->samples, false, &e,
                         err);
    if (!s && known) s = cli_time_two(model, shape, &times, err);
    if (!s && !known)
        cli_warn("shape '%s' is unknown (--plugin FILE loads it): the accuracy was not measured",
                 info->shape);
    if (!s) s = report_model(args, path, info, &e, &times, err);
    cli_eval_dispose(&e);
    sdm_model_free(model);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    return s;
}

static bool is_model(const char *path)
{
    return !cli_ends_with(path, ".vdb") && !sdm_volume_knows(path);
}

static sdm_status verify_file(const cli_args *args, const char *path, sdm_error *err)
{
    if (is_model(path)) return verify_model(args, path, err);
    return cli_ends_with(path, ".vdb") ? verify_vdb(args, path, err)
                                       : verify_image(args, path, err);
}

/* Options that are for models alone: one of the files must be a model. */
static sdm_status check_options(const cli_args *args, sdm_error *err)
{
    const char *path = args->files.items[0];
    for (size_t i = 0; i < args->files.n; i++)
        if (is_model(args->files.items[i])) return SDM_OK;
    if (args->samples >= 0 || args->seed >= 0)
        return sdm_fail(err, SDM_E_ARG,
                        "verify: --%s does nothing for %s: it is for the random shapes of a model",
                        args->samples >= 0 ? "samples" : "seed", path);
    const sdm_status s = cli_expect_model(args, err);
    return s ? s : cli_refuse_plugins(args, path, err);
}

/* Checks one file after the other and tells each failure. Fails as the file with the highest exit
 * code did. */
static sdm_status verify_several(const cli_args *args, sdm_error *err)
{
    sdm_status worst = SDM_OK;
    int highest = CLI_EXIT_DONE;
    size_t failed = 0;
    for (size_t i = 0; i < args->files.n; i++) {
        sdm_error own = {0};
        const sdm_status s = verify_file(args, args->files.items[i], &own);
        if (s == SDM_E_CANCELLED) {
            *err = own;
            return s;
        }
        const int code = s ? cli_report(&own) : CLI_EXIT_DONE;
        failed += s != SDM_OK;
        if (code > highest) highest = code, worst = s;
    }
    return failed ? sdm_fail(err, worst, "verify: %zu of %zu files are not right", failed,
                             args->files.n)
                  : SDM_OK;
}

sdm_status cmd_verify(const cli_args *args, sdm_error *err)
{
    const sdm_status s = check_options(args, err);
    if (s) return s;
    return args->files.n > 1 ? verify_several(args, err)
                             : verify_file(args, args->files.items[0], err);
}
