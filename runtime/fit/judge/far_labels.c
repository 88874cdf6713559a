/* Labels that contradict the shape away from its surface. */
#include "far_labels.h"

#include <math.h>

#include "fit/data/samples.h"

// distances at which labels and maps err: this part of an edge of the labels, and of a voxel of the
// maps
#define LABEL_REACH 1.25
#define MAP_REACH 0.25
// fewer voxels, or a smaller share of the shape, are strays
#define VOXELS_MIN 8.0
#define SHARE_MIN 0.002

fit_far_labels sdm_fit_far_labels(const fit_problem *p, double beyond)
{
    const fit_field field = {
        .grid = &p->maps.grid, .packed = p->maps.distance, .n_fields = 1, .distance = true};
    const double weight = pow((double)p->stride, 3);
    fit_far_labels far = {.limit = LABEL_REACH * fit_longest_edge(&p->target->grid) +
                                   MAP_REACH * fit_longest_edge(&p->maps.grid)};
    for (size_t i = 0; i < p->samples.n; i++) {
        const bool label = p->samples.value[i] > 0.5f;
        const double d = sdm_fit_field_at(&field, &p->state, p->samples.world + 3 * i);
        if (label ? d > far.limit : d < -far.limit) {
            far.voxels[!label] += weight;
            far.depth[!label] = fmax(far.depth[!label], fabs(d));
        }
    }
    far.voxels[0] += beyond;
    return far;
}

bool sdm_fit_far_labels_count(const fit_problem *p, double voxels)
{
    const sdm_grid *image = &p->target->grid, *map = &p->maps.grid;
    double inside = 0;
    for (size_t v = 0; v < p->maps.n_voxels; v++) inside += p->maps.distance[v] < 0;
    inside *= map->spacing[0] * map->spacing[1] * map->spacing[2] /
              (image->spacing[0] * image->spacing[1] * image->spacing[2]);
    return voxels >= VOXELS_MIN && voxels > SHARE_MIN * inside;
}
