/* Observation models of images, label maps and points.

   Partial volume (Santago and Gage 1993): a voxel holds one inside tissue j (weight w_j) and one
   outside tissue k (weight v_k). With the share a of the shape its value has the mean a m_j + (1 -
   a) m_k and the variance a s_j^2 + (1 - a) s_k^2; the pair has the weight w_j v_k. If one tissue
   of a pair has a Student's t distribution, so has the pair; if both have, the smaller number of
   degrees of freedom counts (heavier tails).

   Labels (Demarcy 2017): a voxel is inside with probability mu = 1 / (1 + exp(distance / l_ref)),
   and its value comes from the inside or the outside tissues. */
#include "observation.h"

#include <math.h>
#include <string.h>

#define LOG_2PI 1.8378770664093453

// degrees of freedom of a pair: the smaller number (heavier tails), 0 if both tissues are Gaussian
static double pair_dof(double a, double b)
{
    if (a > 0 && b > 0) return fmin(a, b);
    return a > 0 ? a : b;
}

// log of the normalising constant of a density with scale 1; dof = 0: Gaussian
static double law_constant(double dof)
{
    return dof > 0
               ? lgamma(0.5 * (dof + 1)) - lgamma(0.5 * dof) - 0.5 * log(dof * 3.14159265358979324)
               : -0.5 * LOG_2PI;
}

void sdm_fit_observation_prepare(const sdm_fit_opts *opts, sdm_fit_kind kind,
                                 const fit_state *state, fit_observation *obs)
{
    const sdm_fit_appearance *appearance = &state->appearance;
    *obs = (fit_observation){.kind = kind,
                             .model = opts->image_model,
                             .l_ref = state->l_ref,
                             .point_sd = state->point_sd,
                             .point_dof = opts->point_dof,
                             .outliers = state->outliers,
                             .outlier_density = state->outlier_density,
                             .n_in = appearance->n_inside,
                             .n_tissues = appearance->n_inside + appearance->n_outside,
                             .n_channels = 1};
    // only images have tissues
    if (kind != SDM_FIT_IMAGE) {
        obs->n_in = obs->n_tissues = 0;
        return;
    }
    // tissues with normalised weights
    double sum[2] = {0, 0};
    for (size_t i = 0; i < obs->n_tissues; i++) {
        obs->tissue[i] = i < obs->n_in ? appearance->inside[i] : appearance->outside[i - obs->n_in];
        sum[i >= obs->n_in] += obs->tissue[i].weight;
    }
    for (size_t i = 0; i < obs->n_tissues; i++) {
        obs->tissue[i].weight /= sum[i >= obs->n_in];
        obs->log_constant[i] = law_constant(obs->tissue[i].dof);
        if (i >= obs->n_in) obs->log_outside[i - obs->n_in] = (float)log(obs->tissue[i].weight);
    }
    if (obs->model != SDM_FIT_PARTIAL_VOLUME) return;
    // partial volume: pairs of tissues
    obs->n_channels = 1 + obs->n_tissues;
    for (size_t j = 0; j < obs->n_in; j++)
        for (size_t k = obs->n_in; k < obs->n_tissues; k++) {
            const double dof = pair_dof(obs->tissue[j].dof, obs->tissue[k].dof);
            obs->pair[obs->n_pairs++] =
                (fit_pair){.in = j,
                           .out = k,
                           .log_weight = log(obs->tissue[j].weight),
                           .dof = dof,
                           .constant = law_constant(dof),
                           .information = dof > 0 ? (dof + 1) / (dof + 3) : 1};
        }
}

// log density without the term of the scale; q: squared residual over squared scale; *t_weight:
// robust weight of the residual by Student's t, 1 for Gaussians
static double log_law(double constant, double dof, double q, double *t_weight)
{
    *t_weight = dof > 0 ? (dof + 1) / (dof + q) : 1;
    return dof > 0 ? constant - 0.5 * (dof + 1) * log1p(q / dof) : constant - 0.5 * q;
}

double sdm_fit_log_density(const fit_observation *obs, size_t tissue, double value)
{
    const sdm_fit_law *t = &obs->tissue[tissue];
    const double r = (value - t->mean) / t->sd;
    double t_weight;
    return log_law(obs->log_constant[tissue], t->dof, r * r, &t_weight) - log(t->sd);
}

/* A sample under the hypothesis that its voxel holds one pair of tissues. */
typedef struct pair_likelihood {
    /* log of weight times density; variance of the value; value less its mean; robust weight */
    double log_p, variance, residual, t_weight;
    /* derivative of the clamped share by the share; the variance uses the clamped share */
    double slope;
} pair_likelihood;

// Clamps a share to 0 .. 1, because interpolation overshoots a little. Its derivative *slope is
// continuous, so that scores do not jump.
static double share_clamp(double share, double *slope)
{
    const double width = 4e-3, side = share < 0.5 ? share : 1 - share;
    double a = side;
    *slope = 1;
    if (side < width) {
        const double way = fmax(side + width, 0);
        a = 0.25 * way * way / width;
        *slope = 0.5 * way / width;
    }
    return share < 0.5 ? a : 1 - a;
}

// evaluates one pair of tissues at a voxel with this share
static pair_likelihood pair_evaluate(const fit_observation *obs, const fit_pair *p, double value,
                                     const float *log_weight, double share)
{
    const sdm_fit_law *in = &obs->tissue[p->in], *out = &obs->tissue[p->out];
    pair_likelihood s;
    const double a = share_clamp(share, &s.slope);
    s.variance = a * in->sd * in->sd + (1 - a) * out->sd * out->sd;
    s.residual = value - (share * in->mean + (1 - share) * out->mean);
    s.log_p = p->log_weight +
              (double)(log_weight ? log_weight : obs->log_outside)[p->out - obs->n_in] -
              0.5 * log(s.variance) +
              log_law(p->constant, p->dof, s.residual * s.residual / s.variance, &s.t_weight);
    return s;
}

// replaces the logarithms log_p[n] by probabilities that sum to 1. The sum of exp(log_p) of the
// given values is *sum * exp(returned value)
static double probabilities(double *log_p, size_t n, double *sum)
{
    double most = -INFINITY, all = 0;
    for (size_t i = 0; i < n; i++) most = log_p[i] > most ? log_p[i] : most;
    for (size_t i = 0; i < n; i++) all += log_p[i] = log_p[i] == most ? 1 : exp(log_p[i] - most);
    for (size_t i = 0; i < n; i++) log_p[i] /= all;
    *sum = all;
    return most;
}

// the same, and returns log(sum of exp(log_p)) of the given values
static double normalise(double *log_p, size_t n)
{
    double sum;
    const double most = probabilities(log_p, n, &sum);
    return most + log(sum);
}

static void likelihood_of_share(const fit_observation *obs, double value, const float *log_weight,
                                double share, bool derivatives, fit_likelihood *out)
{
    pair_likelihood s[SDM_FIT_LAWS * SDM_FIT_LAWS];
    double p[SDM_FIT_LAWS * SDM_FIT_LAWS];
    for (size_t i = 0; i < obs->n_pairs; i++) {
        s[i] = pair_evaluate(obs, &obs->pair[i], value, log_weight, share);
        p[i] = s[i].log_p;
    }
    // p: probability of each pair given the value
    out->log_likelihood = normalise(p, obs->n_pairs);
    if (!derivatives) return;

    // expectation over the pairs, given the value, of scores and information
    const size_t c = obs->n_channels;
    memset(out->score, 0, c * sizeof *out->score);
    memset(out->root, 0, c * sizeof *out->root);
    memset(out->complete, 0, c * c * sizeof *out->complete);
    // `observed` first accumulates the covariance of the scores over the pairs
    memset(out->observed, 0, c * c * sizeof *out->observed);
    out->residual = 0;
    for (size_t i = 0; i < obs->n_pairs; i++) {
        const fit_pair *q = &obs->pair[i];
        const sdm_fit_law *in = &obs->tissue[q->in], *tissue = &obs->tissue[q->out];
        const double step = in->mean - tissue->mean;
        const double spread =
            s[i].slope * (in->sd * in->sd - tissue->sd * tissue->sd) / s[i].variance;
        const double weighted = s[i].t_weight * s[i].residual, by_mean = weighted / s[i].variance;
        const double by_variance = 0.5 * spread * (weighted * s[i].residual / s[i].variance - 1);
        // derivatives of the mean of the value (z) and of its log density (score) by the three
        // channels that the pair depends on
        const size_t at[3] = {0, 1 + q->in, 1 + q->out};
        const double z[3] = {step, share, 1 - share};
        const double score[3] = {by_mean * step + by_variance, by_mean * share,
                                 by_mean * (1 - share)};
        const double weight = p[i] * q->information / s[i].variance,
                     root = sqrt(q->information / s[i].variance);
        // add, weighted by the probability of the pair
        for (int a = 0; a < 3; a++) {
            out->score[at[a]] += p[i] * score[a];
            out->root[at[a]] += p[i] * root * z[a];
            for (int b = 0; b < 3; b++) {
                out->complete[at[a] * c + at[b]] += weight * z[a] * z[b];
                out->observed[at[a] * c + at[b]] += p[i] * score[a] * score[b];
            }
        }
        // the share also changes the variance
        out->complete[0] += p[i] * 0.5 * q->information * spread * spread;
        out->residual += p[i] * weighted / sqrt(s[i].variance * q->information);
    }
    // observed = complete - covariance of the scores of the pairs
    for (size_t a = 0; a < c; a++)
        for (size_t b = 0; b < c; b++)
            out->observed[a * c + b] = out->complete[a * c + b] -
                                       (out->observed[a * c + b] - out->score[a] * out->score[b]);
    out->root[0] = copysign(sqrt(out->complete[0]), out->root[0]);
}

// log of 1 / (1 + exp(x)), without overflow
static double log_inside(double x) { return x > 0 ? -x - log1p(exp(-x)) : -log1p(exp(x)); }

// log_f[2]: log density of the value inside and outside; p: probability of each tissue among the
// tissues of its side, given the value
static void mixtures(const fit_observation *obs, double value, double log_f[2],
                     double p[FIT_TISSUES_MAX])
{
    for (size_t i = 0; i < obs->n_tissues; i++)
        p[i] = log(obs->tissue[i].weight) + sdm_fit_log_density(obs, i, value);
    log_f[0] = normalise(p, obs->n_in);
    log_f[1] = normalise(p + obs->n_in, obs->n_tissues - obs->n_in);
}

/* Probability that the voxel is inside given its value, by Bayes' rule from the logistic prior. */
static double posterior(const fit_observation *obs, double value, double distance,
                        double *log_likelihood)
{
    const double x = distance / obs->l_ref;
    double log_f[2], p[FIT_TISSUES_MAX], u[2];
    mixtures(obs, value, log_f, p);
    u[0] = log_inside(x) + log_f[0];
    u[1] = log_inside(-x) + log_f[1];
    *log_likelihood = normalise(u, 2);
    return u[0];
}

// A voxel that is inside with probability u. missing = 0: u is an observed label. missing = u (1 -
// u): u is the posterior probability of expectation-maximisation, and the information is smaller
// because the label is not observed.
static void likelihood_of_label(const fit_observation *obs, double u, double distance,
                                double missing, fit_likelihood *out)
{
    const double mu = exp(log_inside(distance / obs->l_ref)),
                 variance = mu * exp(log_inside(-distance / obs->l_ref));
    const double scale = 1 / obs->l_ref;
    out->score[0] = -scale * (u - mu);
    out->complete[0] = scale * scale * variance;
    out->observed[0] = scale * scale * (variance - missing);
    out->root[0] = -scale * sqrt(variance);
    out->residual = variance > 0 ? (u - mu) / sqrt(variance) : 0;
}

// log density of the distance of a point that is no outlier; *t_weight as in log_law()
static double log_point(const fit_observation *obs, double distance, double *t_weight)
{
    const double r = distance / obs->point_sd;
    return log_law(law_constant(obs->point_dof), obs->point_dof, r * r, t_weight) -
           log(obs->point_sd);
}

// the probability that the point is no outlier, and the log density of its distance
static double point_belongs(const fit_observation *obs, double distance, double *t_weight,
                            double *log_likelihood)
{
    const double log_p = log_point(obs, distance, t_weight);
    *log_likelihood = log_p;
    if (!(obs->outliers > 0)) return 1;
    double u[2] = {log(1 - obs->outliers) + log_p, log(obs->outliers * obs->outlier_density)};
    *log_likelihood = normalise(u, 2);
    return u[0];
}

double sdm_fit_point_belongs(const fit_observation *obs, double distance)
{
    double ignored, t_weight;
    return point_belongs(obs, distance, &t_weight, &ignored);
}

// Student's t about the surface, mixed with outliers at any distance
static void likelihood_of_point(const fit_observation *obs, double distance, fit_likelihood *out)
{
    const double r = distance / obs->point_sd,
                 information = (obs->point_dof + 1) / (obs->point_dof + 3);
    double t_weight;
    const double belongs = point_belongs(obs, distance, &t_weight, &out->log_likelihood),
                 score = -t_weight * r / obs->point_sd;
    out->score[0] = belongs * score;
    out->complete[0] = belongs * information / (obs->point_sd * obs->point_sd);
    out->observed[0] = out->complete[0] - belongs * (1 - belongs) * score * score;
    out->root[0] = -sqrt(information) / obs->point_sd;
    out->residual = belongs * t_weight * r / sqrt(information);
}

void sdm_fit_likelihood(const fit_observation *obs, double value, const float *log_weight,
                        double field, bool derivatives, fit_likelihood *out)
{
    if (obs->kind == SDM_FIT_POINTS) {
        likelihood_of_point(obs, field, out);
    } else if (obs->kind == SDM_FIT_LABEL) {
        const double x = field / obs->l_ref;
        out->log_likelihood = (value > 0 ? value * log_inside(x) : 0) +
                              (value < 1 ? (1 - value) * log_inside(-x) : 0);
        if (derivatives) likelihood_of_label(obs, value, field, 0, out);
    } else if (obs->model == SDM_FIT_LABELS) {
        const double u = posterior(obs, value, field, &out->log_likelihood);
        if (derivatives) likelihood_of_label(obs, u, field, u * (1 - u), out);
    } else {
        likelihood_of_share(obs, value, log_weight, field, derivatives, out);
    }
}

// A share that differs from 0 or 1 by at most this much counts as 0 or 1. It covers rounding only:
// with a larger value scores would jump where voxels cross the threshold.
#define SHARE_ROUNDING 1e-12

bool sdm_fit_in_band(const fit_observation *obs, double field)
{
    if (obs->kind == SDM_FIT_POINTS) return true;
    if (obs->kind == SDM_FIT_IMAGE && obs->model == SDM_FIT_PARTIAL_VOLUME)
        return fabs(fabs(field - 0.5) - 0.5) > SHARE_ROUNDING;
    return fabs(field) < 16 * obs->l_ref; // mu (1 - mu) > 1e-7
}

void sdm_fit_outside_shares(const fit_observation *obs, double value, const float *log_weight,
                            double field, double *part)
{
    double p[SDM_FIT_LAWS * SDM_FIT_LAWS], sum;
    for (size_t i = 0; i < obs->n_pairs; i++)
        p[i] = pair_evaluate(obs, &obs->pair[i], value, log_weight, field).log_p;
    (void)probabilities(p, obs->n_pairs, &sum);
    const double outside = 1 - (field > 0 ? fmin(field, 1) : 0);
    memset(part, 0, (obs->n_tissues - obs->n_in) * sizeof *part);
    for (size_t i = 0; i < obs->n_pairs; i++) part[obs->pair[i].out - obs->n_in] += p[i] * outside;
}

/* Labels: the moments of expectation-maximisation. Partial volume: moments whose estimates have
 * nearly the same zero as the score. The weight of a voxel is the share of it that the tissue
 * fills, for squared residuals the eighth power of this share, which nearly excludes mixed
 * voxels. */
void sdm_fit_moments_add(const fit_observation *obs, double value, const float *log_weight,
                         double field, fit_moments *m)
{
    if (obs->model == SDM_FIT_LABELS) {
        // labels: probability of the side given the value, times the probability of each tissue of
        // this side
        double log_f[2], p[FIT_TISSUES_MAX], ignored;
        const double u = posterior(obs, value, field, &ignored);
        mixtures(obs, value, log_f, p);
        // with the robust weights of Student's t the estimate is one of iterative reweighting
        for (size_t i = 0; i < obs->n_tissues; i++) {
            const sdm_fit_law *t = &obs->tissue[i];
            const double r = value - t->mean, share = p[i] * (i < obs->n_in ? u : 1 - u);
            const double t_weight =
                t->dof > 0 ? (t->dof + 1) / (t->dof + r * r / (t->sd * t->sd)) : 1;
            m->share[i] += share;
            m->count[i] += share * t_weight;
            m->first[i] += share * t_weight * r;
            m->n[i] += share;
            m->square[i] += share * t_weight * r * r;
        }
        return;
    }
    // partial volume: probability of each pair given the value
    double p[SDM_FIT_LAWS * SDM_FIT_LAWS], sum;
    pair_likelihood s[SDM_FIT_LAWS * SDM_FIT_LAWS];
    for (size_t i = 0; i < obs->n_pairs; i++)
        s[i] = pair_evaluate(obs, &obs->pair[i], value, log_weight, field), p[i] = s[i].log_p;
    (void)probabilities(p, obs->n_pairs, &sum);
    // both tissues of each pair
    const double a = field > 0 ? fmin(field, 1) : 0;
    for (size_t i = 0; i < obs->n_pairs; i++) {
        const size_t tissue[2] = {obs->pair[i].in, obs->pair[i].out};
        for (int side = 0; side < 2; side++) {
            const size_t t = tissue[side];
            const double own = side ? 1 - a : a, w = p[i] * pow(own, 8);
            m->share[t] += p[i] * own;
            m->n[t] += w;
            m->square[t] += w * s[i].t_weight * s[i].residual * s[i].residual;
        }
    }
}

void sdm_fit_moments_apply(const fit_observation *obs, const fit_moments *m, const bool *kept,
                           double min_sd, sdm_fit_appearance *appearance)
{
    double sum[2] = {0, 0};
    for (size_t i = 0; i < obs->n_tissues; i++) sum[i >= obs->n_in] += m->share[i];
    for (size_t i = 0; i < obs->n_tissues; i++) {
        sdm_fit_law *t =
            i < obs->n_in ? &appearance->inside[i] : &appearance->outside[i - obs->n_in];
        // the weight is at least 1e-6, so that a tissue that is nearly absent can return
        if (sum[i >= obs->n_in] > 0) t->weight = fmax(m->share[i] / sum[i >= obs->n_in], 1e-6);
        if (kept[i]) continue;
        // labels: the mean moves, and the variance is about the new mean
        const double moved = obs->model == SDM_FIT_LABELS ? m->first[i] / m->count[i] : 0;
        t->mean += moved;
        const double square = m->square[i] - moved * moved * m->count[i];
        t->sd = fmax(sqrt(fmax(square / m->n[i], 0)), min_sd);
    }
}
