/* The shape and its mirror image: which of them the target shows. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit_command.h"
#include "inputs/setup.h"

/* The table of the fitted shape; NULL: that of a model whose plug-in is not loaded. */
static const sdm_shape *find_shape(cli_fit *f)
{
    if (f->shape) return sdm_instance_shape(f->shape);
    if (!f->registry && cli_open_registry(f->args, &f->registry, NULL)) return NULL;
    return sdm_registry_find(f->registry, f->shape_name, NULL);
}

/* True when the command line or a model fixes the side. */
static bool side_is_given(const cli_fit *f)
{
    const size_t length = strlen(f->mirror);
    for (size_t i = 0; i < f->args->options.n; i++)
        if (!strncmp(f->args->options.items[i], f->mirror, length) &&
            f->args->options.items[i][length] == '=')
            return true;
    return f->model_path != NULL;
}

/* buf = the value of the option that mirrors the shape: of the present instance, or its other one.
 */
static void side_name(const cli_fit *f, bool other, char *buf, size_t size)
{
    const sdm_shape *shape = sdm_instance_shape(f->shape);
    size_t at = 0;
    while (strcmp(shape->options[at].name, f->mirror) != 0) at++;
    const char *choices = shape->options[at].choices, *bar = strchr(choices, '|');
    const bool second = (sdm_instance_options(f->shape)[at].number > 0.5) != other;
    snprintf(buf, size, "%.*s", second ? (int)strlen(bar + 1) : (int)(bar - choices),
             second ? bar + 1 : choices);
}

/* The shape of the other side, which f->other_shape becomes. */
static sdm_status create_other_side(cli_fit *f, sdm_error *err)
{
    char side[64], option[160];
    const char *items[CLI_OPTIONS_MAX];
    const cli_list *given = &f->args->options;
    if (given->n + 1 > CLI_OPTIONS_MAX)
        return sdm_fail(err, SDM_E_ARG, "fit: %zu options -O, need fewer than %d", given->n,
                        CLI_OPTIONS_MAX);
    side_name(f, true, side, sizeof side);
    snprintf(option, sizeof option, "%s=%s", f->mirror, side);
    for (size_t i = 0; i < given->n; i++) items[i] = given->items[i];
    items[given->n] = option;
    const cli_list options = {items, given->n + 1};
    return cli_create_shape(f->registry, f->args->shape, &options, &f->other_shape, err);
}

sdm_status cli_fit_swap_side(cli_fit *f, sdm_error *err)
{
    const sdm_status s = f->other_shape ? SDM_OK : create_other_side(f, err);
    if (s) return s;
    sdm_instance *other = f->other_shape;
    f->other_shape = f->shape;
    f->source.shape = f->shape = other;
    f->other_side = !f->other_side;
    return SDM_OK;
}

sdm_status cli_fit_check_mirror(cli_fit *f, sdm_error *err)
{
    if (strcmp(f->args->fit.mirror, "no") != 0) return SDM_OK;
    const sdm_shape *shape = find_shape(f);
    if (!shape || shape->mirror) return SDM_OK;
    return sdm_fail(err, SDM_E_ARG,
                    "fit: --mirror no does nothing: the shape '%s' has no option for its mirror "
                    "image",
                    f->shape_name);
}

bool cli_fit_side_is_open(cli_fit *f)
{
    const sdm_shape *shape = find_shape(f);
    if (!shape || !shape->mirror) return false;
    f->mirror = shape->mirror;
    return !side_is_given(f);
}

/* Replaces the shape by its mirror image, and the result by that of a fit of this one. */
static sdm_status take_other_side(cli_fit *f, sdm_error *err)
{
    const sdm_status s = cli_fit_swap_side(f, err);
    if (s) return s;
    sdm_fit_dispose(&f->result);
    f->doubt = (sdm_error){0};
    f->n_fits++;
    f->doubt.status = sdm_fit(&f->source, &f->target, &f->opts, &f->result, &f->doubt);
    f->better = -f->better;
    return SDM_OK;
}

static void add_finding(cli_fit *f)
{
    // an open side contradicts nothing that the user or the model says
    const sdm_fit_grade grade = f->better > SDM_FIT_PREFERRED ? SDM_FIT_PASSED
                                : f->better < -SDM_FIT_PREFERRED || !side_is_given(f)
                                    ? SDM_FIT_FAILED
                                    : SDM_FIT_DOUBTFUL;
    sdm_fit_finding x = {.kind = SDM_FIT_CHECK_MIRROR,
                         .grade = grade,
                         .figure = f->better,
                         .limit = SDM_FIT_PREFERRED};
    if (f->better < -SDM_FIT_PREFERRED)
        snprintf(x.text, sizeof x.text,
                 "the mirror image of the shape fits better, by %.3g (log-likelihood): the other "
                 "value of the option '%s' is right",
                 -f->better, f->mirror);
    else if (x.grade)
        snprintf(x.text, sizeof x.text,
                 "the shape and its mirror image (option '%s') fit equally well, to %.2g "
                 "(log-likelihood): the side is open",
                 f->mirror, fabs(f->better));
    sdm_fit_verdict_add(&f->result.verdict, &x);
    if (x.grade == SDM_FIT_FAILED && !f->doubt.status)
        (void)sdm_fail(&f->doubt, SDM_E_QUALITY, "%s", x.text);
}

sdm_status cli_fit_mirror(cli_fit *f, sdm_error *err)
{
    if (!strcmp(f->args->fit.mirror, "no")) return SDM_OK;
    const sdm_shape *shape = find_shape(f);
    if (!shape || !shape->mirror) return SDM_OK;
    f->mirror = shape->mirror;
    sdm_fit_result rival = {0};
    f->n_fits++;
    f->at_mirror = true;
    sdm_status s = sdm_fit_mirrored(&f->source, &f->target, &f->opts, &rival, err);
    if (s == SDM_E_QUALITY) s = SDM_OK;
    f->better = sdm_fit_compare(&f->result, &rival);
    sdm_fit_dispose(&rival);
    if (!s && f->better < -SDM_FIT_PREFERRED && !side_is_given(f)) s = take_other_side(f, err);
    if (s) return s;
    if (f->shape) side_name(f, false, f->side, sizeof f->side);
    if (!isnan(f->better)) add_finding(f);
    return SDM_OK;
}

sdm_status cli_fit_run(cli_fit *f, sdm_error *err)
{
    f->doubt = (sdm_error){0};
    f->n_fits++;
    f->at_mirror = false;
    f->doubt.status = sdm_fit(&f->source, &f->target, &f->opts, &f->result, &f->doubt);
    return !f->doubt.status || f->doubt.status == SDM_E_QUALITY ? cli_fit_mirror(f, err) : SDM_OK;
}
