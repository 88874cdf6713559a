/* A read and a write function for each format of mesh files. */
#pragma once

#include "bytes.h"
#include "scan.h"
#include "sdm/internal/builder.h"
#include "sdm/meshfile.h"

/* Read a whole file, data[size], into the builder. A zero byte follows the data; the functions may
 * modify both. The caller calls sdm_builder_finish(). SDM_E_FORMAT with file and line or byte,
 * SDM_E_UNSUPPORTED, SDM_E_NOMEM. */
sdm_status sdm_ply_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_stl_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_obj_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_off_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_vtk_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_vtp_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);

/* Write a mesh to an open file. The caller has checked its indices and coordinates, and commits the
 * file. sdm_stl_write(): SDM_E_MESH for a coordinate outside float32. */
sdm_status sdm_ply_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_stl_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_obj_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_off_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_vtk_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_vtp_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
