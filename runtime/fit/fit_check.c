/* Checks of the arguments of a fit. Comparisons are written such that NaN fails them. */
#include "fit_check.h"

#include <math.h>

#include "fit/data/unknowns.h"
#include "sdm/internal/open_end.h"

sdm_status sdm_fit_check_source(const sdm_fit_source *source, size_t *n_params, sdm_error *err)
{
    if (!source || (!source->model && !source->shape))
        return sdm_fail(err, SDM_E_ARG, "fit: a model or a shape is needed");
    if (source->policy != SDM_RANGE_REFUSE && source->policy != SDM_RANGE_CLAMP &&
        source->policy != SDM_RANGE_EXACT)
        return sdm_fail(err, SDM_E_ARG, "range policy %d is unknown", (int)source->policy);
    if (source->model && source->policy == SDM_RANGE_EXACT && !source->shape)
        return sdm_fail(err, SDM_E_ARG,
                        "the exact policy needs an instance of the shape (sdm_runtime_instance())");
    size_t n = 0;
    if (source->shape) (void)sdm_instance_params(source->shape, &n);
    if (source->model) {
        const size_t of_model = sdm_model_get_info(source->model)->n_params;
        if (source->shape && n != of_model)
            return sdm_fail(err, SDM_E_ARG, "the model has %zu parameters, the shape %zu", of_model,
                            n);
        n = of_model;
    } else {
        const sdm_status s = sdm_grid_check(&source->grid, err);
        if (s) return sdm_fail_in(err, s, "grid of the exact maps");
    }
    if (n < 1 || n > FIT_PARAMS_MAX)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "fit: %zu parameters, need 1 to %d", n,
                        FIT_PARAMS_MAX);
    *n_params = n;
    return SDM_OK;
}

// checks the values of an image or label map: not all NaN, not all equal, labels in 0 .. 1
static sdm_status check_values(const sdm_fit_target *t, sdm_error *err)
{
    const size_t n = sdm_grid_count(&t->grid);
    double least = INFINITY, most = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        const double v = (double)t->values[i];
        if (v < least) least = v;
        if (v > most) most = v;
    }
    if (!(least <= most))
        return sdm_fail(err, SDM_E_FORMAT, "all %zu voxels of the image are NaN", n);
    if (least == most && isfinite(least))
        return sdm_fail(err, SDM_E_QUALITY, "the image shows nothing: every voxel is %g", least);
    if (t->kind == SDM_FIT_LABEL && (!(least >= 0) || !(most <= 1)))
        return sdm_fail(
            err, SDM_E_FORMAT,
            "labels from %g to %g, need probabilities 0 to 1: choose one label and make it 1",
            least, most);
    return SDM_OK;
}

static sdm_status check_target(const sdm_fit_target *t, sdm_error *err)
{
    if (t->kind == SDM_FIT_POINTS) {
        if (!t->points || t->n_points < 3)
            return sdm_fail(err, SDM_E_ARG, "fit: %zu points, need 3 or more", t->n_points);
        for (size_t i = 0; i < 3 * t->n_points; i++)
            if (!isfinite(t->points[i]))
                return sdm_fail(err, SDM_E_FORMAT, "coordinate %zu of point %zu is not finite",
                                i % 3, i / 3);
        return SDM_OK;
    }
    if (t->kind != SDM_FIT_IMAGE && t->kind != SDM_FIT_LABEL)
        return sdm_fail(err, SDM_E_ARG, "kind of target %d is unknown", (int)t->kind);
    if (!t->values) return sdm_fail(err, SDM_E_ARG, "fit: the values of the image are needed");
    const sdm_status s = sdm_grid_check(&t->grid, err);
    return s ? sdm_fail_in(err, s, "grid of the image") : check_values(t, err);
}

static sdm_status check_laws(const char *side, const sdm_fit_law *law, size_t n, sdm_error *err)
{
    if (n < 1 || n > SDM_FIT_LAWS)
        return sdm_fail(err, SDM_E_ARG, "%zu laws %s, need 1 to %d", n, side, SDM_FIT_LAWS);
    for (size_t i = 0; i < n; i++) {
        if (!(law[i].weight > 0) || !isfinite(law[i].weight))
            return sdm_fail(err, SDM_E_ARG, "weight of law %zu %s is %g, need a positive number", i,
                            side, law[i].weight);
        if (!isfinite(law[i].mean))
            return sdm_fail(err, SDM_E_ARG, "mean of law %zu %s is %g, need a number", i, side,
                            law[i].mean);
        if (!(law[i].sd > 0) || !isfinite(law[i].sd))
            return sdm_fail(err, SDM_E_ARG, "sd of law %zu %s is %g, need a positive number", i,
                            side, law[i].sd);
        if (!(law[i].dof >= 0) || !isfinite(law[i].dof))
            return sdm_fail(err, SDM_E_ARG,
                            "degrees of freedom of law %zu %s are %g, need 0 (Gaussian) or more", i,
                            side, law[i].dof);
    }
    return SDM_OK;
}

static sdm_status check_appearance(const sdm_fit_appearance *a, sdm_error *err)
{
    sdm_status s = check_laws("inside", a->inside, a->n_inside, err);
    if (!s) s = check_laws("outside", a->outside, a->n_outside, err);
    if (!s && a->inside[0].mean == a->outside[0].mean)
        s = sdm_fail(
            err, SDM_E_ARG,
            "the first laws inside and outside have the same mean %g: no contrast to fit by",
            a->inside[0].mean);
    return s;
}

/* A numeric option and its allowed range: value > 0, or value >= 0 if may_be_zero. */
typedef struct number {
    const char *name;
    double value;
    bool may_be_zero;
} number;

static sdm_status check_numbers(const sdm_fit_opts *o, sdm_error *err)
{
    const number n[] = {{"l_ref", o->l_ref, false},
                        {"blur", o->blur, false},
                        {"point_sd", o->point_sd, false},
                        {"point_dof", o->point_dof, false},
                        {"eps_sd", o->eps_sd, true},
                        {"prior_sd", o->prior_sd, true},
                        {"prior_rotation_sd", o->prior_rotation_sd, true},
                        {"prior_translation_sd", o->prior_translation_sd, true},
                        {"margin", o->margin, false},
                        {"cavity", o->cavity, true},
                        {"tissue_mm", o->tissue_mm, true},
                        {"least_inside", o->least_inside, true},
                        {"tolerance", o->tolerance, true},
                        {"beside", o->beside, true},
                        {"eps", o->eps, false},
                        {"polish_eps", o->polish_eps, false}};
    for (size_t i = 0; i < sizeof n / sizeof *n; i++)
        if (!(n[i].value >= 0) || !isfinite(n[i].value) || (n[i].value == 0 && !n[i].may_be_zero))
            return sdm_fail(err, SDM_E_ARG, "fit option %s is %g, need a number above 0%s",
                            n[i].name, n[i].value, n[i].may_be_zero ? ", or 0" : "");
    if (o->least_inside > 1)
        return sdm_fail(err, SDM_E_ARG, "fit option least_inside is %g, need 0 to 1",
                        o->least_inside);
    if (o->tolerance > 1)
        return sdm_fail(err, SDM_E_ARG, "fit option tolerance is %g, need 0 to 1", o->tolerance);
    return SDM_OK;
}

sdm_status sdm_fit_check(const sdm_fit_target *target, const sdm_fit_opts *o, sdm_error *err)
{
    if (!target || !o) return sdm_fail(err, SDM_E_ARG, "fit: a target and options are needed");
    if (o->image_model != SDM_FIT_PARTIAL_VOLUME && o->image_model != SDM_FIT_LABELS)
        return sdm_fail(err, SDM_E_ARG, "model of the image %d is unknown", (int)o->image_model);
    if (o->turns != SDM_FIT_TURNS_NONE && o->turns != SDM_FIT_TURNS_AXIS &&
        o->turns != SDM_FIT_TURNS_SPHERE)
        return sdm_fail(err, SDM_E_ARG, "kind of turns %d is unknown", (int)o->turns);
    if (o->turns != SDM_FIT_TURNS_NONE && (o->n_turns < 1 || o->n_turns > 4096))
        return sdm_fail(err, SDM_E_ARG, "%zu turns, need 1 to 4096", o->n_turns);
    if (o->max_iterations < 1)
        return sdm_fail(
            err, SDM_E_ARG,
            "0 iterations, need 1 or more; sdm_fit_defaults_for() gives options to begin with");
    if (o->n_threads < 0)
        return sdm_fail(err, SDM_E_ARG, "%d threads, need 0 (all) or more", o->n_threads);
    if (o->keep_params && o->keep_pose)
        return sdm_fail(err, SDM_E_ARG, "parameters and pose are both kept: nothing to fit");
    for (int k = 0; k < 3; k++) {
        if (!isfinite(o->pivot[k]))
            return sdm_fail(err, SDM_E_ARG, "the pivot of the turns is not finite");
        if (o->use_box && !(o->box_min[k] < o->box_max[k]))
            return sdm_fail(err, SDM_E_ARG, "the box runs from %g to %g mm along %c", o->box_min[k],
                            o->box_max[k], "xyz"[k]);
    }
    sdm_status s = sdm_pose_check(&o->start_pose, err);
    if (!s) s = check_numbers(o, err);
    if (!s) s = check_appearance(&o->appearance, err);
    return s ? s : check_target(target, err);
}

sdm_status sdm_fit_check_open_end(const sdm_fit_source *source, const sdm_fit_target *target,
                                  const sdm_fit_opts *o, sdm_error *err)
{
    if (!o->open_end) return SDM_OK;
    if (target->kind == SDM_FIT_POINTS)
        return sdm_fail(
            err, SDM_E_ARG,
            "sdm_fit_opts.open_end applies to images and labels: points do not show what "
            "lies beyond an open end; leave it out");
    if (!source->shape)
        return sdm_fail(err, SDM_E_ARG,
                        "sdm_fit_opts.open_end needs an instance of the shape beside the model "
                        "(sdm_runtime_instance())");
    if (!sdm_instance_has_open_end(source->shape))
        return sdm_fail(
            err, SDM_E_ARG,
            "sdm_fit_opts.open_end: the shape states no open end, as cochlea and duct do "
            "and plug-ins may (sdm_shape.open_end); leave it out");
    return SDM_OK;
}
