/* Sign of points and of grids, by the method that sdm_sign_choose() selected. */
#include "sign.h"

#include "mesh/crossings.h"
#include "sdm/internal/vec3.h"
#include "sign_rows.h"

sdm_status sdm_sign_choose(const sdm_audit *a, sdm_sign_method wanted, sdm_sign_method *method,
                           sdm_error *err)
{
    sdm_sign_method m = wanted;
    if (m == SDM_SIGN_AUTO) m = a->closed ? SDM_SIGN_CROSSINGS : SDM_SIGN_WINDING;
    if (m == SDM_SIGN_CROSSINGS && !a->closed)
        return sdm_fail(err, SDM_E_ARG,
                        "sign method crossings needs a closed mesh, this one has %zu boundary "
                        "edges and %zu edges with "
                        "triangles of mixed orientation; use winding",
                        a->boundary_edges, a->misoriented_edges);
    // an edge of a triangle without area would get the normal of only one of its two faces
    if (m == SDM_SIGN_PSEUDONORMAL && (!a->manifold || a->self_intersections || a->degenerate))
        return sdm_fail(err, SDM_E_ARG,
                        "sign method pseudonormal needs a manifold mesh without overlap, this one "
                        "has %zu boundary, %zu "
                        "non-manifold and %zu misoriented edges, %zu intersecting pairs of "
                        "triangles and %zu triangles without "
                        "area; use auto",
                        a->boundary_edges, a->nonmanifold_edges, a->misoriented_edges,
                        a->self_intersections, a->degenerate);
    if (m != SDM_SIGN_CROSSINGS && m != SDM_SIGN_PSEUDONORMAL && m != SDM_SIGN_WINDING)
        return sdm_fail(err, SDM_E_ARG, "unknown sign method %d", (int)m);
    *method = m;
    return SDM_OK;
}

sdm_status sdm_sign_build(const sdm_mesh *solid, const sdm_survey *survey,
                          const sdm_nearest *surface, sdm_sign_method method, sdm_sign *s,
                          sdm_error *err)
{
    s->method = method;
    s->solid = solid;
    s->survey = survey;
    s->surface = surface;
    if (method == SDM_SIGN_WINDING)
        return sdm_winding_build(solid, &survey->tree, &survey->topo, &s->winding, err);
    if (method == SDM_SIGN_PSEUDONORMAL)
        return sdm_pseudonormals_build(solid, &survey->topo, &s->normals, err);
    return SDM_OK;
}

void sdm_sign_dispose(sdm_sign *s)
{
    sdm_winding_dispose(&s->winding);
    sdm_pseudonormals_dispose(&s->normals);
}

size_t sdm_sign_bytes(const sdm_sign *s)
{
    const sdm_topology *t = &s->survey->topo;
    if (s->method == SDM_SIGN_PSEUDONORMAL)
        return (t->n_vert + t->n_edges + t->n_tri) * sizeof(double[3]);
    return 2 * s->winding.boundary.n * sizeof(sdm_chain) +
           (s->winding.far_field ? s->survey->tree.n_node * sizeof(sdm_far_field) : 0);
}

bool sdm_sign_inside(const sdm_sign *s, const double x[3], uint32_t slot, const double q[3],
                     int feature)
{
    double r[3];
    switch (s->method) {
    case SDM_SIGN_WINDING:
        return sdm_winding_inside(&s->winding, x);
    case SDM_SIGN_PSEUDONORMAL:
        v3_sub(x, q, r);
        return v3_dot(r, sdm_pseudonormal(&s->normals, &s->survey->topo,
                                          s->surface->tree.order[slot], feature)) < 0;
    default:
        return sdm_ray_winding(s->solid, &s->survey->tree, x, 0, 1, NULL, 0) >= 1;
    }
}

/* Negates the values of one row of voxels that lie inside, one point query per voxel. */
static void row_flip_by_points(const sdm_sign *s, const sdm_grid *g, int64_t j, int64_t k,
                               float *values)
{
    for (int64_t i = 0; i < g->n[0]; i++) {
        const double index[3] = {(double)i, (double)j, (double)k};
        double x[3], q[3] = {0, 0, 0};
        uint32_t slot = 0;
        int feature = SDM_FACE;
        sdm_grid_world(g, index, x);
        if (s->method == SDM_SIGN_PSEUDONORMAL)
            (void)sdm_nearest_find(s->surface, x, INFINITY, &slot, q, &feature);
        if (sdm_sign_inside(s, x, slot, q, feature)) values[i] = -values[i];
    }
}

typedef struct map_job {
    const sdm_sign *sign;
    const sdm_sign_rows *rows;
    const sdm_grid *grid;
    float *values;
} map_job;

static void tile_flip(void *user, const sdm_row_tile *t, const int32_t *base)
{
    const map_job *job = user;
    const int64_t n0 = job->grid->n[0], n1 = job->grid->n[1];
    for (int64_t k = t->k0; k < t->k1; k++) {
        for (int64_t j = t->j0; j < t->j1; j++) {
            const int64_t row = k * n1 + j;
            float *values = job->values + row * n0;
            if (!job->rows) {
                row_flip_by_points(job->sign, job->grid, j, k, values);
                continue;
            }
            sdm_rows_apply(&job->rows->rows, (size_t)row, t->i0, t->i1, base, values);
            if (base) base += t->i1 - t->i0;
        }
    }
}

sdm_status sdm_sign_map(const sdm_sign *s, const sdm_grid *g, const sdm_exact_opts *opts,
                        float *values, sdm_error *err)
{
    const bool by_rows = sdm_sign_fits_rows(s->method, &s->winding.boundary);
    sdm_sign_rows rows = {0};
    map_job job = {s, by_rows ? &rows : NULL, g, values};
    sdm_status st = SDM_OK;
    if (by_rows)
        st = sdm_sign_rows_build(s->solid,
                                 s->method == SDM_SIGN_WINDING ? &s->winding.boundary : NULL, g,
                                 (const int[3]){0, 1, 2}, opts, &rows, err);
    if (!st) st = sdm_sign_tiles(&rows, g->n[1], g->n[2], opts, tile_flip, &job, err);
    sdm_rows_dispose(&rows.rows);
    return st;
}
