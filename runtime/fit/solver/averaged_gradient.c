/* Averaged gradient: difference quotients of the log-likelihood over a fixed motion of the surface.
 */
#include "averaged_gradient.h"

#include <math.h>

#include "objective.h"
#include "open_motions.h"

// rms motion of the surface over the half width, in voxels of the map: large enough to cross many
// kinks, but small compared to the details that an image resolves
#define MOTION 0.03
// largest half width, as a share of the parameter's range
#define WIDTH_MAX 0.05

// mean square motion of the surface per unit of parameter k, over voxels within one voxel of it
static double motion_on_map(const fit_maps *m, size_t k)
{
    double sum = 0, n = 0;
    for (size_t v = 0; v < m->n_voxels; v++) {
        if (fabs(m->distance[v]) > fit_longest_edge(&m->grid)) continue;
        sum += (double)m->jacobian[k * m->n_voxels + v] * (double)m->jacobian[k * m->n_voxels + v];
        n++;
    }
    return n > 0 ? sum / n : 0;
}

// the same per unit of column k, over the points
static double motion_at_points(const fit_samples *s, size_t k)
{
    double sum = 0;
    for (size_t i = 0; i < s->n_band; i++)
        sum +=
            (double)s->jacobian[i * s->n_columns + k] * (double)s->jacobian[i * s->n_columns + k];
    return s->n_band ? sum / (double)s->n_band : 0;
}

void sdm_fit_averaging_widths(const fit_problem *p, double *half_width)
{
    const double step = fit_longest_edge(&p->maps.grid);
    for (size_t k = 0; k < p->n_params; k++) {
        const double square = fit_maps_direct(&p->maps) ? motion_at_points(&p->samples, k)
                                                        : motion_on_map(&p->maps, k),
                     range = p->high[k] - p->low[k];
        half_width[k] = fmin(square > 0 ? MOTION * step / sqrt(square) : range, WIDTH_MAX * range);
    }
}

// the same difference quotients by rotation and translation. The surface of the state is at hand
static void average_pose_gradient(fit_problem *p)
{
    const double step = fit_longest_edge(&p->maps.grid);
    for (size_t k = p->n_params; k < p->n_params + 6; k++) {
        const double square = motion_at_points(&p->samples, k);
        if (!(square > 0)) continue;
        const double width = MOTION * step / sqrt(square);
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

sdm_status sdm_fit_average_gradient(fit_problem *p, const double *half_width, sdm_error *err)
{
    double params[FIT_PARAMS_MAX];
    // on a map the interpolation makes the likelihood smooth in the pose
    if (fit_maps_direct(&p->maps) && !p->opts->keep_pose) average_pose_gradient(p);
    for (size_t k = 0; k < p->n_params; k++) params[k] = p->state.params[k];
    for (size_t k = 0; k < p->n_params; k++) {
        const double here = params[k], low = fmax(here - half_width[k], p->low[k]),
                     high = fmin(here + half_width[k], p->high[k]);
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
