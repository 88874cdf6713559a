/* Re-estimation of the tissues by expectation-maximisation, or by moments that converge to nearly
 * the same estimate, see sdm_fit_moments_add(). */
#include "tissues.h"

#include <math.h>

#include "tissue_field.h"

// samples below which a distribution cannot be estimated
#define VALUES_MIN 10.0

// whether the means are re-estimated here; with partial volume they are unknowns of Newton's method
static bool means_estimated(const fit_problem *p) { return p->opts->image_model == SDM_FIT_LABELS; }

// difference of the start means of the first inside and the first outside tissue
static double contrast(const fit_problem *p)
{
    return fabs(p->opts->appearance.inside[0].mean - p->opts->appearance.outside[0].mean);
}

// smallest sd of points, over the reach of the shape: fewer points than unknowns may lie on it
// exactly
#define POINT_SD_LEAST 1e-5

// the share of outliers stays where it can still change
static double outliers_limit(double share) { return fmin(fmax(share, 1e-6), 0.9); }

static sdm_fit_law *tissue_law(sdm_fit_appearance *a, size_t i)
{
    return i < a->n_inside ? &a->inside[i] : &a->outside[i - a->n_inside];
}

size_t sdm_fit_appearance_pack(const fit_problem *p, double *x)
{
    fit_state s = p->state;
    size_t n = 0;
    if (p->target->kind == SDM_FIT_POINTS) {
        x[n++] = log(s.point_sd);
        x[n++] = log(s.outliers / (1 - s.outliers));
    }
    for (size_t i = 0; i < p->observation.n_tissues; i++) {
        const sdm_fit_law *t = tissue_law(&s.appearance, i);
        x[n++] = log(t->weight);
        x[n++] = log(t->sd);
        if (means_estimated(p)) x[n++] = t->mean / contrast(p);
    }
    return n;
}

void sdm_fit_appearance_unpack(fit_problem *p, const double *x)
{
    fit_state *s = &p->state;
    if (p->target->kind == SDM_FIT_POINTS) {
        s->point_sd = fmax(exp(x[0]), POINT_SD_LEAST * p->extent.reach);
        s->outliers = outliers_limit(1 / (1 + exp(-x[1])));
    }
    for (size_t i = 0; i < p->observation.n_tissues; i++) {
        sdm_fit_law *t = tissue_law(&s->appearance, i);
        t->weight = exp(*x++);
        t->sd = exp(*x++);
        if (means_estimated(p)) t->mean = contrast(p) * *x++;
    }
    sdm_fit_observation_prepare(p->opts, p->target->kind, s, &p->observation);
    for (size_t i = 0; i < p->observation.n_tissues; i++)
        tissue_law(&s->appearance, i)->weight = p->observation.tissue[i].weight; // normalised
}

void sdm_fit_appearance_mark_absent(fit_problem *p)
{
    if (p->target->kind != SDM_FIT_IMAGE || p->opts->keep_appearance) return;
    fit_moments m;
    sdm_fit_appearance start = p->opts->appearance;
    sdm_fit_samples_moments(&p->samples, &p->observation, p->opts->n_threads, &m);
    for (size_t i = 0; i < p->observation.n_tissues; i++) {
        p->absent[i] = !(m.n[i] > fmax(p->noise_factor, VALUES_MIN));
        if (!p->absent[i]) continue;
        sdm_fit_law *t = tissue_law(&p->state.appearance, i);
        t->mean = tissue_law(&start, i)->mean;
        t->sd = tissue_law(&start, i)->sd;
    }
}

// points: share of the outliers, and scale of Student's t by iterated reweighting of the others
static void points_update(fit_problem *p)
{
    const double dof = p->opts->point_dof;
    double sum = 0, n = 0;
    for (size_t i = 0; i < p->samples.n; i++) {
        const double r = p->samples.field[i] / p->state.point_sd,
                     w = sdm_fit_point_belongs(&p->observation, p->samples.field[i]);
        sum += w * (dof + 1) / (dof + r * r) * r * r;
        n += w;
    }
    p->state.point_sd = fmax(p->state.point_sd * sqrt(fmax(sum / fmax(n, 1), 1e-6)),
                             POINT_SD_LEAST * p->extent.reach);
    p->state.outliers = outliers_limit(1 - n / (double)p->samples.n);
}

sdm_status sdm_fit_appearance_update(fit_problem *p, sdm_error *err)
{
    const sdm_status s = sdm_fit_tissue_field_update(p, err);
    if (s) return s;
    if (p->target->kind == SDM_FIT_POINTS) {
        points_update(p);
    } else if (p->target->kind == SDM_FIT_IMAGE) {
        fit_moments m;
        sdm_fit_samples_moments(&p->samples, &p->observation, p->opts->n_threads, &m);
        bool kept[FIT_TISSUES_MAX];
        for (size_t i = 0; i < p->observation.n_tissues; i++)
            kept[i] = p->absent[i] || !(m.n[i] > VALUES_MIN);
        sdm_fit_moments_apply(&p->observation, &m, kept, 1e-3 * contrast(p), &p->state.appearance);
    } else {
        return SDM_OK;
    }
    sdm_fit_observation_prepare(p->opts, p->target->kind, &p->state, &p->observation);
    sdm_fit_information_compute(&p->information, &p->samples, &p->observation, p->opts->n_threads);
    return SDM_OK;
}
