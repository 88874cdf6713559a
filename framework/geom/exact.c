/* The exact engine: prepares a mesh for distance queries, and answers them for grids and single
 * points. */
#include "sdm/exact.h"

#include <float.h>
#include <string.h>

#include "layers/layers.h"
#include "layers/point_slopes.h"
#include "map/grid_blocks.h"
#include "map/grid_distance.h"
#include "points/at_points.h"
#include "points/point_aids.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/threads.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"
#include "sign/sign.h"
#include "solid/parts.h"
#include "solid/survey.h"
#include "solid/union_hull.h"

struct sdm_exact {
    sdm_exact_opts opts;
    sdm_exact_report report;
    // holds survey and nearest; with a memory limit, arena.used counts the bytes of all members
    sdm_arena arena;
    sdm_mesh solid;   // the given mesh with its orientation corrected: the sign comes from it
    sdm_mesh surface; // the mesh to which distances are measured
    // [surface.n_tri] triangle of the given mesh from which each triangle of `surface` was cut
    uint32_t *source;
    sdm_survey survey;   // audit, topology and tree of `solid`
    sdm_nearest nearest; // tree and features of `surface`
    sdm_sign sign;
    double rounding; // bound on the rounding error of the coordinates, mm
    sdm_point_aids *aids;
    bool bounds; // the surface bounds the solid: outside in front of it, inside behind it
};

const char *sdm_sign_method_name(sdm_sign_method m)
{
    static const char *const names[] = {"auto", "crossings", "pseudonormal", "winding"};
    return (unsigned)m < sizeof names / sizeof *names ? names[m] : "unknown";
}

/* Bytes of the arrays of a mesh, unused capacity included. */
static size_t mesh_bytes(const sdm_mesh *m)
{
    return m->cap_vert * 3 * sizeof *m->vert + m->cap_tri * 3 * sizeof *m->tri;
}

/* The options with memory_limit reduced by the bytes of the engine and by `more` further bytes. */
static sdm_exact_opts opts_beside(const sdm_exact *e, size_t more)
{
    sdm_exact_opts o = e->opts;
    const size_t taken = more < SIZE_MAX - e->arena.used ? e->arena.used + more : SIZE_MAX;
    if (o.memory_limit) // at least 1: 0 means no limit
        o.memory_limit = taken < o.memory_limit ? o.memory_limit - taken : 1;
    return o;
}

static sdm_status copy_mesh(sdm_exact *e, const sdm_mesh *mesh, sdm_error *err)
{
    const sdm_status s = sdm_arena_charge(
        &e->arena, mesh->n_vert * 3 * sizeof *mesh->vert + mesh->n_tri * 3 * sizeof *mesh->tri,
        err);
    return s ? s : sdm_mesh_copy(mesh, &e->solid, err);
}

/* Makes the surface: the union hull of the solid, or a copy of the solid if nothing is removed. */
static sdm_status make_surface(sdm_exact *e, sdm_error *err)
{
    bool changed = false;
    sdm_status s = SDM_OK;
    if (e->survey.audit.closed && !e->opts.keep_overlap)
        s = sdm_union_hull(&e->solid, &e->survey, &e->arena, &e->surface, &e->source, &changed,
                           &e->report.union_error_mm, err);
    if (s) return s;
    // sheets that cancel everywhere enclose nothing: distances are then to the sheets
    e->report.unioned = changed && e->surface.n_tri;
    e->bounds = e->survey.audit.closed && !e->opts.keep_overlap && (!changed || e->surface.n_tri);
    if (e->report.unioned) return SDM_OK;
    e->report.union_error_mm = 0;
    e->arena.used -= mesh_bytes(&e->surface) + e->surface.cap_tri * sizeof *e->source;
    sdm_free(e->source);
    e->source = NULL;
    sdm_mesh_dispose(&e->surface);
    s = sdm_arena_charge(&e->arena, mesh_bytes(&e->solid) + e->solid.n_tri * sizeof *e->source,
                         err);
    if (!s) s = SDM_ALLOC(&e->source, e->solid.n_tri, "sources of triangles", err);
    for (size_t t = 0; t < e->solid.n_tri && !s; t++) e->source[t] = (uint32_t)t;
    return s ? s : sdm_mesh_copy(&e->solid, &e->surface, err);
}

/* Refuses the pseudonormal method when inner surface was removed. */
static sdm_status check_pseudonormal(const sdm_exact *e, sdm_error *err)
{
    if (e->report.sign != SDM_SIGN_PSEUDONORMAL || !e->report.unioned) return SDM_OK;
    return sdm_fail(err, SDM_E_ARG,
                    "sign method pseudonormal needs a mesh without surface inside the solid, this "
                    "one has some; use auto");
}

/* Builds the tree and the features of the surface. Frees the survey except for its tree and, where
 * needed, its topology. */
static sdm_status build_nearest(sdm_exact *e, sdm_error *err)
{
    const sdm_mesh *m = &e->surface;
    sdm_survey_shrink(&e->survey, &e->arena,
                      !e->report.unioned || e->report.sign != SDM_SIGN_CROSSINGS);
    if (!e->report.unioned) {
        // the surface has the triangles of the solid, and so the same tree and topology
        e->nearest.tree = e->survey.tree;
        return sdm_nearest_build(m, &e->survey.topo, &e->arena, &e->nearest, err);
    }
    const sdm_arena_mark before = e->arena.end[SDM_HIGH];
    sdm_topology topo = {0};
    sdm_status s = sdm_bvh_derive(&e->survey.tree, m, e->source, &e->arena, &e->nearest.tree, err);
    if (!s) s = sdm_topology_build(m, &e->arena, &topo, err);
    if (!s) s = sdm_nearest_build(m, &topo, &e->arena, &e->nearest, err);
    sdm_arena_release(&e->arena, SDM_HIGH, before);
    return s;
}

static sdm_status build_sign(sdm_exact *e, sdm_error *err)
{
    const sdm_status s =
        sdm_sign_build(&e->solid, &e->survey, &e->nearest, e->report.sign, &e->sign, err);
    return s ? s : sdm_arena_charge(&e->arena, sdm_sign_bytes(&e->sign), err);
}

/* Bytes that the arena needs for a closed mesh with few contacts. Larger needs are met by separate
 * allocations. */
static size_t usual_bytes(const sdm_mesh *m) { return 1080 * m->n_tri + 220 * m->n_vert; }

/* Runs the preparation step by step. After an error the caller frees e with sdm_exact_free(). */
static sdm_status prepare(sdm_exact *e, const sdm_mesh *mesh, sdm_error *err)
{
    e->arena.opts = &e->opts;
    e->arena.n_tri = mesh->n_tri;
    sdm_status s = copy_mesh(e, mesh, err);
    if (!s) s = sdm_arena_reserve(&e->arena, usual_bytes(mesh), err);
    sdm_exact_report *r = &e->report;
    if (!s)
        s = sdm_parts_survey(&e->solid, &e->arena, &e->survey, &r->audit, &r->turned,
                             &r->parts_turned, err);
    if (!s) s = sdm_sign_choose(&e->report.audit, e->opts.sign, &e->report.sign, err);
    if (!s) s = make_surface(e, err);
    if (!s) s = check_pseudonormal(e, err);
    if (!s) s = build_nearest(e, err);
    if (!s) s = sdm_point_aids_create(&e->aids, err);
    if (!s) s = build_sign(e, err);
    if (s) return s;
    double largest = 0;
    for (int a = 0; a < 3; a++)
        largest = fmax(largest, fmax(fabs(e->report.audit.min[a]), fabs(e->report.audit.max[a])));
    e->rounding = 4 * DBL_EPSILON * largest;
    e->report.n_tri_used = e->surface.n_tri;
    return SDM_OK;
}

sdm_status sdm_exact_create(const sdm_mesh *mesh, const sdm_exact_opts *opts, sdm_exact **out,
                            sdm_error *err)
{
    if (!mesh || !out)
        return sdm_fail(err, SDM_E_ARG, "exact engine without a mesh or a place for the result");
    *out = NULL;
    const double start = sdm_clock();
    sdm_exact *e;
    sdm_status s = SDM_ALLOC(&e, 1, "exact engine", err);
    if (s) return s;
    if (opts) e->opts = *opts;
    s = prepare(e, mesh, err);
    if (s) {
        sdm_exact_free(e);
        return s;
    }
    e->report.ms_build = 1e3 * (sdm_clock() - start);
    *out = e;
    return SDM_OK;
}

void sdm_exact_free(sdm_exact *e)
{
    if (!e) return;
    sdm_mesh_dispose(&e->solid);
    sdm_mesh_dispose(&e->surface);
    sdm_free(e->source);
    sdm_sign_dispose(&e->sign);
    sdm_point_aids_free(e->aids);
    sdm_arena_dispose(&e->arena);
    sdm_free(e);
}

const sdm_exact_report *sdm_exact_get_report(const sdm_exact *e) { return &e->report; }
const sdm_mesh *sdm_exact_surface(const sdm_exact *e) { return &e->surface; }
const uint32_t *sdm_exact_source(const sdm_exact *e) { return e->source; }

/* What the answers for n points need; *opts: the options that remain for them. */
static sdm_points_job points_job(const sdm_exact *e, const sdm_exact_opts *opts, size_t n)
{
    const bool bounds = e->bounds && e->report.sign == SDM_SIGN_CROSSINGS;
    return (sdm_points_job){
        .surface = sdm_point_aids_use(e->aids, &e->nearest, bounds, opts->memory_limit, n),
        .sign = &e->sign,
        .rounding = e->rounding,
        .seam = 16 * e->rounding + 2 * e->report.union_error_mm,
        .opts = opts};
}

double sdm_exact_point(const sdm_exact *e, const double x[3], double closest[3], double normal[3],
                       uint32_t *triangle)
{
    double d;
    const sdm_exact_opts opts = opts_beside(e, 0);
    const sdm_points_job job = points_job(e, &opts, 1);
    sdm_point_find(&job, x, &(sdm_exact_at){&d, normal, closest, triangle}, 0);
    return d;
}

sdm_status sdm_exact_points(const sdm_exact *e, const double *x, size_t n, const sdm_exact_at *out,
                            sdm_error *err)
{
    if (!e || !out || (n && !x))
        return sdm_fail(err, SDM_E_ARG,
                        "points without an engine, points or a place for the result");
    const sdm_exact_opts opts = opts_beside(e, 0);
    const sdm_points_job job = points_job(e, &opts, n);
    return sdm_points_find(&job, x, n, out, err);
}

double sdm_exact_distance(const sdm_exact *e, const double x[3])
{
    const sdm_exact_opts opts = opts_beside(e, 0);
    return sdm_point_distance(points_job(e, &opts, 1).surface, x);
}

/* Fills values[] with the signed map and, if slot is not NULL, slot[] with the slot of the nearest
 * triangle of every voxel. `more`: bytes in use beside the engine, for the memory limit. */
static sdm_status fill_map(const sdm_exact *e, const sdm_grid *grid, double band_mm, size_t more,
                           float *values, uint32_t *slot, sdm_error *err)
{
    const sdm_exact_opts opts = opts_beside(e, more);
    sdm_status s = sdm_grid_check(grid, err);
    if (!s) s = sdm_grid_distance(&e->nearest, grid, &opts, band_mm, values, slot, err);
    return s ? s : sdm_sign_map(&e->sign, grid, &opts, values, err);
}

sdm_status sdm_exact_map(const sdm_exact *e, const sdm_grid *grid, float *values, sdm_error *err)
{
    if (!e || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "map without an engine, a grid or a place for the values");
    return fill_map(e, grid, INFINITY, 0, values, NULL, err);
}

sdm_status sdm_exact_sign(const sdm_exact *e, const sdm_grid *grid, float *values, sdm_error *err)
{
    if (!e || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "signs without an engine, a grid or distances");
    const sdm_exact_opts opts = opts_beside(e, 0);
    const sdm_status s = sdm_grid_check(grid, err);
    return s ? s : sdm_sign_map(&e->sign, grid, &opts, values, err);
}

sdm_status sdm_exact_certify(const sdm_exact *e, const sdm_grid *grid, const float *values,
                             sdm_sign_certificate *out, sdm_error *err)
{
    if (!e || !grid || !values || !out)
        return sdm_fail(err, SDM_E_ARG,
                        "certificate without an engine, a grid, a map or a place for the result");
    const sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    // largest abs(coordinate) of a voxel: at a corner of the grid
    double largest = 0;
    for (int corner = 0; corner < 8; corner++) {
        double index[3], x[3];
        for (int a = 0; a < 3; a++) index[a] = corner >> a & 1 ? (double)(grid->n[a] - 1) : 0;
        sdm_grid_world(grid, index, x);
        for (int a = 0; a < 3; a++) largest = fmax(largest, fabs(x[a]));
    }
    // the tolerance is the sum of the rounding errors of the mesh and of the voxel centres
    const sdm_exact_opts opts = opts_beside(e, 0);
    return sdm_sign_certify(&e->sign, grid, &opts, 4 * e->rounding + 16 * DBL_EPSILON * largest,
                            values, out, err);
}

/* The sheets of the surface, with the frames of the solid's triangles. */
static sdm_sheets sheets_with(const sdm_exact *e, const sdm_frame *frames)
{
    const double seam = e->report.unioned ? 2 * e->report.union_error_mm : 0;
    return (sdm_sheets){&e->nearest, &e->solid, frames, e->source, seam};
}

sdm_status sdm_exact_slopes_create(const sdm_exact *e, const double *velocity, size_t n,
                                   sdm_exact_slopes **out, sdm_error *err)
{
    const size_t limit = opts_beside(e, 0).memory_limit, need = e->solid.n_tri * sizeof(sdm_frame);
    *out = NULL;
    if (limit && need > limit)
        return sdm_fail(err, SDM_E_NOMEM,
                        "derivatives at points need %zu bytes, memory_limit leaves %zu", need,
                        limit);
    sdm_exact_slopes *s;
    sdm_status status = SDM_ALLOC(&s, 1, "derivatives at points", err);
    if (status) return status;
    status = SDM_ALLOC(&s->frames, e->solid.n_tri, "frames of triangles", err);
    if (status) {
        sdm_exact_slopes_free(s);
        return status;
    }
    sdm_sheets_frames(&e->solid, sdm_threads(e->opts.n_threads), s->frames);
    s->sheets = sheets_with(e, s->frames);
    s->surface = &e->surface;
    s->velocity = velocity;
    s->n = n;
    *out = s;
    return SDM_OK;
}

/* Fills the layers and derivatives of *job. The map itself is always computed, because the layers
 * need its signs; it is written to a temporary array if the caller has none. */
static sdm_status map_with_layers(const sdm_exact *e, const sdm_grid *grid, sdm_layers_job *job,
                                  sdm_error *err)
{
    sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    const double band = job->out->band_mm;
    if (!(band >= 0))
        return sdm_fail(err, SDM_E_ARG,
                        "narrow band of %g mm, need a positive width or 0 for the whole map", band);
    // temporary arrays: the map, the nearest triangles, and the frames of the solid's triangles
    const bool layers = sdm_layers_wanted(job);
    const size_t n_value = job->out->values ? 0 : sdm_grid_count(grid),
                 limit = opts_beside(e, 0).memory_limit;
    const size_t n_slot = layers ? sdm_grid_count(grid) : 0,
                 n_frame = job->derivative ? e->solid.n_tri : 0;
    float *own = NULL;
    uint32_t *slot = NULL;
    sdm_frame *frames = NULL;
    const size_t need = n_value * sizeof *own + n_slot * sizeof *slot + n_frame * sizeof *frames;
    if (limit && need > limit)
        return sdm_fail(err, SDM_E_NOMEM,
                        "layers of the map need %zu bytes, memory_limit leaves %zu", need, limit);
    s = SDM_ALLOC(&own, n_value, "distance map", err);
    if (!s) s = SDM_ALLOC(&slot, n_slot, "nearest triangles", err);
    if (!s) s = SDM_ALLOC(&frames, n_frame, "frames of triangles", err);
    float *values = n_value ? own : job->out->values;
    if (!s)
        s = fill_map(e, grid, band > 0 ? band : INFINITY, need, values, layers ? slot : NULL, err);
    if (!s && n_frame) sdm_sheets_frames(&e->solid, sdm_threads(e->opts.n_threads), frames);
    // the layers from the map
    job->sheets = sheets_with(e, frames);
    job->rounding = e->rounding;
    job->opts = &e->opts;
    job->values = values;
    job->slot = slot;
    if (!s && layers) s = sdm_layers_fill(job, grid, err);
    sdm_free(frames);
    sdm_free(slot);
    sdm_free(own);
    return s;
}

sdm_status sdm_exact_map_blocks(const sdm_exact *e, const sdm_grid *grid, double band_mm,
                                sdm_blocks *out, sdm_error *err)
{
    if (!e || !grid || !out)
        return sdm_fail(err, SDM_E_ARG,
                        "blocks without an engine, a grid or a place for the result");
    *out = (sdm_blocks){0};
    sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    const float band = (float)band_mm;
    if (!(band > 0 && band < INFINITY))
        return sdm_fail(err, SDM_E_ARG, "narrow band of %g mm, need a positive width", band_mm);
    if (e->report.sign != SDM_SIGN_CROSSINGS)
        return sdm_fail(err, SDM_E_ARG,
                        "blocks need a closed mesh and the sign method crossings, not %s: the sign "
                        "may change away from the surface; use the whole map",
                        sdm_sign_method_name(e->report.sign));
    sdm_exact_opts opts = opts_beside(e, 0);
    s = sdm_grid_blocks_make(&e->nearest, grid, (double)band, &opts, out, err);
    opts = opts_beside(e, sdm_blocks_bytes(out));
    if (!s) s = sdm_grid_distance_blocks(&e->nearest, &opts, out, err);
    if (!s) s = sdm_sign_blocks(&e->sign, &opts, out, err);
    if (!s)
        sdm_grid_blocks_prune(out);
    else
        sdm_blocks_dispose(out);
    return s;
}

sdm_status sdm_exact_map_layers(const sdm_exact *e, const sdm_grid *grid,
                                const sdm_exact_layers *layers, sdm_error *err)
{
    if (!e || !grid || !layers)
        return sdm_fail(err, SDM_E_ARG, "map without an engine, a grid or layers to fill");
    return map_with_layers(e, grid, &(sdm_layers_job){.out = layers}, err);
}

sdm_status sdm_exact_map_derivative(const sdm_exact *e, const sdm_grid *grid,
                                    const double *velocity, size_t n,
                                    const sdm_exact_layers *layers, float *derivative,
                                    sdm_error *err)
{
    if (!e || !grid || !velocity || !n || !derivative)
        return sdm_fail(
            err, SDM_E_ARG,
            "derivative without an engine, a grid, velocities or a place for the result");
    sdm_layers_job job = {.out = layers ? layers : &(sdm_exact_layers){0},
                          .velocity = velocity,
                          .n_velocity = n,
                          .derivative = derivative};
    return map_with_layers(e, grid, &job, err);
}
