/* Rotations that cover an axis or the sphere evenly. */
#pragma once

#include "sdm/fit.h"

/* rotation[9]: matrix of turn i of n, about z, or evenly over all rotations by super-Fibonacci
 * spirals (Alexa 2022); turn 0 is the identity. */
void sdm_fit_turn(sdm_fit_turns turns, size_t i, size_t n, double rotation[9]);

/* Angle between two rotations, rad, 0 .. pi. */
double sdm_fit_angle_between(const double a[9], const double b[9]);
