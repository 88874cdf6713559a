/* Writing a map in the form its file name asks for. */
#ifndef CLI_OUTPUT_H
#define CLI_OUTPUT_H

#include "args/options.h"
#include "sdm/grid.h"
#include "sdm/runtime.h"

/* What is known about a map; goes into the metadata of the file. */
typedef struct cli_map {
    const sdm_grid *grid;
    const float *values; /* [nz][ny][nx], mm */
    const char *shape;   /* name of the shape or of the mesh file */
    const char *params;  /* "a=4.4 alpha=0.5", "" for a mesh file */
    sdm_source source;
    bool clamped;
    double error_mm;
    const char
        *origin; /* the model's checksum, or the method without a network: "exact", "edt" ... */
    sdm_reason reason;      /* why the exact engine stood in for the network */
    const sdm_check *check; /* of the network's map; NULL: not checked */
} cli_map;

/* Checks, before any work, that the type of the file is known by its name. SDM_E_ARG,
 * SDM_E_UNSUPPORTED. */
sdm_status cli_check_type(const char *path, bool meshes_only, sdm_error *err);

/* Whether the name is that of a picture: .png .svg .pdf. */
bool cli_is_picture(const char *path);

/* Writes the map to `path`. Notices (a surface cut by the grid) go to stderr. */
sdm_status cli_write_map(const char *path, const cli_map *map, const cli_args *args,
                         sdm_error *err);

/* buf = path with row number `row` for its %d (%4d, %04d), or "-0001" before the extension.
 * SDM_E_ARG: too long. */
sdm_status cli_number_path(const char *path, size_t row, char *buf, size_t size, sdm_error *err);

#endif
