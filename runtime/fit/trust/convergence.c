/* Convergence of a fit: the movement of each unknown in the last iterations, as a share of its
 * standard deviation. */
#include "convergence.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit/data/source_params.h"
#include "fit/solver/newton.h"
#include "fit/solver/recent.h"
#include "sdm/internal/hardly_known.h"

// an unknown has converged when it moves by no more than this share of its sd
#define UNREST_MAX 0.1

// movement of unknown i in the last iterations; where there were too few, its last step
static double movement(const fit_problem *p, size_t i)
{
    const size_t n = p->recent.n;
    return n >= FIT_RECENT || !n ? sdm_fit_unrest(p, i) : fabs(p->recent.step[n - 1][i]);
}

// the unknown that moves most in the last iterations, and by how many of its standard deviations
// (*most); infinite where this cannot be told
static size_t most_restless(const fit_problem *p, const sdm_fit_result *r,
                            double (*moves)(const fit_problem *p, size_t i), double *most)
{
    size_t worst = 0;
    *most = 0;
    for (size_t i = 0; i < p->n_params + 6; i++) {
        const bool kept = i < p->n_params ? fit_param_is_kept(p, i) : p->opts->keep_pose;
        if (kept) continue;
        double unrest = moves(p, i) / r->sd[i];
        if (isnan(unrest)) unrest = INFINITY; // an unknown without a sd
        if (unrest > *most) *most = unrest, worst = i;
    }
    return worst;
}

void sdm_fit_accept_small_steps(const fit_problem *p, sdm_fit_result *r)
{
    double most;
    if (r->converged) return;
    (void)most_restless(p, r, sdm_fit_unrest, &most);
    if (!(most <= UNREST_MAX)) return;
    r->converged = true;
    snprintf(r->reason, sizeof r->reason,
             "the last steps move every unknown by at most %.2g of its standard deviation", most);
}

// text[size] = the parameters that the data hardly determine; empty: there are none, or too few
// iterations were made to blame them
static void name_hardly_known(const fit_problem *p, const sdm_fit_result *r, char *text,
                              size_t size)
{
    *text = '\0';
    for (size_t k = 0; k < p->n_params && r->n_iterations >= FIT_ITERATIONS_USUAL; k++) {
        double low, high;
        const char *name;
        if (!sdm_fit_hardly_known(r, k)) continue;
        sdm_fit_bounds(p->source, k, &low, &high, &name);
        const size_t used = strlen(text);
        snprintf(text + used, size - used, "%s%.40s", used ? ", " : "", name);
    }
}

static const char *unknown_name(const fit_problem *p, size_t i)
{
    static const char *const pose[6] = {"rotation about x",    "rotation about y",
                                        "rotation about z",    "translation along x",
                                        "translation along y", "translation along z"};
    double low, high;
    const char *name = NULL;
    if (i >= p->n_params) return pose[i - p->n_params];
    sdm_fit_bounds(p->source, i, &low, &high, &name);
    return name;
}

// text[size] = what may end the iterations, besides more of them and another start. Returns whether
// more of them may help. worst: the unknown that moves most; hidden: the damping hides it; swings:
// it goes to and fro; unknown: the parameters that the data hardly determine
static bool name_remedy(const fit_problem *p, const sdm_fit_result *r, size_t worst, bool hidden,
                        bool swings, const char *unknown, char *text, size_t size)
{
    const bool own = worst < p->n_params, many = strchr(unknown, ',');
    // what the data do not determine moves on with more iterations, too; where damping hides what
    // moves, it is the likeliest; and the others go to and fro with it
    if (*unknown && (hidden || swings || (own && sdm_fit_hardly_known(r, worst)))) {
        snprintf(text, size,
                 "the data hardly determine %s: keep %s (sdm_fit_opts.kept), or give data that "
                 "determine %s",
                 unknown, many ? "them at known values" : "it at a known value",
                 many ? "them" : "it");
        return false;
    }
    if (*unknown)
        snprintf(text, size,
                 "a nearer start, or known values (sdm_fit_opts.kept) of %s, which the "
                 "data hardly determine",
                 unknown);
    else if (own && !hidden)
        snprintf(text, size,
                 "a nearer start, or data that determine %.60s, or keep it at a known value "
                 "(sdm_fit_opts.kept)",
                 unknown_name(p, worst));
    else
        snprintf(text, size, "a nearer start, or data that determine what still moves");
    return !swings;
}

static void not_converged(const fit_problem *p, const sdm_fit_result *r, sdm_error *err)
{
    double most;
    const size_t worst = most_restless(p, r, movement, &most);
    const char *name = unknown_name(p, worst);
    char moves[200] = "", remedy[400], unknown[200];
    const bool swings = isfinite(most) && sdm_fit_swing(p, worst) > UNREST_MAX * r->sd[worst];
    if (isnan(r->sd[worst]))
        snprintf(moves, sizeof moves, "; %.100s may still move, its standard deviation is unknown",
                 name);
    else if (isfinite(most))
        snprintf(moves, sizeof moves,
                 swings ? "; %.100s still goes to and fro by %.2g of its standard deviation, need "
                          "%.2g"
                        : "; %.100s still moves by %.2g of its standard deviation, need %.2g",
                 name, most, UNREST_MAX);
    name_hardly_known(p, r, unknown, sizeof unknown);
    // whoever has allowed more iterations already is not told to allow more
    const bool more = name_remedy(p, r, worst, !*moves, swings, unknown, remedy, sizeof remedy) &&
                      p->opts->max_iterations <= FIT_ITERATIONS_USUAL;
    sdm_fail(err, SDM_E_QUALITY, "not converged after %zu iterations (%s%s): %s%s", r->n_iterations,
             r->reason, moves, more ? "more of them (sdm_fit_opts.max_iterations), " : "", remedy);
}

void sdm_fit_name_restless(const fit_problem *p, sdm_fit_result *r, sdm_error *err)
{
    for (size_t i = 0; i < r->verdict.n_findings && !r->converged; i++) {
        sdm_fit_finding *f = &r->verdict.findings[i];
        if (f->kind != SDM_FIT_CHECK_CONVERGED) continue;
        sdm_error named = {0};
        not_converged(p, r, &named);
        if (err && !strcmp(err->text, f->text)) *err = named;
        snprintf(f->text, sizeof f->text, "%.511s", named.text);
    }
}
