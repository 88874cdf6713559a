/* Damped Newton steps (Levenberg 1944, Marquardt 1963) with the information of the observed values (Louis 1982) where it is positive
   definite, of the complete ones elsewhere: the step is then that of expectation-maximisation. */
#include "newton.h"

#include <math.h>
#include <string.h>

#include "sdm/memory.h"

// largest step of one iteration: share of a range, rad, share of the shape's reach
#define STEP_MOST 0.25
// a gain in log-likelihood too small to tell from rounding: such steps are taken without asking whether they gain
#define GAIN_LEAST 1e-4
// so many of them in a row are an end too: creases of the distance keep the steps from becoming smaller
#define FLAT_MOST 12
#define DAMPING_MOST 1e8

sdm_status sdm_fit_look(fit_problem *p, sdm_error *err)
{
    const fit_state *s = &p->state;
    sdm_status status = SDM_OK;
    bool same = true;
    for (size_t k = 0; k < p->n_params; k++) same = same && p->maps_at[k] == s->params[k];
    if (!same) {
        p->packed_blur = p->maps_at[0] = NAN;
        status = sdm_fit_maps_at(&p->maps, s->params, err);
        if (!status) memcpy(p->maps_at, s->params, p->n_params * sizeof *s->params);
    } else if (p->maps.cancelled && p->maps.cancelled(p->maps.user)) {
        status = sdm_fail(err, SDM_E_CANCELLED, "fit stopped on request");
    }
    if (status) return status;
    if (!(p->packed_blur == s->blur)) {
        sdm_fit_maps_pack(&p->maps, s->blur);
        p->packed_blur = s->blur;
    }
    sdm_fit_laws_prepare(p->opts, p->target->kind, s, &p->laws);
    status = sdm_fit_sites_sample(&p->sites, &p->maps, &p->laws, s, err);
    if (!status) sdm_fit_sums_fill(&p->sums, &p->sites, &p->laws, p->opts->n_threads);
    return status;
}

static void add_normal(size_t n, size_t at, double residual, double precision, double *gradient, double *complete,
                       double *observed)
{
    if (gradient) gradient[at] -= precision * residual;
    if (complete) complete[at * n + at] += precision;
    if (observed) observed[at * n + at] += precision;
}

// the turn from the prior's rotation
static void turned(const fit_problem *p, const fit_state *s, double w[3])
{
    double r[9];
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            r[3 * a + b] = 0;
            for (int k = 0; k < 3; k++) r[3 * a + b] += s->rotation[3 * a + k] * p->prior.rotation[3 * b + k];
        }
    sdm_rotation_vector(r, w);
}

double sdm_fit_prior(const fit_problem *p, const fit_state *s, double *gradient, double *complete, double *observed)
{
    const sdm_fit_opts *o = p->opts;
    const size_t n = p->sums.n_unknowns;
    double sum = 0;
    for (size_t k = 0; k < p->n_params && o->prior_sd > 0; k++) {
        const double sd = 0.5 * o->prior_sd * (p->high[k] - p->low[k]), precision = 1 / (sd * sd);
        const double residual = s->params[k] - 0.5 * (p->low[k] + p->high[k]);
        sum -= 0.5 * precision * residual * residual;
        add_normal(n, k, residual, precision, gradient, complete, observed);
    }
    if (o->prior_rotation_sd > 0) {
        const double precision = 1 / (o->prior_rotation_sd * o->prior_rotation_sd);
        double w[3];
        turned(p, s, w);
        for (size_t k = 0; k < 3; k++) { // J^-T w = w: the gradient by a small turn is along w
            sum -= 0.5 * precision * w[k] * w[k];
            add_normal(n, fit_at_rotation(p->n_params) + k, w[k], precision, gradient, complete, observed);
        }
    }
    if (o->prior_translation_sd > 0) {
        const double precision = 1 / (o->prior_translation_sd * o->prior_translation_sd);
        for (size_t k = 0; k < 3; k++) {
            const double residual = s->translation[k] - p->prior.translation[k];
            sum -= 0.5 * precision * residual * residual;
            add_normal(n, fit_at_translation(p->n_params) + k, residual, precision, gradient, complete, observed);
        }
    }
    return sum;
}

void sdm_fit_move(const fit_problem *p, const fit_state *from, const double *step, fit_state *to)
{
    const size_t n = p->n_params;
    *to = *from;
    for (size_t k = 0; k < n; k++) to->params[k] = fmin(fmax(from->params[k] + step[k], p->low[k]), p->high[k]);
    const sdm_pose turn = {.rotation = {step[n], step[n + 1], step[n + 2]}};
    double r[9];
    sdm_pose_matrix(&turn, r);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            double sum = 0;
            for (int k = 0; k < 3; k++) sum += r[3 * a + k] * from->rotation[3 * k + b];
            to->rotation[3 * a + b] = sum;
        }
    for (size_t k = 0; k < 3; k++) to->translation[k] += step[fit_at_translation(n) + k];
    to->blur += step[fit_at_blur(n)];
    for (size_t i = 0; fit_columns(n) + i < p->sums.n_unknowns; i++) {
        sdm_fit_law *t = i < to->look.n_inside ? &to->look.inside[i] : &to->look.outside[i - to->look.n_inside];
        t->mean += step[fit_columns(n) + i];
    }
}

static void set_limits(const fit_problem *p, const fit_run *run, fit_limits *l)
{
    const size_t n = p->n_params;
    const fit_state *s = &p->state;
    for (size_t i = 0; i < p->sums.n_unknowns; i++) {
        l->least[i] = -INFINITY, l->most[i] = INFINITY;
        l->kept[i] = i < n ? run->keep_params : i < n + 6 ? run->keep_pose : i > n + 6 ? run->keep_look : false;
    }
    for (size_t k = 0; k < n; k++) {
        const double most = STEP_MOST * (p->high[k] - p->low[k]);
        l->least[k] = fmax(p->low[k] - s->params[k], -most);
        l->most[k] = fmin(p->high[k] - s->params[k], most);
    }
    const size_t blur = fit_at_blur(n);
    l->kept[blur] = run->keep_blur || !p->maps.share;
    l->least[blur] = fmax(p->maps.least_blur - s->blur, -0.5 * s->blur);
    l->most[blur] = fmin(0.5 * s->blur, fmax(p->extent.reach - s->blur, 0));
}

// the largest of what sdm_fit_opts.eps counts
static double step_size(const fit_problem *p, const double *step)
{
    double most = 0;
    for (size_t k = 0; k < p->n_params; k++) most = fmax(most, fabs(step[k]) / (p->high[k] - p->low[k]));
    for (size_t k = 0; k < 3; k++) {
        most = fmax(most, fabs(step[fit_at_rotation(p->n_params) + k]));
        most = fmax(most, fabs(step[fit_at_translation(p->n_params) + k]) / p->extent.reach);
    }
    return most;
}

/* Nobody knows less than that nothing is known: a turn of any angle, a parameter of its range, a place within the shape's reach. Where
   there is no prior this keeps steps along what the data do not determine within bounds; the maximum stays where it is. */
void sdm_fit_add_ignorance(const fit_problem *p, double *a)
{
    const sdm_fit_opts *o = p->opts;
    const size_t n = p->sums.n_unknowns, m = p->n_params;
    for (size_t k = 0; k < m && !(o->prior_sd > 0); k++)
        a[k * (n + 1)] += 12 / ((p->high[k] - p->low[k]) * (p->high[k] - p->low[k]));
    for (size_t k = 0; k < 3; k++) {
        if (!(o->prior_rotation_sd > 0)) a[(m + k) * (n + 1)] += 3 / (3.14159265358979324 * 3.14159265358979324);
        if (!(o->prior_translation_sd > 0)) a[(m + 3 + k) * (n + 1)] += 1 / (p->extent.reach * p->extent.reach);
    }
}

// whether a step goes back by more than half of the one before
static bool swings(const fit_problem *p, const double *step, const double *last)
{
    double along = 0, square = 0;
    for (size_t k = 0; k < p->n_params + 6; k++) {
        const double unit = k < p->n_params ? p->high[k] - p->low[k] : k < p->n_params + 3 ? 1 : p->extent.reach;
        along += step[k] * last[k] / (unit * unit);
        square += last[k] * last[k] / (unit * unit);
    }
    return along < -0.25 * square;
}

static bool find_step(const fit_problem *p, const fit_run *run, double damping, double shrink, bool observed,
                      double *step, double *work)
{
    const size_t n = p->sums.n_unknowns;
    double gradient[FIT_UNKNOWNS_MAX], *a = work;
    memcpy(gradient, p->sums.gradient, n * sizeof *gradient);
    memcpy(a, observed ? p->sums.observed : p->sums.complete, n * n * sizeof *a);
    (void)sdm_fit_prior(p, &p->state, gradient, a, NULL);
    sdm_fit_add_ignorance(p, a);
    fit_limits limits;
    set_limits(p, run, &limits);
    if (!sdm_fit_step(n, a, gradient, damping, &limits, step, work + n * n)) return false;
    const double size = step_size(p, step);
    const double factor = size > STEP_MOST ? STEP_MOST / size : 1;
    for (size_t i = 0; i < n; i++) step[i] *= factor * shrink;
    return true;
}

static double expected_gain(const fit_problem *p, const double *step)
{
    double gradient[FIT_UNKNOWNS_MAX], sum = 0;
    memcpy(gradient, p->sums.gradient, p->sums.n_unknowns * sizeof *gradient);
    (void)sdm_fit_prior(p, &p->state, gradient, NULL, NULL);
    for (size_t i = 0; i < p->sums.n_unknowns; i++) sum += gradient[i] * step[i];
    return sum;
}

static void swap_sums(fit_problem *p)
{
    const fit_sums kept = p->sums;
    p->sums = p->trial;
    p->trial = kept;
}

/* Where the steps of an iteration stand. */
typedef struct fit_pace {
    double damping;
    double shrink; // factor of steps about a crease of the posterior (distances have them), else 1
    bool flat;     // the gain of the last step was too small to tell
} fit_pace;

/* One step that gains; *taken is false where none does. */
static sdm_status one_step(fit_problem *p, const fit_run *run, fit_pace *pace, double *step, double *work, bool *taken,
                           sdm_error *err)
{
    const double before = p->sums.log_likelihood + sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
    const fit_state from = p->state;
    bool observed = true;
    *taken = false;
    for (double *damping = &pace->damping; *damping <= DAMPING_MOST; *damping = fmax(10 * *damping, 1e-3)) {
        if (observed) observed = find_step(p, run, *damping, pace->shrink, true, step, work);
        if (!observed && !find_step(p, run, *damping, pace->shrink, false, step, work)) continue;
        fit_state to;
        sdm_fit_move(p, &from, step, &to);
        const double expected = expected_gain(p, step);
        p->state = to;
        swap_sums(p);
        const sdm_status s = sdm_fit_look(p, err);
        const double after = s ? 0 : p->sums.log_likelihood + sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
        if (s) return s;
        pace->flat = fabs(expected) < GAIN_LEAST;
        if (after > before || (pace->flat && after > before - GAIN_LEAST)) {
            *taken = true;
            *damping = *damping > 1e-6 ? *damping / 10 : 0;
            return SDM_OK;
        }
        p->state = from;
        swap_sums(p);
        observed = false;
    }
    return sdm_fit_look(p, err); // maps and samples of the state that is kept
}

// weights, sd and (labels) means of the tissues, sd of points; then the sums with them
static void update_look(fit_problem *p)
{
    if (p->target->kind == SDM_FIT_POINTS) {
        double sum = 0;
        for (size_t i = 0; i < p->sites.n; i++) {
            const double r = p->sites.field[i] / p->state.point_sd;
            sum += (p->opts->point_dof + 1) / (p->opts->point_dof + r * r) * r * r;
        }
        p->state.point_sd *= sqrt(fmax(sum / (double)p->sites.n, 1e-6));
    } else if (p->target->kind == SDM_FIT_IMAGE) {
        fit_moments m;
        sdm_fit_sums_moments(&p->sites, &p->laws, p->opts->n_threads, &m);
        const double step = fabs(p->opts->appearance.inside[0].mean - p->opts->appearance.outside[0].mean);
        sdm_fit_moments_apply(&p->laws, &m, 1e-3 * step, &p->state.look);
    } else {
        return;
    }
    sdm_fit_laws_prepare(p->opts, p->target->kind, &p->state, &p->laws);
    sdm_fit_sums_fill(&p->sums, &p->sites, &p->laws, p->opts->n_threads);
}

static sdm_status record(fit_problem *p, const fit_run *run, double step, sdm_error *err)
{
    const double objective = p->sums.log_likelihood + sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
    p->n_steps++;
    if (p->opts->progress) {
        sdm_fit_progress g = {.phase = run->phase,
                              .iteration = p->n_steps,
                              .objective = objective,
                              .step = step,
                              .params = p->state.params};
        sdm_rotation_vector(p->state.rotation, g.pose.rotation);
        memcpy(g.pose.translation, p->state.translation, sizeof g.pose.translation);
        p->opts->progress(p->opts->user, &g);
    }
    if (run->phase == SDM_FIT_SEARCH) return SDM_OK;
    if (p->n_iterations == p->objective_capacity) {
        const size_t now = 2 * p->objective_capacity + 16;
        const sdm_status s = sdm_grow((void **)&p->objective, p->objective_capacity, now, sizeof *p->objective,
                                      "history of the fit", err);
        if (s) return s;
        p->objective_capacity = now;
    }
    p->objective[p->n_iterations++] = objective;
    return SDM_OK;
}

sdm_status sdm_fit_iterate(fit_problem *p, const fit_run *run, fit_ended *out, sdm_error *err)
{
    const size_t n = p->sums.n_unknowns;
    double step[FIT_UNKNOWNS_MAX], last[FIT_UNKNOWNS_MAX] = {0}, *work = NULL;
    fit_pace pace = {.damping = run->phase == SDM_FIT_SEARCH ? 1e-2 : 1e-4, .shrink = 1};
    int flat = 0;  // steps in a row whose gain is too small to tell
    int stuck = 0; // steps that gain nothing or swing, and do not become smaller
    *out = (fit_ended){.step = INFINITY};
    sdm_status s = SDM_ALLOC(&work, 3 * n * n, "matrices of the fit", err);
    if (!s) s = sdm_fit_look(p, err);
    for (size_t i = 0; i < run->max_iterations && !s && !out->converged; i++) {
        if (!run->keep_look) update_look(p);
        bool taken;
        s = one_step(p, run, &pace, step, work, &taken, err);
        if (s) break;
        if (!taken) {
            // nowhere to go: a maximum to rounding, or derivatives that do not fit
            out->converged = out->step <= 1e3 * run->eps;
            break;
        }
        const double size = step_size(p, step);
        const bool back = swings(p, step, last);
        stuck = (pace.flat || back) && size > 0.8 * out->step ? stuck + 1 : 0;
        if ((pace.flat && back) || stuck == 3) pace.shrink *= 0.5, stuck = 0;
        memcpy(last, step, n * sizeof *last);
        out->step = size;
        flat = pace.flat ? flat + 1 : 0;
        out->rough = flat == FLAT_MOST && size > run->eps;
        out->converged = size <= run->eps || out->rough;
        s = record(p, run, out->step, err);
    }
    sdm_free(work);
    return s;
}
