/* Whether the data and the maps suffice for the fit: number and extent of the points, size of the
   voxels of the maps. */
#pragma once

#include "fit/points/shared_errors.h"
#include "residuals.h"

/* Adds the findings "data" and "size" of a fit to points. noise_factor: see sdm_fit_result.
   SDM_E_NOMEM. */
sdm_status sdm_fit_check_points(const fit_problem *p, const fit_residuals *s, double noise_factor,
                                sdm_fit_verdict *v, sdm_error *err);

/* Adds the finding "residuals" of a fit to points that lie too far apart to tell their scatter from
 * errors of the shape: passed where their distances from the surface agree with a standard
 * deviation that the options keep, else doubtful. */
void sdm_fit_check_sparse_points(const fit_problem *p, sdm_fit_verdict *v);

/* *sd = robust standard deviation of the distances of the points from the surface, mm; outliers
 * hardly change it. SDM_E_NOMEM. */
sdm_status sdm_fit_points_sd(const fit_problem *p, double *sd, sdm_error *err);

/* Of any fit to points whose options keep the standard deviation of the points: adds the finding
 * "residuals", doubtful or failed, if the points lie farther off the surface than that. shared: the
 * errors that neighbours have in common. Returns whether it did. */
bool sdm_fit_doubt_given_scatter(const fit_problem *p, const fit_shared_errors *shared,
                                 sdm_fit_verdict *v);

/* What the voxels of the maps show. */
typedef struct fit_coarseness {
    /* longest edge (mm) of voxels that show the shape and the data; INFINITY: any do */
    double limit;
    /* SDM_GRID_FIT_ADVISED times it: the next fit may find a thinner shape */
    double advice;
    /* the reason of the limit, "the thickness of the shape" */
    const char *detail;
    /* the voxels of the maps are longer than the thickest part of the shape is thick */
    bool blind;
    /* thickness (mm) of the thinnest part of the fitted shape; NaN: not known */
    double thinnest;
    /* why maps with so short an edge would have more than FIT_SENSIBLE_VOXELS voxels; "": they have
     * fewer */
    char cause[160];
} fit_coarseness;

/* More voxels than this in the maps of a fit are a sign of a mistake, not an advice: 2^27. */
#define FIT_SENSIBLE_VOXELS 134217728.0

/* Judges the maps by the fitted shape, by labels and by the point spread. blur: its sd, mm; 0: the
 * target is no image. Where the shape is known, it is measured at its exact surface: neither the
 * errors of a network nor the voxels of the maps change the limit. */
fit_coarseness sdm_fit_coarseness(const fit_problem *p, double blur);

/* Adds the finding "map voxels" to r->verdict, and sets r->advised_voxel_mm where it has not passed
 * and the maps would have a sensible number of voxels; does nothing if the parameters are kept. */
void sdm_fit_check_voxels(const fit_problem *p, fit_coarseness coarse, sdm_fit_result *r);

/* Labels: adds the finding "data", doubtful where their voxels are longer than the thinnest part of
 * the fitted shape is thick, mm; nothing where that is not known (NaN). */
void sdm_fit_check_labels(const fit_problem *p, double thinnest, sdm_fit_verdict *v);

/* Adds the finding "data" if nothing failed before: failed where the data determine none of the
 * parameters; doubtful where they leave at least half of those open that have no normal
 * distribution. */
void sdm_fit_check_determined(const fit_problem *p, const sdm_fit_result *r, sdm_fit_verdict *v);
