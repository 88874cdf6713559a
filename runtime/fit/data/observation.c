/* Observation models.
   Partial volume (Santago and Gage 1993): inside tissue j with weight w_j, outside tissue k with
   weight v_k, and a voxel with the share a of the shape has the law of the pair, mean a m_j + (1 -
   a) m_k, variance a s_j^2 + (1 - a) s_k^2, with the weight w_j v_k. Pairs are of Student's t where
   one of the two is, with the fewer degrees of freedom (heavier tails). Labels (Demarcy 2017): a
   voxel is inside with the probability mu = 1 / (1 + exp(distance / l_ref)). */
#include "observation.h"

#include <math.h>
#include <string.h>

#define LOG_2PI 1.8378770664093453

static double pair_dof(double a, double b)
{
    if (a > 0 && b > 0) return fmin(a, b);
    return a > 0 ? a : b;
}

// log of the density's constant for a scale of 1
static double law_constant(double dof)
{
    return dof > 0
               ? lgamma(0.5 * (dof + 1)) - lgamma(0.5 * dof) - 0.5 * log(dof * 3.14159265358979324)
               : -0.5 * LOG_2PI;
}

void sdm_fit_laws_prepare(const sdm_fit_opts *opts, sdm_fit_kind kind, const fit_state *state,
                          fit_laws *out)
{
    const sdm_fit_appearance *look = &state->look;
    fit_laws *l = out;
    *l = (fit_laws){.kind = kind,
                    .model = opts->image_model,
                    .l_ref = state->l_ref,
                    .point_sd = state->point_sd,
                    .point_dof = opts->point_dof,
                    .n_in = look->n_inside,
                    .n_tissues = look->n_inside + look->n_outside,
                    .n_channels = 1};
    if (kind != SDM_FIT_IMAGE) {
        l->n_in = l->n_tissues = 0;
        return;
    }
    double sum[2] = {0, 0};
    for (size_t i = 0; i < l->n_tissues; i++) {
        l->tissue[i] = i < l->n_in ? look->inside[i] : look->outside[i - l->n_in];
        sum[i >= l->n_in] += l->tissue[i].weight;
    }
    for (size_t i = 0; i < l->n_tissues; i++) {
        l->tissue[i].weight /= sum[i >= l->n_in];
        l->log_constant[i] = law_constant(l->tissue[i].dof);
        if (i >= l->n_in) l->log_outside[i - l->n_in] = (float)log(l->tissue[i].weight);
    }
    if (l->model != SDM_FIT_PARTIAL_VOLUME) return;
    l->n_channels = 1 + l->n_tissues;
    for (size_t j = 0; j < l->n_in; j++)
        for (size_t k = l->n_in; k < l->n_tissues; k++) {
            const double dof = pair_dof(l->tissue[j].dof, l->tissue[k].dof);
            l->pair[l->n_pairs++] = (fit_pair){.in = j,
                                               .out = k,
                                               .log_weight = log(l->tissue[j].weight),
                                               .dof = dof,
                                               .constant = law_constant(dof),
                                               .information = dof > 0 ? (dof + 1) / (dof + 3) : 1};
        }
}

// log density for a squared residual q in units of the scale, without the scale; *pull: weight of
// the residual, 1 for Gaussians
static double log_law(double constant, double dof, double q, double *pull)
{
    *pull = dof > 0 ? (dof + 1) / (dof + q) : 1;
    return dof > 0 ? constant - 0.5 * (dof + 1) * log1p(q / dof) : constant - 0.5 * q;
}

double sdm_fit_log_density(const fit_laws *l, size_t tissue, double value)
{
    const sdm_fit_law *t = &l->tissue[tissue];
    const double r = (value - t->mean) / t->sd;
    double pull;
    return log_law(l->log_constant[tissue], t->dof, r * r, &pull) - log(t->sd);
}

/* What a pair says of a value. */
typedef struct said {
    double log_p, variance, residual, pull;
    double mixing; // derivative of the share that the variance has, by the share
} said;

// share within 0 .. 1, for interpolation overshoots a little: with a continuous derivative, so that
// scores do not jump
static double within(double share, double *slope)
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

static said ask(const fit_laws *l, const fit_pair *p, double value, const float *place,
                double share)
{
    const sdm_fit_law *in = &l->tissue[p->in], *out = &l->tissue[p->out];
    said s;
    const double a = within(share, &s.mixing);
    s.variance = a * in->sd * in->sd + (1 - a) * out->sd * out->sd;
    s.residual = value - (share * in->mean + (1 - share) * out->mean);
    s.log_p = p->log_weight + (double)(place ? place : l->log_outside)[p->out - l->n_in] -
              0.5 * log(s.variance) +
              log_law(p->constant, p->dof, s.residual * s.residual / s.variance, &s.pull);
    return s;
}

// probabilities from logarithms, in place; returns the logarithm of their sum
static double normalise(double *log_p, size_t n)
{
    double most = log_p[0], sum = 0;
    for (size_t i = 1; i < n; i++) most = fmax(most, log_p[i]);
    for (size_t i = 0; i < n; i++) sum += log_p[i] = log_p[i] == most ? 1 : exp(log_p[i] - most);
    for (size_t i = 0; i < n; i++) log_p[i] /= sum;
    return most + log(sum);
}

static void respond_share(const fit_laws *l, double value, const float *place, double share,
                          bool derivatives, fit_response *out)
{
    said s[SDM_FIT_LAWS * SDM_FIT_LAWS];
    double p[SDM_FIT_LAWS * SDM_FIT_LAWS];
    for (size_t i = 0; i < l->n_pairs; i++) {
        s[i] = ask(l, &l->pair[i], value, place, share);
        p[i] = s[i].log_p;
    }
    out->log_likelihood = normalise(p, l->n_pairs);
    if (!derivatives) return;

    const size_t c = l->n_channels;
    memset(out->score, 0, c * sizeof *out->score);
    memset(out->root, 0, c * sizeof *out->root);
    memset(out->complete, 0, c * c * sizeof *out->complete);
    memset(out->observed, 0,
           c * c * sizeof *out->observed); // first: covariance of the scores of the pairs
    out->residual = 0;
    for (size_t i = 0; i < l->n_pairs; i++) {
        const fit_pair *q = &l->pair[i];
        const sdm_fit_law *in = &l->tissue[q->in], *tissue = &l->tissue[q->out];
        const double step = in->mean - tissue->mean;
        const double spread =
            s[i].mixing * (in->sd * in->sd - tissue->sd * tissue->sd) / s[i].variance;
        const double pulled = s[i].pull * s[i].residual, by_mean = pulled / s[i].variance;
        const double by_variance = 0.5 * spread * (pulled * s[i].residual / s[i].variance - 1);
        const size_t at[3] = {0, 1 + q->in, 1 + q->out};
        const double z[3] = {step, share, 1 - share};
        const double score[3] = {by_mean * step + by_variance, by_mean * share,
                                 by_mean * (1 - share)};
        const double weight = p[i] * q->information / s[i].variance,
                     root = sqrt(q->information / s[i].variance);
        for (int a = 0; a < 3; a++) {
            out->score[at[a]] += p[i] * score[a];
            out->root[at[a]] += p[i] * root * z[a];
            for (int b = 0; b < 3; b++) {
                out->complete[at[a] * c + at[b]] += weight * z[a] * z[b];
                out->observed[at[a] * c + at[b]] += p[i] * score[a] * score[b];
            }
        }
        out->complete[0] += p[i] * 0.5 * q->information * spread * spread;
        out->residual += p[i] * pulled / sqrt(s[i].variance * q->information);
    }
    for (size_t a = 0; a < c; a++)
        for (size_t b = 0; b < c; b++)
            out->observed[a * c + b] = out->complete[a * c + b] -
                                       (out->observed[a * c + b] - out->score[a] * out->score[b]);
    out->root[0] = copysign(sqrt(out->complete[0]), out->root[0]);
}

// log of 1 / (1 + exp(x))
static double log_inside(double x) { return x > 0 ? -x - log1p(exp(-x)) : -log1p(exp(x)); }

// log densities of inside and outside
static void mixtures(const fit_laws *l, double value, double log_f[2], double p[FIT_TISSUES_MAX])
{
    for (size_t i = 0; i < l->n_tissues; i++)
        p[i] = log(l->tissue[i].weight) + sdm_fit_log_density(l, i, value);
    log_f[0] = normalise(p, l->n_in);
    log_f[1] = normalise(p + l->n_in, l->n_tissues - l->n_in);
}

/* Probability of inside before and after the value was seen. */
static double posterior(const fit_laws *l, double value, double distance, double *log_likelihood)
{
    const double x = distance / l->l_ref;
    double log_f[2], p[FIT_TISSUES_MAX], u[2];
    mixtures(l, value, log_f, p);
    u[0] = log_inside(x) + log_f[0];
    u[1] = log_inside(-x) + log_f[1];
    *log_likelihood = normalise(u, 2);
    return u[0];
}

// a label with probability u of inside: a value seen (Bernoulli), or what EM knows of it
static void respond_label(const fit_laws *l, double u, double distance, double missing,
                          fit_response *out)
{
    const double mu = exp(log_inside(distance / l->l_ref)),
                 variance = mu * exp(log_inside(-distance / l->l_ref));
    const double scale = 1 / l->l_ref;
    out->score[0] = -scale * (u - mu);
    out->complete[0] = scale * scale * variance;
    out->observed[0] = scale * scale * (variance - missing);
    out->root[0] = -scale * sqrt(variance);
    out->residual = variance > 0 ? (u - mu) / sqrt(variance) : 0;
}

static void respond_point(const fit_laws *l, double distance, fit_response *out)
{
    const double r = distance / l->point_sd, information = (l->point_dof + 1) / (l->point_dof + 3);
    double pull;
    out->log_likelihood =
        log_law(law_constant(l->point_dof), l->point_dof, r * r, &pull) - log(l->point_sd);
    out->score[0] = -pull * r / l->point_sd;
    out->complete[0] = out->observed[0] = information / (l->point_sd * l->point_sd);
    out->root[0] = -sqrt(information) / l->point_sd;
    out->residual = pull * r / sqrt(information);
}

void sdm_fit_respond(const fit_laws *l, double value, const float *place, double field,
                     bool derivatives, fit_response *out)
{
    if (l->kind == SDM_FIT_POINTS) {
        respond_point(l, field, out);
    } else if (l->kind == SDM_FIT_LABEL) {
        const double x = field / l->l_ref;
        out->log_likelihood = (value > 0 ? value * log_inside(x) : 0) +
                              (value < 1 ? (1 - value) * log_inside(-x) : 0);
        if (derivatives) respond_label(l, value, field, 0, out);
    } else if (l->model == SDM_FIT_LABELS) {
        const double u = posterior(l, value, field, &out->log_likelihood);
        if (derivatives) respond_label(l, u, field, u * (1 - u), out);
    } else {
        respond_share(l, value, place, field, derivatives, out);
    }
}

// what rounding leaves of a share of 0 or 1: with more, voxels that cross it would make scores jump
#define FLAT 1e-12

bool sdm_fit_near(const fit_laws *l, double field)
{
    if (l->kind == SDM_FIT_POINTS) return true;
    if (l->kind == SDM_FIT_IMAGE && l->model == SDM_FIT_PARTIAL_VOLUME)
        return fabs(fabs(field - 0.5) - 0.5) > FLAT;
    return fabs(field) < 16 * l->l_ref; // mu (1 - mu) > 1e-7
}

void sdm_fit_outside(const fit_laws *l, double value, const float *place, double field,
                     double *part)
{
    double p[SDM_FIT_LAWS * SDM_FIT_LAWS];
    for (size_t i = 0; i < l->n_pairs; i++) p[i] = ask(l, &l->pair[i], value, place, field).log_p;
    (void)normalise(p, l->n_pairs);
    const double outside = 1 - (field > 0 ? fmin(field, 1) : 0);
    memset(part, 0, (l->n_tissues - l->n_in) * sizeof *part);
    for (size_t i = 0; i < l->n_pairs; i++) part[l->pair[i].out - l->n_in] += p[i] * outside;
}

/* Labels: expectation-maximisation. Partial volume: estimating equations with about the same zero;
   voxels count as the share of the tissue in them says, for squares as its eighth power: those that
   hold little else. */
void sdm_fit_moments_add(const fit_laws *l, double value, const float *place, double field,
                         fit_moments *m)
{
    if (l->model == SDM_FIT_LABELS) {
        double log_f[2], p[FIT_TISSUES_MAX], ignored;
        const double u = posterior(l, value, field, &ignored);
        mixtures(l, value, log_f, p);
        for (size_t i = 0; i < l->n_tissues; i++) {
            const sdm_fit_law *t = &l->tissue[i];
            const double r = value - t->mean, share = p[i] * (i < l->n_in ? u : 1 - u);
            const double pull = t->dof > 0 ? (t->dof + 1) / (t->dof + r * r / (t->sd * t->sd)) : 1;
            m->share[i] += share;
            m->count[i] += share * pull;
            m->first[i] += share * pull * r;
            m->n[i] += share;
            m->square[i] += share * pull * r * r;
        }
        return;
    }
    double p[SDM_FIT_LAWS * SDM_FIT_LAWS];
    said s[SDM_FIT_LAWS * SDM_FIT_LAWS];
    for (size_t i = 0; i < l->n_pairs; i++)
        s[i] = ask(l, &l->pair[i], value, place, field), p[i] = s[i].log_p;
    (void)normalise(p, l->n_pairs);
    const double a = field > 0 ? fmin(field, 1) : 0;
    for (size_t i = 0; i < l->n_pairs; i++) {
        const size_t tissue[2] = {l->pair[i].in, l->pair[i].out};
        for (int side = 0; side < 2; side++) {
            const size_t t = tissue[side];
            const double own = side ? 1 - a : a, w = p[i] * pow(own, 8);
            m->share[t] += p[i] * own;
            m->n[t] += w;
            m->square[t] += w * s[i].pull * s[i].residual * s[i].residual;
        }
    }
}

void sdm_fit_moments_apply(const fit_laws *l, const fit_moments *m, const bool *kept,
                           double least_sd, sdm_fit_appearance *look)
{
    double sum[2] = {0, 0};
    for (size_t i = 0; i < l->n_tissues; i++) sum[i >= l->n_in] += m->share[i];
    for (size_t i = 0; i < l->n_tissues; i++) {
        sdm_fit_law *t = i < l->n_in ? &look->inside[i] : &look->outside[i - l->n_in];
        // a tissue that is hardly there keeps its law, so that it can come back
        if (sum[i >= l->n_in] > 0) t->weight = fmax(m->share[i] / sum[i >= l->n_in], 1e-6);
        if (kept[i]) continue;
        const double moved = l->model == SDM_FIT_LABELS ? m->first[i] / m->count[i] : 0;
        t->mean += moved;
        const double square = m->square[i] - moved * moved * m->count[i];
        t->sd = fmax(sqrt(fmax(square / m->n[i], 0)), least_sd);
    }
}
