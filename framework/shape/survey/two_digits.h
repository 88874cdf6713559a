/* Numbers that are multiples of the second digit of a spacing. */
#pragma once

#include <math.h>

/* Power of ten of the second digit of x > 0: -2 for 0.23. */
static inline int second_digit(double x) { return (int)floor(log10(x)) - 1; }

/* count times 10^power, rounded once; never a negative zero. */
static inline double decimal(double count, int power)
{
    const double x = power < 0 ? count / pow(10, -power) : count * pow(10, power);
    return x == 0 ? 0 : x;
}

/* x / 10^power. */
static inline double in_units(double x, int power)
{
    return power < 0 ? x * pow(10, -power) : x / pow(10, power);
}
