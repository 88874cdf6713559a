/* Centreline and cross-sections of the duct (duct.c has the formulas). theta is the angle around
 * the z axis, from 0 at the basal end. */
#pragma once

#include <stddef.h>

/* Indices of the unknowns x[DUCT_UNKNOWNS]: the four published parameters, then those of the
 * centreline, then those of the section, of which the last four exist for lobes only. */
enum {
    DUCT_A,
    DUCT_ALPHA,
    DUCT_B,
    DUCT_PHI,
    DUCT_C,     /* rise of the centreline, mm/rad */
    DUCT_THETA, /* angle of the apical end, rad */
    DUCT_DOME,  /* how far the middle of the centreline lies above an even rise, mm */
    DUCT_HOOK,  /* how far the basal end lies outside of the spiral, mm */
    DUCT_DIP,   /* how far the basal end lies above the spiral, mm */
    DUCT_WIDTH_BASE,
    DUCT_WIDTH_MIDDLE,
    DUCT_WIDTH_APEX,
    DUCT_FLARE, /* widening of the basal end, as a radius, mm */
    DUCT_CAP,   /* length of the basal cap over the mean radius of its section */
    DUCT_TIP,   /* size of the section at the apical end over the one without a taper */
    DUCT_HEIGHT_BASE,
    DUCT_HEIGHT_MIDDLE,
    DUCT_HEIGHT_APEX,
    DUCT_TILT_BASE,
    DUCT_TILT_MIDDLE,
    DUCT_TILT_APEX,
    DUCT_WAIST,
    DUCT_EGG,
    DUCT_SLANT_OUT, /* slope of the basal end face outwards, mm along the centreline per mm */
    DUCT_SLANT_UP,  /* slope of the basal end face upwards, mm along the centreline per mm */
    DUCT_UNKNOWNS
};

/* Harmonics of the outline's growth. */
enum {
    DUCT_GROWTH_SIZE,    /* 1 */
    DUCT_GROWTH_OUTER,   /* cos(v) */
    DUCT_GROWTH_UPPER,   /* sin(v) */
    DUCT_GROWTH_OVAL,    /* cos(2 v) */
    DUCT_GROWTH_OBLIQUE, /* sin(2 v) */
    DUCT_HARMONICS
};

/* The details follow the unknowns; they are 0 unless the option `detail` makes them parameters. The
 * last ones are the control values of each harmonic, n_values at a time. */
enum {
    DUCT_SURGE = DUCT_UNKNOWNS, /* amplitudes of a second longitudinal wave, mm: of the cosine */
    DUCT_SWAY,                  /* and of the sine */
    DUCT_FLARE_HIGH, /* how much more the height of the basal end widens, as a radius, mm */
    DUCT_TWIST,      /* further tilt of the basal end, rad */
    DUCT_VALUES,
    DUCT_VALUES_MAX = 7,
    DUCT_ALL = DUCT_VALUES + DUCT_HARMONICS * DUCT_VALUES_MAX
};

typedef enum duct_form { DUCT_ELLIPSE, DUCT_CIRCLE, DUCT_LOBES } duct_form;

/* Decay of the longitudinal wave, 1/rad, and angle over which the flare decays by e, rad: constants
 * of the cochlea. */
#define DUCT_KAPPA 0.3
#define DUCT_FLARE_ANGLE 0.35

/* A cross-section: centre (mm), unit tangent, unit vectors e1 (outward, horizontal) and e2 =
 * tangent x e1 (downward), curvature vector `bend` of the centreline in (e1, e2) (1/mm), half axes
 * (mm), cosine and sine of the tilt from e1 to e2, waist and egg towards e2, logarithm of the
 * growth as harmonics of the outline's angle from the width to e2. */
typedef struct duct_section {
    double centre[3], tangent[3], e1[3], e2[3], bend[2];
    double wide, high, tilt[2], waist, egg, growth[DUCT_HARMONICS];
} duct_section;

/* The cross-section at theta = fraction * (apical angle), 0 <= fraction <= 1. x[DUCT_ALL]; n_values
 * <= DUCT_VALUES_MAX. */
void sdm_duct_section_at(duct_form form, size_t n_values, const double *x, double fraction,
                         duct_section *out);

/* slant[2] = how far, in mm per mm along e1 and e2, the points of a section lie ahead of it along
 * its tangent. */
void sdm_duct_slant_at(const double *x, double fraction, double slant[2]);

/* at[2] = point of the outline of a section in (e1, e2), mm, given cosine and sine of its angle. */
void sdm_duct_outline_at(const duct_section *s, double co, double si, double at[2]);

/* The largest product of a point of the outline (e1, e2) with `along`: for a unit vector how far
 * the outline reaches from the centre along it, mm; right to 1e-4. */
double sdm_duct_reach(const duct_section *s, const double along[2]);

/* Mean radius of a section, mm: the unit of the lengths of the caps. */
double sdm_duct_mean_radius(const duct_section *s);
