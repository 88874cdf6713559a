/* Prior densities: Gaussians of the parameters, of the pose about the start, and of the mean values
 * inside about those of the start. A parameter with a normal distribution has this distribution as
 * its prior; its truncation is the bounds of the fit. The others have a Gaussian about the middle
 * of their range. */
#include "prior.h"

#include <math.h>

#include "sdm/internal/mat3.h"
#include "sdm/internal/rotation.h"

// adds the derivatives of one Gaussian term; each array may be NULL
static void normal_add(size_t n, size_t at, double residual, double precision, double *gradient,
                       double *complete, double *observed)
{
    if (gradient) gradient[at] -= precision * residual;
    if (complete) complete[at * n + at] += precision;
    if (observed) observed[at * n + at] += precision;
}

// w: rotation vector (rad) from the prior's rotation to the state's
static void rotation_residual(const fit_problem *p, const fit_state *s, double w[3])
{
    const double *q = p->prior.rotation,
                 back[9] = {q[0], q[3], q[6], q[1], q[4], q[7], q[2], q[5], q[8]};
    double r[9];
    m3_product(s->rotation, back, r);
    sdm_rotation_vector(r, w);
}

// whether mean values of tissues are unknowns of the fit
static bool has_means(const fit_problem *p)
{
    return p->information.n_unknowns > fit_columns(p->n_params) && !p->opts->keep_appearance;
}

bool sdm_fit_has_prior(const fit_problem *p)
{
    const sdm_fit_opts *o = p->opts;
    return (!o->keep_params && o->prior_sd > 0) || has_means(p) ||
           (!o->keep_pose && (o->prior_rotation_sd > 0 || o->prior_translation_sd > 0));
}

bool sdm_fit_may_have_prior(const fit_problem *p, size_t i)
{
    const size_t means = fit_columns(p->n_params);
    return i < fit_at_blur(p->n_params) || (i >= means && i < means + p->observation.n_in);
}

double sdm_fit_prior_sd(const fit_problem *p, size_t k)
{
    const double range = p->high[k] - p->low[k];
    if (!(p->opts->prior_sd > 0)) return range / sqrt(12);
    return p->distribution[k].kind == SDM_DISTRIBUTION_NORMAL
               ? p->opts->prior_sd * p->distribution[k].deviation
               : 0.5 * p->opts->prior_sd * range;
}

double sdm_fit_prior_mean(const fit_problem *p, size_t k)
{
    return p->distribution[k].kind == SDM_DISTRIBUTION_NORMAL ? p->distribution[k].mean
                                                              : 0.5 * (p->low[k] + p->high[k]);
}

double sdm_fit_prior(const fit_problem *p, const fit_state *s, double *gradient, double *complete,
                     double *observed)
{
    const sdm_fit_opts *o = p->opts;
    const size_t n = p->information.n_unknowns;
    const double *weight = p->prior_weight;
    double sum = 0;
    // parameters
    for (size_t k = 0; k < p->n_params && o->prior_sd > 0; k++) {
        const double sd = sdm_fit_prior_sd(p, k), precision = weight[k] / (sd * sd);
        const double residual = s->params[k] - sdm_fit_prior_mean(p, k);
        sum -= 0.5 * precision * residual * residual;
        normal_add(n, k, residual, precision, gradient, complete, observed);
    }
    // rotation
    if (o->prior_rotation_sd > 0) {
        double w[3];
        rotation_residual(p, s, w);
        for (size_t k = 0; k < 3; k++) { // with the left Jacobian J of the rotation, J^-T w = w:
                                         // the gradient by a small rotation is along w
            const size_t at = fit_at_rotation(p->n_params) + k;
            const double precision = weight[at] / (o->prior_rotation_sd * o->prior_rotation_sd);
            sum -= 0.5 * precision * w[k] * w[k];
            normal_add(n, at, w[k], precision, gradient, complete, observed);
        }
    }
    // translation
    if (o->prior_translation_sd > 0) {
        for (size_t k = 0; k < 3; k++) {
            const size_t at = fit_at_translation(p->n_params) + k;
            const double precision =
                weight[at] / (o->prior_translation_sd * o->prior_translation_sd);
            const double residual = s->translation[k] - p->prior.translation[k];
            sum -= 0.5 * precision * residual * residual;
            normal_add(n, at, residual, precision, gradient, complete, observed);
        }
    }
    // mean values of the tissues inside: where blur is as wide as the shape is thick, no voxel
    // shows them, and the data tell a higher value from a thicker shape hardly at all
    for (size_t i = 0; i < s->appearance.n_inside && fit_columns(p->n_params) + i < n; i++) {
        const size_t at = fit_columns(p->n_params) + i;
        if (fit_mean_is_kept(p, at)) continue;
        const sdm_fit_law *given = &o->appearance.inside[i];
        const double precision = weight[at] / (given->sd * given->sd),
                     residual = s->appearance.inside[i].mean - given->mean;
        sum -= 0.5 * precision * residual * residual;
        normal_add(n, at, residual, precision, gradient, complete, observed);
    }
    return sum;
}

// precisions: parameters 12 / range^2 (uniform distribution), rotation 3 / pi^2 (angle about each
// axis uniform in -pi .. pi), translation 1 / reach^2
void sdm_fit_add_weak_prior(const fit_problem *p, double *a)
{
    const sdm_fit_opts *o = p->opts;
    const size_t n = p->information.n_unknowns, m = p->n_params;
    for (size_t k = 0; k < m && !(o->prior_sd > 0); k++)
        a[k * (n + 1)] += 1 / pow(sdm_fit_prior_sd(p, k), 2);
    for (size_t k = 0; k < 3; k++) {
        if (!(o->prior_rotation_sd > 0))
            a[(m + k) * (n + 1)] += 3 / (3.14159265358979324 * 3.14159265358979324);
        if (!(o->prior_translation_sd > 0))
            a[(m + 3 + k) * (n + 1)] += 1 / (p->extent.reach * p->extent.reach);
    }
}
