/* Iterations: from a state to the nearest maximum of the posterior. */
#ifndef FIT_NEWTON_H
#define FIT_NEWTON_H

#include "information.h"
#include "solve.h"

/* All of one fit. */
typedef struct fit_problem {
    const sdm_fit_source *source;
    const sdm_fit_target *target;
    const sdm_fit_opts *opts;
    bool given_labels; // the target is a label map, taken as an image
    size_t n_params;
    double low[FIT_PARAMS_MAX], high[FIT_PARAMS_MAX]; // bounds
    fit_state prior;                                  // pose the priors are about
    double prior_weight[FIT_PARAMS_MAX + 6];          // see sdm_fit_weigh_priors()
    double noise_factor; // by which the log-likelihood counts correlated values too often
    fit_extent extent;   // of the shape at the start

    fit_maps maps;
    double maps_at[FIT_PARAMS_MAX], packed_blur; // what maps holds; NaN: nothing yet
    fit_sites sites;
    size_t stride; // every how many voxels of the image are sites
    fit_laws laws;
    fit_state state;
    bool absent[FIT_TISSUES_MAX]; // tissues (inside first) that the image does not hold:
                                  // sdm_fit_look_settle()
    bool places;                  // tissues outside may have places: sdm_fit_places_update()
    fit_sums sums, trial;         // at the state, and at a state that is tried

    double *objective; // [n_iterations]
    size_t n_iterations, objective_capacity, n_steps;
} fit_problem;

/* What an iteration may change, and when it ends. */
typedef struct fit_run {
    sdm_fit_phase phase;
    bool keep_params, keep_pose, keep_blur, keep_look;
    size_t max_iterations;
    double eps;
    int flat_most; // so many steps in a row that promise no gain are an end, too; 0: not
    bool averaged; // steps by averaged derivatives, see creases.h
    double way[FIT_PARAMS_MAX]; // what they are averaged over
} fit_run;

typedef struct fit_ended {
    bool converged;
    bool rough;  // not by the size of the steps, but because they promise no gain
    double step; // the last
} fit_ended;

/* Maps, samples and sums at problem->state. */
sdm_status sdm_fit_look(fit_problem *p, sdm_error *err);

/* Sd of the Gaussian that the field is seen through at problem->state, mm. */
double sdm_fit_field_blur(const fit_problem *p);

/* Log-likelihood at problem->state but for its parameters. The next look makes its maps anew. */
sdm_status sdm_fit_value(fit_problem *p, const double *params, double *log_likelihood,
                         sdm_error *err);

/* Whether unknown i, a mean of a tissue, stays as it is. */
static inline bool fit_mean_stays(const fit_problem *p, size_t i)
{
    return p->opts->keep_appearance || p->absent[i - fit_columns(p->n_params)];
}

/* Whether there is a prior of anything that is fitted. */
bool sdm_fit_has_prior(const fit_problem *p);

/* Standard deviation of parameter k before the fit: that of its prior, or of any value in its
 * range. */
double sdm_fit_prior_sd(const fit_problem *p, size_t k);

/* Log prior density times the weights, with its derivatives added where gradient and the matrices
 * (may be NULL) are given. */
double sdm_fit_prior(const fit_problem *p, const fit_state *s, double *gradient, double *complete,
                     double *observed);

/* Adds what nobody knows less than to an information matrix: wide Gaussians where there is no
 * prior. */
void sdm_fit_add_ignorance(const fit_problem *p, double *a);

sdm_status sdm_fit_iterate(fit_problem *p, const fit_run *run, fit_ended *out, sdm_error *err);

/* state moved by a step in all unknowns. */
void sdm_fit_move(const fit_problem *p, const fit_state *from, const double *step, fit_state *to);

#endif
