/* Distributions of the parameters of a shape, and their quantiles. */
#include "sdm/internal/distribution.h"

#include <math.h>
#include <stdio.h>

#include "sdm/internal/text.h"

/* Above this many ranges a normal distribution is uniform for every purpose, and its quantiles
 * would lose digits. */
#define DEVIATION_MAX 1000.0
/* A range with less probability holds no values of the distribution. */
#define PROBABILITY_MIN 1e-9

/* Probability that a standard normal variable exceeds z, with a small relative error for every
 * z. */
static double upper_tail(double z) { return 0.5 * erfc(z * 0.70710678118654752440); }

/* The z whose upper tail is q, 0 < q <= 1/2: Hastings' approximation (Abramowitz and Stegun
 * 26.2.23, error below 4.5e-4), improved by Halley's method, which triples the number of digits in
 * each step. */
static double upper_quantile(double q)
{
    const double t = sqrt(-2 * log(q));
    double z = t - (2.515517 + t * (0.802853 + t * 0.010328)) /
                       (1 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
    for (int i = 0; i < 3; i++) {
        const double density = 0.39894228040143267794 * exp(-0.5 * z * z);
        const double step = (upper_tail(z) - q) / density;
        z += step / (1 - 0.5 * z * step);
    }
    return z;
}

double sdm_distribution_quantile(const sdm_distribution *d, double min, double max, double u)
{
    if (d->kind == SDM_DISTRIBUTION_UNIFORM) return min + (max - min) * u;
    // The tails of the result are the means of those of the limits. Their terms are positive, so
    // the smaller tail has all its digits, however far the range is from the mean.
    const double a = (min - d->mean) / d->deviation, b = (max - d->mean) / d->deviation;
    const double lower = (1 - u) * upper_tail(-a) + u * upper_tail(-b);
    const double upper = (1 - u) * upper_tail(a) + u * upper_tail(b);
    // no more precision than this in a double: the value is a limit
    if (!(u > 0) || lower < 1e-300) return min;
    if (!(u < 1) || upper < 1e-300) return max;
    const double z = lower < upper ? -upper_quantile(lower) : upper_quantile(upper);
    return fmin(fmax(d->mean + d->deviation * z, min), max);
}

/* Probability of min .. max before the truncation. */
static double probability(const sdm_distribution *d, double min, double max)
{
    const double a = (min - d->mean) / d->deviation, b = (max - d->mean) / d->deviation;
    return a > 0 ? upper_tail(a) - upper_tail(b) : upper_tail(-b) - upper_tail(-a);
}

sdm_status sdm_distribution_check(const sdm_distribution *d, double min, double max, sdm_error *err)
{
    char mean[32], deviation[32], low[32], high[32];
    if (d->kind == SDM_DISTRIBUTION_UNIFORM) return SDM_OK;
    if (d->kind != SDM_DISTRIBUTION_NORMAL)
        return sdm_fail(err, SDM_E_ARG,
                        "distribution of the unknown kind %d, need %d (uniform) or %d (normal)",
                        (int)d->kind, SDM_DISTRIBUTION_UNIFORM, SDM_DISTRIBUTION_NORMAL);
    sdm_format_real(d->mean, mean), sdm_format_real(d->deviation, deviation);
    sdm_format_real(min, low), sdm_format_real(max, high);
    if (!isfinite(d->mean)) return sdm_fail(err, SDM_E_ARG, "the mean %s is not finite", mean);
    if (!(d->deviation > 0) || !isfinite(d->deviation))
        return sdm_fail(err, SDM_E_ARG, "the deviation %s is not a finite number above 0",
                        deviation);
    if (d->deviation > DEVIATION_MAX * (max - min))
        return sdm_fail(err, SDM_E_ARG,
                        "the deviation %s is more than %g times the range %s .. %s: use uniform",
                        deviation, DEVIATION_MAX, low, high);
    if (!(probability(d, min, max) >= PROBABILITY_MIN))
        return sdm_fail(err, SDM_E_ARG,
                        "a normal distribution of mean %s and deviation %s has no values in the "
                        "range %s .. %s: move the mean towards the range, or raise the deviation",
                        mean, deviation, low, high);
    return SDM_OK;
}

const char *sdm_distribution_text(const sdm_distribution *d, char buf[80])
{
    char mean[32], deviation[32];
    if (d->kind == SDM_DISTRIBUTION_UNIFORM)
        snprintf(buf, 80, "uniform");
    else
        snprintf(buf, 80, "normal, mean %s, deviation %s", sdm_format_real(d->mean, mean),
                 sdm_format_real(d->deviation, deviation));
    return buf;
}
