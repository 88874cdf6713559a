/* Rows of an experiment that find shapes in test images with known truth. */
#ifndef CLI_EXPERIMENT_FIT_H
#define CLI_EXPERIMENT_FIT_H

#include "experiment_command.h"
#include "sdm/pose.h"

/* An image, what it shows, and where a fit begins. Zero-initialise; experiment_phantom_dispose()
 * frees. */
typedef struct experiment_phantom {
    double truth[SDM_MAX_PARAMS], start[SDM_MAX_PARAMS];
    sdm_pose pose, start_pose;
    sdm_grid grid;
    float *values;
    uint8_t *label;
} experiment_phantom;

/* Phantom `index` of the experiment: the same for every method whose shape has the same ranges. */
sdm_status experiment_phantom_make(const experiment_run *run, const experiment_job *job,
                                   size_t index, experiment_phantom *out, sdm_error *err);
void experiment_phantom_dispose(experiment_phantom *p);

/* What a method found in one phantom; the estimate is known where the fit converged. */
typedef struct experiment_fit {
    bool converged;
    bool at_bound[SDM_MAX_PARAMS];
    double truth[SDM_MAX_PARAMS], found[SDM_MAX_PARAMS], sd[SDM_MAX_PARAMS];
    double seconds, dice;
    size_t maps_network, maps_exact;
} experiment_fit;

struct experiment_fits {
    size_t n, n_params;
    char name[SDM_MAX_PARAMS][SDM_NAME_MAX], unit[SDM_MAX_PARAMS][16];
    experiment_fit *fit; /* [n] */
};

/* Of one parameter, over the fits that converged; NaN: not known. */
typedef struct experiment_spread {
    double difference; /* mean |estimate - estimate of the exact fit| */
    double error;      /* mean |estimate - truth| */
    double sd;         /* mean standard deviation */
    double within; /* share of estimates within three of them of the truth; those at a bound do not
                      count */
    double reference; /* difference that others reported */
} experiment_spread;
experiment_spread experiment_fit_spread(const experiment_run *run, const experiment_result *r,
                                        size_t param);

/* Fits every phantom and fills the figures of *out; that of a naive method waits for
 * experiment_fit_finish(). */
sdm_status experiment_fit_row(const experiment_run *run, experiment_job *job,
                              experiment_result *out, sdm_error *err);

/* After all rows: what the exact fits would cost with naive maps. */
void experiment_fit_finish(const experiment_run *run);

/* The parameters one by one: a second table in Markdown, a list in a row's JSON, parameters.csv and
 * ROW/fits.csv. */
void experiment_fit_markdown(const experiment_run *run, sdm_text *t);
void experiment_fit_json(const experiment_run *run, const experiment_result *r, sdm_json *j);
sdm_status experiment_fit_write(const experiment_run *run, sdm_error *err);

void experiment_fits_free(experiment_fits *f);

#endif
