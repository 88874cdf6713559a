/* Sorting triangles into clusters of eight that lie near each other, and a tree over them. */
#ifndef SDM_GEOM_CLUSTERS_H
#define SDM_GEOM_CLUSTERS_H

#include <stddef.h>

#include "surface_features.h"

/* Reorders order[n] (n > 0) so that eight after eight make a cluster, the last one maybe fewer, by the positions mid[order[i]][0 .. 2];
   box[order[i]]: lo, hi. node[2 ceil(n / 8)] takes the tree; returns how many were used. */
size_t sdm_clusters_build(float (*mid)[4], float (*box)[6], uint32_t *order, size_t n, sdm_cluster_node *node);

#endif
