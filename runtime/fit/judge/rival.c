/* The gain of a fit over a rival: by the likelihood of voxels, or by the residuals of
 * neighbourhoods. */
#include "rival.h"

#include <math.h>

#include "finding.h"
#include "fit/solver/open_motions.h"
#include "fit/start/turn_set.h"
#include "residuals.h"
#include "sdm/internal/mat3.h"
#include "sdm/internal/rotation.h"
#include "sdm/internal/vec3.h"

// a chi-square is at least this: residuals without any noise
#define CHI_SQUARE_MIN 1e-3
// points: a gain in log-likelihood that counts whatever their neighbourhoods tell: a smaller one
// may come from few iterations, and from errors of coarse maps at sharp edges
#define CLEARLY_LIKELIER 30.0
// of points that only one of two shapes takes for strays
#define CHI_SQUARE_STRAY 9.0
// loss of log-likelihood, below the worse one of the two, that is no valley
#define VALLEY 0.5
// a start passes for the place of a rival if it is nearer to it than this share of the way to the
// fit
#define NEARER 0.25
// a direction is open if its standard deviation is larger than this: rad, or reaches of the shape
#define OPEN_SD 0.5
// an open axis may tilt by so much (rad), and the middle of the shape shift by this share of its
// reach; other unknowns may differ by this many standard deviations
#define TILT_MAX 0.2
#define SHIFT_MAX 0.1
#define DEVIATIONS_MAX 3.0

sdm_status sdm_fit_stand(const fit_problem *p, double factor, fit_standing *out, sdm_error *err)
{
    if (fit_is_image(p)) {
        *out = (fit_standing){.log_likelihood = p->information.log_likelihood, .factor = factor};
        return SDM_OK;
    }
    fit_residuals residuals;
    fit_misfit misfit;
    sdm_status s = sdm_fit_residuals_create(p, &residuals, err);
    if (!s) s = sdm_fit_misfit(p, &residuals, &misfit, err);
    sdm_fit_residuals_dispose(&residuals);
    if (!s)
        *out = (fit_standing){.n_units = misfit.few ? 0 : misfit.n_units[0] + misfit.n_units[1],
                              .chi_square = misfit.noise_chi_square,
                              .n_points = misfit.n_points};
    if (!s && p->target->kind == SDM_FIT_POINTS)
        out->log_likelihood = p->information.log_likelihood, out->factor = factor;
    return s;
}

double sdm_fit_units_gain(double n, double chi_square, double rival_chi_square)
{
    return 0.5 * n * log(fmax(rival_chi_square, CHI_SQUARE_MIN) / fmax(chi_square, CHI_SQUARE_MIN));
}

double sdm_fit_chi_square(const fit_standing *s, const fit_standing *against)
{
    if (s->n_points >= against->n_points) return s->chi_square;
    const double kept = (double)s->n_points / (double)against->n_points;
    return kept * s->chi_square + (1 - kept) * CHI_SQUARE_STRAY;
}

bool sdm_fit_has_units(const fit_standing *fit, const fit_standing *rival)
{
    return fit->n_units && rival->n_units;
}

double sdm_fit_gain(const fit_standing *fit, const fit_standing *rival)
{
    const bool units = sdm_fit_has_units(fit, rival), likelihoods = fit->factor > 0;
    const double by_likelihood =
        likelihoods ? (fit->log_likelihood - rival->log_likelihood) / fit->factor : NAN;
    if (!units) return by_likelihood;
    const double by_units =
        sdm_fit_units_gain(0.5 * (double)(fit->n_units + rival->n_units),
                           sdm_fit_chi_square(fit, rival), sdm_fit_chi_square(rival, fit));
    // each chi-square has the scatter of its own residuals as its unit: points that scatter far
    // about another shape excuse it
    if (!likelihoods || !(by_likelihood > 0)) return by_units;
    return fmax(by_units, by_likelihood > CLEARLY_LIKELIER ? by_likelihood : 0);
}

bool sdm_fit_same_maximum(const fit_problem *p, const fit_standing *fit, const double *field,
                          const fit_standing *rival)
{
    const fit_samples *s = &p->samples;
    if (!fit_is_image(p) || !p->maps.share || !(fit->factor > 0)) return false;
    if (!(fabs(sdm_fit_gain(fit, rival)) < SDM_FIT_PREFERRED)) return false;
    fit_standing between = {.factor = fit->factor};
    for (size_t i = 0; i < s->n; i++) {
        fit_likelihood l;
        (void)sdm_fit_likelihood_beyond(&p->observation, (double)s->value[i],
                                        fit_sample_weights(s, i), 0.5 * (field[i] + s->field[i]),
                                        fit_sample_beyond(s, i), false, &l);
        between.log_likelihood += l.log_likelihood;
    }
    const double below_fit = sdm_fit_gain(fit, &between),
                 below_rival = sdm_fit_gain(rival, &between);
    // much better half-way: the image shows both, or the truth between them
    return fmin(below_fit, below_rival) < VALLEY && below_fit > -SDM_FIT_PREFERRED;
}

// v[3] = way of the middle of the shape from one state to the other, mm
static void centre_shift(const fit_state *from, const fit_state *to, const double centre[3],
                         double v[3])
{
    double a[3], b[3];
    sdm_fit_to_world(from, centre, a);
    sdm_fit_to_world(to, centre, b);
    v3_sub(b, a, v);
}

// how far the poses are apart: rad, with shifts in reaches of the shape
static double pose_distance(const fit_problem *p, const fit_state *a, const fit_state *b,
                            const double centre[3])
{
    double shift[3];
    centre_shift(a, b, centre, shift);
    return sdm_fit_angle_between(a->rotation, b->rotation) + v3_norm(shift) / p->extent.reach;
}

static bool began_in_pose(const fit_problem *p, const fit_state *start, const fit_state *fitted,
                          const fit_state *rival, const double centre[3])
{
    return pose_distance(p, start, rival, centre) <
           NEARER * pose_distance(p, fitted, rival, centre);
}

static bool began_with_value(const fit_state *start, const fit_state *fitted,
                             const fit_state *rival, size_t k)
{
    return fabs(start->params[k] - rival->params[k]) <
           NEARER * fabs(fitted->params[k] - rival->params[k]);
}

bool sdm_fit_began_at(const fit_problem *p, const fit_state *fitted, const fit_state *rival,
                      size_t param, const double centre[3])
{
    // the values that were given: a search may have left them
    bool began = param && began_with_value(&p->prior, fitted, rival, param - 1);
    for (size_t i = 0; i < p->n_begun; i++)
        began = began || (param ? began_with_value(&p->begun[i], fitted, rival, param - 1)
                                : began_in_pose(p, &p->begun[i], fitted, rival, centre));
    return began;
}

// c[9] = covariance of the middle of the shape: it moves with the origin, and turns about it
static void centre_covariance(const sdm_fit_result *r, const fit_state *s, const double centre[3],
                              double c[9])
{
    const size_t n = r->n_params, size = n + 6;
    double arm[3];
    m3_apply(s->rotation, centre, arm);
    // derivative of the middle by rotation vector and translation
    const double j[3][6] = {{0, arm[2], -arm[1], 1, 0, 0},
                            {-arm[2], 0, arm[0], 0, 1, 0},
                            {arm[1], -arm[0], 0, 0, 0, 1}};
    for (size_t a = 0; a < 9; a++) c[a] = 0;
    for (size_t a = 0; a < 3; a++)
        for (size_t b = 0; b < 3; b++)
            for (size_t i = 0; i < 6; i++)
                for (size_t k = 0; k < 6; k++)
                    c[3 * a + b] += j[a][i] * r->covariance[(n + i) * size + n + k] * j[b][k];
}

// axis[9]: rows, eigenvectors of c[9], which is changed; sd[3] of each, in increasing order
static void spread_along(double *c, double sd[3], double axis[9])
{
    sdm_fit_eigen(3, c, sd, axis);
    for (int i = 0; i < 3; i++) sd[i] = sqrt(fmax(sd[i], 0));
}

// whether the turn from the fit to the rival leaves the one open axis where it is; *open: the
// number of open axes
static bool turns_openly(const sdm_fit_result *r, const fit_state *fitted, const fit_state *rival,
                         int *open)
{
    const size_t n = r->n_params, size = n + 6;
    double c[9], sd[3], axis[9], back[9], turn[9], there[3];
    for (size_t i = 0; i < 9; i++) c[i] = r->covariance[(n + i / 3) * size + n + i % 3];
    spread_along(c, sd, axis);
    *open = 0;
    for (int i = 0; i < 3; i++) *open += sd[i] > OPEN_SD;
    if (*open > 1) return true;
    if (!*open) return sdm_fit_angle_between(fitted->rotation, rival->rotation) < TILT_MAX;
    for (int i = 0; i < 9; i++) back[i] = fitted->rotation[3 * (i % 3) + i / 3];
    m3_product(rival->rotation, back, turn);
    m3_apply(turn, axis + 6, there); // the last one has the largest deviation
    return v3_dot(axis + 6, there) > cos(TILT_MAX);
}

bool sdm_fit_differs_openly(const fit_problem *p, const sdm_fit_result *r, const fit_state *fitted,
                            const fit_state *rival, const double centre[3])
{
    double c[9], sd[3], axis[9], shift[3];
    int open;
    centre_covariance(r, fitted, centre, c);
    for (int i = 0; i < 9; i++)
        if (!isfinite(c[i])) return false;
    if (!turns_openly(r, fitted, rival, &open)) return false;
    spread_along(c, sd, axis);
    centre_shift(fitted, rival, centre, shift);
    for (int i = 0; i < 3; i++) {
        const bool free = sd[i] > OPEN_SD * p->extent.reach;
        open += free;
        if (!free && fabs(v3_dot(axis + 3 * i, shift)) >
                         fmax(DEVIATIONS_MAX * sd[i], SHIFT_MAX * p->extent.reach))
            return false;
    }
    for (size_t k = 0; k < p->n_params; k++)
        if (!r->by_prior[k] &&
            fabs(rival->params[k] - fitted->params[k]) > DEVIATIONS_MAX * r->sd[k])
            return false;
    return open > 0;
}
