/* When distances in float do not tell which of two features is the nearer one. */
#pragma once

/* Two squared distances in float that differ by less than k (d + 1) may have either order; returns
   k = 8 e, where e bounds the error of a region function, scaled. Reason: abs(error of d) <= 2 e,
   so abs(error of d^2) <= 4 (d + 1) e, and the difference of two such values has at most twice this
   error. */
static inline float ambiguity(float error) { return 8 * error; }
