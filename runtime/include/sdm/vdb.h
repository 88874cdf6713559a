/* OpenVDB level sets: writing, checking, reading back. In a library of its own (C++ inside, C
 * outside). */
#ifndef SDM_VDB_H
#define SDM_VDB_H

#include <stdbool.h>

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sdm_named_value {
    const char *name, *value;
} sdm_named_value;

typedef struct sdm_vdb_opts {
    double band_voxels; /* half width of the narrow band in voxels, 3..100; 0: the default 3 */
    bool dense;         /* the whole map, grid class unset */
    bool half;          /* values stored as 16-bit floats */
    const sdm_named_value *metadata; /* string metadata: version, shape, parameters, source, error
                                        ...; names once each and not those written here: name,
                                        class, creator, file_*, is_*, sdm_* of below */
    size_t n_metadata;
    bool (*cancelled)(
        void *user); /* asked now and then; true: SDM_E_CANCELLED and no file; may be NULL */
    void *user;
} sdm_vdb_opts;

typedef struct sdm_vdb_report {
    int64_t active_voxels;
    bool cut; /* the surface leaves the grid: the level set is closed at the border of the grid */
    uint64_t hash;           /* CRC-64 of the values, stored as metadata "sdm_hash" and checked by
                                sdm_vdb_verify() */
    int64_t adjusted_voxels; /* voxels whose value was changed so that checkLevelSet passes
                                (creases, very thin parts) */
    double adjusted_mm;      /* largest such change */
} sdm_vdb_report;

/* Writes values[nz][ny][nx] as grid `surface`, atomically. A level set has uniform voxels (else
   SDM_E_ARG, naming --dense), class level set, background = band, inside filled negative, and
   passes openvdb::tools::checkLevelSet, which is run before the file is committed (SDM_E_QUALITY
   when it objects). Frame LPS, mm. report may be NULL. [any thread]

   checkLevelSet wants 0.5 <= |grad|^2 <= 1.5 at zero crossings. The differences of an exact
   distance lie outside in voxels next to a sharp edge or crease, or a part thinner than a voxel, so
   there, and only there, values are changed, each time by the least that brings a gradient back
   (Kaczmarz 1937), until the check passes. Every voxel stays on its side of the surface: none of
   the inside is lost. Zero crossings move by a fraction of a voxel. All other values are those
   given. SDM_E_QUALITY where no such values are found. A surface that leaves the grid is closed at
   the grid's border (half a voxel beyond the outermost centres), and where the band leaves the grid
   it goes on outside. SDM_E_ARG when nothing is inside, and for voxels below 2e-5 mm (1e-3 mm on
   turned axes). The file ends with a checksum of all its bytes, which other readers of OpenVDB
   files do not see. */
SDM_API sdm_status sdm_vdb_write(const char *path, const sdm_grid *grid, const float *values,
                                 const sdm_vdb_opts *opts, sdm_vdb_report *report, sdm_error *err);

/* Reads a file back: checks the checksum of the file, recomputes the hash and runs checkLevelSet.
   *text (may be NULL) receives a multi-line description (grid, class, voxels, metadata), freed with
   sdm_free(). SDM_E_FORMAT: damaged, or the hash differs. */
SDM_API sdm_status sdm_vdb_verify(const char *path, char **text, sdm_error *err);

/* Value at index (i, j, k) of grid `surface` for each of n points index[n][3], into values[n]; for
 * tests and tools. */
SDM_API sdm_status sdm_vdb_sample(const char *path, const int32_t *index, size_t n, float *values,
                                  sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
