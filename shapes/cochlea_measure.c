/* Measures of the cochlea (cochlea_measure.h): diameters, lengths, angles and frequencies. */
#include "cochlea_measure.h"

#include <math.h>

#include "lathe.h"

const sdm_measure sdm_cochlea_measures[COCHLEA_MEASURES] = {
    [COCHLEA_DIAMETER_A] = {"diameter_a", "mm",
                            "A: from the centre of the basal end through the modiolar axis to the "
                            "lateral wall (Escude et al. 2006)",
                            0},
    [COCHLEA_DIAMETER_B] = {"diameter_b", "mm",
                            "B: from wall to wall through the modiolar axis, perpendicular to A "
                            "(Escude et al. 2006)",
                            0},
    [COCHLEA_HEIGHT] = {"height", "mm", "H: extent of the tube along the modiolar axis", 0},
    [COCHLEA_LENGTH_CENTRE] = {"length_centre", "mm", "length of the centreline", 0},
    [COCHLEA_LENGTH_WALL] = {"length_wall", "mm",
                             "duct length along the lateral wall (Alexiades et al. 2015)", 0},
    [COCHLEA_TURNS] = {"turns", "", "number of turns of the centreline", 0},
    [COCHLEA_INSERTION_ANGLE] = {"insertion_angle", "deg",
                                 "angle about the modiolar axis at a depth along the lateral wall "
                                 "(Verbist et al. 2010)",
                                 1},
    [COCHLEA_FREQUENCY] = {"frequency", "Hz",
                           "characteristic frequency at a depth along the lateral wall (Greenwood "
                           "1990)",
                           1},
};

// Number of chords along a curve. A curve is longer than its chords by (angle of a chord)^2 / 24:
// by 2e-6 for 14.5 rad.
#define CHORDS 2048

// Number of sections among which the highest is sought.
#define SECTIONS 256

// Half of the step of differences by theta, rad.
#define STEP 1e-4

/* A cochlea of circles or ellipses: the owner of its path. */
typedef struct tube {
    const cochlea_model *model;
    const double *x;
} tube;

static void centre_at(const void *owner, double fraction, double out[3])
{
    const tube *t = owner;
    sdm_cochlea_centre_at(t->model, t->x, fraction * t->x[COCHLEA_THETA], out);
}

/* The unit vector e1 of a section is horizontal and normal to the centreline. */
static void wall_at(const void *owner, double fraction, double out[3])
{
    const cochlea_model *m = ((const tube *)owner)->model;
    const double *x = ((const tube *)owner)->x;
    const double theta = fraction * x[COCHLEA_THETA], radius = sdm_cochlea_radius_at(m, theta);
    double before[3], after[3];
    sdm_cochlea_centre_at(m, x, theta, out);
    sdm_cochlea_centre_at(m, x, theta - STEP, before);
    sdm_cochlea_centre_at(m, x, theta + STEP, after);
    const double along[2] = {after[0] - before[0], after[1] - before[1]},
                 level = hypot(along[0], along[1]);
    out[0] += radius * along[1] / level;
    out[1] -= radius * along[0] / level;
}

static double height_at(const void *owner, double fraction, double up, int end)
{
    const tube *t = owner;
    cochlea_section s;
    sdm_cochlea_section_at(t->model, t->x, fraction, &s);
    const double across = s.high.v * s.e2[2].v, along = s.wide.v * s.tangent[2].v;
    return up * s.centre[2].v + (up * end * along > 0 ? hypot(across, along) : fabs(across));
}

/* Length of the curve, mm. If `depth` is less, *fraction = where the curve has this length, else
 * NaN. */
static double curve_length(const cochlea_path *p, cochlea_curve *curve, double depth,
                           double *fraction)
{
    double last[3], now[3], length = 0;
    *fraction = NAN;
    curve(p->owner, 0, last);
    for (int i = 1; i <= CHORDS; i++) {
        curve(p->owner, (double)i / CHORDS, now);
        const double chord =
            sqrt((now[0] - last[0]) * (now[0] - last[0]) + (now[1] - last[1]) * (now[1] - last[1]) +
                 (now[2] - last[2]) * (now[2] - last[2]));
        if (isnan(*fraction) && depth <= length + chord)
            *fraction = (i - 1 + (depth - length) / chord) / CHORDS;
        length += chord;
        for (int k = 0; k < 3; k++) last[k] = now[k];
    }
    return length;
}

/* Angle of the wall about the axis at theta = fraction * (apical angle), rad: continuous, 0 in the
 * direction of the centreline's basal end. *away = distance from the axis, mm. */
static double wall_angle(const cochlea_path *p, double fraction, double *away)
{
    double wall[3];
    p->wall(p->owner, fraction, wall);
    const double theta = fraction * p->end, c = cos(theta), s = sin(theta);
    *away = hypot(wall[0], wall[1]);
    return theta + atan2(c * wall[1] - s * wall[0], c * wall[0] + s * wall[1]);
}

/* Distance of the wall from the axis at an angle about it, mm; by bisection, since the angle of the
 * wall increases with theta. */
static double wall_away(const cochlea_path *p, double angle)
{
    double low = 0, high = 1, away = 0;
    while (high - low > 1e-12) {
        const double middle = 0.5 * (low + high);
        if (wall_angle(p, middle, &away) < angle)
            low = middle;
        else
            high = middle;
    }
    return away;
}

/* Highest point of the tube over the plane z = 0, mm, or of its image in this plane with `up` -1.
 * The highest of the samples is improved by a parabola through its neighbours. */
static double top(const cochlea_path *p, double up)
{
    double best = -INFINITY, before = NAN, last = NAN;
    for (int i = 0; i <= SECTIONS; i++) {
        const double fraction = (double)i / SECTIONS, now = p->height(p->owner, fraction, up, 0);
        if (last > before && last >= now) {
            const double slope = 0.5 * (now - before), bend = now - 2 * last + before;
            best = fmax(best, last - 0.5 * slope * slope / bend);
        }
        if (i == 0 || i == SECTIONS)
            best = fmax(best, p->height(p->owner, fraction, up, i ? 1 : -1));
        before = last, last = now;
    }
    return best;
}

/* Frequency, Hz, at the proportion `part` of the length from the apex (Greenwood 1990, man). */
static double greenwood(double part) { return 165.4 * (pow(10, 2.1 * part) - 0.88); }

double sdm_cochlea_path_measure(const cochlea_path *p, uint32_t index, double depth)
{
    double fraction, away, centre[3];
    switch (index) {
    case COCHLEA_DIAMETER_A:
        p->centre(p->owner, 0, centre);
        return hypot(centre[0], centre[1]) + wall_away(p, LATHE_PI);
    case COCHLEA_DIAMETER_B:
        return wall_away(p, 0.5 * LATHE_PI) + wall_away(p, 1.5 * LATHE_PI);
    case COCHLEA_HEIGHT:
        return top(p, 1) + top(p, -1);
    case COCHLEA_LENGTH_CENTRE:
        return curve_length(p, p->centre, 0, &fraction);
    case COCHLEA_LENGTH_WALL:
        return curve_length(p, p->wall, 0, &fraction);
    case COCHLEA_TURNS:
        return p->end / (2 * LATHE_PI);
    case COCHLEA_INSERTION_ANGLE:
        curve_length(p, p->wall, depth, &fraction);
        return (wall_angle(p, fraction, &away) - wall_angle(p, 0, &away)) * 180 / LATHE_PI;
    default: { // COCHLEA_FREQUENCY
        const double length = curve_length(p, p->wall, depth, &fraction);
        return depth <= length ? greenwood(1 - depth / length) : NAN;
    }
    }
}

double sdm_cochlea_measure(const cochlea_model *m, const double *x, uint32_t index, double depth)
{
    const tube owner = {m, x};
    const cochlea_path path = {&owner, x[COCHLEA_THETA], centre_at, wall_at, height_at};
    return sdm_cochlea_path_measure(&path, index, depth);
}
