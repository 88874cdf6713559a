/* One step is one of expectation-maximisation, or like it: see sdm_fit_moments_add(). */
#include "tissues.h"

#include <math.h>

#include "tissue_field.h"

// fewer say nothing of a law
#define VALUES_LEAST 10.0

static bool has_means(const fit_problem *p) { return p->opts->image_model == SDM_FIT_LABELS; }

// contrast of the start
static double contrast(const fit_problem *p)
{
    return fabs(p->opts->appearance.inside[0].mean - p->opts->appearance.outside[0].mean);
}

static sdm_fit_law *tissue(sdm_fit_appearance *a, size_t i)
{
    return i < a->n_inside ? &a->inside[i] : &a->outside[i - a->n_inside];
}

size_t sdm_fit_look_numbers(const fit_problem *p, double *x)
{
    fit_state s = p->state;
    size_t n = 0;
    if (p->target->kind == SDM_FIT_POINTS) x[n++] = log(s.point_sd);
    for (size_t i = 0; p->target->kind == SDM_FIT_IMAGE && i < s.look.n_inside + s.look.n_outside;
         i++) {
        const sdm_fit_law *t = tissue(&s.look, i);
        x[n++] = log(t->weight);
        x[n++] = log(t->sd);
        if (has_means(p)) x[n++] = t->mean / contrast(p);
    }
    return n;
}

void sdm_fit_look_set(fit_problem *p, const double *x)
{
    fit_state *s = &p->state;
    if (p->target->kind == SDM_FIT_POINTS) s->point_sd = exp(*x);
    for (size_t i = 0; p->target->kind == SDM_FIT_IMAGE && i < s->look.n_inside + s->look.n_outside;
         i++) {
        sdm_fit_law *t = tissue(&s->look, i);
        t->weight = exp(*x++);
        t->sd = exp(*x++);
        if (has_means(p)) t->mean = contrast(p) * *x++;
    }
    sdm_fit_laws_prepare(p->opts, p->target->kind, s, &p->laws);
    for (size_t i = 0; i < p->laws.n_tissues; i++)
        tissue(&s->look, i)->weight = p->laws.tissue[i].weight; // sum to 1
}

void sdm_fit_look_settle(fit_problem *p)
{
    if (p->target->kind != SDM_FIT_IMAGE || p->opts->keep_appearance) return;
    fit_moments m;
    sdm_fit_appearance start = p->opts->appearance;
    sdm_fit_sums_moments(&p->sites, &p->laws, p->opts->n_threads, &m);
    for (size_t i = 0; i < p->laws.n_tissues; i++) {
        p->absent[i] = !(m.n[i] > fmax(p->noise_factor, VALUES_LEAST));
        if (!p->absent[i]) continue;
        sdm_fit_law *t = tissue(&p->state.look, i);
        t->mean = tissue(&start, i)->mean;
        t->sd = tissue(&start, i)->sd;
    }
}

sdm_status sdm_fit_look_update(fit_problem *p, sdm_error *err)
{
    const sdm_status s = sdm_fit_places_update(p, err);
    if (s) return s;
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
        bool kept[FIT_TISSUES_MAX];
        for (size_t i = 0; i < p->laws.n_tissues; i++)
            kept[i] = p->absent[i] || !(m.n[i] > VALUES_LEAST);
        sdm_fit_moments_apply(&p->laws, &m, kept, 1e-3 * contrast(p), &p->state.look);
    } else {
        return SDM_OK;
    }
    sdm_fit_laws_prepare(p->opts, p->target->kind, &p->state, &p->laws);
    sdm_fit_sums_fill(&p->sums, &p->sites, &p->laws, p->opts->n_threads);
    return SDM_OK;
}
