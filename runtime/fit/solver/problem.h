/* The complete state of one fit, shared by the solver, the search for a start and the assessment.

   Glossary
   - sample: a voxel of the image, or a surface point, that the fit uses.
   - field: the function of space through which the shape explains a sample: its signed distance
     (mm, negative inside) or its share. It is computed on a map, a grid in the shape's frame.
   - share: the part of a voxel that the shape fills, 0 .. 1, seen through the point spread.
   - observation model: the probability of a sample's value given the field at the sample.
   - tissue: a class of material with one intensity distribution (a Gaussian or Student's t). Some
     tissues lie inside the shape, the others outside.
   - appearance: weights, means and sd of all tissues.
   - tissue field: weights of the outside tissues that vary smoothly in space.
   - band: the samples near the surface, where the derivative of the field is not negligible.
   - score: derivative of the log-likelihood, of one sample or of all.
   - information: negative second derivative of the log-likelihood, the matrix of the normal
     equations. `complete` pretends that the tissue of every sample is known (expected information
     of expectation-maximisation); `observed` accounts for the unknown tissues (Louis 1982).
   - evidence: log-likelihood gained by the shape over a mixture of the same tissues without a
     shape, less the cost of the shape's unknowns. */
#pragma once

#include "information.h"

/* number of the last iterations that are remembered */
enum { FIT_RECENT = 8 };
/* largest number of starts that are remembered */
enum { FIT_BEGUN = 4 };
/* independent rigid motions of a body */
enum { FIT_MOTIONS_MAX = 6 };

/* A parameter that moves the shape as a change of its pose does, see trust/pose_params.h. */
typedef struct fit_pose_param {
    size_t param;
    /* motion that undoes a change of the parameter by 1: rotation vector (rad), then translation at
     * the origin of the shape (mm) */
    double motion[FIT_MOTIONS_MAX];
} fit_pose_param;

/* The unknowns in the last iterations, from which sdm_fit_unrest() judges convergence. */
typedef struct fit_recent {
    /* rings of [n_params + 6]: sum of the steps of each unknown so far; the undamped step */
    double position[FIT_RECENT][FIT_PARAMS_MAX + 6], step[FIT_RECENT][FIT_PARAMS_MAX + 6];
    /* number of all iterations so far */
    size_t n;
} fit_recent;

typedef struct fit_problem {
    /* inputs, owned by the caller of sdm_fit() or by its stack frame */
    const sdm_fit_source *source;
    const sdm_fit_target *target;
    const sdm_fit_opts *opts;
    /* the caller's target is a label map; `target` presents it as an image of values 0 and 1 */
    bool given_labels;

    /* shape parameters, their bounds and their distributions [n_params] */
    size_t n_params;
    double low[FIT_PARAMS_MAX], high[FIT_PARAMS_MAX];
    sdm_distribution distribution[FIT_PARAMS_MAX];
    /* centre of the priors of rotation and translation; only the pose is used */
    fit_state prior;
    /* [n_unknowns] factor >= 1 of each log prior, see sdm_fit_weigh_priors() */
    double prior_weight[FIT_UNKNOWNS_MAX];
    /* >= 1: number of correlated samples that carry as much information as one independent one */
    double noise_factor;
    /* where the start shape lies on its map */
    fit_extent extent;

    /* rigid motions that the data do not determine: rotation vector (rad), then translation at the
     * origin of the shape (mm); and the largest eigenvalue of the information of the pose, with
     * translations in units of the reach, see open_motions.h */
    size_t n_motions;
    double motion[FIT_MOTIONS_MAX][6], pose_information;
    /* parameters that the data determine only together with the pose */
    size_t n_pose_params;
    fit_pose_param pose_param[FIT_MOTIONS_MAX];

    /* maps of the shape and their derivatives */
    fit_maps maps;
    /* true: derivatives of `maps` are averaged over +-half_width[n_params], see
     * averaged_gradient.h. Direct maps have other averages */
    bool averaged;
    double half_width[FIT_PARAMS_MAX];
    /* parameters [n_params] and blur (mm) of `maps`; maps_params[0] = NaN: `maps` is out of date */
    double maps_params[FIT_PARAMS_MAX], maps_blur;
    /* the samples: every `stride`-th voxel along each axis of the image, stride >= 1 */
    fit_samples samples;
    size_t stride;
    /* observation model and unknowns at the current iteration */
    fit_observation observation;
    fit_state state;
    /* [tissues, inside first] true: the image does not hold the tissue, whose mean and sd then stay
     * at the start values, see sdm_fit_appearance_mark_absent() */
    bool absent[FIT_TISSUES_MAX];
    /* false: weights of the outside tissues are the same everywhere, whatever the options say */
    bool use_tissue_field;
    /* points: number of those that count as spread evenly over the surface, see even_points.h; 0:
     * they may lie anywhere on it */
    double n_even;
    /* log-likelihood and its derivatives at `state`, and memory for those at a trial state */
    fit_information information, trial;

    /* [n_iterations] log-posterior density after each iteration, except those of the search */
    double *objective;
    size_t n_iterations, objective_capacity;
    fit_recent recent;
    /* number of iterations so far, including those of the search */
    size_t n_steps;
    /* whether the error of the network was measured, and what exact maps change in each parameter,
     * see network_bias.h */
    bool network_measured;
    double network_change[FIT_PARAMS_MAX];
    /* true: the fit only serves to judge another one, see fit_rival.h */
    bool is_rival;
    /* the second best of several starts of the search; its objective */
    bool has_runner_up;
    double runner_up_objective;
    fit_state runner_up;
    /* points: the judgement has refused or doubted the fit because the shape in this pose explains
     * them better */
    bool has_better;
    fit_state better;
    /* where the fit began, the first time and at each restart, after the search */
    size_t n_begun;
    fit_state begun[FIT_BEGUN];
    /* where the search for the start is, for progress(); see sdm_fit_progress */
    size_t search_round, search_start, search_starts;
    const double *search_best;
    /* name of the check that has refused the fit before this attempt; NULL: none has */
    const char *refused_by;
} fit_problem;

/* Whether the target is an image: its voxels have tissues. */
static inline bool fit_is_image(const fit_problem *p)
{
    return p->target->kind == SDM_FIT_IMAGE && !p->given_labels;
}

/* Whether the target is a label map. */
static inline bool fit_is_labels(const fit_problem *p)
{
    return p->given_labels || p->target->kind == SDM_FIT_LABEL;
}

/* Whether parameter k keeps its start value. */
static inline bool fit_param_is_kept(const fit_problem *p, size_t k)
{
    return p->opts->keep_params || (p->opts->kept && p->opts->kept[k]);
}

/* Whether unknown i, the mean of a tissue, keeps its value. */
static inline bool fit_mean_is_kept(const fit_problem *p, size_t i)
{
    return p->opts->keep_appearance || p->absent[i - fit_columns(p->n_params)];
}
