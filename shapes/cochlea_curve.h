/* Centreline of the cochlea, its moving frame and tube radius, with derivatives with respect to the
   unknowns. The centreline is a rising logarithmic spiral with a longitudinal wave; theta is the
   angle around the z axis, from 0 at the basal end. As an option the radius of the centreline is a
   cubic polynomial of theta up to theta2 (the polynomial start). cochlea.c has the formulas. */
#pragma once

#include <stdbool.h>

/* Indices of the unknowns x[COCHLEA_UNKNOWNS] of the model: the four published parameters, then the
   anatomical constants that can be parameters (option `free`). */
enum {
    COCHLEA_A,
    COCHLEA_ALPHA,
    COCHLEA_B,
    COCHLEA_PHI,
    COCHLEA_C,      /* rise of the centreline, mm/rad */
    COCHLEA_KAPPA,  /* decay of the longitudinal wave, 1/rad */
    COCHLEA_THETA,  /* angle of the apical end, rad */
    COCHLEA_THETA2, /* end of the polynomial start, rad */
    COCHLEA_P0,     /* radius of the polynomial start at theta = 0, mm */
    COCHLEA_UNKNOWNS
};

/* Dual number for forward automatic differentiation: value v and derivatives d with respect to the
 * unknowns. */
typedef struct dual {
    double v, d[COCHLEA_UNKNOWNS];
} dual;

/* Properties of the model that are never parameters. */
typedef struct cochlea_model {
    bool cubic; /* true: polynomial start below theta2 */
    /* tube radius = radius - taper theta + flare exp(-theta / flare_angle), mm */
    double radius, taper;
    double flare, flare_angle;
    /* true: the cross-section is an ellipse with axis ratio `ratio` at the base and becomes a
     * circle after one turn */
    bool ellipse;
    double ratio;
} cochlea_model;

/* A cross-section: centre (mm), unit tangent, unit vectors e1 (outward, horizontal) and e2 =
 * tangent x e1, curvature vector `bend` of the centreline in (e1, e2) (1/mm), and the half axes
 * `wide` along e1 and `high` along e2 (mm). */
typedef struct cochlea_section {
    dual centre[3], tangent[3], e1[3], e2[3], bend[2], wide, high;
} cochlea_section;

/* The cross-section at theta = fraction * (apical angle), 0 <= fraction <= 1.
 * x[COCHLEA_UNKNOWNS]. */
void sdm_cochlea_section_at(const cochlea_model *m, const double *x, double fraction,
                            cochlea_section *out);

/* centre = position of the centreline at the angle theta, mm, without derivatives. */
void sdm_cochlea_centre_at(const cochlea_model *m, const double *x, double theta, double centre[3]);

/* Tube radius at the angle theta, mm. */
double sdm_cochlea_radius_at(const cochlea_model *m, double theta);

/* Signed distance (mm) from a point to the volume of a ball of the tube's radius swept along the
 * centreline: exact outside; inside, the absolute value is a lower bound of the true one. */
double sdm_cochlea_distance(const cochlea_model *m, const double *x, const double point[3]);

/* Arithmetic of dual numbers. */
dual sdm_dual_of(double v);
dual sdm_dual_add(dual a, dual b);
dual sdm_dual_sub(dual a, dual b);
dual sdm_dual_mul(dual a, dual b);
dual sdm_dual_div(dual a, dual b);
dual sdm_dual_scale(double s, dual a);
/* f(a), given the value f and the derivative df at a.v. */
dual sdm_dual_apply(dual a, double f, double df);
