/* What the files of the level set library share that knows OpenVDB: C++, and no exception leaves
 * the library. */
#ifndef VDB_PARTS_H
#define VDB_PARTS_H

#include <openvdb/openvdb.h>

#include <string>

#include "sdm/vdb.h"

// the library exports its C interface alone
namespace vdb_parts __attribute__((visibility("hidden")))
{

    using Grid = openvdb::FloatGrid;
    using openvdb::Coord;

    // a status on its way through C++ code; the text is in the caller's sdm_error
    struct failure {
        sdm_status status;
    };

    inline void need(sdm_status s)
    {
        if (s) throw failure{s};
    }

    // as it comes back from a file of 16-bit floats, where it is written to one
    inline float as_stored(float v, bool half)
    {
        return half ? openvdb::io::truncateRealToHalf(v) : v;
    }

    // SDM_E_CANCELLED where the caller wants to stop
    void check_cancelled(const sdm_vdb_opts &o, sdm_error *err);

    /* Changes values at creases until checkLevelSet has nothing to object to, and counts them in
   report (the check is the caller's: this may end without success). */
    void mend_creases(Grid & grid, const sdm_vdb_opts &o, sdm_vdb_report &report, sdm_error *err);

    // ---- files

    extern const char *const GRID_NAME;

    // of coordinates, extents and bits of all values in the order of the tree, tiles included
    uint64_t hash_of(const Grid &grid);

    // string metadata; "": none of that name
    std::string text_of(const Grid &grid, const char *name);

    Grid::Ptr read_grid(const char *path, bool *sealed, sdm_error *err);

    // writes, reads back and compares before the file gets its name
    void write_grid(const char *path, const Grid::Ptr &grid, sdm_error *err);

    // `status` where checkLevelSet objects
    void check_level_set(const Grid &grid, const char *path, sdm_status status, sdm_error *err);

} // namespace )

#endif
