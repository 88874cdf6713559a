/* Where the rings of vertices of the cochlea lie along its centreline. */
#include <math.h>
#include <stdlib.h>

#include "cochlea_ring.h"
#include "lathe.h"

/* Root mean square over a ring of abs(d(vertex) / d(theta)), mm/rad, at the default parameters. */
static double ring_speed(const cochlea_model *m, const double *x, double theta)
{
    cochlea_section s;
    sdm_cochlea_section_at(m, x, theta / x[COCHLEA_THETA], &s);
    const double h = 1e-4;
    double before[3], after[3], speed = 0;
    sdm_cochlea_centre_at(m, x, theta - h, before);
    sdm_cochlea_centre_at(m, x, theta + h, after);
    for (int k = 0; k < 3; k++) speed += (after[k] - before[k]) * (after[k] - before[k]);
    const double bend = sdm_cochlea_radius_at(m, theta) * hypot(s.bend[0].v, s.bend[1].v);
    return sqrt(speed) / (2 * h) * sqrt(1 + 0.5 * bend * bend);
}

#define SAMPLES 1024

/* Integrates ring_speed() by the trapezoidal rule: way[i] = length of the way of a ring from 0 to i
   / SAMPLES of the apical angle, mm. Returns the mean circumference of the sections, mm. */
static double way_measure(const cochlea_model *m, const double *x, double way[SAMPLES + 1])
{
    const double step = x[COCHLEA_THETA] / SAMPLES;
    double last = ring_speed(m, x, 0), round = 0;
    way[0] = 0;
    for (int i = 1; i <= SAMPLES; i++) {
        const double now = ring_speed(m, x, step * i);
        way[i] = way[i - 1] + step * (last + now) / 2;
        round += 2 * LATHE_PI * sdm_cochlea_radius_at(m, step * (i - 0.5)) * (way[i] - way[i - 1]);
        last = now;
    }
    return round / way[SAMPLES];
}

/* Writes the n rings of a cap between pole and tube: from pole to tube at the base, from tube to
 * pole at the apex. Returns the address after the last one. */
static cochlea_ring *cap_rings(size_t n, bool apex, cochlea_ring *r)
{
    for (size_t i = 1; i <= n; i++) {
        const double up = LATHE_PI / 2 * (double)(apex ? i : n + 1 - i) / (double)(n + 1);
        *r++ = (cochlea_ring){
            .fraction = apex, .shrink = cos(up), .ahead = (apex ? 1 : -1) * sin(up), .whole = true};
    }
    return r;
}

static void rings_place(size_t n_base, size_t n_tube, size_t n_apex, const double way[SAMPLES + 1],
                        cochlea_ring *r)
{
    r = cap_rings(n_base, false, r);
    size_t at = 0;
    for (size_t i = 0; i <= n_tube; i++) {
        const double target = way[SAMPLES] * (double)i / (double)n_tube;
        while (at + 1 < SAMPLES && way[at + 1] < target) at++;
        const double part = (target - way[at]) / (way[at + 1] - way[at]);
        const double fraction = i == n_tube ? 1 : ((double)at + part) / SAMPLES;
        *r++ = (cochlea_ring){.fraction = fraction, .shrink = 1, .whole = i == 0 || i == n_tube};
    }
    cap_rings(n_apex, true, r);
}

int sdm_cochlea_rings_make(const cochlea_model *m, const double *x, double edge,
                           cochlea_rings *rings)
{
    // The factors 1.1 and 1.2 make the mean edge over the parameter ranges about `edge`, with
    // triangles a little longer along the tube, where the curvature is lower.
    double way[SAMPLES + 1];
    const double round = way_measure(m, x, way), quarter = LATHE_PI / 2;
    const size_t n_sectors = sdm_lathe_pieces(round, 1.1 * edge, 6),
                 n_tube = sdm_lathe_pieces(way[SAMPLES], 1.2 * edge, 8);
    const size_t n_base =
        sdm_lathe_pieces(quarter * sdm_cochlea_radius_at(m, 0), 1.2 * edge, 2) - 1;
    const size_t n_apex =
        sdm_lathe_pieces(quarter * sdm_cochlea_radius_at(m, x[COCHLEA_THETA]), 1.2 * edge, 2) - 1;
    const size_t n = n_base + n_tube + 1 + n_apex;
    *rings = (cochlea_rings){.n = n, .n_sectors = n_sectors};
    rings->at = malloc(n * sizeof *rings->at);
    double *direction = rings->direction = malloc(4 * n_sectors * sizeof *direction);
    if (!rings->at || !direction) {
        sdm_cochlea_rings_free(rings);
        return -1;
    }
    for (size_t odd = 0; odd < 2; odd++)
        for (size_t j = 0; j < n_sectors; j++) {
            const double angle = sdm_lathe_angle(odd, j, n_sectors);
            *direction++ = cos(angle);
            *direction++ = sin(angle);
        }
    rings_place(n_base, n_tube, n_apex, way, rings->at);
    return 0;
}

void sdm_cochlea_rings_free(cochlea_rings *rings)
{
    free(rings->at);
    free(rings->direction);
    *rings = (cochlea_rings){0};
}
