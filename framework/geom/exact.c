/* The exact engine: from a mesh to a prepared solid, maps and single points. */
#include "sdm/exact.h"

#include <float.h>
#include <string.h>
#include <time.h>

#include "crossings.h"
#include "grid_distance.h"
#include "pseudonormal.h"
#include "sdm/memory.h"
#include "survey.h"
#include "union_hull.h"
#include "vec3.h"
#include "winding.h"

struct sdm_exact {
    sdm_exact_opts opts;
    sdm_exact_report report;
    sdm_mesh solid;      // the mesh as given, turned if it was inside out: the sign comes from it
    sdm_mesh surface;    // what distances are measured to
    sdm_survey survey;   // of solid
    sdm_nearest nearest; // of surface
    sdm_winding winding;
    sdm_pseudonormals normals;
    double rounding; // size of a rounding error of the coordinates
};

const char *sdm_sign_method_name(sdm_sign_method m)
{
    static const char *const names[] = {"auto", "crossings", "pseudonormal", "winding"};
    return (unsigned)m < sizeof names / sizeof *names ? names[m] : "unknown";
}

static double now_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static sdm_status choose_sign(sdm_exact *e, sdm_error *err)
{
    const sdm_audit *a = &e->report.audit;
    sdm_sign_method m = e->opts.sign;
    if (m == SDM_SIGN_AUTO) m = a->closed ? SDM_SIGN_CROSSINGS : SDM_SIGN_WINDING;
    if (m == SDM_SIGN_CROSSINGS && !a->closed)
        return sdm_fail(err, SDM_E_ARG,
                        "sign method crossings needs a closed mesh, this one has %zu boundary edges and %zu edges with "
                        "triangles of mixed orientation; use winding",
                        a->boundary_edges, a->misoriented_edges);
    if (m == SDM_SIGN_PSEUDONORMAL && (!a->manifold || a->self_intersections))
        return sdm_fail(
            err, SDM_E_ARG,
            "sign method pseudonormal needs a manifold mesh without overlap, this one has %zu boundary, %zu "
            "non-manifold and %zu misoriented edges and %zu intersecting pairs of triangles; use auto",
            a->boundary_edges, a->nonmanifold_edges, a->misoriented_edges, a->self_intersections);
    if (m != SDM_SIGN_CROSSINGS && m != SDM_SIGN_PSEUDONORMAL && m != SDM_SIGN_WINDING)
        return sdm_fail(err, SDM_E_ARG, "unknown sign method %d", (int)m);
    e->report.sign = m;
    return SDM_OK;
}

static sdm_status survey_solid(sdm_exact *e, sdm_error *err)
{
    sdm_status s = sdm_survey_build(&e->solid, &e->survey, err);
    if (s) return s;
    e->report.audit = e->survey.audit;
    if (!e->survey.audit.inverted) return SDM_OK;
    // inside out: turn every triangle; the report keeps what was found
    for (size_t t = 0; t < e->solid.n_tri; t++) {
        const uint32_t v = e->solid.tri[3 * t + 1];
        e->solid.tri[3 * t + 1] = e->solid.tri[3 * t + 2];
        e->solid.tri[3 * t + 2] = v;
    }
    sdm_survey_dispose(&e->survey);
    e->report.turned = true;
    return sdm_survey_build(&e->solid, &e->survey, err);
}

static sdm_status make_surface(sdm_exact *e, sdm_error *err)
{
    bool changed = false;
    if (e->survey.audit.closed && !e->opts.keep_overlap) {
        const sdm_status s =
            sdm_union_hull(&e->solid, &e->survey, &e->surface, &changed, &e->report.union_error_mm, err);
        if (s) return s;
        // sheets that cancel everywhere enclose nothing: distances are to the sheets
        if (changed && !e->surface.n_tri) changed = false;
    }
    e->report.unioned = changed;
    if (!changed) {
        e->report.union_error_mm = 0;
        return sdm_mesh_copy(&e->solid, &e->surface, err);
    }
    return SDM_OK;
}

static sdm_status build_nearest(sdm_exact *e, sdm_error *err)
{
    if (!e->report.unioned) return sdm_nearest_build(&e->surface, &e->survey.topo, &e->nearest, err);
    sdm_topology topo = {0};
    sdm_status s = sdm_topology_build(&e->surface, &topo, err);
    if (!s) s = sdm_nearest_build(&e->surface, &topo, &e->nearest, err);
    sdm_topology_dispose(&topo);
    return s;
}

/* Bytes that preparing a mesh takes, from above but for the contacts of triangles that meet. */
static size_t bytes_needed(const sdm_mesh *m)
{
    return m->n_vert * (2 * 3 * sizeof(double) + 64) +
           m->n_tri * (6 * sizeof(uint32_t) + 3 * sizeof(sdm_edge) + 16 * sizeof(uint32_t) + 3 * sizeof(sdm_bvh_node) +
                       4 * sizeof(double[6]) + 2 * sizeof(sdm_frame) + sizeof(sdm_lane_triangle));
}

static sdm_status prepare(sdm_exact *e, const sdm_mesh *mesh, sdm_error *err)
{
    const size_t need = bytes_needed(mesh);
    if (e->opts.memory_limit && need > e->opts.memory_limit)
        return sdm_fail(err, SDM_E_NOMEM, "the mesh of %zu triangles needs about %zu bytes, memory_limit is %zu",
                        mesh->n_tri, need, e->opts.memory_limit);
    sdm_status s = sdm_mesh_copy(mesh, &e->solid, err);
    if (!s) s = survey_solid(e, err);
    if (!s) s = choose_sign(e, err);
    if (!s) s = make_surface(e, err);
    if (!s && e->report.sign == SDM_SIGN_PSEUDONORMAL && e->report.unioned)
        s = sdm_fail(
            err, SDM_E_ARG,
            "sign method pseudonormal needs a mesh without surface inside the solid, this one has some; use auto");
    if (!s) s = build_nearest(e, err);
    if (!s && e->report.sign == SDM_SIGN_WINDING) s = sdm_winding_build(&e->solid, &e->survey.tree, &e->winding, err);
    if (!s && e->report.sign == SDM_SIGN_PSEUDONORMAL)
        s = sdm_pseudonormals_build(&e->surface, &e->survey.topo, &e->normals, err);
    if (s) return s;
    double largest = 0;
    for (int a = 0; a < 3; a++)
        largest = fmax(largest, fmax(fabs(e->report.audit.min[a]), fabs(e->report.audit.max[a])));
    e->rounding = 4 * DBL_EPSILON * largest;
    e->report.n_tri_used = e->surface.n_tri;
    return SDM_OK;
}

sdm_status sdm_exact_create(const sdm_mesh *mesh, const sdm_exact_opts *opts, sdm_exact **out, sdm_error *err)
{
    if (!mesh || !out) return sdm_fail(err, SDM_E_ARG, "exact engine without a mesh or a place for the result");
    *out = NULL;
    const double start = now_ms();
    sdm_exact *e;
    sdm_status s = SDM_ALLOC(&e, 1, "exact engine", err);
    if (s) return s;
    if (opts) e->opts = *opts;
    s = prepare(e, mesh, err);
    if (s) {
        sdm_exact_free(e);
        return s;
    }
    e->report.ms_build = now_ms() - start;
    *out = e;
    return SDM_OK;
}

void sdm_exact_free(sdm_exact *e)
{
    if (!e) return;
    sdm_mesh_dispose(&e->solid);
    sdm_mesh_dispose(&e->surface);
    sdm_survey_dispose(&e->survey);
    sdm_nearest_dispose(&e->nearest);
    sdm_winding_dispose(&e->winding);
    sdm_pseudonormals_dispose(&e->normals);
    sdm_free(e);
}

const sdm_exact_report *sdm_exact_get_report(const sdm_exact *e) { return &e->report; }
const sdm_mesh *sdm_exact_surface(const sdm_exact *e) { return &e->surface; }

/* Is x inside? slot, q, feature: its nearest point. */
static bool inside(const sdm_exact *e, const double x[3], uint32_t slot, const double q[3], int feature)
{
    double r[3];
    switch (e->report.sign) {
    case SDM_SIGN_WINDING:
        return sdm_winding_inside(&e->winding, x);
    case SDM_SIGN_PSEUDONORMAL:
        v3_sub(x, q, r);
        return v3_dot(r, sdm_pseudonormal(&e->normals, &e->survey.topo, e->nearest.tree.order[slot], feature)) < 0;
    default:
        return sdm_ray_winding(&e->solid, &e->survey.tree, x, 0, 1, NULL, 0) >= 1;
    }
}

double sdm_exact_point(const sdm_exact *e, const double x[3], double closest[3], double normal[3], uint32_t *triangle)
{
    uint32_t slot = 0;
    int feature = SDM_FACE;
    double q[3] = {NAN, NAN, NAN}, n[3] = {NAN, NAN, NAN};
    double d = NAN;
    if (isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2])) {
        d = sqrt(sdm_nearest_find(&e->nearest, x, INFINITY, &slot, q, &feature));
        if (inside(e, x, slot, q, feature)) d = -d;
        for (int i = 0; i < 3; i++) n[i] = fabs(d) > e->rounding ? (x[i] - q[i]) / d : e->nearest.frames[slot].n[i];
    }
    if (closest) memcpy(closest, q, sizeof q);
    if (normal) memcpy(normal, n, sizeof n);
    if (triangle) *triangle = e->nearest.tree.order[slot];
    return d;
}

/* Signs of one row of voxels by asking for every point. */
static void sign_by_points(const sdm_exact *e, const sdm_grid *g, int64_t j, int64_t k, float *values)
{
    for (int64_t i = 0; i < g->n[0]; i++) {
        const double index[3] = {(double)i, (double)j, (double)k};
        double x[3], q[3] = {0, 0, 0};
        uint32_t slot = 0;
        int feature = SDM_FACE;
        sdm_grid_world(g, index, x);
        if (e->report.sign == SDM_SIGN_PSEUDONORMAL)
            (void)sdm_nearest_find(&e->nearest, x, INFINITY, &slot, q, &feature);
        if (inside(e, x, slot, q, feature)) values[i] = -values[i];
    }
}

static sdm_status set_signs(const sdm_exact *e, const sdm_grid *g, float *values, sdm_error *err)
{
    const int n_threads = sdm_thread_count(e->opts.n_threads);
    (void)n_threads; // without OpenMP
    const int64_t n_rows = g->n[1] * g->n[2];
    if (e->report.sign != SDM_SIGN_CROSSINGS) {
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
        for (int64_t r = 0; r < n_rows; r++) sign_by_points(e, g, r % g->n[1], r / g->n[1], values + r * g->n[0]);
        return SDM_OK;
    }
    sdm_rows rows = {0};
    int32_t *change = NULL;
    sdm_status s = sdm_rows_build(&e->solid, g, &rows, err);
    if (!s) s = SDM_ALLOC(&change, (size_t)g->n[0], "row of crossings", err);
    if (!s)
        for (int64_t r = 0; r < n_rows; r++) sdm_rows_apply(&rows, (size_t)r, g->n[0], change, values + r * g->n[0]);
    sdm_free(change);
    sdm_rows_dispose(&rows);
    return s;
}

sdm_status sdm_exact_map(const sdm_exact *e, const sdm_grid *grid, float *values, sdm_error *err)
{
    if (!e || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "map without an engine, a grid or a place for the values");
    sdm_status s = sdm_grid_check(grid, err);
    if (!s) s = sdm_grid_distance(&e->nearest, grid, &e->opts, values, err);
    return s ? s : set_signs(e, grid, values, err);
}
