/* Log-likelihood of all sites with its derivatives by all unknowns. */
#ifndef FIT_SUMS_H
#define FIT_SUMS_H

#include "fit/data/samples.h"

typedef struct fit_sums {
    size_t n_unknowns; // columns of the field, then means of the tissues
    double log_likelihood;
    double rounding;             // what the rounding of the maps, which are floats, makes of it
    double *gradient;            // [n_unknowns]
    double *complete, *observed; // [n_unknowns][n_unknowns], see fit_response
    double *parts;               // working memory
} fit_sums;

sdm_status sdm_fit_sums_create(size_t n_unknowns, fit_sums *out, sdm_error *err);
void sdm_fit_sums_dispose(fit_sums *s);

/* From what sdm_fit_sites_sample() left; the same bits for any number of threads. */
void sdm_fit_sums_fill(fit_sums *s, const fit_sites *sites, const fit_laws *laws, int n_threads);

/* The log-likelihood alone, at the state whose first field maps hold; what sites hold stays. The
 * same bits for any number of threads. */
double sdm_fit_sums_value(const fit_sites *sites, const fit_maps *maps, const fit_laws *laws,
                          const fit_state *state);

/* The laws' moments over all sites. */
void sdm_fit_sums_moments(const fit_sites *sites, const fit_laws *laws, int n_threads,
                          fit_moments *out);

#endif
