// clang-format off
/* The whole C interface of sdmgen in one header. Its headers, in the order in which data pass
 * through a program:
 *
 *   errors, memory        sdm/status.h          sdm_status, sdm_error: the result of a function
 *                         sdm/memory.h          sdm_alloc(), sdm_free()
 *                         sdm/export.h          version of the headers
 *   a shape               sdm/shape.h           the table of a shape, for authors of plug-ins
 *                         sdm/registry.h        shapes by name; mesh and measures at parameters
 *                         sdm/builtin_shapes.h  adds the built-in shapes to a registry
 *   a mesh                sdm/mesh.h            triangles; audit of a mesh
 *                         sdm/meshfile.h        .ply .stl .obj .off .vtk .vtp files
 *   a grid                sdm/grid.h            voxels: their places in space and in arrays
 *                         sdm/pose.h            rotation and translation of a shape
 *   an exact map          sdm/exact.h           distances of a mesh, at points and on grids
 *   a map by a network    sdm/model.h           opens a model file; its parameters by name
 *                         sdm/runtime.h         maps and derivatives at given parameters
 *                         sdm/field.h           the same on any grid, at points, as a narrow band
 *                         sdm/check.h           error of a map
 *   a narrow band         sdm/blocks.h          values near a surface, in blocks of voxels
 *   use of a map          sdm/map.h             gradient and volume
 *                         sdm/isosurface.h      surface as a mesh
 *                         sdm/vdb.h             OpenVDB level set [sdmgen::vdb]
 *                         sdm/image.h           .nii .nrrd .mha .npy files [sdmgen::image]
 *                         sdm/picture.h         .png .svg .pdf pictures [sdmgen::picture]
 *   fits                  sdm/volume.h          reads images and label maps [sdmgen::image]
 *                         sdm/phantom.h         test images of a shape
 *                         sdm/fit.h             fits a shape to an image, labels or points
 *   training              sdm/train_file.h      a model from a configuration [sdmgen::training]
 *
 * Functions are in the library sdmgen::sdmgen (CMake target); in brackets: those in another one.
 * sdm/vdb.h and sdm/train_file.h are included where they are installed. A comment that ends with
 * [any thread] is of a function that several threads may call at the same time.
 *
 * For many points of one map: sdm_field_create() and sdm_field_set_params() compute it once,
 * sdm_field_points() reads it. The map of a trained network, and the distance at a point:
 *
 *   sdm_error err = {0};
 *   sdm_model *model = NULL;
 *   if (sdm_model_open("model.sdm", &model, &err)) { fputs(err.text, stderr); return 1; }
 *   const sdm_model_info *info = sdm_model_get_info(model);
 *   double *p = malloc(info->n_params * sizeof *p);                       // the parameters
 *   for (size_t i = 0; i < info->n_params; i++) p[i] = info->params[i].def;
 *   const int radius = sdm_model_param_index(model, "radius");            // -1: no such parameter
 *   if (radius >= 0) p[radius] = 3;
 *   float *values = malloc(sdm_grid_count(&info->grid) * sizeof *values); // mm, negative inside
 *   sdm_status s = sdm_generate(model, p, NULL, values, NULL, &err);
 *   if (!s) printf("%g mm at voxel (4, 5, 6)\n", values[sdm_grid_voxel(&info->grid, 4, 5, 6)]);
 *   // far from the surface some models err by more than a voxel
 *   if (sdm_model_check_use(model, SDM_USE_DISTANCE, &err)) fputs(err.text, stderr);
 *   const double x[3] = {1, 2, 0.5};                                      // LPS, mm
 *   float value, gradient[3];
 *   if (!s) s = sdm_generate_points(model, p, NULL, x, 1, &value, gradient, NULL, NULL, &err);
 *   if (!s) printf("%g mm at (1, 2, 0.5)\n", value);
 *   if (s) fputs(err.text, stderr);
 *   free(values), free(p), sdm_model_free(model); */
// clang-format on
#ifndef SDM_SDMGEN_H
#define SDM_SDMGEN_H

#include "sdm/blocks.h"
#include "sdm/builtin_shapes.h"
#include "sdm/check.h"
#include "sdm/exact.h"
#include "sdm/export.h"
#include "sdm/field.h"
#include "sdm/fit.h"
#include "sdm/grid.h"
#include "sdm/image.h"
#include "sdm/isosurface.h"
#include "sdm/map.h"
#include "sdm/memory.h"
#include "sdm/mesh.h"
#include "sdm/meshfile.h"
#include "sdm/model.h"
#include "sdm/phantom.h"
#include "sdm/picture.h"
#include "sdm/pose.h"
#include "sdm/registry.h"
#include "sdm/runtime.h"
#include "sdm/shape.h"
#include "sdm/status.h"
#include "sdm/volume.h"

#if defined(__has_include)
#if __has_include("sdm/train_file.h")
#include "sdm/train_file.h"
#endif
#if __has_include("sdm/vdb.h")
#include "sdm/vdb.h"
#endif
#endif

#endif
