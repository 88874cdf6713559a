/* Reads and writes triangle mesh files; the ending of the name selects the format: .ply .stl .obj
 * .off .vtk .vtp */
#ifndef SDM_MESHFILE_H
#define SDM_MESHFILE_H

#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Reads PLY (ASCII, and binary in both byte orders), STL (ASCII, binary), OBJ, OFF, VTK
   polydata in legacy files .vtk (ASCII, binary; versions 1 to 5.1) and in XML .vtp (one piece;
   ASCII, base64 or appended, also with zlib). Polygons become fans of triangles; equal vertices of
   STL are merged. Coordinates are mm. *out must be zero-initialised; the caller frees it by
   sdm_mesh_dispose(). Declared sizes are checked against the length of the file before memory is
   allocated. SDM_E_ARG, SDM_E_IO, SDM_E_NOMEM; SDM_E_FORMAT with file and line (text) or byte
   offset (binary); SDM_E_UNSUPPORTED for another ending. */
SDM_API sdm_status sdm_mesh_read(const char *path, sdm_mesh *out, sdm_error *err);

/* Writes .ply (binary, little endian, double), .stl (binary, float32), .obj, .off, .vtk
   (binary, version 3.0, double) or .vtp (base64, double). The file appears under its name only when
   it is complete. SDM_E_ARG, SDM_E_IO, SDM_E_NOMEM; SDM_E_MESH for bad indices or coordinates;
   SDM_E_UNSUPPORTED for another ending. */
SDM_API sdm_status sdm_mesh_write(const char *path, const sdm_mesh *mesh, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
