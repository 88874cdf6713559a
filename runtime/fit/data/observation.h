/* How likely a value is, given the field at its place: the observation models of images, label maps
 * and points. */
#ifndef FIT_LAWS_H
#define FIT_LAWS_H

#include "problem.h"

/* Channels of a response: the field, then the means of the tissues (inside, outside) where they are
 * unknowns. */
enum { FIT_CHANNELS = 1 + FIT_TISSUES_MAX };

/* Log-likelihood of one value with derivatives by its channels. */
typedef struct fit_response {
    double log_likelihood;
    double score[FIT_CHANNELS];
    /* Negative second derivatives [n_channels][n_channels]. complete: as if it were known which
       tissues the value comes from, never negative; observed: less what is not known (Louis 1982).
     */
    double complete[FIT_CHANNELS * FIT_CHANNELS], observed[FIT_CHANNELS * FIT_CHANNELS];
    /* score = residual * root about, with a residual of mean 0 and variance 1. */
    double residual, root[FIT_CHANNELS];
} fit_response;

/* Values of the constants of a law pair, made once for a look. */
typedef struct fit_pair {
    size_t in, out;    // tissues, counted inside first
    double log_weight; // of the tissue inside
    double dof, constant, information;
} fit_pair;

typedef struct fit_laws {
    sdm_fit_kind kind;
    sdm_fit_model model;
    double l_ref, point_sd, point_dof;
    size_t n_in, n_tissues, n_channels, n_pairs;
    sdm_fit_law tissue[FIT_TISSUES_MAX];  // inside first; weights sum to 1 on either side
    double log_constant[FIT_TISSUES_MAX]; // of a law with sd 1
    float log_outside[SDM_FIT_LAWS];      // log weights of the tissues outside
    fit_pair pair[SDM_FIT_LAWS * SDM_FIT_LAWS];
} fit_laws;

void sdm_fit_laws_prepare(const sdm_fit_opts *opts, sdm_fit_kind kind, const fit_state *state,
                          fit_laws *out);

/* All of *out where `derivatives`, the log-likelihood alone otherwise. place[n_tissues - n_in]: log
   weights of the tissues outside at the place of the value (shares of a partial volume alone);
   NULL: those of the laws. */
void sdm_fit_respond(const fit_laws *l, double value, const float *place, double field,
                     bool derivatives, fit_response *out);

/* False where the field is so far from the surface that no derivative by it counts. */
bool sdm_fit_near(const fit_laws *l, double field);

/* log density of a tissue at a value, weight left out. */
double sdm_fit_log_density(const fit_laws *l, size_t tissue, double value);

/* Sums over values for the re-estimation of weights, sd and (labels) means. */
typedef struct fit_moments {
    double share[FIT_TISSUES_MAX]; // weight of the tissue
    double n[FIT_TISSUES_MAX];     // divisor of the square
    double count[FIT_TISSUES_MAX], first[FIT_TISSUES_MAX];
    double square[FIT_TISSUES_MAX];
} fit_moments;

void sdm_fit_moments_add(const fit_laws *l, double value, const float *place, double field,
                         fit_moments *m);

/* part[n_tissues - n_in]: how much of a voxel each tissue outside probably has; together what is
 * not the shape. */
void sdm_fit_outside(const fit_laws *l, double value, const float *place, double field,
                     double *part);

/* Writes what the sums say to look, of tissues that are kept their weights alone; least_sd keeps
 * laws from collapsing. */
void sdm_fit_moments_apply(const fit_laws *l, const fit_moments *m, const bool *kept,
                           double least_sd, sdm_fit_appearance *look);

#endif
