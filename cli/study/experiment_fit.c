/* Rows of an experiment that fit shapes to phantoms: with a network, with a network and exact maps
 * (polish), with exact maps, or only the time of naive maps. */
#include "experiment_fit.h"
#include "experiment_phantom.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "report/progress_bar.h"
#include "report/terminal.h"
#include "sdm/fit.h"
#include "sdm/internal/clock.h"
#include "sdm/memory.h"

/* Number of shapes on which the naive method is timed. */
enum { NAIVE_SHAPES = 2 };

/* ---- the network ---- */

/* Checks that a model is for the job's shape and was trained on the whole ranges from which the
 * phantoms are drawn. */
static sdm_status check_model(const cli_experiment_job *job, const char *path,
                              const sdm_model_info *info, sdm_error *err)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(job->shape, &n);
    const char *shape = sdm_instance_shape(job->shape)->name;
    if (strcmp(info->shape, shape) != 0 || info->n_params != n)
        return sdm_fail(
            err, SDM_E_CONFIG,
            "fit.model: %.500s has the shape '%s' with %zu parameters, need '%s' with %zu", path,
            info->shape, info->n_params, shape, n);
    for (size_t i = 0; i < n; i++) {
        const double min = job->maker.min[i], max = job->maker.max[i];
        if (!strcmp(info->params[i].name, params[i].name) && info->params[i].min <= min &&
            info->params[i].max >= max)
            continue;
        return sdm_fail(
            err, SDM_E_CONFIG,
            "fit.model: %.500s was trained on %s = %g .. %g, the experiment needs %s = %g .. %g",
            path, info->params[i].name, info->params[i].min, info->params[i].max, params[i].name,
            min, max);
    }
    return SDM_OK;
}

/* Opens the network: the file fit.model; else the row's own network, which is trained if necessary;
 * when polishing, the network of the row that uses the same network without polishing. */
static sdm_status open_network(const cli_experiment_run *run, const cli_experiment_job *job,
                               cli_experiment_result *out, sdm_model **model, sdm_error *err)
{
    const char *given = run->e->fit.model;
    const cli_experiment_result *trained = &run->results[out->row->network_row];
    char path[SDM_PATH_TEXT_MAX];
    sdm_status s = SDM_OK;
    out->loaded = *given != 0;
    // the row's folder may hold the model of another configuration, so that row must be done
    if (!*given && trained != out && trained->state != CLI_EXPERIMENT_DONE)
        return sdm_fail(
            err, trained->state == CLI_EXPERIMENT_MISSING ? SDM_E_UNSUPPORTED : SDM_E_QUALITY,
            "the network of '%s', which it uses, is not available", trained->row->title);
    if (*given)
        snprintf(path, sizeof path, "%s", given);
    else
        s = cli_experiment_path(run, out->row->network_row, "model.sdm", path, err);
    if (!s && !*given && trained == out) s = cli_experiment_provide_model(run, job, out, err);
    if (!s) s = sdm_model_open(path, model, err);
    return s ? s : check_model(job, path, sdm_model_get_info(*model), err);
}

/* ---- one phantom ---- */

/* Overlap of the fitted shape with the phantom's label. */
static sdm_status measure_dice(const sdm_fit_source *source, const sdm_fit_result *found,
                               const cli_experiment_phantom *p, double *dice, sdm_error *err)
{
    const size_t n = sdm_grid_count(&p->grid);
    size_t both = 0, sum = 0;
    float *map = NULL;
    sdm_status s = SDM_ALLOC(&map, n, "distance map", err);
    if (!s) s = sdm_fit_map(source, found->params, &found->pose, &p->grid, 0, map, err);
    for (size_t i = 0; i < n && !s; i++) {
        const bool inside = map[i]<0, true_inside = p->label[i]> 0;
        both += inside && true_inside;
        sum += (size_t)inside + (size_t)true_inside;
    }
    *dice = sum ? 2 * (double)both / (double)sum : 1;
    sdm_free(map);
    return s;
}

/* Refuses a fit of a shape with a mirror image unless it is better than that of the mirror image.
 */
static sdm_status check_mirror(const cli_experiment_job *job, const sdm_fit_source *source,
                               const sdm_fit_target *target, const sdm_fit_opts *opts,
                               const sdm_fit_result *r, sdm_error *why)
{
    if (!sdm_instance_shape(job->shape)->mirror) return SDM_OK;
    sdm_fit_result mirror = {0};
    const sdm_status s = sdm_fit_mirrored(source, target, opts, &mirror, why);
    const double better = sdm_fit_compare(r, &mirror);
    sdm_fit_dispose(&mirror);
    if (s && s != SDM_E_QUALITY) return s;
    if (better > SDM_FIT_PREFERRED) return SDM_OK;
    return sdm_fail(why, SDM_E_QUALITY, "the mirror image of the shape fits as well");
}

/* Fits one phantom. A fit that is not to be trusted is a result, not an error; *why then holds the
 * reason. */
static sdm_status fit_one(const cli_experiment_job *job, const sdm_fit_source *source, bool polish,
                          const sdm_experiment *e, const cli_experiment_phantom *p,
                          cli_experiment_fit *out, sdm_error *why, sdm_error *err)
{
    const sdm_experiment_method *method = e->rows[job->index].method;
    const bool wrong = *method->shows || method->wrong;
    const sdm_fit_target target = {.kind = method->labels ? SDM_FIT_LABEL : SDM_FIT_IMAGE,
                                   .grid = p->grid,
                                   .values = p->values};
    sdm_fit_opts opts = sdm_fit_defaults();
    sdm_fit_result r = {0};
    double start[SDM_MAX_PARAMS];
    for (size_t i = 0; i < job->maker.n_params; i++)
        start[i] = 0.5 * (job->maker.min[i] + job->maker.max[i]);
    // fit
    opts.prior_sd = e->fit.prior_sd;
    opts.polish_eps = e->fit.eps;
    opts.eps_sd = 0;
    opts.start_params = start;
    if (!wrong) opts.appearance.inside[0].mean = opts.appearance.outside[0].mean + p->contrast;
    opts.start_pose = p->start_pose;
    opts.max_polish_iterations = polish ? opts.max_iterations : 0;
    opts.n_threads = 1; // the table has times of one core
    opts.cancelled = cli_interrupted;
    const double begin = sdm_thread_clock();
    sdm_status s = sdm_fit(source, &target, &opts, &r, why);
    if (!s) s = check_mirror(job, source, &target, &opts, &r, why);
    if (s == SDM_E_ARG && wrong) s = SDM_E_QUALITY; // the start lies outside of the image
    out->seconds = sdm_thread_clock() - begin;
    // store the estimate
    out->converged = !s;
    if (s) {
        cli_name_options(why->text);
        snprintf(out->reason, sizeof out->reason, "%.299s", why->text);
    }
    out->maps_network = r.n_network;
    out->maps_exact = r.n_exact;
    for (size_t i = 0; i < job->maker.n_params; i++) {
        out->truth[i] = wrong ? NAN : p->truth[i];
        out->found[i] = s ? NAN : r.params[i];
        out->sd[i] = s ? NAN : r.sd[i];
        out->at_bound[i] = !s && r.at_bound[i];
    }
    // measure the overlap
    out->dice = NAN;
    const sdm_fit_source exact = {.shape = job->shape, .grid = job->maker.grid};
    // does the image show the shape, so that there is something to overlap with?
    const bool shown = !*method->shows && (!method->wrong || method->wrong == SDM_EXPERIMENT_MOVED);
    if (!s && shown)
        s = measure_dice(polish ? &exact : source, &r, p, &out->dice, err);
    else if (s && s != SDM_E_QUALITY)
        s = sdm_fail(err, s, "%s", why->text);
    sdm_fit_dispose(&r);
    return s == SDM_E_QUALITY ? SDM_OK : s;
}

/* ---- all phantoms ---- */

static sdm_status allocate_fits(const cli_experiment_run *run, const cli_experiment_job *job,
                                cli_experiment_fits **out, sdm_error *err)
{
    cli_experiment_fits *f = NULL;
    const sdm_param *params = sdm_instance_params(job->shape, NULL);
    sdm_status s = SDM_ALLOC(&f, 1, "fits", err);
    if (s) return s;
    *out = f;
    f->n = (size_t)run->e->fit.phantoms;
    f->n_params = job->maker.n_params;
    for (size_t i = 0; i < f->n_params; i++) {
        snprintf(f->name[i], sizeof f->name[i], "%s", params[i].name);
        snprintf(f->unit[i], sizeof f->unit[i], "%s", params[i].unit);
    }
    return SDM_ALLOC(&f->fit, f->n, "fits", err);
}

void cli_experiment_fits_free(cli_experiment_fits *f)
{
    if (f) sdm_free(f->fit);
    sdm_free(f);
}

/* Fits all phantoms, which show the shape of `shown`; *why holds the reason why the first of the
 * failed fits did not converge. */
static sdm_status fit_all(const cli_experiment_run *run, const cli_experiment_job *job,
                          const cli_experiment_job *shown, const sdm_fit_source *source,
                          cli_experiment_result *out, sdm_error *why, sdm_error *err)
{
    const bool polish = out->row->method->fit == SDM_EXPERIMENT_FIT_POLISH;
    sdm_status s = allocate_fits(run, job, &out->fits, err);
    cli_progress bar;
    cli_progress_start(&bar);
    for (size_t i = 0; !s && i < out->fits->n; i++) {
        cli_experiment_phantom phantom = {0};
        sdm_error doubt = {0};
        cli_progress_show(&bar, out->row->title, (double)i / (double)out->fits->n, NULL);
        s = cli_experiment_phantom_make(run, shown, out->row->method, i, &phantom, err);
        if (!s) s = fit_one(job, source, polish, run->e, &phantom, &out->fits->fit[i], &doubt, err);
        if (!s && !out->fits->fit[i].converged && !why->status) {
            *why = doubt;
            why->status = SDM_E_QUALITY;
        }
        if (!s) s = cli_check_interrupt(err);
        if (s) s = sdm_fail_in(err, s, "phantom %zu", i + 1);
        cli_experiment_phantom_dispose(&phantom);
    }
    cli_progress_end(&bar, !s);
    return s;
}

static void set_figures(cli_experiment_result *out)
{
    const cli_experiment_fits *f = out->fits;
    double fits = 0, seconds = 0, dice = 0, network = 0, exact = 0, within = 0, two = 0,
           counted = 0;
    for (size_t i = 0; i < f->n; i++) {
        const cli_experiment_fit *one = &f->fit[i];
        seconds += one->seconds / (double)f->n;
        network += (double)one->maps_network / (double)f->n;
        exact += (double)one->maps_exact / (double)f->n;
        if (!one->converged) continue;
        fits++;
        dice += one->dice;
        for (size_t k = 0; k < f->n_params; k++) {
            counted += !one->at_bound[k] && !isnan(one->truth[k]);
            within += !one->at_bound[k] && fabs(one->found[k] - one->truth[k]) <= 3 * one->sd[k];
            two += !one->at_bound[k] && fabs(one->found[k] - one->truth[k]) <= 2 * one->sd[k];
        }
    }
    out->figure[SDM_FIGURE_SHAPES] = (double)f->n;
    out->figure[SDM_FIGURE_FITS] = fits;
    out->figure[SDM_FIGURE_FIT] = seconds;
    out->figure[SDM_FIGURE_MAPS_NETWORK] = network;
    out->figure[SDM_FIGURE_MAPS_EXACT] = exact;
    if (fits > 0 && !isnan(dice)) out->figure[SDM_FIGURE_DICE] = dice / fits;
    if (counted > 0) out->figure[SDM_FIGURE_WITHIN] = within / counted;
    if (counted > 0) out->figure[SDM_FIGURE_WITHIN_2] = two / counted;
}

/* ---- rows ---- */

static void set_note(const cli_experiment_run *run, const sdm_model *model, const sdm_error *why,
                     cli_experiment_result *out)
{
    char maps[64] = "exact maps";
    if (model)
        snprintf(maps, sizeof maps, "maps by the network %s%s", sdm_model_get_info(model)->kind,
                 out->row->method->fit == SDM_EXPERIMENT_FIT_POLISH ? ", then exact ones" : "");
    snprintf(out->note, sizeof out->note,
             "%s, %s; %lld phantoms with voxels of %g mm, started %g mm and %g degrees off%s%.280s",
             maps, out->grid, (long long)run->e->fit.phantoms, run->e->fit.voxel,
             run->e->fit.off_mm, run->e->fit.off_deg, why->status ? "; the first failure: " : "",
             why->text);
}

sdm_status cli_experiment_fit_row(const cli_experiment_run *run, cli_experiment_job *job,
                                  cli_experiment_result *out, sdm_error *err)
{
    const int fit = out->row->method->fit;
    const bool by_network = fit == SDM_EXPERIMENT_FIT_NETWORK || fit == SDM_EXPERIMENT_FIT_POLISH;
    sdm_model *model = NULL;
    sdm_error why = {0};
    double share;
    if (fit == SDM_EXPERIMENT_FIT_NAIVE)
        return cli_time_naive(&job->maker, run->e->experiment.seed, NAIVE_SHAPES,
                              &out->figure[SDM_FIGURE_MS], &share, err);
    sdm_status s = by_network ? open_network(run, job, out, &model, err) : SDM_OK;
    const sdm_fit_source source = {.model = model, .shape = job->shape, .grid = job->maker.grid};
    cli_experiment_job other = {0};
    const bool own = out->row->shown_row == job->index;
    if (!s && !own) {
        s = cli_experiment_job_open(run, out->row->shown_row, &other);
        if (s && err) *err = other.open_error;
    }
    if (!s) s = fit_all(run, job, own ? job : &other, &source, out, &why, err);
    cli_experiment_job_close(&other);
    if (!s) set_figures(out);
    if (!s) set_note(run, model, &why, out);
    if (!s)
        cli_experiment_log(run, "%s: %.0f of %zu fits accepted, %.3g s each", out->row->title,
                           out->figure[SDM_FIGURE_FITS], out->fits->n, out->figure[SDM_FIGURE_FIT]);
    sdm_model_free(model);
    return s;
}
