/* Observation models of images, label maps and points: how likely the value of a sample is, given
 * the field at the sample. */
#pragma once

#include "unknowns.h"

/* Channels: what the likelihood of one sample depends on. Channel 0 is the field; partial volume
 * adds the means of the tissues, inside first. */
enum { FIT_CHANNELS = 1 + FIT_TISSUES_MAX };

/* Log-likelihood of one sample with its derivatives by the channels. */
typedef struct fit_likelihood {
    double log_likelihood;
    /* [n_channels] gradient */
    double score[FIT_CHANNELS];
    /* [n_channels][n_channels] information. complete: expected, as if the tissue of the sample were
     * known, positive semidefinite; observed: the complete one less the information that is missing
     * because the tissue is not known (Louis 1982) */
    double complete[FIT_CHANNELS * FIT_CHANNELS], observed[FIT_CHANNELS * FIT_CHANNELS];
    /* score ~ residual * root[n_channels], with a residual of mean 0 and variance 1 */
    double residual, root[FIT_CHANNELS];
} fit_likelihood;

/* Constants of a pair of tissues, which share a voxel: tissue `in` inside, tissue `out` outside
 * (indices into fit_observation.tissue). */
typedef struct fit_pair {
    size_t in, out;
    /* log weight of the inside tissue */
    double log_weight;
    /* degrees of freedom (0: Gaussian), log of the normalising constant of the density, and
     * expected information on the mean for scale 1 */
    double dof, constant, information;
} fit_pair;

typedef struct fit_observation {
    sdm_fit_kind kind;
    sdm_fit_model model;
    /* scale of the logistic prior of labels (mm); sd (mm) and degrees of freedom of points about
     * the surface */
    double l_ref, point_sd, point_dof;
    /* share of outliers among the points, and the density of their distances, per mm */
    double outliers, outlier_density;
    /* numbers of inside tissues, all tissues, channels in use, pairs in use */
    size_t n_in, n_tissues, n_channels, n_pairs;
    /* [n_tissues] inside first; weights sum to 1 inside, and to 1 outside */
    sdm_fit_law tissue[FIT_TISSUES_MAX];
    /* [n_tissues] log of the normalising constant of the density with sd 1 */
    double log_constant[FIT_TISSUES_MAX];
    /* [n_tissues - n_in] log weights of the outside tissues */
    float log_outside[SDM_FIT_LAWS];
    /* [n_pairs] partial volume only */
    fit_pair pair[SDM_FIT_LAWS * SDM_FIT_LAWS];
} fit_observation;

/* Sets *obs to the observation model of a kind of target, with the appearance, l_ref and point_sd
 * of `state`. */
void sdm_fit_observation_prepare(const sdm_fit_opts *opts, sdm_fit_kind kind,
                                 const fit_state *state, fit_observation *obs);

/* Probability that a point at this distance (mm) is no outlier. */
double sdm_fit_point_belongs(const fit_observation *obs, double distance);

/* Likelihood of one sample. Sets all members of *out if `derivatives`, else log_likelihood alone.
   log_weight[n_tissues - n_in]: log weights of the outside tissues at the sample (partial volume
   only); NULL: those of the model. [any thread, as all functions below] */
void sdm_fit_likelihood(const fit_observation *obs, double value, const float *log_weight,
                        double field, bool derivatives, fit_likelihood *out);

/* Whether a field value lies in the band: near enough to the surface that derivatives by it are not
 * negligible. */
bool sdm_fit_in_band(const fit_observation *obs, double field);

/* Log density of a tissue at a value, without the weight of the tissue. */
double sdm_fit_log_density(const fit_observation *obs, size_t tissue, double value);

/* Sums over samples for the re-estimation of the tissues, each [n_tissues]. r is the residual about
   the mean; w the probability of the tissue times its robust weight (1 for Gaussians). */
typedef struct fit_moments {
    /* probable amount of the tissue, in samples: its weight, unnormalised */
    double share[FIT_TISSUES_MAX];
    /* divisor of `square` for the variance, in samples */
    double n[FIT_TISSUES_MAX];
    /* sums of w and of w r, for the means of labels */
    double count[FIT_TISSUES_MAX], first[FIT_TISSUES_MAX];
    /* sum of squared residuals, robustly weighted */
    double square[FIT_TISSUES_MAX];
} fit_moments;

/* Adds one sample. */
void sdm_fit_moments_add(const fit_observation *obs, double value, const float *log_weight,
                         double field, fit_moments *m);

/* Sets weights, sd and (labels) means of *appearance from the moments. Where kept[n_tissues] is
   true, only the weight of the tissue is set. min_sd: lower bound of each sd, so that no density
   collapses to a point. */
void sdm_fit_moments_apply(const fit_observation *obs, const fit_moments *m, const bool *kept,
                           double min_sd, sdm_fit_appearance *appearance);

/* part[n_tissues - n_in]: expected part of the voxel that each outside tissue fills; they sum to 1
 * less the share of the shape. Partial volume only. */
void sdm_fit_outside_shares(const fit_observation *obs, double value, const float *log_weight,
                            double field, double *part);
