/* Exact predicates: signs of small determinants without rounding error. Ties are broken by
 * simulation of simplicity (Edelsbrunner and Muecke 1990); the floating-point filter and the
 * expansions follow Shewchuk 1997. */
#pragma once

/* Orientation in the plane: the sign (+1 or -1) of (v - u) x (p - u), with p moved by the
 * infinitesimal vector (e, e^2), so that p never lies on the line. 0 only when u == v.
 * sdm_side(u, v, p) == -sdm_side(v, u, p). *area (may be NULL) = the determinant in floating point,
 * without the move; 0 when u == v. */
int sdm_side(const double u[2], const double v[2], const double p[2], double *area);
