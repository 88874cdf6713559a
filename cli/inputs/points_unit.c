/* Asks for the unit of points that are in m or um beside a shape in mm. */
#include "points_unit.h"

#include <math.h>

#include "report/terminal.h"
#include "sdm/internal/vec3.h"

/* The size of points in the right unit, over that of the shape. */
#define LEAST 0.2
#define MOST 10.0

/* Are the points of the box, times mm, about as large as the shape, and around it? */
static bool would_fit(const sdm_box *points, const sdm_box *shape, double mm)
{
    const double ratio =
        mm * sqrt(v3_dist2(points->min, points->max) / v3_dist2(shape->min, shape->max));
    for (int a = 0; a < 3; a++)
        if (mm * points->min[a] > shape->max[a] || mm * points->max[a] < shape->min[a])
            return false;
    return ratio >= LEAST && ratio <= MOST;
}

void cli_warn_points_unit(const char *path, const double *x, size_t n, const sdm_box *shape,
                          const char *name)
{
    sdm_box points = SDM_BOX_EMPTY;
    sdm_box_add_points(&points, x, n);
    const char *unit = would_fit(&points, shape, 1e3)    ? "m"
                       : would_fit(&points, shape, 1e-3) ? "um"
                                                         : NULL;
    if (unit)
        cli_warn("%s: the points measure %.3g mm across, %s %.3g mm: are they in %s? "
                 "lengths are mm",
                 path, sqrt(v3_dist2(points.min, points.max)), name,
                 sqrt(v3_dist2(shape->min, shape->max)), unit);
}
