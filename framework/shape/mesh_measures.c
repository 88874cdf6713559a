/* Names, units and texts of the measures that every shape has from its mesh. */
#include "sdm/internal/mesh_measures.h"

const sdm_measure sdm_mesh_measures[SDM_MESH_MEASURES] = {
    {"volume", "mm^3", "volume; where the mesh overlaps itself, of the union", 0},
    {"area", "mm^2", "area of the surface; where the mesh overlaps itself, of the union", 0},
    {"extent_x", "mm", "extent along x of the shape's frame", 0},
    {"extent_y", "mm", "extent along y of the shape's frame", 0},
    {"extent_z", "mm", "extent along z of the shape's frame", 0},
};
