/* What to try after a fit that is not trustworthy: the end of its error. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit_command.h"

/* Share of the surface without points from which on the points show a part of the shape, whose
 * middle is not theirs. */
#define UNCOVERED 0.1

/* Farther from the middle of its range than this multiple of the prior's standard deviation, a
 * parameter is held back by the prior. */
#define FAR_FROM_PRIOR 2.0

/* Did the fit start at the middle of the points? It does unless an option gives another place:
 * --translation, --start-centre or --start-points. */
static bool began_at_points(const cli_fit *f)
{
    return f->points && isnan(f->args->pose.translation[0]) &&
           isnan(f->args->fit.start_centre[0]) && !f->args->fit.start_points;
}

/* Is the parameter where the prior wants it, or pulled to it by data that disagree? */
static bool is_held(const cli_fit *f, size_t k)
{
    const sdm_param *p = &f->params[k];
    const double sd = f->result.prior_sd[k],
                 even = 0.5 * f->opts.prior_sd * (p->max - p->min); // of a uniform distribution
    return f->result.by_prior[k] ||
           (fabs(sd - even) < 1e-6 * even &&
            fabs(f->result.params[k] - 0.5 * (p->min + p->max)) > FAR_FROM_PRIOR * sd);
}

/* A --prior-sd below its default that holds parameters; false: there is none. */
static bool name_prior(const cli_fit *f, char *text, size_t size)
{
    char list[200] = "";
    for (size_t k = 0; k < f->n_params; k++) {
        const size_t used = strlen(list);
        if (is_held(f, k))
            snprintf(list + used, sizeof list - used, "%s%s", used ? ", " : "", f->params[k].name);
    }
    if (!*list) return false;
    snprintf(text, size,
             "; --prior-sd %g holds %s near the middle of the range, whatever the data show: a "
             "wider one (default 1) lets them decide%s",
             f->opts.prior_sd, list, f->suspicion ? f->suspicion : "");
    return true;
}

/* Does the fit of points lie on them? */
static bool lies_on_points(const cli_fit *f)
{
    return !cli_fit_found(f, SDM_FIT_CHECK_MISSING, SDM_FIT_FAILED, -INFINITY) &&
           !cli_fit_found(f, SDM_FIT_CHECK_RESIDUALS, SDM_FIT_FAILED, -INFINITY);
}

/* Writes into `text` that a wrong start may be the cause of the failure, and the options that
 * change the start; nothing where the start is kept. */
static void name_start(const cli_fit *f, char *text, size_t size)
{
    const bool turned = !isnan(f->args->pose.rotation[0]) && !f->opts.keep_pose,
               placed = f->target.kind == SDM_FIT_IMAGE && !f->args->fit.find && !f->opts.keep_pose,
               values = !f->opts.keep_params;
    if (!turned && !values && !placed) return;
    snprintf(text, size, "; %s%s%s%s%s%s",
             strstr(f->doubt.text, "a wrong start") ? "" : "a wrong start ends like this, too: ",
             turned ? "without --rotation many are tried" : "", turned && placed ? "; " : "",
             placed ? "--start-centre X,Y,Z gives the place, --find searches the image" : "",
             (turned || placed) && values ? "; " : "",
             !values             ? ""
             : f->args->params.n ? "the values of -p may be wrong"
                                 : "-p NAME=VALUE gives start values of parameters");
}

const char *cli_fit_remedy(const cli_fit *f, char *text, size_t size)
{
    char astray[400] = "";
    const cli_fit_args *a = &f->args->fit;
    const sdm_fit_result *r = &f->result;
    const bool network = f->model && f->shape && !a->exact && !a->polish;
    const char *suspicion = f->suspicion ? f->suspicion : "";
    *text = '\0';
    if (f->exchanged || cli_fit_lacks_data(f)) return text;
    if (f->found && !r->converged && a->max_iterations && !cli_fit_swings(f) &&
        r->n_iterations >= (size_t)a->max_iterations)
        snprintf(text, size, "; --max-iterations %lld ended it too early to judge the fit%s",
                 (long long)a->max_iterations, suspicion);
    else if (f->found && !f->opts.keep_params && f->opts.prior_sd > 0 && f->opts.prior_sd < 1 &&
             name_prior(f, text, size))
        return text;
    else if (!cli_fit_astray(f, astray, sizeof astray, NULL) && *astray)
        snprintf(text, size, "%s%s", astray, suspicion);
    else if (*suspicion)
        snprintf(text, size, "%s", suspicion);
    else if (f->found && !r->converged && network)
        snprintf(text, size, "; if the network is the limit, --exact fits with exact maps");
    else if (f->found && began_at_points(f) &&
             cli_fit_found(f, SDM_FIT_CHECK_COVERED, SDM_FIT_DOUBTFUL, UNCOVERED)) {
        const size_t used = (size_t)snprintf(
            text, size,
            "%s the points show only a part of the shape, their middle, where the fit began, is "
            "not its own: --start-centre X,Y,Z says where the middle of the whole shape is, about",
            lies_on_points(f) ? "; if, as it seems," : "; if");
        if (!lies_on_points(f) && used < size) name_start(f, text + used, size - used);
    }
    // tissues that are the wrong way round are no matter of the start
    else if (!(f->found && cli_fit_found(f, SDM_FIT_CHECK_CONTRAST, SDM_FIT_FAILED, -INFINITY)) &&
             !cli_fit_voxels_refuse(f))
        name_start(f, text, size);
    return text;
}
