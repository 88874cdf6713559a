/* The centreline of the cochlea, its moving frame and its tube radius, with derivatives with respect to the parameters. */
#ifndef COCHLEA_CURVE_H
#define COCHLEA_CURVE_H

#include <stdbool.h>

enum { COCHLEA_A, COCHLEA_ALPHA, COCHLEA_B, COCHLEA_PHI, COCHLEA_PARAMS };

/* A number with its derivatives with respect to the parameters (forward differentiation). */
typedef struct dual {
    double v, d[COCHLEA_PARAMS];
} dual;

/* The constants of the model: options of the shape. */
typedef struct cochlea_model {
    double theta;         /* angle of the apical end, rad */
    double c, kappa;      /* rise, mm / rad; decay of the wave, 1 / rad */
    bool cubic;           /* the basal start is a polynomial below theta2, from radius p0 */
    double theta2, p0;    /* rad, mm */
    double radius, taper; /* tube radius = radius - taper theta + flare exp(-theta / flare_angle), mm */
    double flare, flare_angle;
    bool ellipse; /* the section is an ellipse of axis ratio `ratio` at the base, a circle after one turn */
    double ratio;
} cochlea_model;

/* A cross-section: centre, unit tangent, the axes across it (e1 outwards and level, e2 = tangent x e1), and the curvature
   vector of the centreline in those axes (1 / mm). */
typedef struct cochlea_section {
    dual centre[3], tangent[3], e1[3], e2[3], bend[2];
} cochlea_section;

void sdm_cochlea_section_at(const cochlea_model *m, const double *p, double theta, cochlea_section *out);

/* Position alone. */
void sdm_cochlea_centre_at(const cochlea_model *m, const double *p, double theta, double centre[3]);

/* Tube radius, mm, and the axis ratio of the section; neither depends on the parameters. */
double sdm_cochlea_radius_at(const cochlea_model *m, double theta);
double sdm_cochlea_ratio_at(const cochlea_model *m, double theta);

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
