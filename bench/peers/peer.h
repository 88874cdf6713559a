/* Peer programs: each makes the map of `sdmgen bench exact`, or the distances of `sdmgen bench
   points`, with another library. Calls:

     sdmgen-peer-NAME MESH NX NY NZ OX OY OZ SX SY SZ SHARE BAND REPEAT VALUES.npy
     sdmgen-peer-NAME MESH POINTS.npy REPEAT VALUES.npy

   MESH          .ply file, mm
   NX NY NZ      number of voxels of an axis-aligned grid
   OX OY OZ      centre of the first voxel, mm
   SX SY SZ      edges of a voxel, mm
   SHARE         in (0, 1]: row r = j + NY k of voxels along x must be computed if
                 frac(r * 0.6180339887498949) < SHARE; a library may compute more
   BAND          0, or only voxels with abs(distance) <= BAND mm need a value
   REPEAT        largest number of runs; the fastest one counts
   POINTS.npy    float64 points[n][3], mm, in any order
   VALUES.npy    output: float32 values[NZ][NY][NX] or [n], mm, negative inside, NaN where not
                 computed

   The program prints one line of JSON on stdout:

   prepare_ms, map_ms  processor time of one thread, without files, for the computed share
   share               fraction of the voxels computed; 1 for points
   peak_kb             peak of the resident memory above that before preparing; -1: unknown
   band                true when BAND saved work
   version, note       texts

   or {"error": "what is missing and what to install, or that it has no distances at points"}. */
#ifndef SDMGEN_PEER_H
#define SDMGEN_PEER_H

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "sdm/grid.h"
#include "sdm/mesh.h"

namespace peer
{

/* The arguments. */
struct job {
    sdm_mesh mesh{};
    sdm_grid grid{};
    std::vector<double> points; // [n][3]; empty: the voxels of the grid
    double share = 1, band = 0;
    int repeat = 1;

    /* True for the rows of voxels that SHARE requires. */
    bool has_row(int64_t row) const
    {
        const double x = static_cast<double>(row) * 0.6180339887498949;
        return x - std::floor(x) < share;
    }
};

/* Facts about a library. */
struct about {
    std::string version, note;
    bool whole = false;  // computes the whole grid for every share
    bool band = false;   // does less work for a narrow band
    bool points = false; // computes distances at any points
};

/* Writes the values of all voxels, of the required rows, or of the points; captures the prepared
 * data. */
using map_function = std::function<void(float *values)>;

/* Reads the arguments and the mesh, measures prepare() and the function that it returns, and
 * writes the results. Returns the exit code of main(). An exception becomes the "error" of
 * the JSON line. */
int run(int argc, char **argv, const about &a,
        const std::function<map_function(const job &)> &prepare);

/* values = distance(x) at every voxel of the required rows, in the order of x, or at every point.
 */
template <class F> void for_places(const job &j, float *values, F &&distance)
{
    for (size_t i = 0; 3 * i < j.points.size(); i++)
        values[i] = static_cast<float>(distance(&j.points[3 * i]));
    if (!j.points.empty()) return;
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
