/* Goes on with finer exact maps after a fit whose voxels alone leave, or may leave, it in doubt. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit_command.h"
#include "report/terminal.h"
#include "sdm/internal/fit_finding.h"
#include "sdm/internal/shape_box.h"

/* Limits of the finer maps, so that time and memory stay bounded: voxels, and values of a map with
 * its derivatives by the parameters. */
#define VOXELS_MAX 2097152.0
#define VALUES_MAX 16777216.0

/* Voxels that pass are nearly too coarse if they are longer than this share of their limit. */
#define NEARLY_COARSE 0.5
/* They explain figures of up to so many times their limit. */
#define LITTLE_BEYOND 1.5
/* Such a fit goes on by itself with at most so many voxels, because finer maps may not be the
 * remedy: twice those of the default grid. */
#define NEARLY_VOXELS_MAX 524288.0

/* Are the exact maps on the default grid, because no model and no option gives another one? */
static bool grid_is_open(const cli_fit *f)
{
    const cli_args *a = f->args;
    return !f->model && !a->like && !(a->size[0] > 0) && !(a->spacing[0] > 0);
}

/* Do coarse maps explain why this check has not passed? */
static bool coarse_maps_explain(sdm_fit_check_kind kind)
{
    return kind == SDM_FIT_CHECK_VOXELS || kind == SDM_FIT_CHECK_RESIDUALS ||
           kind == SDM_FIT_CHECK_BESIDE || kind == SDM_FIT_CHECK_INSIDE ||
           kind == SDM_FIT_CHECK_OUTSIDE;
}

/* Are the voxels of the maps nearly too coarse, and is nothing in doubt but checks that coarse maps
 * explain, each a little beyond its limit? */
static bool maps_are_nearly_coarse(const cli_fit *f)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    const sdm_fit_finding *voxels = sdm_fit_finding_of(v, SDM_FIT_CHECK_VOXELS);
    if (!voxels || voxels->grade != SDM_FIT_PASSED || v->grade != SDM_FIT_DOUBTFUL || f->points ||
        !(voxels->figure > NEARLY_COARSE * voxels->limit))
        return false;
    for (size_t i = 0; i < v->n_findings; i++) {
        const sdm_fit_finding *x = &v->findings[i];
        if (x->grade != SDM_FIT_PASSED &&
            !(coarse_maps_explain(x->kind) && x->figure <= LITTLE_BEYOND * x->limit))
            return false;
    }
    return true;
}

double cli_fit_finer_voxel(const cli_fit *f)
{
    // finer maps that were tried for this reason and did not help are not advised again
    const bool nearly = !f->was_nearly_coarse && maps_are_nearly_coarse(f);
    return nearly ? SDM_GRID_FIT_ADVISED * cli_fit_map_voxel(f) : f->result.advised_voxel_mm;
}

static bool only_maps_doubt(const cli_fit *f)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    if (!isfinite(cli_fit_finer_voxel(f))) return false;
    if (f->doubt.status && !cli_fit_voxels_refuse(f)) return false;
    for (size_t i = 0; i < v->n_findings; i++)
        if (v->findings[i].grade != SDM_FIT_PASSED && !coarse_maps_explain(v->findings[i].kind))
            return false;
    return true;
}

/* f->coarse_beside = the end of "coarse beside ..." in the finding on the voxels. */
static void note_reason(cli_fit *f)
{
    static const char before[] = "coarse beside ";
    const sdm_fit_finding *x = sdm_fit_finding_of(&f->result.verdict, SDM_FIT_CHECK_VOXELS);
    const char *at = x ? strstr(x->text, before) : NULL;
    if (!at) return;
    at += strlen(before);
    snprintf(f->coarse_beside, sizeof f->coarse_beside, "%.*s", (int)strcspn(at, ":"), at);
}

/* Adds the work of the fit with coarse maps to that of the result; the start that it chose stays.
 */
static void add_work(const sdm_fit_result *first, sdm_fit_result *r)
{
    r->turn = first->turn;
    r->n_exact += first->n_exact;
    r->n_restarts += first->n_restarts;
    r->start_clamped = first->start_clamped;
    r->seconds += first->seconds;
    r->seconds_exact += first->seconds_exact;
    r->seconds_search += first->seconds_search;
    r->seconds_verdict += first->seconds_verdict;
}

/* Fits with maps on the grid g from the result of `before`. SDM_E_QUALITY is no error here. */
static sdm_status fit_finer(cli_fit *f, const cli_fit *before, const sdm_grid *g, sdm_error *err)
{
    f->was_nearly_coarse = maps_are_nearly_coarse(f);
    f->coarse_mm = cli_fit_map_voxel(f);
    note_reason(f);
    f->thinnest = 0;
    f->source.grid = *g;
    cli_fit_default_lengths(f);
    f->opts.start_params = before->result.params;
    f->opts.start_pose = before->result.pose;
    f->opts.turns = SDM_FIT_TURNS_NONE;
    f->result = (sdm_fit_result){0};
    sdm_status s = cli_fit_run(f, err);
    if (!s && f->doubt.status && f->doubt.status != SDM_E_QUALITY)
        s = sdm_fail(err, f->doubt.status, "%s", f->doubt.text);
    // what follows names the start of the command line
    f->opts.start_params = f->start;
    f->opts.start_pose = before->opts.start_pose;
    f->opts.turns = before->opts.turns;
    return s;
}

/* Returns to the result of the coarse maps. */
static sdm_status go_back(cli_fit *f, const cli_fit *before, sdm_error *err)
{
    const sdm_status s = f->other_side == before->other_side ? SDM_OK : cli_fit_swap_side(f, err);
    sdm_fit_dispose(&f->result);
    f->result = before->result;
    f->doubt = before->doubt;
    f->source.grid = before->source.grid;
    f->opts = before->opts;
    f->thinnest = before->thinnest;
    f->better = before->better;
    memcpy(f->side, before->side, sizeof f->side);
    f->coarse_mm = 0;
    f->was_nearly_coarse = false;
    return s;
}

sdm_status cli_fit_go_finer(cli_fit *f, sdm_error *err)
{
    sdm_grid g;
    // a prior of the pose is one about its start
    const bool anchored = f->opts.prior_rotation_sd > 0 || f->opts.prior_translation_sd > 0;
    if (!grid_is_open(f) || anchored || !only_maps_doubt(f) ||
        cli_fit_finer_grid(f, f->result.params, cli_fit_finer_voxel(f), &g, NULL))
        return SDM_OK;
    const double voxels = (double)sdm_grid_count(&g),
                 most = fmin(maps_are_nearly_coarse(f) ? NEARLY_VOXELS_MAX : VOXELS_MAX,
                             floor(VALUES_MAX / (double)(f->n_params + 1)));
    if (voxels > most) {
        f->too_many = voxels, f->many_at_most = most;
        return SDM_OK;
    }
    cli_fit before = *f;
    sdm_error why = {0};
    const sdm_status s = fit_finer(f, &before, &g, &why);
    if (s && s != SDM_E_CANCELLED) {
        cli_warn("no finer maps, the result is that of coarse ones: %s", why.text);
        return go_back(f, &before, err);
    }
    if (!s) add_work(&before.result, &f->result);
    sdm_fit_dispose(&before.result);
    return s ? sdm_fail(err, s, "%s", why.text) : SDM_OK;
}
