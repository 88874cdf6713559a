/* Options of a fit from the command line. */
#include <math.h>
#include <string.h>

#include "fit_command.h"

static sdm_fit_law law(const double given[2], double weight)
{
    return (sdm_fit_law){.weight = weight, .mean = given[0], .sd = given[1]};
}

static sdm_status read_appearance(const cli_fit_args *a, sdm_fit_appearance *look, sdm_error *err)
{
    const bool has_air = !isnan(a->air[0]), other = !isnan(a->inside[0]) || !isnan(a->outside[0]);
    if (!isnan(a->inside[0])) look->inside[0] = law(a->inside, 1);
    if (!isnan(a->outside[0])) look->outside[0] = law(a->outside, look->outside[0].weight);
    if (has_air) look->outside[1] = law(a->air, look->outside[1].weight);
    if (other && !has_air) look->n_outside = 1;
    if (look->inside[0].sd > 0 && look->outside[0].sd > 0 &&
        (look->n_outside == 1 || look->outside[1].sd > 0))
        return SDM_OK;
    return sdm_fail(err, SDM_E_ARG,
                    "fit: --inside, --outside and --air need standard deviations above 0");
}

static sdm_status read_keep(const cli_list *words, sdm_fit_opts *o, sdm_error *err)
{
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
        if (k == 4)
            return sdm_fail(err, SDM_E_ARG,
                            "--keep '%.100s': need one of parameters|pose|blur|appearance",
                            words->items[i]);
        *known[k].field = true;
    }
    if (o->keep_params && o->keep_pose)
        return sdm_fail(err, SDM_E_ARG, "--keep of parameters and pose leaves nothing to fit");
    return SDM_OK;
}

static void set(double given, double *field)
{
    if (!isnan(given)) *field = given;
}

/* Two opposite corners, in any order. */
static void read_region(const cli_fit_args *a, sdm_fit_opts *o)
{
    if (isnan(a->region[0])) return;
    double corner[6];
    memcpy(corner, a->region, sizeof corner);
    if (a->ras) cli_turn_ras(corner, 2);
    o->use_box = true;
    for (int k = 0; k < 3; k++) {
        o->box_min[k] = fmin(corner[k], corner[3 + k]);
        o->box_max[k] = fmax(corner[k], corner[3 + k]);
    }
}

sdm_status cli_fit_read_options(cli_fit *f, sdm_error *err)
{
    const cli_fit_args *a = &f->args->fit;
    sdm_fit_opts *o = &f->opts;
    *o = sdm_fit_defaults();
    if (!strcmp(a->image_model, "labels")) o->image_model = SDM_FIT_LABELS;
    set(a->blur, &o->blur);
    set(a->l_ref, &o->l_ref);
    set(a->point_sd, &o->point_sd);
    set(a->margin, &o->margin);
    set(a->cavity, &o->cavity);
    set(a->tissue_places, &o->tissue_mm);
    set(a->least_inside, &o->least_inside);
    set(a->prior_sd, &o->prior_sd);
    set(a->prior_rotation, &o->prior_rotation_sd);
    set(a->prior_translation, &o->prior_translation_sd);
    if (!isnan(a->eps)) o->eps = o->polish_eps = a->eps;
    if (a->max_iterations) o->max_iterations = (size_t)a->max_iterations;
    if (a->polish) o->max_polish_iterations = o->max_iterations;
    o->n_threads = (int)f->args->threads;
    o->start_params = f->start;
    read_region(a, o);
    const sdm_status s = read_appearance(a, &o->appearance, err);
    return s ? s : read_keep(&a->keep, o, err);
}
