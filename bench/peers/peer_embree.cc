/* Embree: point queries on its bounding volume hierarchy. A callback computes the distance to a
 * triangle, as in Embree's tutorial; the sign is that of the angle-weighted pseudo-normal
 * (Baerentzen and Aanaes 2005). */
#include <embree3/rtcore.h>

#include <array>
#include <memory>
#include <stdexcept>
#include <unordered_map>
#include <vector>

#include "peer.h"

namespace
{

struct vec {
    float x, y, z;
};
vec operator+(vec a, vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
vec operator-(vec a, vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
vec operator*(float s, vec a) { return {s * a.x, s * a.y, s * a.z}; }
float dot(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
vec cross(vec a, vec b)
{
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
vec unit(vec a)
{
    const float l = std::sqrt(dot(a, a));
    return l > 0 ? (1 / l) * a : a;
}

/* Parts of a triangle, as indices into its normals. */
enum part { corner_0, corner_1, corner_2, edge_01, edge_12, edge_20, face };

/* The point of the triangle a, b, c nearest to p (Ericson 2005, 5.1.5); on: the part it lies on. */
vec nearest(vec p, vec a, vec b, vec c, part &on)
{
    const vec ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
    const float d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp),
                d5 = dot(ab, cp), d6 = dot(ac, cp);
    if (d1 <= 0 && d2 <= 0) return on = corner_0, a;
    if (d3 >= 0 && d4 <= d3) return on = corner_1, b;
    if (d6 >= 0 && d5 <= d6) return on = corner_2, c;
    const float vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return on = edge_01, a + d1 / (d1 - d3) * ab;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return on = edge_20, a + d2 / (d2 - d6) * ac;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
        return on = edge_12, b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
    const float s = 1 / (va + vb + vc);
    return on = face, a + vb * s * ab + vc * s * ac;
}

struct triangles {
    std::vector<vec> vert;
    std::vector<std::array<unsigned, 3>> tri;
    std::vector<std::array<vec, 7>> normal; // [triangle][part]
};

/* Pseudo-normals: at a corner the sum of the face normals weighted by their angles, at an edge the
 * sum of its two face normals. */
void make_normals(triangles &t)
{
    std::vector<vec> corner(t.vert.size(), vec{0, 0, 0});
    std::unordered_map<uint64_t, vec> edge(2 * t.tri.size());
    const auto key = [](unsigned a, unsigned b) {
        return uint64_t{std::min(a, b)} << 32 | std::max(a, b);
    };
    t.normal.resize(t.tri.size());
    for (size_t i = 0; i < t.tri.size(); i++) {
        const auto &v = t.tri[i];
        const vec n = unit(cross(t.vert[v[1]] - t.vert[v[0]], t.vert[v[2]] - t.vert[v[0]]));
        t.normal[i][face] = n;
        for (int k = 0; k < 3; k++) {
            const vec here = t.vert[v[k]], u = unit(t.vert[v[(k + 1) % 3]] - here),
                      w = unit(t.vert[v[(k + 2) % 3]] - here);
            corner[v[k]] = corner[v[k]] + std::acos(std::max(-1.0f, std::min(1.0f, dot(u, w)))) * n;
            vec &e = edge.emplace(key(v[k], v[(k + 1) % 3]), vec{0, 0, 0}).first->second;
            e = e + n;
        }
    }
    for (size_t i = 0; i < t.tri.size(); i++)
        for (int k = 0; k < 3; k++) {
            t.normal[i][k] = corner[t.tri[i][k]];
            t.normal[i][edge_01 + k] = edge[key(t.tri[i][k], t.tri[i][(k + 1) % 3])];
        }
}

struct query {
    const triangles *t;
    vec point, nearest;
    unsigned triangle;
    part on;
    float distance2; // squared distance to the nearest triangle so far
};

/* Callback for a triangle: shrinks the query's radius and returns true if the triangle is
 * nearer. */
bool visit_triangle(RTCPointQueryFunctionArguments *args)
{
    query &q = *static_cast<query *>(args->userPtr);
    const auto &v = q.t->tri[args->primID];
    part on;
    const vec at = nearest(q.point, q.t->vert[v[0]], q.t->vert[v[1]], q.t->vert[v[2]], on);
    const vec r = q.point - at;
    const float d = dot(r, r);
    if (!(d < q.distance2)) return false;
    q.distance2 = d;
    q.nearest = at;
    q.triangle = args->primID;
    q.on = on;
    args->query->radius = std::sqrt(d);
    return true;
}

struct scene {
    RTCDevice device;
    RTCScene tree;
    triangles t;

    explicit scene(const sdm_mesh &m) : device(rtcNewDevice("threads=1")), tree(rtcNewScene(device))
    {
        t.vert.resize(m.n_vert);
        t.tri.resize(m.n_tri);
        for (size_t i = 0; i < m.n_vert; i++)
            t.vert[i] = {static_cast<float>(m.vert[3 * i]), static_cast<float>(m.vert[3 * i + 1]),
                         static_cast<float>(m.vert[3 * i + 2])};
        for (size_t i = 0; i < m.n_tri; i++)
            t.tri[i] = {m.tri[3 * i], m.tri[3 * i + 1], m.tri[3 * i + 2]};
        make_normals(t);
        RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        void *vert = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                             sizeof(vec), m.n_vert);
        void *tri = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            sizeof t.tri[0], m.n_tri);
        if (!vert || !tri) throw std::runtime_error("Embree: out of memory for the mesh");
        std::copy(t.vert.begin(), t.vert.end(), static_cast<vec *>(vert));
        std::copy(t.tri.begin(), t.tri.end(), static_cast<std::array<unsigned, 3> *>(tri));
        rtcSetGeometryPointQueryFunction(g, visit_triangle);
        rtcCommitGeometry(g);
        rtcAttachGeometry(tree, g);
        rtcReleaseGeometry(g);
        rtcSetSceneBuildQuality(tree, RTC_BUILD_QUALITY_MEDIUM);
        rtcCommitScene(tree);
    }
    ~scene()
    {
        rtcReleaseScene(tree);
        rtcReleaseDevice(device);
    }
};

peer::map_function prepare(const peer::job &j)
{
    const auto s = std::make_shared<scene>(j.mesh);
    return [s, &j](float *values) {
        RTCPointQueryContext context;
        rtcInitPointQueryContext(&context);
        vec last{};
        // abs(distance) at the previous place; abs(distance here) <= bound + length of the step
        float bound = INFINITY;
        peer::for_places(j, values, [&](const double x[3]) {
            const vec p = {static_cast<float>(x[0]), static_cast<float>(x[1]),
                           static_cast<float>(x[2])};
            const vec step = p - last;
            query q{&s->t, p, {}, RTC_INVALID_GEOMETRY_ID, face, INFINITY};
            float radius = 1.0001f * (bound + std::sqrt(dot(step, step)));
            if (j.band > 0) radius = std::min(radius, static_cast<float>(j.band));
            RTCPointQuery request{p.x, p.y, p.z, 0, radius};
            rtcPointQuery(s->tree, &request, &context, nullptr, &q);
            if (q.triangle == RTC_INVALID_GEOMETRY_ID) {
                bound = INFINITY;
                return NAN;
            }
            last = p;
            bound = std::sqrt(q.distance2);
            return dot(p - q.nearest, s->t.normal[q.triangle][q.on]) < 0 ? -bound : bound;
        });
    };
}

} // namespace

int main(int argc, char **argv)
{
    peer::about a;
    a.points = true;
    a.version = "Embree " RTC_VERSION_STRING;
    a.note =
        "float32; point queries bounded by the distance of the previous place, pseudo-normals; "
        "measures to all triangles";
    a.band = true;
    return peer::run(argc, argv, a, prepare);
}
