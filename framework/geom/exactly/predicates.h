/* Exact predicates: signs of small determinants without rounding, ties broken by simulation of
   simplicity (Edelsbrunner and Muecke 1990; filter and expansions after Shewchuk 1997). */
#ifndef SDM_GEOM_PREDICATES_H
#define SDM_GEOM_PREDICATES_H

/* Sign of (v - u) x (p - u) for the point p moved by an infinitely small (e, e^2): 0 when u == v,
   never else. sdm_side(u, v, p) == -sdm_side(v, u, p). *area (may be NULL): the rounded value, 0
   when u == v. */
int sdm_side(const double u[2], const double v[2], const double p[2], double *area);

#endif
