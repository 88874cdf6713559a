/* Writes a distance map to a file; the ending of the file name selects the type. */
#pragma once

#include "args/options.h"
#include "sdm/blocks.h"
#include "sdm/exact.h"
#include "sdm/grid.h"
#include "sdm/model.h"
#include "sdm/runtime.h"

/* Part of the text in the header of an image file that holds a distance map. */
#define SDM_MAP_TEXT "mm, negative inside"

/* A map with the facts that go into the metadata of its file. */
typedef struct cli_map {
    const sdm_grid *grid;
    const float *values; /* [nz][ny][nx], mm; NULL: the map is in `blocks` */
    /* narrow-band map with the band of cli_blocks_band(), for level sets only; NULL: in values */
    const sdm_blocks *blocks;
    const char *shape;  /* name of the shape or of the mesh file */
    const char *params; /* "a=4.4 alpha=0.5", "" for a mesh file */
    sdm_source source;  /* network or exact engine */
    bool clamped;       /* parameters were clamped to the trained range */
    double error_mm;    /* of a network: its RMSE; else the bound on the error */
    double volume; /* of the shape, mm^3: a surface that encloses much less or more is warned of; 0:
                      not known */
    double trained_mm; /* of a network: longest edge of a voxel of its training; 0: exact maps */
    const sdm_model_quality
        *quality;  /* of a network: errors that its training measured; else NULL */
    bool thin;     /* a part is too thin for the voxels, as was told with a better spacing */
    size_t pieces; /* closed surfaces of the shape: more of them in a file are warned of; 0: not
                      known */
    const char *origin; /* "model CHECKSUM", or the method without a network: "exact", "edt" ... */
    sdm_reason reason;  /* why the exact engine replaced the network */
    const sdm_check *check; /* errors of the network's map; NULL: not checked */
    sdm_exact *engine;      /* makes the same map on other grids; NULL: none */
} cli_map;

/* Writes the map to the n files in paths[]; compares only the first surface with the shape. Errors
 * as cli_write_map(). */
sdm_status cli_write_maps(const char *const *paths, size_t n, cli_map *map, const cli_args *args,
                          sdm_error *err);

/* Sets what surfaces are compared with, to the values of the mesh of the shape: map->volume, and
 * map->pieces where no parts grow together. Nothing for an open mesh, or one with parts that are
 * inside out. */
void cli_map_compare(const sdm_mesh *shape, cli_map *map);

/* True if an output of the command line is a surface. */
bool cli_writes_surface(const cli_args *args);

/* True if an output of the command line is a level set (.vdb). */
bool cli_writes_level_set(const cli_args *args);

/* Checks, before any work, that the ending of the name is a known type; meshes_only: a known type
 * of mesh files. SDM_E_ARG; SDM_E_UNSUPPORTED: .vdb in a build without OpenVDB. */
sdm_status cli_check_type(const char *path, bool meshes_only, sdm_error *err);

/* Refuses options of level sets (--band, --half, --dense) if no output is a .vdb file, and --band
 * with --dense: they would do nothing. SDM_E_ARG. */
sdm_status cli_check_vdb_options(const cli_args *args, sdm_error *err);

/* Whether all outputs of the command line are level sets, for which blocks suffice. */
bool cli_blocks_suffice(const cli_args *args);

/* *band_mm = half width of the band of a level set on this grid. Errors as sdm_vdb_band(). */
sdm_status cli_blocks_band(const sdm_grid *grid, const cli_args *args, double *band_mm,
                           sdm_error *err);

/* Whether the name is that of a picture: .png .svg .pdf. */
bool cli_is_picture(const char *path);

/* Writes the map to `path`. Notices, such as a surface cut by the grid, go to stderr.
 * SDM_E_CANCELLED after an interrupt; SDM_E_MESH: no zero surface to write as a mesh; SDM_E_IO. */
sdm_status cli_write_map(const char *path, const cli_map *map, const cli_args *args,
                         sdm_error *err);

/* Writes labels[grid], 1 inside and 0 outside; as .seg.nrrd a segmentation with one segment of this
 * name. Errors as sdm_volume_write() and sdm_segmentation_write(). */
sdm_status cli_write_labels(const char *path, const sdm_grid *grid, const uint8_t *labels,
                            const char *name, const char *text, sdm_error *err);

/* Whether a name has a place for a number: %d, %4d, %04d. */
bool cli_has_number(const char *path);

/* buf[size] = path with `row` in place of its %d (or %4d, %04d); without one, "-0001" is inserted
 * before the ending. SDM_E_ARG: the name is too long. */
sdm_status cli_number_path(const char *path, size_t row, char *buf, size_t size, sdm_error *err);
