/* Default options of a fit. */
#include <math.h>

#include "fit/solver/newton.h"
#include "sdm/fit.h"

sdm_fit_opts sdm_fit_defaults(void)
{
    return (sdm_fit_opts){
        .image_model = SDM_FIT_PARTIAL_VOLUME,
        .l_ref = 0.2,
        .blur = 0.2,
        .appearance = {.n_inside = 1,
                       .n_outside = 2,
                       .inside = {{.weight = 1, .mean = 40, .sd = 170}},
                       .outside = {{.weight = 0.9, .mean = 1300, .sd = 270},
                                   {.weight = 0.1, .mean = -880, .sd = 150}}},
        .tissue_mm = 1,
        .point_sd = 0.1,
        .point_dof = 4,
        .n_turns = 1,
        .prior_sd = 1,
        .margin = 1.5,
        .least_inside = 0.5,
        .beside = 0.3,
        .max_iterations = FIT_ITERATIONS_USUAL,
        .max_polish_iterations = 0,
        .eps = 1e-4,
        .polish_eps = 3e-6,
        .eps_sd = 0.01,
        .max_restarts = 2,
    };
}

// a length, but between two multiples of a voxel
static double between(double length, double voxel, double least, double most)
{
    return fmin(fmax(length, least * voxel), most * voxel);
}

sdm_fit_opts sdm_fit_defaults_for(double voxel)
{
    sdm_fit_opts o = sdm_fit_defaults();
    o.blur = between(o.blur, voxel, 0.25, 2);
    o.l_ref = between(o.l_ref, voxel, 0.25, 2);
    o.margin = between(o.margin, voxel, 1.5, 15);
    o.tissue_mm = between(o.tissue_mm, voxel, 1, 10);
    o.point_sd = between(o.point_sd, voxel, 0.125, 1);
    return o;
}
