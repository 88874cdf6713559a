/* Labels that contradict the shape away from its surface. */
#include "far_labels.h"

#include <math.h>

#include "fit/data/samples.h"

// labels and maps err up to this distance from the surface: this part of an edge of the labels, and
// of a voxel of the maps
#define LABEL_REACH 1.25
#define MAP_REACH 0.25
// fewer voxels, or a smaller share of the volume of the shape, are strays
#define VOXELS_MIN 8.0
#define SHARE_MIN 0.002

// volume of the shape, in voxels of the labels
static double volume_of(const fit_problem *p)
{
    const double *label = p->target->grid.spacing, *map = p->maps.grid.spacing;
    double inside = 0;
    for (size_t v = 0; v < p->maps.n_voxels; v++) inside += p->maps.distance[v] < 0;
    return inside * map[0] * map[1] * map[2] / (label[0] * label[1] * label[2]);
}

fit_far_labels sdm_fit_far_labels(const fit_problem *p, double beyond)
{
    const fit_field field = sdm_fit_maps_distances(&p->maps);
    const double reach = LABEL_REACH * fit_longest_edge(&p->target->grid) +
                         MAP_REACH * fit_longest_edge(&p->maps.grid),
                 weight = pow((double)p->stride, 3), volume = fmax(volume_of(p), 1);
    fit_far_labels far = {.voxels = {beyond, 0}, .limit = fmax(SHARE_MIN, VOXELS_MIN / volume)};
    for (size_t i = 0; i < p->samples.n; i++) {
        const bool label = p->samples.value[i] > 0.5f;
        const double d = sdm_fit_field_at(&field, &p->state, p->samples.world + 3 * i);
        if (!(label ? d > reach : d < -reach)) continue;
        far.voxels[!label] += weight;
        far.depth[!label] = fmax(far.depth[!label], fabs(d));
    }
    for (int side = 0; side < 2; side++)
        if (!(far.voxels[side] >= VOXELS_MIN && far.voxels[side] > SHARE_MIN * volume))
            far.voxels[side] = 0;
    for (int side = 0; side < 2; side++) far.share[side] = far.voxels[side] / volume;
    return far;
}
