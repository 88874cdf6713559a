/* Priors of parameters and pose, and what is known without them. */
#include <math.h>

#include "newton.h"
#include "sdm/internal/rotation.h"

static void add_normal(size_t n, size_t at, double residual, double precision, double *gradient,
                       double *complete, double *observed)
{
    if (gradient) gradient[at] -= precision * residual;
    if (complete) complete[at * n + at] += precision;
    if (observed) observed[at * n + at] += precision;
}

// the turn from the prior's rotation
static void turned(const fit_problem *p, const fit_state *s, double w[3])
{
    const double *q = p->prior.rotation,
                 back[9] = {q[0], q[3], q[6], q[1], q[4], q[7], q[2], q[5], q[8]};
    double r[9];
    sdm_rotation_product(s->rotation, back, r);
    sdm_rotation_vector(r, w);
}

bool sdm_fit_has_prior(const fit_problem *p)
{
    const sdm_fit_opts *o = p->opts;
    return (!o->keep_params && o->prior_sd > 0) ||
           (!o->keep_pose && (o->prior_rotation_sd > 0 || o->prior_translation_sd > 0));
}

double sdm_fit_prior_sd(const fit_problem *p, size_t k)
{
    const double range = p->high[k] - p->low[k];
    return p->opts->prior_sd > 0 ? 0.5 * p->opts->prior_sd * range : range / sqrt(12);
}

double sdm_fit_prior(const fit_problem *p, const fit_state *s, double *gradient, double *complete,
                     double *observed)
{
    const sdm_fit_opts *o = p->opts;
    const size_t n = p->sums.n_unknowns;
    const double *weight = p->prior_weight;
    double sum = 0;
    for (size_t k = 0; k < p->n_params && o->prior_sd > 0; k++) {
        const double sd = sdm_fit_prior_sd(p, k), precision = weight[k] / (sd * sd);
        const double residual = s->params[k] - 0.5 * (p->low[k] + p->high[k]);
        sum -= 0.5 * precision * residual * residual;
        add_normal(n, k, residual, precision, gradient, complete, observed);
    }
    if (o->prior_rotation_sd > 0) {
        double w[3];
        turned(p, s, w);
        for (size_t k = 0; k < 3; k++) { // J^-T w = w: the gradient by a small turn is along w
            const size_t at = fit_at_rotation(p->n_params) + k;
            const double precision = weight[at] / (o->prior_rotation_sd * o->prior_rotation_sd);
            sum -= 0.5 * precision * w[k] * w[k];
            add_normal(n, at, w[k], precision, gradient, complete, observed);
        }
    }
    if (o->prior_translation_sd > 0) {
        for (size_t k = 0; k < 3; k++) {
            const size_t at = fit_at_translation(p->n_params) + k;
            const double precision =
                weight[at] / (o->prior_translation_sd * o->prior_translation_sd);
            const double residual = s->translation[k] - p->prior.translation[k];
            sum -= 0.5 * precision * residual * residual;
            add_normal(n, at, residual, precision, gradient, complete, observed);
        }
    }
    return sum;
}

/* Nobody knows less than that nothing is known: a turn of any angle, a parameter of its range, a
   place within the shape's reach. Where there is no prior this keeps steps along what the data do
   not determine within bounds; the maximum stays where it is. */
void sdm_fit_add_ignorance(const fit_problem *p, double *a)
{
    const sdm_fit_opts *o = p->opts;
    const size_t n = p->sums.n_unknowns, m = p->n_params;
    for (size_t k = 0; k < m && !(o->prior_sd > 0); k++)
        a[k * (n + 1)] += 1 / pow(sdm_fit_prior_sd(p, k), 2);
    for (size_t k = 0; k < 3; k++) {
        if (!(o->prior_rotation_sd > 0))
            a[(m + k) * (n + 1)] += 3 / (3.14159265358979324 * 3.14159265358979324);
        if (!(o->prior_translation_sd > 0))
            a[(m + 3 + k) * (n + 1)] += 1 / (p->extent.reach * p->extent.reach);
    }
}
