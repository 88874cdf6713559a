/* Averaged gradient: widths of the intervals, and for points difference quotients of the
 * log-likelihood over a fixed motion of the surface. */
#include "averaged_gradient.h"

#include <math.h>

#include "objective.h"
#include "open_motions.h"

// motion of the surface over the half width, in voxels of the map: large enough to cross many
// kinks, but small compared to the details that an image resolves
#define MOTION 0.03
// largest motion of points, in standard deviations of their distances: the likelihood of a point
// farther off is not symmetric, which would move the zero of the averaged gradient
#define MOTION_OF_POINTS 0.3
// largest half width, as a share of the parameter's range
#define WIDTH_MAX 0.05

// Motions of places on the surface per unit of a parameter or of the pose.
typedef struct motions {
    double squares, fourths; // sums of powers
} motions;

static void add_motion(motions *m, double x)
{
    m->squares += x * x;
    m->fourths += x * x * x * x;
}

// How far the moving part of the surface moves: sqrt(sum of m^4 / sum of m^2) over the motions m.
// The root mean square of m over the whole surface would be small where only a small part moves,
// and the derivative would be averaged over too wide an interval
static double typical_motion(const motions *m)
{
    return m->squares > 0 ? sqrt(m->fourths / m->squares) : 0;
}

// typical motion per unit of parameter k, of the voxels within one voxel of the surface
static double motion_on_map(const fit_maps *map, size_t k)
{
    motions m = {0};
    for (size_t v = 0; v < map->n_voxels; v++)
        if (fabs(map->distance[v]) <= fit_longest_edge(&map->grid))
            add_motion(&m, (double)map->jacobian[k * map->n_voxels + v]);
    return typical_motion(&m);
}

// typical motion per unit of column k, of the points
static double motion_at_points(const fit_samples *s, size_t k)
{
    motions m = {0};
    for (size_t i = 0; i < s->n_band; i++)
        add_motion(&m, (double)s->jacobian[i * s->n_columns + k]);
    return typical_motion(&m);
}

// how far that part of the surface moves over the half width, mm
static double motion_wanted(const fit_problem *p)
{
    const double step = MOTION * fit_longest_edge(&p->maps.grid);
    return fit_maps_direct(&p->maps) ? fmin(step, MOTION_OF_POINTS * p->state.point_sd) : step;
}

void sdm_fit_averaging_begin(fit_problem *p)
{
    const double wanted = motion_wanted(p);
    for (size_t k = 0; k < p->n_params; k++) {
        const double typical = fit_maps_direct(&p->maps) ? motion_at_points(&p->samples, k)
                                                         : motion_on_map(&p->maps, k),
                     range = p->high[k] - p->low[k];
        p->half_width[k] = fmin(typical > 0 ? wanted / typical : range, WIDTH_MAX * range);
    }
    if (fit_maps_direct(&p->maps)) return;
    p->averaged = true;
    p->maps_params[0] = NAN;
}

void sdm_fit_averaging_end(fit_problem *p)
{
    if (p->averaged) p->maps_params[0] = NAN;
    p->averaged = false;
}

// the same difference quotients by rotation and translation. The surface of the state is at hand
static void average_pose_gradient(fit_problem *p)
{
    const double wanted = motion_wanted(p);
    for (size_t k = p->n_params; k < p->n_params + 6; k++) {
        const double typical = motion_at_points(&p->samples, k);
        if (!(typical > 0)) continue;
        const double width = wanted / typical;
        double change = 0;
        for (int side = -1; side <= 1; side += 2) {
            double motion[FIT_MOTIONS_MAX] = {0};
            fit_state to;
            motion[k - p->n_params] = 1;
            sdm_fit_move_along(&p->state, motion, side * width, &to);
            change +=
                side * sdm_fit_samples_log_likelihood(&p->samples, &p->maps, &p->observation, &to);
        }
        p->information.gradient[k] = change / (2 * width);
    }
}

sdm_status sdm_fit_average_gradient(fit_problem *p, sdm_error *err)
{
    double params[FIT_PARAMS_MAX];
    if (!fit_maps_direct(&p->maps)) return SDM_OK;
    if (!p->opts->keep_pose) average_pose_gradient(p);
    for (size_t k = 0; k < p->n_params; k++) params[k] = p->state.params[k];
    for (size_t k = 0; k < p->n_params; k++) {
        const double here = params[k], low = fmax(here - p->half_width[k], p->low[k]),
                     high = fmin(here + p->half_width[k], p->high[k]);
        double before, after;
        params[k] = low;
        sdm_status s = sdm_fit_log_likelihood(p, params, &before, err);
        params[k] = high;
        if (!s) s = sdm_fit_log_likelihood(p, params, &after, err);
        if (s) return s;
        p->information.gradient[k] = (after - before) / (high - low);
        params[k] = here;
    }
    return SDM_OK;
}
