/* Sets the options of a fit from the command line. */
#include <math.h>
#include <string.h>

#include "fit_command.h"
#include "report/terminal.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"

static sdm_fit_law make_law(const double given[2], double weight)
{
    return (sdm_fit_law){.weight = weight, .mean = given[0], .sd = given[1]};
}

/* Sets the distributions of the tissues at the start. The default second tissue outside (air) is
 * dropped when the command line gives other tissues but no air. */
static sdm_status read_appearance(const cli_fit_args *a, sdm_fit_appearance *t, sdm_error *err)
{
    const bool has_air = !isnan(a->air[0]), other = !isnan(a->inside[0]) || !isnan(a->outside[0]);
    if (!isnan(a->inside[0])) t->inside[0] = make_law(a->inside, 1);
    if (!isnan(a->outside[0])) t->outside[0] = make_law(a->outside, t->outside[0].weight);
    if (has_air) t->outside[1] = make_law(a->air, t->outside[1].weight);
    if (other && !has_air) t->n_outside = 1;
    if (t->inside[0].sd > 0 && t->outside[0].sd > 0 && (t->n_outside == 1 || t->outside[1].sd > 0))
        return SDM_OK;
    return sdm_fail(err, SDM_E_ARG,
                    "fit: --inside, --outside and --air need standard deviations above 0");
}

/* Shortest margin that shows what lies beside the surface, in voxels. */
#define MARGIN_MIN 1.5

/* The shape that the default tissues belong to: in CT it is fluid in bone. */
#define SHAPE_OF_TISSUES "cochlea"

void cli_fit_notice_tissues(cli_fit *f)
{
    const bool inside = isnan(f->args->fit.inside[0]), outside = isnan(f->args->fit.outside[0]);
    const sdm_fit_appearance *t = &f->opts.appearance;
    if (f->target.kind != SDM_FIT_IMAGE || (!inside && !outside) ||
        !strcmp(f->shape_name, SHAPE_OF_TISSUES))
        return;
    cli_notice("%s not given: the fit starts from inside %g +- %g, outside %g +- %g, of which the "
               "default is fluid in bone in CT; give MEAN,SD of the values of this image, which "
               "has %.6g to %.6g",
               inside && outside ? "--inside and --outside are"
               : inside          ? "--inside is"
                                 : "--outside is",
               t->inside[0].mean, t->inside[0].sd, t->outside[0].mean, t->outside[0].sd,
               (double)f->image.min, (double)f->image.max);
    if (!f->suspicion)
        f->suspicion = "; values of CT were taken, as --inside and --outside are not both given";
}

void cli_fit_notice_kept(const cli_fit *f)
{
    if (f->opts.keep_params && !f->args->params.n && !f->args->cohort.cases)
        cli_notice("--keep parameters without -p: the parameters keep their default values");
}

/* The parameter whose name is like this one; NULL: none is. */
static const char *nearest_param(const cli_fit *f, const char *name)
{
    enum { NAMES = 64 };
    const char *names[NAMES];
    const size_t n = f->n_params < NAMES ? f->n_params : NAMES;
    for (size_t k = 0; k < n; k++) names[k] = f->params[k].name;
    return sdm_nearest_name(name, names, n);
}

/* Marks the parameter of this name in f->kept; false: there is none. */
static bool keep_named(cli_fit *f, const char *name)
{
    for (size_t k = 0; k < f->n_params; k++)
        if (!strcmp(f->params[k].name, name)) return f->kept[k] = true;
    return false;
}

static sdm_status read_keep(cli_fit *f, sdm_error *err)
{
    const cli_list *words = &f->args->fit.keep;
    sdm_fit_opts *o = &f->opts;
    size_t n_kept = 0;
    if (!words->n) return SDM_OK;
    sdm_status s = SDM_ALLOC(&f->kept, f->n_params, "parameters", err);
    if (s) return s;
    const struct {
        const char *name;
        bool *field;
    } known[] = {{"parameters", &o->keep_params},
                 {"pose", &o->keep_pose},
                 {"blur", &o->keep_blur},
                 {"appearance", &o->keep_appearance}};
    for (size_t i = 0; i < words->n; i++) {
        size_t k = 0;
        while (k < 4 && strcmp(words->items[i], known[k].name)) k++;
        if (k < 4) {
            *known[k].field = true;
        } else if (keep_named(f, words->items[i])) {
            o->kept = f->kept;
        } else {
            const char *near = nearest_param(f, words->items[i]);
            return sdm_fail(err, SDM_E_ARG,
                            "--keep '%.100s'%s%s%s: need one of parameters|pose|blur|appearance, "
                            "or the name of a parameter of '%s' (%s lists them)",
                            words->items[i], near ? ", did you mean '" : "", near ? near : "",
                            near ? "'?" : "", f->shape_name,
                            f->model ? "`sdmgen info MODEL`" : "`sdmgen shapes NAME`");
        }
    }
    for (size_t k = 0; k < f->n_params; k++) n_kept += f->kept[k];
    if (n_kept == f->n_params) o->keep_params = true;
    if (o->keep_params && o->keep_pose)
        return sdm_fail(err, SDM_E_ARG,
                        "--keep parameters and --keep pose together leave nothing to fit");
    return SDM_OK;
}

/* *field = the given number, unless the option is missing. */
static void set_real(double given, double *field)
{
    if (!isnan(given)) *field = given;
}

/* --region: a box from two opposite corners in any order. */
static void read_region(const cli_fit_args *a, sdm_fit_opts *o)
{
    if (isnan(a->region[0])) return;
    double corner[6];
    memcpy(corner, a->region, sizeof corner);
    if (a->ras) cli_fit_negate_xy(corner, 2);
    o->use_box = true;
    for (int k = 0; k < 3; k++) {
        o->box_min[k] = fmin(corner[k], corner[3 + k]);
        o->box_max[k] = fmax(corner[k], corner[3 + k]);
    }
}

void cli_fit_default_lengths(cli_fit *f)
{
    const cli_fit_args *a = &f->args->fit;
    sdm_fit_opts *o = &f->opts;
    const double *h = f->target.grid.spacing;
    double voxel = cli_fit_map_voxel(f);
    if (f->target.kind != SDM_FIT_POINTS) voxel = fmax(voxel, fmax(h[0], fmax(h[1], h[2])));
    const sdm_fit_opts d = sdm_fit_defaults_for(voxel);
    o->blur = isnan(a->blur) ? d.blur : a->blur;
    o->l_ref = isnan(a->l_ref) ? d.l_ref : a->l_ref;
    o->margin = isnan(a->margin) ? d.margin : a->margin;
    // a fit that goes on with finer maps has printed this warning before
    if (!(f->coarse_mm > 0) && f->target.kind != SDM_FIT_POINTS &&
        o->margin < 0.999 * MARGIN_MIN * voxel)
        cli_warn("--margin %g mm is less than %g voxels of %.3g mm: the fit hardly sees what lies "
                 "beside the surface, and its verdict is blind there",
                 o->margin, MARGIN_MIN, voxel);
    o->tissue_mm = isnan(a->tissue_field) ? d.tissue_mm : a->tissue_field;
    o->point_sd = isnan(a->point_sd) ? d.point_sd : a->point_sd;
}

sdm_status cli_fit_read_options(cli_fit *f, sdm_error *err)
{
    const cli_fit_args *a = &f->args->fit;
    sdm_fit_opts *o = &f->opts;
    *o = sdm_fit_defaults();
    if (!strcmp(a->image_model, "labels")) o->image_model = SDM_FIT_LABELS;
    set_real(a->cavity, &o->cavity);
    o->open_end = a->open_end;
    set_real(a->least_inside, &o->least_inside);
    set_real(a->tolerance, &o->tolerance);
    set_real(a->beside, &o->beside);
    set_real(a->prior_sd, &o->prior_sd);
    set_real(a->prior_rotation, &o->prior_rotation_sd);
    set_real(a->prior_translation, &o->prior_translation_sd);
    if (!isnan(a->eps)) o->eps = o->polish_eps = a->eps, o->eps_sd = 0;
    if (a->max_iterations) o->max_iterations = (size_t)a->max_iterations;
    if (a->polish) o->max_polish_iterations = o->max_iterations;
    o->n_threads = (int)f->args->threads;
    o->start_params = f->start;
    read_region(a, o);
    const sdm_status s = read_appearance(a, &o->appearance, err);
    return s ? s : read_keep(f, err);
}
