/* What the peer programs share: other people's libraries that make the same distance map, each in a
   program sdmgen-peer-NAME that `sdmgen bench exact` starts. sdmgen-peer-NAME MESH NX NY NZ OX OY
   OZ SX SY SZ SHARE BAND REPEAT VALUES.npy MESH: .ply in mm. Then voxels, centre of the first voxel
   and voxel edges (mm) of an axis-aligned grid. SHARE in (0, 1]: only rows r (of voxels along x, r
   = j + NY k) with frac(r * 0.6180339887498949) < SHARE need to be done, as much as the library
   can. BAND: 0, or only voxels with |distance| <= BAND mm need a value. REPEAT: runs at most; the
   best one counts. Written: float32 values[NZ][NY][NX], mm, negative inside, NaN where nothing was
   computed; and one line of JSON on stdout: prepare_ms, map_ms   processor time of one thread,
   files not included, for the share share                of the voxels done peak_kb largest
   resident memory over that before preparing; -1: unknown band                 true when BAND saved
   work version, note        texts or {"error": "what is missing and what to install"}. */
#ifndef SDMGEN_PEER_H
#define SDMGEN_PEER_H

#include <cmath>
#include <functional>
#include <string>

#include "sdm/grid.h"
#include "sdm/mesh.h"

namespace peer
{

struct job {
    sdm_mesh mesh{};
    sdm_grid grid{};
    double share = 1, band = 0;
    int repeat = 1;

    bool has_row(int64_t row) const
    {
        const double x = static_cast<double>(row) * 0.6180339887498949;
        return x - std::floor(x) < share;
    }
};

struct about {
    std::string version, note;
    bool whole = false; // always the whole grid, whatever the share
    bool band = false;  // does less for a band
};

/* Writes the values of all voxels, or of the share's. What it captures is what was prepared. */
using map_function = std::function<void(float *values)>;

/* Reads the arguments and the mesh, times prepare() and the map it returns, writes the results.
   Returns main()'s exit code. An exception becomes the "error" of the JSON line. */
int run(int argc, char **argv, const about &a,
        const std::function<map_function(const job &)> &prepare);

/* values = distance(x) at every voxel of the share, in rows along x. */
template <class F> void for_voxels(const job &j, float *values, F &&distance)
{
    const sdm_grid &g = j.grid;
    for (int64_t row = 0; row < g.n[1] * g.n[2]; row++) {
        if (!j.has_row(row)) continue;
        double x[3] = {0, g.origin[1] + g.spacing[1] * static_cast<double>(row % g.n[1]),
                       g.origin[2] + g.spacing[2] * static_cast<double>(row / g.n[1])};
        for (int64_t i = 0; i < g.n[0]; i++) {
            x[0] = g.origin[0] + g.spacing[0] * static_cast<double>(i);
            values[row * g.n[0] + i] = static_cast<float>(distance(x));
        }
    }
}

} // namespace peer

#endif
