/* What the C++ files of the level set library share. Only these files use OpenVDB; no exception
   leaves the library. */
#pragma once

#include <openvdb/openvdb.h>

#include <string>

#include "sdm/vdb.h"

// hidden: the library exports its C interface only
#pragma GCC visibility push(hidden)

namespace vdb_parts
{

using Grid = openvdb::FloatGrid;
using openvdb::Coord;

// exception that carries a status through C++ code; the message is in the caller's sdm_error
struct failure {
    sdm_status status;
};

inline void need(sdm_status s)
{
    if (s) throw failure{s};
}

// v after a round trip through the file: rounded if the file has 16-bit floats (half)
inline float as_stored(float v, bool half) { return half ? openvdb::io::truncateRealToHalf(v) : v; }

// fails with SDM_E_CANCELLED if the caller wants to stop
inline void check_cancelled(const sdm_vdb_opts &o, sdm_error *err)
{
    if (o.cancelled && o.cancelled(o.user))
        need(sdm_fail(err, SDM_E_CANCELLED, "level set stopped on request"));
}

// ---- vdb_creases.cc

// A crease is a voxel at a zero crossing whose gradient checkLevelSet refuses. Changes values there
// until no crease is left or the largest number of rounds is reached, and counts the changes in
// report. Since creases may remain, the caller runs checkLevelSet.
void mend_creases(Grid &grid, const sdm_vdb_opts &o, sdm_vdb_report &report, sdm_error *err);

// ---- vdb_file.cc

extern const char *const GRID_NAME;

// CRC-64 of the background, and of positions, extents, bits and activity of all values in the order
// of the tree, tiles included
uint64_t hash_of(const Grid &grid);

// the string metadata `name`; "" if the grid has none
std::string text_of(const Grid &grid, const char *name);

// checks the seal and reads the grid
Grid::Ptr read_grid(const char *path, bool *sealed, sdm_error *err);

// writes to a temporary file, reads it back, compares, and only then renames it to path
void write_grid(const char *path, const Grid::Ptr &grid, sdm_error *err);

// fails with `status` if openvdb::tools::checkLevelSet refuses the grid
void check_level_set(const Grid &grid, const char *path, sdm_status status, sdm_error *err);

} // namespace vdb_parts

#pragma GCC visibility pop
