/* A row that fits: a network, a network polished by exact maps, exact maps alone, or what naive
 * ones would cost. */
#include "experiment_fit.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "report/progress.h"
#include "report/terminal.h"
#include "sdm/fit.h"
#include "sdm/memory.h"

/* Shapes whose naive maps are timed. */
enum { NAIVE_SHAPES = 2 };

/* ---- the network ---- */

/* A model from elsewhere knows the shape, wherever phantoms are drawn. */
static sdm_status check_model(const experiment_job *job, const char *path,
                              const sdm_model_info *info, sdm_error *err)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(job->shape, &n);
    const char *shape = sdm_instance_shape(job->shape)->name;
    if (strcmp(info->shape, shape) != 0 || info->n_params != n)
        return sdm_fail(
            err, SDM_E_CONFIG,
            "fit.model: %.500s is of the shape '%s' with %zu parameters, need '%s' with %zu", path,
            info->shape, info->n_params, shape, n);
    for (size_t i = 0; i < n; i++) {
        const double min = job->maker.min[i], max = job->maker.max[i];
        if (!strcmp(info->params[i].name, params[i].name) && info->params[i].min <= min &&
            info->params[i].max >= max)
            continue;
        return sdm_fail(
            err, SDM_E_CONFIG,
            "fit.model: %.500s was trained on %s = %g .. %g, the experiment has %s = %g .. %g",
            path, info->params[i].name, info->params[i].min, info->params[i].max, params[i].name,
            min, max);
    }
    return SDM_OK;
}

/* That of fit.model, of this row's own training, or of the row that polishing goes on from. */
static sdm_status open_network(const experiment_run *run, const experiment_job *job,
                               experiment_result *out, sdm_model **model, sdm_error *err)
{
    const char *given = run->e->fit.model;
    const experiment_result *trained = &run->results[out->row->network_row];
    char path[SDM_PATH_TEXT_MAX];
    sdm_status s = SDM_OK;
    out->loaded = *given != 0;
    // a model that lies there may be that of another configuration
    if (!*given && trained != out && trained->state != EXPERIMENT_DONE)
        return sdm_fail(err,
                        trained->state == EXPERIMENT_MISSING ? SDM_E_UNSUPPORTED : SDM_E_QUALITY,
                        "its network is that of '%s', which was not done", trained->row->title);
    if (*given)
        snprintf(path, sizeof path, "%s", given);
    else
        s = experiment_path(run, out->row->network_row, "model.sdm", path, err);
    if (!s && !*given && trained == out) s = experiment_provide(run, job, out, err);
    if (!s) s = sdm_model_open(path, model, err);
    return s ? s : check_model(job, path, sdm_model_get_info(*model), err);
}

/* ---- one phantom ---- */

static sdm_status measure_dice(const sdm_fit_source *source, const sdm_fit_result *found,
                               const experiment_phantom *p, double *dice, sdm_error *err)
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

/* A fit that is not to be trusted is a result; its reason is left in *why. */
static sdm_status fit_one(const experiment_job *job, const sdm_fit_source *source, bool polish,
                          const sdm_experiment *e, const experiment_phantom *p, experiment_fit *out,
                          sdm_error *why, sdm_error *err)
{
    const sdm_fit_target target = {.kind = SDM_FIT_IMAGE, .grid = p->grid, .values = p->values};
    sdm_fit_opts opts = sdm_fit_defaults();
    sdm_fit_result r = {0};
    opts.prior_sd = e->fit.prior_sd;
    opts.polish_eps = e->fit.eps;
    opts.start_params = p->start;
    opts.start_pose = p->start_pose;
    opts.max_polish_iterations = polish ? opts.max_iterations : 0;
    opts.n_threads = 1; // the time is that of one core
    opts.cancelled = cli_interrupted;
    const double begin = cli_thread_clock();
    sdm_status s = sdm_fit(source, &target, &opts, &r, why);
    out->seconds = cli_thread_clock() - begin;
    out->converged = !s;
    out->maps_network = r.n_network;
    out->maps_exact = r.n_exact;
    for (size_t i = 0; i < job->maker.n_params; i++) {
        out->truth[i] = p->truth[i];
        out->found[i] = s ? NAN : r.params[i];
        out->sd[i] = s ? NAN : r.sd[i];
        out->at_bound[i] = !s && r.at_bound[i];
    }
    out->dice = NAN;
    const sdm_fit_source exact = {.shape = job->shape, .grid = job->maker.grid};
    if (!s)
        s = measure_dice(polish ? &exact : source, &r, p, &out->dice, err);
    else if (s != SDM_E_QUALITY)
        s = sdm_fail(err, s, "%s", why->text);
    sdm_fit_dispose(&r);
    return s == SDM_E_QUALITY ? SDM_OK : s;
}

/* ---- all of them ---- */

static sdm_status make_fits(const experiment_run *run, const experiment_job *job,
                            experiment_fits **out, sdm_error *err)
{
    experiment_fits *f = NULL;
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

void experiment_fits_free(experiment_fits *f)
{
    if (f) sdm_free(f->fit);
    sdm_free(f);
}

static sdm_status fit_all(const experiment_run *run, const experiment_job *job,
                          const sdm_fit_source *source, experiment_result *out, sdm_error *why,
                          sdm_error *err)
{
    const bool polish = out->row->method->fit == SDM_EXPERIMENT_FIT_POLISH;
    sdm_status s = make_fits(run, job, &out->fits, err);
    cli_progress bar;
    cli_progress_start(&bar);
    for (size_t i = 0; !s && i < out->fits->n; i++) {
        experiment_phantom phantom = {0};
        sdm_error doubt = {0};
        cli_progress_show(&bar, out->row->title, (double)i / (double)out->fits->n, NULL);
        s = experiment_phantom_make(run, job, i, &phantom, err);
        if (!s) s = fit_one(job, source, polish, run->e, &phantom, &out->fits->fit[i], &doubt, err);
        if (!s && !out->fits->fit[i].converged && !why->status) {
            *why = doubt;
            why->status = SDM_E_QUALITY;
        }
        if (!s) s = cli_check_interrupt(err);
        if (s) s = sdm_fail_in(err, s, "phantom %zu", i + 1);
        experiment_phantom_dispose(&phantom);
    }
    cli_progress_clear(&bar);
    return s;
}

static void set_figures(experiment_result *out)
{
    const experiment_fits *f = out->fits;
    double fits = 0, seconds = 0, dice = 0, network = 0, exact = 0, within = 0, counted = 0;
    for (size_t i = 0; i < f->n; i++) {
        const experiment_fit *one = &f->fit[i];
        seconds += one->seconds / (double)f->n;
        network += (double)one->maps_network / (double)f->n;
        exact += (double)one->maps_exact / (double)f->n;
        if (!one->converged) continue;
        fits++;
        dice += one->dice;
        for (size_t k = 0; k < f->n_params; k++) {
            counted += !one->at_bound[k];
            within += !one->at_bound[k] && fabs(one->found[k] - one->truth[k]) <= 3 * one->sd[k];
        }
    }
    out->figure[SDM_FIGURE_SHAPES] = (double)f->n;
    out->figure[SDM_FIGURE_FITS] = fits;
    out->figure[SDM_FIGURE_FIT] = seconds;
    out->figure[SDM_FIGURE_MAPS_NETWORK] = network;
    out->figure[SDM_FIGURE_MAPS_EXACT] = exact;
    if (fits > 0) out->figure[SDM_FIGURE_DICE] = dice / fits;
    if (counted > 0) out->figure[SDM_FIGURE_WITHIN] = within / counted;
}

/* ---- rows ---- */

static sdm_status time_naive(const experiment_run *run, const experiment_job *job,
                             experiment_result *out, sdm_error *err)
{
    double p[SDM_MAX_PARAMS], ms[NAIVE_SHAPES], share = 1;
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < NAIVE_SHAPES && !s; i++) {
        sdm_mesh mesh = {0};
        cli_maker_params(&job->maker, run->e->experiment.seed, i, p);
        s = sdm_instance_mesh(job->shape, p, &mesh, err);
        if (!s) s = cli_time_naive(&mesh, &job->maker.grid, &ms[i], &share, err);
        if (!s) s = cli_check_interrupt(err);
        sdm_mesh_dispose(&mesh);
    }
    if (!s) out->figure[SDM_FIGURE_MS] = cli_median(ms, NAIVE_SHAPES);
    return s;
}

static void describe(const experiment_run *run, const sdm_model *model, const sdm_error *why,
                     experiment_result *out)
{
    char maps[64] = "exact maps";
    if (model)
        snprintf(maps, sizeof maps, "maps by the network %s%s", sdm_model_get_info(model)->kind,
                 out->row->method->fit == SDM_EXPERIMENT_FIT_POLISH ? ", then exact ones" : "");
    snprintf(out->note, sizeof out->note,
             "%s, %s; %lld phantoms with voxels of %g mm, started %g mm and %g degrees off%s%.200s",
             maps, out->grid, (long long)run->e->fit.phantoms, run->e->fit.voxel,
             run->e->fit.off_mm, run->e->fit.off_deg,
             why->status ? "; the first that failed: " : "", why->text);
}

sdm_status experiment_fit_row(const experiment_run *run, experiment_job *job,
                              experiment_result *out, sdm_error *err)
{
    const int fit = out->row->method->fit;
    const bool by_network = fit == SDM_EXPERIMENT_FIT_NETWORK || fit == SDM_EXPERIMENT_FIT_POLISH;
    sdm_model *model = NULL;
    sdm_error why = {0};
    if (fit == SDM_EXPERIMENT_FIT_NAIVE) return time_naive(run, job, out, err);
    sdm_status s = by_network ? open_network(run, job, out, &model, err) : SDM_OK;
    const sdm_fit_source source = {.model = model, .shape = job->shape, .grid = job->maker.grid};
    if (!s) s = fit_all(run, job, &source, out, &why, err);
    if (!s) set_figures(out);
    if (!s) describe(run, model, &why, out);
    if (!s)
        experiment_log(run, "%s: %.0f of %zu fits converged, %.3g s each", out->row->title,
                       out->figure[SDM_FIGURE_FITS], out->fits->n, out->figure[SDM_FIGURE_FIT]);
    sdm_model_free(model);
    return s;
}
