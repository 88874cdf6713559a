/* Readers and writers of mesh files: one pair of functions for each format. */
#ifndef SDM_IO_MESHPARTS_H
#define SDM_IO_MESHPARTS_H

#include "bytes.h"
#include "scan.h"
#include "sdm/internal/builder.h"
#include "sdm/meshfile.h"

/* Readers take the whole file (one zero byte behind it) and may write to it; the mesh is finished
 * by the caller. */
sdm_status sdm_ply_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_stl_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_obj_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_off_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);

/* Writers get a mesh whose indices and coordinates have been checked. */
sdm_status sdm_ply_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_stl_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_obj_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_off_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);

#endif
