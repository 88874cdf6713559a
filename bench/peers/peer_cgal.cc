/* CGAL: distances by its AABB tree with the search structure for distance queries, signs by
 * Side_of_triangle_mesh. */
#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Side_of_triangle_mesh.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/version.h>

#include <array>
#include <memory>
#include <stdexcept>
#include <vector>

#include "peer.h"

namespace
{

// the fastest kernel, which CGAL's manual uses for distance queries; its predicates are not exact
using kernel = CGAL::Simple_cartesian<double>;
using surface = CGAL::Surface_mesh<kernel::Point_3>;
using primitive = CGAL::AABB_face_graph_triangle_primitive<surface>;
using tree = CGAL::AABB_tree<CGAL::AABB_traits<kernel, primitive>>;
using side = CGAL::Side_of_triangle_mesh<surface, kernel, CGAL::Default, tree>;

struct solid {
    surface mesh;
    std::unique_ptr<tree> boxes;
    std::unique_ptr<side> inside;

    explicit solid(const sdm_mesh &m)
    {
        namespace pmp = CGAL::Polygon_mesh_processing;
        std::vector<kernel::Point_3> vert(m.n_vert);
        std::vector<std::array<size_t, 3>> tri(m.n_tri);
        for (size_t i = 0; i < m.n_vert; i++)
            vert[i] = {m.vert[3 * i], m.vert[3 * i + 1], m.vert[3 * i + 2]};
        for (size_t i = 0; i < m.n_tri; i++)
            tri[i] = {m.tri[3 * i], m.tri[3 * i + 1], m.tri[3 * i + 2]};
        if (!pmp::is_polygon_soup_a_polygon_mesh(tri))
            throw std::runtime_error("CGAL: the mesh is not manifold");
        pmp::polygon_soup_to_polygon_mesh(vert, tri, mesh);
        if (!CGAL::is_closed(mesh))
            throw std::runtime_error("CGAL: Side_of_triangle_mesh needs a closed mesh");
        boxes = std::make_unique<tree>(faces(mesh).begin(), faces(mesh).end(), mesh);
        boxes->accelerate_distance_queries();
        boxes->build();
        inside = std::make_unique<side>(*boxes);
    }
};

peer::map_function prepare(const peer::job &j)
{
    const auto s = std::make_shared<solid>(j.mesh);
    return [s, &j](float *values) {
        peer::for_places(j, values, [&](const double x[3]) {
            const kernel::Point_3 p(x[0], x[1], x[2]);
            const double d = std::sqrt(s->boxes->squared_distance(p));
            return (*s->inside)(p) == CGAL::ON_BOUNDED_SIDE ? -d : d;
        });
    };
}

} // namespace

int main(int argc, char **argv)
{
    peer::about a;
    a.points = true;
    a.version = "CGAL " CGAL_VERSION_STR;
    a.note = "AABB tree with accelerate_distance_queries, Side_of_triangle_mesh; measures to all "
             "triangles";
    return peer::run(argc, argv, a, prepare);
}
