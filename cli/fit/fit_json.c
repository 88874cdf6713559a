/* Writes the result of a fit as JSON. */
#include <math.h>

#include "fit_command.h"
#include "report/json_values.h"
#include "sdm/internal/threads.h"

/* Adds the matrix m[n][n], whose rows and columns have the order of the member "unknowns". */
static void add_matrix(sdm_json *j, const char *key, const double *m, size_t n)
{
    sdm_json_open(j, key, '[');
    for (size_t i = 0; i < n; i++) sdm_json_reals(j, NULL, m + i * n, n);
    sdm_json_close(j, ']');
}

static void add_unknowns(sdm_json *j, const cli_fit *f)
{
    static const char *const pose[6] = {"rotation_x",    "rotation_y",    "rotation_z",
                                        "translation_x", "translation_y", "translation_z"};
    const sdm_fit_result *r = &f->result;
    // parameters
    cli_json_params(j, "parameters", f->params, f->n_params, r->params);
    cli_json_params(j, "parameters_sd", f->params, f->n_params, r->sd);
    if (f->truth) cli_json_params(j, "truth", f->params, f->n_params, f->truth);
    sdm_json_open(j, "at_bound", '[');
    for (size_t i = 0; i < f->n_params; i++)
        if (r->at_bound[i]) sdm_json_text(j, NULL, f->params[i].name);
    sdm_json_close(j, ']');
    sdm_json_open(j, "not_determined", '[');
    for (size_t i = 0; i < f->n_params; i++)
        if (r->by_prior[i]) sdm_json_text(j, NULL, f->params[i].name);
    sdm_json_close(j, ']');
    // pose
    sdm_json_open(j, "pose", '{');
    sdm_json_reals(j, "rotation_rad", r->pose.rotation, 3);
    sdm_json_reals(j, "translation_mm", r->pose.translation, 3);
    sdm_json_reals(j, "rotation_sd_rad", r->sd + f->n_params, 3);
    sdm_json_reals(j, "translation_sd_mm", r->sd + f->n_params + 3, 3);
    if (*r->open_motions) {
        sdm_json_reals(j, "rotation_sd_determined_rad", r->pose_sd_determined, 3);
        sdm_json_reals(j, "translation_sd_determined_mm", r->pose_sd_determined + 3, 3);
    }
    sdm_json_text(j, "meaning",
                  "world = R x + translation, LPS mm; R turns about the origin of the shape's "
                  "frame by the rotation "
                  "vector (axis times angle); sd of the rotation: of a small turn after it about "
                  "the axes of the world");
    sdm_json_close(j, '}');
    sdm_json_text(j, "not_determined_motions", r->open_motions);
    cli_fit_json_truth_pose(f, j);
    if (f->opts.keep_pose) {
        sdm_json_real(j, "kept_pose_motion_mm", r->kept_pose_motion);
        sdm_json_real(j, "kept_pose_gain", r->kept_pose_gain);
    }
    // correlation and covariance
    sdm_json_open(j, "unknowns", '[');
    for (size_t i = 0; i < f->n_params; i++) sdm_json_text(j, NULL, f->params[i].name);
    for (int i = 0; i < 6; i++) sdm_json_text(j, NULL, pose[i]);
    sdm_json_close(j, ']');
    add_matrix(j, "correlation", r->correlation, f->n_params + 6);
    add_matrix(j, "covariance", r->covariance, f->n_params + 6);
}

/* Adds the n normal distributions of the values on one side of the surface. */
static void add_mixture(sdm_json *j, const char *key, const sdm_fit_law *law, size_t n)
{
    sdm_json_open(j, key, '[');
    for (size_t i = 0; i < n; i++) {
        sdm_json_open(j, NULL, '{');
        sdm_json_real(j, "weight", law[i].weight);
        sdm_json_real(j, "mean", law[i].mean);
        sdm_json_real(j, "sd", law[i].sd);
        sdm_json_close(j, '}');
    }
    sdm_json_close(j, ']');
}

static void add_target(sdm_json *j, const cli_fit *f)
{
    const sdm_fit_result *r = &f->result;
    sdm_json_int(j, "used", (int64_t)r->n_used);
    sdm_json_int(j, "nan", (int64_t)r->n_nan);
    sdm_json_int(j, "cavity", (int64_t)r->n_cavity);
    if (f->opts.open_end) sdm_json_int(j, "beyond_open_end", (int64_t)r->n_beyond);
    sdm_json_real(j, "inside_share", r->inside_share);
    sdm_json_real(j, "noise_factor", r->noise_factor);
    sdm_json_real(j, "model_error_mm", r->model_error_mm);
    sdm_json_real(j, "log_likelihood", r->log_likelihood);
    if (f->target.kind == SDM_FIT_POINTS) sdm_json_real(j, "point_sd_mm", r->point_sd);
    if (f->target.kind == SDM_FIT_POINTS) sdm_json_real(j, "outliers", r->outliers);
    if (f->target.kind != SDM_FIT_IMAGE) return;
    sdm_json_text(j, "image_model", f->args->fit.image_model);
    sdm_json_real(j, "evidence", r->evidence);
    if (r->blur > 0) sdm_json_real(j, "blur_mm", r->blur);
    sdm_json_real(j, "map_voxel_mm", cli_fit_map_voxel(f));
    add_mixture(j, "inside", r->appearance.inside, r->appearance.n_inside);
    add_mixture(j, "outside", r->appearance.outside, r->appearance.n_outside);
}

static void add_overlap(sdm_json *j, const cli_fit *f)
{
    const cli_overlap *o = &f->overlap;
    if (!o->measured) return;
    sdm_json_open(j, "overlap", '{');
    sdm_json_text(j, "with", f->reference_is_target ? f->path : f->args->fit.reference);
    if (!isnan(f->args->fit.label_close))
        sdm_json_real(j, "label_close_mm", f->args->fit.label_close);
    sdm_json_real(j, "dice", o->dice);
    sdm_json_int(j, "voxels_fit", (int64_t)o->n_fit);
    sdm_json_int(j, "voxels_reference", (int64_t)o->n_reference);
    if (f->reference_is_target) sdm_json_int(j, "voxels_far", (int64_t)o->n_beyond);
    if (o->has_surface) {
        sdm_json_real(j, "surface_mean_mm", o->mean_mm);
        sdm_json_real(j, "surface_q95_mm", o->q95_mm);
        sdm_json_real(j, "surface_hausdorff_mm", o->hausdorff_mm);
    }
    sdm_json_close(j, '}');
}

static void add_work(sdm_json *j, const cli_fit *f)
{
    const sdm_fit_result *r = &f->result;
    sdm_json_int(j, "iterations", (int64_t)r->n_iterations);
    sdm_json_int(j, "restarts", (int64_t)r->n_restarts);
    sdm_json_reals(j, "objective", r->objective, r->n_iterations);
    sdm_json_bool(j, "start_clamped", f->start_clamped || r->start_clamped);
    sdm_json_int(j, "turn", (int64_t)r->turn);
    sdm_json_int(j, "maps_network", (int64_t)r->n_network);
    sdm_json_int(j, "maps_exact", (int64_t)r->n_exact);
    sdm_json_int(j, "maps_exact_outside", (int64_t)r->n_exact_outside);
    sdm_json_real(j, "seconds", r->seconds);
    sdm_json_real(j, "seconds_network", r->seconds_network);
    sdm_json_real(j, "seconds_exact", r->seconds_exact);
    sdm_json_real(j, "seconds_search", r->seconds_search);
    sdm_json_real(j, "seconds_verdict", r->seconds_verdict);
    sdm_json_int(j, "threads", sdm_threads((int)f->args->threads));
}

void cli_fit_json(const cli_fit *f, sdm_json *j)
{
    const sdm_fit_result *r = &f->result;
    sdm_json_open(j, NULL, '{');
    sdm_json_text(j, "made_by", "sdmgen " SDM_VERSION_TEXT);
    sdm_json_text(j, "shape", f->shape_name);
    if (f->model_path) sdm_json_text(j, "model", f->model_path);
    sdm_json_text(j, "image", f->path);
    cli_fit_json_repeat(f, j);
    sdm_json_text(j, "kind", cli_fit_kind(f));
    sdm_json_bool(j, "trusted", !f->doubt.status);
    if (f->doubt.status) sdm_json_text(j, "doubt", f->doubt.text);
    cli_fit_json_verdict(f, j);
    cli_fit_json_candidates(f, j);
    sdm_json_bool(j, "converged", r->converged);
    sdm_json_text(j, "reason", r->reason);
    add_unknowns(j, f);
    if (f->args->measure) cli_json_measures(&f->measures, true, j);
    add_overlap(j, f);
    add_target(j, f);
    add_work(j, f);
    if (f->target.kind != SDM_FIT_POINTS) sdm_json_grid(j, "grid", &f->target.grid, false);
    sdm_json_close(j, '}');
}
