/* Reading and writing of triangle mesh files, chosen by the file name: .ply .stl .obj .off */
#ifndef SDM_MESHFILE_H
#define SDM_MESHFILE_H

#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Reads PLY (ASCII, binary of both byte orders), STL (ASCII, binary), OBJ, OFF. Polygons become
   fans of triangles; bitwise equal vertices of STL are welded. Coordinates are taken as mm. *out is
   zero-initialised. Sizes are checked against the file before anything is allocated. SDM_E_IO;
   SDM_E_FORMAT with file and line (text) or byte offset; SDM_E_UNSUPPORTED for another type. */
SDM_API sdm_status sdm_mesh_read(const char *path, sdm_mesh *out, sdm_error *err);

/* Writes .ply (binary little endian, double), .stl (binary), .obj or .off, atomically. */
SDM_API sdm_status sdm_mesh_write(const char *path, const sdm_mesh *mesh, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
