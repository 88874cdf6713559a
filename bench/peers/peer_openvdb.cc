/* OpenVDB: meshToVolume over a band that reaches all voxels of the grid, or over the requested
 * narrow band. */
#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "peer.h"

namespace
{

/* The mesh as the arrays for which the library holds a compiled meshToVolume(): a type of our own
 * would take a minute to compile. Vertices in voxel indices. */
struct index_mesh {
    std::vector<openvdb::Vec3s> vertices;
    std::vector<openvdb::Vec3I> triangles;
};

index_mesh in_voxels(const peer::job &j)
{
    index_mesh m;
    for (size_t v = 0; v < j.mesh.n_vert; v++) {
        openvdb::Vec3d at;
        for (int i = 0; i < 3; i++)
            at[i] = (j.mesh.vert[3 * v + i] - j.grid.origin[i]) / j.grid.spacing[i];
        m.vertices.emplace_back(at);
    }
    for (size_t t = 0; t < j.mesh.n_tri; t++) m.triangles.emplace_back(&j.mesh.tri[3 * t]);
    return m;
}

/* Half widths of the band in voxels. */
struct widths {
    float outside, inside;
};

/* Half widths that reach all voxels. Outside: the largest distance of 5 x 5 x 5 points of the
 * grid to the nearest of about 1000 vertices, plus a voxel; an estimate, because a safe bound
 * would make the band much slower. Inside: half the shortest edge of the mesh's bounding box,
 * plus a voxel. */
widths full_widths(const peer::job &j)
{
    const size_t step = 1 + j.mesh.n_vert / 1000;
    double low[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL},
           far2 = 0;
    for (size_t v = 0; v < 3 * j.mesh.n_vert; v++) {
        low[v % 3] = std::min(low[v % 3], j.mesh.vert[v]);
        high[v % 3] = std::max(high[v % 3], j.mesh.vert[v]);
    }
    for (int k = 0; k < 125; k++) {
        const int at[3] = {k % 5, k / 5 % 5, k / 25};
        double nearest2 = HUGE_VAL;
        for (size_t v = 0; v < j.mesh.n_vert; v += step) {
            double sum = 0;
            for (int i = 0; i < 3; i++) {
                const double x = j.grid.origin[i] + j.grid.spacing[i] * 0.25 * at[i] *
                                                        static_cast<double>(j.grid.n[i] - 1);
                sum += (x - j.mesh.vert[3 * v + i]) * (x - j.mesh.vert[3 * v + i]);
            }
            nearest2 = std::min(nearest2, sum);
        }
        far2 = std::max(far2, nearest2);
    }
    const double edge = std::min({high[0] - low[0], high[1] - low[1], high[2] - low[2]}),
                 h = j.grid.spacing[0];
    return {static_cast<float>(std::sqrt(far2) / h + 1), static_cast<float>(0.5 * edge / h + 1)};
}

peer::map_function prepare(const peer::job &j)
{
    if (j.grid.spacing[0] != j.grid.spacing[1] || j.grid.spacing[0] != j.grid.spacing[2])
        throw std::runtime_error("OpenVDB level sets need voxels with equal edges");
    const double h = j.grid.spacing[0];
    // half a voxel more, to include voxels at the edge of the band
    const float narrow = static_cast<float>(j.band / h + 0.5);
    const widths w = j.band > 0 ? widths{narrow, narrow} : full_widths(j);
    const auto frame = openvdb::math::Transform::createLinearTransform(h);
    const index_mesh m = in_voxels(j);
    const openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, openvdb::Vec3I> mesh(
        m.vertices, m.triangles);
    openvdb::util::NullInterrupter never;
    const auto level =
        openvdb::tools::meshToVolume<openvdb::FloatGrid>(never, mesh, *frame, w.outside, w.inside);
    return [level, &j](float *values) {
        const openvdb::CoordBBox box(0, 0, 0, static_cast<int>(j.grid.n[0]) - 1,
                                     static_cast<int>(j.grid.n[1]) - 1,
                                     static_cast<int>(j.grid.n[2]) - 1);
        openvdb::tools::Dense<float, openvdb::tools::LayoutXYZ> dense(box, values);
        openvdb::tools::copyToDense(*level, dense, true);
    };
}

} // namespace

int main(int argc, char **argv)
{
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    openvdb::initialize();
    peer::about a;
    a.version = std::string("OpenVDB ") + openvdb::getLibraryVersionString();
    a.note = "meshToVolume; its values near the surface are smoothed; prepare makes the volume, "
             "map copies it";
    a.whole = a.band = true;
    return peer::run(argc, argv, a, prepare);
}
