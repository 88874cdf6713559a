/* The largest ball inside a shape, its thinnest part, and the voxels that show its details. */
#include "shape_details.h"

#include <math.h>
#include <string.h>

#include "maps/shape_surface.h"
#include "sdm/internal/part_audit.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"
#include "surface_points.h"

// number of places on the surface
enum { PLACES = 2000 };
// steps that shrink a ball until it lies inside; balls that are then moved, and the steps of these
enum { SHRINK_STEPS = 20, BALLS = 32, MOVE_STEPS = 24 };
// a ball lies inside if nothing of the surface is nearer than this share of its radius
#define BALL_TOUCHES 0.999

// shortest gradient of a distance, by differences over two voxels, whose details are shown
#define GRADIENT_MIN 0.8
// largest share of the surface with a shorter gradient; it is known to a twentieth
#define DETAILS_MAX 0.105
// the edge is halved up to so many times, and then known to 2 to the power of 1/16
enum { HALVINGS = 10, BISECTIONS = 4 };

// multiples of the powers of 1 / P, P = 1.1673... with P^5 = P^4 + 1 ..., fill space evenly
static const double SPREAD[2] = {0, 0.6180339887498949},
                    ASIDE[3] = {0.81917251339616440, 0.67104360670378920, 0.54970047790197026};

typedef struct details_places {
    const sdm_exact *engine;
    // [PLACES][3] on the surface, and the unit normals there
    double *x, *normal;
    // [PLACES][3] and [6 PLACES][3] points; [6 PLACES], [PLACES][3] answers of the engine
    double *at, *around, *distance, *closest;
} details_places;

static void places_dispose(details_places *p)
{
    sdm_free(p->x);
    sdm_free(p->normal);
    sdm_free(p->at);
    sdm_free(p->around);
    sdm_free(p->distance);
    sdm_free(p->closest);
}

static sdm_status places_create(const sdm_exact *engine, details_places *p, sdm_error *err)
{
    uint32_t *triangle = NULL;
    const sdm_mesh *m = sdm_exact_surface(engine);
    *p = (details_places){.engine = engine};
    sdm_status s = SDM_ALLOC(&triangle, PLACES, "places of the surface", err);
    if (!s) s = SDM_ALLOC(&p->x, 3 * PLACES, "places of the surface", err);
    if (!s) s = SDM_ALLOC(&p->normal, 3 * PLACES, "places of the surface", err);
    if (!s) s = SDM_ALLOC(&p->at, 3 * PLACES, "places of the surface", err);
    if (!s) s = SDM_ALLOC(&p->around, 18 * PLACES, "places of the surface", err);
    if (!s) s = SDM_ALLOC(&p->distance, 6 * PLACES, "places of the surface", err);
    if (!s) s = SDM_ALLOC(&p->closest, 3 * PLACES, "places of the surface", err);
    const double area = s ? 0 : sdm_fit_spread_over(m, PLACES, SPREAD, p->x, triangle);
    if (!s && !(area > 0 && isfinite(area)))
        s = sdm_fail(err, SDM_E_QUALITY, "the surface of the shape has no area");
    for (size_t i = 0; i < PLACES && !s; i++) {
        const uint32_t *t = m->tri + 3 * (size_t)triangle[i];
        double *n = p->normal + 3 * i;
        v3_triangle_normal(m->vert + 3 * (size_t)t[0], m->vert + 3 * (size_t)t[1],
                           m->vert + 3 * (size_t)t[2], n);
        const double length = v3_norm(n);
        for (int a = 0; a < 3 && length > 0; a++) n[a] /= length;
    }
    sdm_free(triangle);
    return s;
}

/* radius[PLACES] = of the largest ball inside that touches the surface at each place: a ball that
 * holds another point of the surface shrinks until it touches that (Ma, Bae and Choi 2012); 0: the
 * steps are too few, as beside the rim of a thin plate. */
static sdm_status shrink_balls(const details_places *p, double largest, double *radius,
                               sdm_error *err)
{
    for (size_t i = 0; i < PLACES; i++) radius[i] = largest;
    const sdm_exact_at out = {.distance = p->distance, .closest = p->closest};
    for (int step = 0; step <= SHRINK_STEPS; step++) {
        for (size_t i = 0; i < 3 * PLACES; i++) p->at[i] = p->x[i] - radius[i / 3] * p->normal[i];
        const sdm_status s = sdm_exact_points(p->engine, p->at, PLACES, &out, err);
        if (s) return s;
        for (size_t i = 0; i < PLACES; i++) {
            double to[3];
            v3_sub(p->x + 3 * i, p->closest + 3 * i, to);
            const double along = 2 * v3_dot(to, p->normal + 3 * i);
            if (-p->distance[i] >= BALL_TOUCHES * radius[i]) continue;
            radius[i] =
                step < SHRINK_STEPS && along > 0 ? fmin(radius[i], v3_dot(to, to) / along) : 0;
        }
    }
    return SDM_OK;
}

// Moves the centres of the largest balls step by step to places deeper inside the shape. *deepest:
// the largest distance of one from the surface, mm.
static sdm_status move_balls(const details_places *p, const double *radius, double *deepest,
                             sdm_error *err)
{
    static const double axis[6][3] = {{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
                                      {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};
    double centre[BALLS][3], depth[BALLS], step[BALLS];
    const sdm_exact_at out = {.distance = p->distance};
    double taken = INFINITY;
    for (size_t b = 0; b < BALLS; b++) {
        // the next smaller one
        size_t best = 0;
        double most = 0;
        for (size_t i = 0; i < PLACES; i++)
            if (radius[i] < taken && radius[i] > most) most = radius[i], best = i;
        taken = most;
        for (size_t a = 0; a < 3; a++)
            centre[b][a] = p->x[3 * best + a] - most * p->normal[3 * best + a];
        depth[b] = -sdm_exact_point(p->engine, centre[b], NULL, NULL, NULL);
        step[b] = 0.25 * most;
    }
    for (int n = 0; n < MOVE_STEPS; n++) {
        for (size_t i = 0; i < 18 * BALLS; i++)
            p->around[i] = centre[i / 18][i % 3] + step[i / 18] * axis[i / 3 % 6][i % 3];
        const sdm_status s = sdm_exact_points(p->engine, p->around, 6 * BALLS, &out, err);
        if (s) return s;
        for (size_t b = 0; b < BALLS; b++) {
            size_t best = 6 * b;
            for (size_t i = 6 * b; i < 6 * b + 6; i++)
                if (p->distance[i] < p->distance[best]) best = i;
            if (-p->distance[best] > depth[b]) {
                depth[b] = -p->distance[best];
                memcpy(centre[b], p->around + 3 * best, sizeof centre[b]);
            } else {
                step[b] *= 0.5;
            }
        }
    }
    *deepest = 0;
    for (size_t b = 0; b < BALLS; b++) *deepest = fmax(*deepest, depth[b]);
    return SDM_OK;
}

static sdm_status largest_ball(const details_places *p, double *radius, sdm_error *err)
{
    const sdm_mesh *m = sdm_exact_surface(p->engine);
    double *each = NULL, low[3], high[3];
    sdm_status s = SDM_ALLOC(&each, PLACES, "balls in the shape", err);
    memcpy(low, p->x, sizeof low);
    memcpy(high, p->x, sizeof high);
    for (size_t i = 0; i < 3 * m->n_vert; i++) {
        low[i % 3] = fmin(low[i % 3], m->vert[i]);
        high[i % 3] = fmax(high[i % 3], m->vert[i]);
    }
    if (!s) s = shrink_balls(p, 0.5 * sqrt(v3_dist2(low, high)), each, err);
    if (!s) s = move_balls(p, each, radius, err);
    if (!s && !(*radius > 0)) s = sdm_fail(err, SDM_E_QUALITY, "the shape has no inside");
    sdm_free(each);
    return s;
}

static double fraction(double x) { return x - floor(x); }

/* *share of the surface beside details that voxels with this longest edge do not show: there the
 * gradient of the distance, by differences over two voxels, is clearly shorter than 1. The points
 * stand for the centres of the voxels within half an edge of the surface: each lies in a voxel
 * about a place of the surface. */
static sdm_status bent_share(const details_places *p, const double voxel[3], double edge,
                             double *share, sdm_error *err)
{
    const sdm_exact_at out = {.distance = p->distance};
    size_t all = 0, bent = 0;
    double *at = p->at, near = 0.5 * edge;
    for (size_t i = 0; i < 3 * PLACES; i++)
        at[i] = p->x[i] + edge * voxel[i % 3] * (fraction(ASIDE[i % 3] * (double)(i / 3)) - 0.5);
    sdm_status s = sdm_exact_points(p->engine, at, PLACES, &out, err);
    for (size_t i = 0; i < PLACES && !s; i++)
        if (fabs(p->distance[i]) <= near) memmove(at + 3 * all++, at + 3 * i, 3 * sizeof *at);
    for (size_t i = 0; i < 18 * all; i++) {
        const size_t side = i / 3 % 6, a = i % 3;
        p->around[i] = at[i / 18 * 3 + a];
        if (side / 2 == a) p->around[i] += side % 2 ? -edge * voxel[a] : edge * voxel[a];
    }
    if (!s) s = sdm_exact_points(p->engine, p->around, 6 * all, &out, err);
    for (size_t i = 0; i < all && !s; i++) {
        double square = 0;
        for (size_t a = 0; a < 3; a++) {
            const double *d = p->distance + 6 * i + 2 * a;
            square += pow((d[0] - d[1]) / (2 * edge * voxel[a]), 2);
        }
        bent += square < GRADIENT_MIN * GRADIENT_MIN;
    }
    *share = all ? (double)bent / (double)all : 0;
    return s;
}

/* *edge = longest edge, up to `most`, of voxels that show the details; INFINITY: those of `most`
 * do. voxel[3]: proportions of the voxels, 1 along the longest edge. */
static sdm_status longest_edge(const details_places *p, const double voxel[3], double most,
                               double *edge, sdm_error *err)
{
    double share, shown = most, hidden = most;
    sdm_status s = bent_share(p, voxel, most, &share, err);
    *edge = INFINITY;
    if (s || share <= DETAILS_MAX) return s;
    for (int i = 0; i < HALVINGS && share > DETAILS_MAX && !s; i++) {
        hidden = shown;
        shown *= 0.5;
        s = bent_share(p, voxel, shown, &share, err);
    }
    for (int i = 0; i < BISECTIONS && !s; i++) {
        const double middle = sqrt(shown * hidden);
        s = bent_share(p, voxel, middle, &share, err);
        *(share > DETAILS_MAX ? &hidden : &shown) = middle;
    }
    *edge = shown;
    return s;
}

/* The share of bent_share(), at the voxels of a map beside its surface. */
static double bent_share_of_map(const sdm_grid *g, const double *distance)
{
    const int64_t step[3] = {1, g->n[0], g->n[0] * g->n[1]};
    const double near = 0.5 * fit_longest_edge(g);
    double all = 0, bent = 0;
    for (int64_t k = 1; k + 1 < g->n[2]; k++)
        for (int64_t j = 1; j + 1 < g->n[1]; j++)
            for (int64_t i = 1; i + 1 < g->n[0]; i++) {
                const double *d = distance + k * step[2] + j * step[1] + i;
                double square = 0;
                if (fabs(*d) > near) continue;
                for (int a = 0; a < 3; a++)
                    square += pow((d[step[a]] - d[-step[a]]) / (2 * g->spacing[a]), 2);
                all++;
                bent += square < GRADIENT_MIN * GRADIENT_MIN;
            }
    return all > 0 ? bent / all : 0;
}

/* Raises *edge where an exact map on the grid of the maps shows the details. */
static sdm_status try_own_grid(const fit_maps *maps, const sdm_exact *engine, double *edge,
                               sdm_error *err)
{
    const double *distance = maps->distance, voxel = fit_longest_edge(&maps->grid);
    double *made = NULL;
    float *values = NULL;
    sdm_status s = SDM_OK;
    if (*edge >= voxel) return SDM_OK;
    if (!maps->made_exact) {
        const size_t n = sdm_grid_count(&maps->grid);
        s = SDM_ALLOC(&values, n, "exact map", err);
        if (!s) s = SDM_ALLOC(&made, n, "exact map", err);
        if (!s) s = sdm_exact_map(engine, &maps->grid, values, err);
        for (size_t v = 0; v < n && !s; v++) made[v] = (double)values[v];
        distance = made;
    }
    const double share = s ? INFINITY : bent_share_of_map(&maps->grid, distance);
    if (share <= DETAILS_MAX) *edge = share > 0 ? voxel * DETAILS_MAX / share : INFINITY;
    sdm_free(values);
    sdm_free(made);
    return s;
}

static double thinnest_part(const sdm_mesh *m, const sdm_exact_opts *opts)
{
    sdm_part_audit audit = {0};
    double thick = NAN;
    if (!sdm_part_audit_make(m, SDM_AUDIT_WALLS, opts, &audit, NULL))
        thick = sdm_part_audit_thickness(&audit);
    sdm_part_audit_dispose(&audit);
    return thick;
}

size_t sdm_fit_thinning_param(const sdm_instance *shape, const double *params, double thinnest)
{
    size_t n, thins;
    const sdm_param *param = sdm_instance_params(shape, &n);
    double *p = NULL, most = 2 * thinnest;
    if (SDM_ALLOC(&p, n, "parameters", NULL)) return n;
    thins = n;
    for (size_t k = 0; k < n; k++) {
        const double step = (param[k].max - param[k].min) / 50;
        sdm_mesh mesh = {0};
        memcpy(p, params, n * sizeof *p);
        p[k] += p[k] + step > param[k].max ? -step : step;
        const double thick =
            sdm_instance_mesh(shape, p, &mesh, NULL) ? NAN : thinnest_part(&mesh, NULL);
        sdm_mesh_dispose(&mesh);
        if (thick > most) most = thick, thins = k;
    }
    sdm_free(p);
    return thins;
}

sdm_status sdm_fit_shape_details(const fit_maps *maps, const double *params, double most,
                                 fit_details *out, sdm_error *err)
{
    shape_surface surface = {0};
    details_places places = {0};
    const sdm_exact_opts o = {
        .n_threads = maps->n_threads, .cancelled = maps->cancelled, .user = maps->user};
    const double *h = maps->grid.spacing, longest = fit_longest_edge(&maps->grid);
    const double voxel[3] = {h[0] / longest, h[1] / longest, h[2] / longest};
    sdm_status s = sdm_shape_surface_make(maps->source->shape, params, false, &o, &surface, err);
    if (!s) s = places_create(surface.engine, &places, err);
    if (!s) s = largest_ball(&places, &out->radius, err);
    if (!s) out->thinnest = thinnest_part(&surface.mesh, &o);
    if (!s)
        s = longest_edge(&places, voxel, fmin(most, 2 * out->radius / SDM_GRID_FIT_VOXELS),
                         &out->edge, err);
    if (!s) s = try_own_grid(maps, surface.engine, &out->edge, err);
    places_dispose(&places);
    sdm_shape_surface_dispose(&surface);
    return s;
}

fit_details sdm_fit_map_details(const fit_maps *maps, double thinnest)
{
    const double share = bent_share_of_map(&maps->grid, maps->distance),
                 radius = sdm_fit_inradius(maps);
    // the map shows the largest ball too small; no part is thicker than it
    return (fit_details){.radius = 0.5 * thinnest > radius ? 0.5 * thinnest : radius,
                         .thinnest = thinnest,
                         // at edges the share grows with the voxel
                         .edge = share > DETAILS_MAX
                                     ? fit_longest_edge(&maps->grid) * DETAILS_MAX / share
                                     : INFINITY};
}
