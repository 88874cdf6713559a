/* Angle-weighted pseudo-normals of the vertices, edges and faces of a mesh. */
#include "pseudonormal.h"

#include "mesh/point_triangle.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

static void normal_add(double sum[3], double t, const double n[3]) { v3_along(sum, t, n, sum); }

static void pseudonormals_add(const sdm_mesh *m, const sdm_topology *topo, sdm_pseudonormals *p,
                              size_t t)
{
    const double *v[3];
    double n[3];
    for (size_t k = 0; k < 3; k++) v[k] = &m->vert[3 * (size_t)m->tri[3 * t + k]];
    v3_triangle_normal(v[0], v[1], v[2], n);
    const double len = v3_norm(n);
    if (!(len > 0)) return; // a triangle without area has no normal and adds nothing
    for (int i = 0; i < 3; i++) p->face[t][i] = n[i] / len;
    for (size_t k = 0; k < 3; k++) {
        double a[3], b[3], c[3];
        v3_sub(v[(k + 1) % 3], v[k], a);
        v3_sub(v[(k + 2) % 3], v[k], b);
        v3_cross(a, b, c);
        normal_add(p->vertex[topo->tri[3 * t + k]], atan2(v3_norm(c), v3_dot(a, b)), p->face[t]);
        if (topo->edge[3 * t + k] != SDM_NONE)
            normal_add(p->edge[topo->edge[3 * t + k]], 1, p->face[t]);
    }
}

sdm_status sdm_pseudonormals_build(const sdm_mesh *m, const sdm_topology *topo,
                                   sdm_pseudonormals *p, sdm_error *err)
{
    sdm_status s = SDM_ALLOC(&p->vertex, m->n_vert, "pseudo-normals", err);
    if (!s) s = SDM_ALLOC(&p->edge, topo->n_edges, "pseudo-normals", err);
    if (!s) s = SDM_ALLOC(&p->face, m->n_tri, "pseudo-normals", err);
    for (size_t t = 0; t < m->n_tri && !s; t++) pseudonormals_add(m, topo, p, t);
    return s;
}

void sdm_pseudonormals_dispose(sdm_pseudonormals *p)
{
    sdm_free(p->vertex);
    sdm_free(p->edge);
    sdm_free(p->face);
    *p = (sdm_pseudonormals){0};
}

const double *sdm_pseudonormal(const sdm_pseudonormals *p, const sdm_topology *topo, uint32_t tri,
                               int feature)
{
    if (feature == SDM_FACE) return p->face[tri];
    if (feature >= SDM_EDGE_0) {
        const uint32_t e = topo->edge[3 * (size_t)tri + (size_t)(feature - SDM_EDGE_0)];
        return e == SDM_NONE ? p->face[tri] : p->edge[e];
    }
    return p->vertex[topo->tri[3 * (size_t)tri + (size_t)feature]];
}
