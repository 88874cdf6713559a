/* Colour maps with even steps of lightness (mixed in OKLab, Ottosson 2020), and round ticks for
 * axes and colour bars. */
#include "canvas.h"

#include <math.h>
#include <stdio.h>

/* sRGB to linear light, 0 .. 1, and back. */
static double to_linear(uint8_t v)
{
    const double s = v / 255.0;
    return s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
}

static uint8_t from_linear(double v)
{
    const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055;
    return (uint8_t)(255 * fmin(1, fmax(0, s)) + 0.5);
}

/* OKLab: lightness, green to red, blue to yellow. */
static void to_lab(sdm_colour c, double lab[3])
{
    const double r = to_linear(c.r), g = to_linear(c.g), b = to_linear(c.b);
    const double l = cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
    const double m = cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
    const double s = cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
    lab[0] = 0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s;
    lab[1] = 1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s;
    lab[2] = 0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s;
}

static sdm_colour from_lab(const double lab[3])
{
    const double l = pow(lab[0] + 0.3963377774 * lab[1] + 0.2158037573 * lab[2], 3);
    const double m = pow(lab[0] - 0.1055613458 * lab[1] - 0.0638541728 * lab[2], 3);
    const double s = pow(lab[0] - 0.0894841775 * lab[1] - 1.2914855480 * lab[2], 3);
    return (sdm_colour){from_linear(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s),
                        from_linear(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s),
                        from_linear(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s)};
}

#define ANCHORS 5

/* The colour at t, 0 .. 1, along evenly spaced anchors. */
static sdm_colour mix(const sdm_colour anchor[ANCHORS], double t)
{
    const double at = fmin(1, fmax(0, t)) * (ANCHORS - 1);
    const int i = at >= ANCHORS - 1 ? ANCHORS - 2 : (int)at;
    double a[3], b[3];
    to_lab(anchor[i], a);
    to_lab(anchor[i + 1], b);
    for (int d = 0; d < 3; d++) a[d] += (at - i) * (b[d] - a[d]);
    return from_lab(a);
}

sdm_colour sdm_map_colour(sdm_colour_map map, double low, double high, double value)
{
    static const sdm_colour distance[2][ANCHORS] = {
        {{250, 249, 246}, {250, 216, 172}, {238, 167, 96}, {200, 111, 44}, {134, 62, 16}},
        {{250, 249, 246}, {196, 216, 236}, {128, 171, 214}, {62, 115, 174}, {24, 58, 110}}};
    static const sdm_colour plus_minus[2][ANCHORS] = {
        {{250, 250, 248}, {190, 224, 190}, {122, 184, 130}, {60, 134, 84}, {18, 80, 52}},
        {{250, 250, 248}, {236, 196, 224}, {214, 138, 188}, {170, 76, 142}, {108, 28, 92}}};
    static const sdm_colour error[ANCHORS] = {
        {18, 14, 34}, {82, 28, 104}, {170, 48, 108}, {236, 112, 76}, {252, 234, 176}};
    if (!isfinite(value)) return (sdm_colour){160, 160, 160};
    if (map == SDM_MAP_ERROR) return mix(error, high > low ? (value - low) / (high - low) : 0);
    if (map == SDM_MAP_GREY) {
        const uint8_t v = (uint8_t)(255 * fmin(1, fmax(0, (value - low) / (high - low))) + 0.5);
        return (sdm_colour){v, v, v};
    }
    const double end = value < 0 ? low : high;
    const sdm_colour(*side)[ANCHORS] = map == SDM_MAP_DISTANCE ? distance : plus_minus;
    return mix(side[value >= 0], fabs(end) > 0 ? value / end : 0);
}

int sdm_ticks(double low, double high, int wanted, double *first, double *step)
{
    const double range = high - low, raw = range / wanted, unit = pow(10, floor(log10(raw)));
    const double ratio = raw / unit;
    *step = unit * (ratio <= 1.0001 ? 1 : ratio <= 2.0001 ? 2 : ratio <= 5.0001 ? 5 : 10);
    const double start = ceil(low / *step - 1e-9), stop = floor(high / *step + 1e-9);
    *first = start * *step;
    return stop >= start ? (int)(stop - start) + 1 : 0;
}

const char *sdm_tick_text(double value, double step, char buf[32])
{
    const int decimals = (int)fmax(0, ceil(-log10(step) - 1e-9));
    const double size = fabs(value);
    const bool zero = size < step * 1e-6;
    const char *sign = value < 0 && !zero ? "\xE2\x88\x92" : ""; // U+2212, as wide as a plus
    if (decimals > 4 || size >= 1e7)
        snprintf(buf, 32, "%s%.3g", sign, zero ? 0 : size);
    else
        snprintf(buf, 32, "%s%.*f", sign, decimals, zero ? 0 : size);
    return buf;
}
