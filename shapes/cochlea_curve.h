/* The centreline of the cochlea, its moving frame and its tube radius, with derivatives with
 * respect to the parameters. */
#ifndef COCHLEA_CURVE_H
#define COCHLEA_CURVE_H

#include <stdbool.h>

/* What may be a parameter. The published four, then constants of the anatomy. */
enum {
    COCHLEA_A,
    COCHLEA_ALPHA,
    COCHLEA_B,
    COCHLEA_PHI,
    COCHLEA_C,      /* rise, mm / rad */
    COCHLEA_KAPPA,  /* decay of the wave, 1 / rad */
    COCHLEA_THETA,  /* angle of the apical end, rad */
    COCHLEA_THETA2, /* a cubic start lies below this angle, rad, */
    COCHLEA_P0,     /* and begins at this radius, mm */
    COCHLEA_UNKNOWNS
};

/* A number with its derivatives with respect to the unknowns (forward differentiation). */
typedef struct dual {
    double v, d[COCHLEA_UNKNOWNS];
} dual;

/* What is never a parameter. */
typedef struct cochlea_model {
    bool cubic; /* the basal start is a polynomial */
    double radius,
        taper; /* tube radius = radius - taper theta + flare exp(-theta / flare_angle), mm */
    double flare, flare_angle;
    bool ellipse; /* the section is an ellipse of axis ratio `ratio` at the base, a circle after one
                     turn */
    double ratio;
} cochlea_model;

/* A cross-section: centre, unit tangent, the axes across it (e1 outwards and level, e2 = tangent x
   e1), the curvature vector of the centreline in those axes (1 / mm), and the half axes of the tube
   along them (mm). */
typedef struct cochlea_section {
    dual centre[3], tangent[3], e1[3], e2[3], bend[2], wide, high;
} cochlea_section;

/* x[COCHLEA_UNKNOWNS] are the unknowns. The section at `share` of the apical angle, 0 .. 1. */
void sdm_cochlea_section_at(const cochlea_model *m, const double *x, double share,
                            cochlea_section *out);

/* Position alone, at an angle. */
void sdm_cochlea_centre_at(const cochlea_model *m, const double *x, double theta, double centre[3]);

/* Tube radius at an angle, mm. */
double sdm_cochlea_radius_at(const cochlea_model *m, double theta);

/* Signed distance of a point to the ball of the tube's radius swept along the centreline, mm: exact
 * outside, a bound inside. */
double sdm_cochlea_distance(const cochlea_model *m, const double *x, const double point[3]);

/* Arithmetic of duals. */
dual sdm_dual_of(double v);
dual sdm_dual_add(dual a, dual b);
dual sdm_dual_sub(dual a, dual b);
dual sdm_dual_mul(dual a, dual b);
dual sdm_dual_div(dual a, dual b);
dual sdm_dual_scale(double s, dual a);
/* f(a), given the value and the derivative of f there. */
dual sdm_dual_apply(dual a, double f, double df);

#endif
