/* The gain of a fit over a rival: by the likelihood of voxels, or by the residuals of
 * neighbourhoods. */
#include "rival.h"

#include <math.h>

#include "residuals.h"

// a chi-square is at least this: residuals without any noise
#define CHI_SQUARE_MIN 1e-3

bool sdm_fit_is_image(const fit_problem *p)
{
    return p->target->kind == SDM_FIT_IMAGE && !p->given_labels;
}

sdm_status sdm_fit_stand(const fit_problem *p, double factor, fit_standing *out, sdm_error *err)
{
    if (sdm_fit_is_image(p)) {
        *out = (fit_standing){p->information.log_likelihood, factor, 0, 0};
        return SDM_OK;
    }
    fit_residuals residuals;
    fit_misfit misfit;
    sdm_status s = sdm_fit_residuals_create(p, &residuals, err);
    if (!s) s = sdm_fit_misfit(p, &residuals, &misfit, err);
    sdm_fit_residuals_dispose(&residuals);
    if (!s)
        *out = (fit_standing){0, 0, misfit.n_units[0] + misfit.n_units[1], misfit.noise_chi_square};
    return s;
}

double sdm_fit_units_gain(double n, double chi_square, double rival_chi_square)
{
    return 0.5 * n * log(fmax(rival_chi_square, CHI_SQUARE_MIN) / fmax(chi_square, CHI_SQUARE_MIN));
}

double sdm_fit_gain(const fit_standing *fit, const fit_standing *rival)
{
    if (fit->factor > 0) return (fit->log_likelihood - rival->log_likelihood) / fit->factor;
    if (!fit->n_units || !rival->n_units) return NAN;
    return sdm_fit_units_gain(0.5 * (double)(fit->n_units + rival->n_units), fit->chi_square,
                              rival->chi_square);
}
