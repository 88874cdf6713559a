/* OpenVDB level sets: writing, checking, reading back. A library of its own with a C interface; it
   is written in C++. */
#ifndef SDM_VDB_H
#define SDM_VDB_H

#include <stdbool.h>

#include "sdm/blocks.h"
#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sdm_named_value {
    const char *name, *value;
} sdm_named_value;

typedef struct sdm_vdb_opts {
    double band_voxels; /* half width of the narrow band in voxels, 3 .. 100; 0: the default 3 */
    bool dense; /* true: writes the whole map, with grid class unset, instead of a level set */
    bool half;  /* true: values are stored as 16-bit floats */
    /* String metadata, for example version, shape, parameters, source, error. Each name may be
       given at most once. Names that the writer sets itself are not allowed: name, class, creator,
       file_*, is_* and its own sdm_* entries. */
    const sdm_named_value *metadata;
    size_t n_metadata;
    /* Called now and then; true: SDM_E_CANCELLED and no file. May be NULL. */
    bool (*cancelled)(void *user);
    /* Makes the same map on another grid: values[nz][ny][nx]. Called at most once, with a larger
       grid, if the band leaves the grid and the surface does not: it gives the values of the band
       beyond the grid. NULL: they are estimated from the values at its border. */
    sdm_status (*map)(void *user, const sdm_grid *grid, float *values, sdm_error *err);
    void *user; /* passed to cancelled() and map() */
} sdm_vdb_opts;

typedef struct sdm_vdb_report {
    int64_t active_voxels;
    bool cut; /* true: the surface leaves the grid; the level set is closed at its border */
    /* CRC-64 of the values, stored as metadata "sdm_hash"; sdm_vdb_verify() checks it. */
    uint64_t hash;
    /* Voxels whose value was changed to satisfy checkLevelSet (creases, very thin parts). */
    int64_t adjusted_voxels;
    double adjusted_mm; /* largest such change */
    /* Voxels of the band beyond the grid whose distances are estimated from those at its border, to
     * about a quarter of a voxel. */
    int64_t estimated_voxels;
} sdm_vdb_report;

/* Writes values[nz][ny][nx] as grid `surface`, atomically. Coordinates are LPS, mm. report may be
   NULL. [any thread]

   A level set has uniform voxels, class level set, background = half width of the band, and
   negative values filled inside. The file is committed only if openvdb::tools::checkLevelSet
   accepts it, else SDM_E_QUALITY. The map itself (`dense`) may have voxels of any shape.

   checkLevelSet demands 0.5 <= |grad|^2 <= 1.5 at zero crossings. The finite differences of an
   exact distance violate this next to a sharp edge or crease, or where a part is thinner than a
   voxel. Only there, values are changed, each time by the smallest change that brings a gradient
   back (Kaczmarz 1937), until the check passes; SDM_E_QUALITY if it never does. Signs stay: no
   voxel changes between inside and outside. Zero crossings move by a fraction of a voxel.

   A surface that leaves the grid is closed at the grid's border (half a voxel beyond the outermost
   centres). Where only the band leaves the grid, it continues outside: by opts->map(), else by
   estimates (report->estimated_voxels).

   SDM_E_ARG: nothing is inside; voxels of a level set are not uniform (the message names the
   remedy, opts->dense); voxels are below 2e-5 mm (1e-3 mm on rotated axes). The file ends with a
   checksum of all its bytes, which other readers of OpenVDB files ignore. */
SDM_API sdm_status sdm_vdb_write(const char *path, const sdm_grid *grid, const float *values,
                                 const sdm_vdb_opts *opts, sdm_vdb_report *report, sdm_error *err);

/* *band_mm = half width of the band of a level set on this grid, mm: that of opts->band_voxels,
   rounded up so that checkLevelSet accepts it. SDM_E_ARG as for sdm_vdb_write(). [any thread] */
SDM_API sdm_status sdm_vdb_band(const sdm_grid *grid, const sdm_vdb_opts *opts, double *band_mm,
                                sdm_error *err);

/* Writes a narrow-band map in blocks as a level set, without a dense map: each block becomes a leaf
   of the tree. For blocks whose band_mm is that of sdm_vdb_band() the file has the same tree as
   that of sdm_vdb_write() for the dense map, and is checked in the same way. opts->dense must not
   be set. SDM_E_ARG also if the blocks have another band, or if the band reaches the border
   of the grid: such a map must be written by sdm_vdb_write(). [any thread] */
SDM_API sdm_status sdm_vdb_write_blocks(const char *path, const sdm_blocks *blocks,
                                        const sdm_vdb_opts *opts, sdm_vdb_report *report,
                                        sdm_error *err);

/* Reads a file back: checks the checksum of the file, recomputes the hash and, for a level set,
   runs checkLevelSet. *text (`text` may be NULL) = new multi-line description (grid, class, voxels,
   metadata), freed with sdm_free(). SDM_E_FORMAT: damaged, or the hash differs. */
SDM_API sdm_status sdm_vdb_verify(const char *path, char **text, sdm_error *err);

/* values[n] = values of grid `surface` at the voxel indices (i, j, k) in index[n][3]; for tests and
   tools. */
SDM_API sdm_status sdm_vdb_sample(const char *path, const int32_t *index, size_t n, float *values,
                                  sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
