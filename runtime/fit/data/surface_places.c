/* Places on the surface of the fitted shape: on its triangles, or where its map is zero. A wall
   thinner than two voxels bends the distances between their centres, so that such places on a map
   may lie beside the surface. */
#include "surface_places.h"

#include <math.h>

#include "samples.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/vec3.h"
#include "surface_points.h"

// multiples of 1 / P and 1 / P^2, P = 1.3247... with P^3 = P + 1, fill the square evenly; places
// spread by them coincide with no points that other multiples have spread
static const double BETWEEN[2] = {0.75487766624669276, 0.56984029099805327};

static sdm_status places_allocate(size_t n_params, size_t most, fit_places *out, sdm_error *err)
{
    *out = (fit_places){0};
    size_t count;
    sdm_status s = sdm_mul(most, n_params, &count, err);
    if (!s) s = SDM_ALLOC(&out->world, most, "places of the surface", err);
    if (!s) s = SDM_ALLOC(&out->by, count, "places of the surface", err);
    if (s) sdm_fit_places_dispose(out);
    return s;
}

void sdm_fit_places_dispose(fit_places *places)
{
    sdm_free(places->world);
    sdm_free(places->by);
    *places = (fit_places){0};
}

// `most` places on the triangles
static sdm_status places_of_mesh(const fit_maps *maps, const fit_state *state, size_t most,
                                 fit_places *out, sdm_error *err)
{
    const shape_surface *surface = &maps->surface;
    const sdm_mesh *m = sdm_exact_surface(surface->engine);
    uint32_t *triangle = NULL;
    double *x = &out->world[0][0];
    const sdm_status s = SDM_ALLOC(&triangle, most, "places of the surface", err);
    if (s) return s;
    const double area = sdm_fit_spread_over(m, most, BETWEEN, x, triangle);
    out->n = area > 0 && isfinite(area) ? most : 0;
    for (size_t i = 0; i < out->n; i++) {
        const uint32_t *t = m->tri + 3 * (size_t)triangle[i];
        const double y[3] = {x[3 * i], x[3 * i + 1], x[3 * i + 2]};
        double normal[3];
        v3_triangle_normal(m->vert + 3 * (size_t)t[0], m->vert + 3 * (size_t)t[1],
                           m->vert + 3 * (size_t)t[2], normal);
        const double length = v3_norm(normal);
        for (int a = 0; a < 3 && length > 0; a++) normal[a] /= length;
        if (surface->velocity)
            sdm_shape_surface_derivatives(surface, triangle[i], y, normal,
                                          out->by + i * maps->n_params);
        sdm_fit_to_world(state, y, x + 3 * i);
    }
    sdm_free(triangle);
    return SDM_OK;
}

// the place of the surface next to voxel v, whose indices are index[3]
static void place_of_voxel(const fit_maps *m, const fit_state *state, size_t v, double index[3],
                           fit_places *out)
{
    const sdm_grid *g = &m->grid;
    const double *d = m->distance + v;
    const int64_t step[3] = {1, g->n[0], g->n[0] * g->n[1]};
    double slope[3], square = 0, y[3];
    for (int a = 0; a < 3; a++) {
        slope[a] = (d[step[a]] - d[-step[a]]) / (2 * g->spacing[a]);
        square += slope[a] * slope[a];
    }
    for (int a = 0; a < 3 && square > 0; a++) index[a] -= *d * slope[a] / (square * g->spacing[a]);
    sdm_grid_world(g, index, y);
    for (size_t k = 0; k < m->n_params; k++)
        out->by[out->n * m->n_params + k] = (double)m->jacobian[k * m->n_voxels + v];
    sdm_fit_to_world(state, y, out->world[out->n++]);
}

static void places_of_map(const fit_maps *maps, const fit_state *state, size_t most,
                          fit_places *out)
{
    const sdm_grid *g = &maps->grid;
    const double *d = maps->distance, half = 0.5 * fit_longest_edge(g);
    size_t all = 0, number = 0;
    for (size_t v = 0; v < maps->n_voxels; v++) all += fabs(d[v]) <= half;
    const size_t each = (all + most - 1) / most;
    for (int64_t k = 1; k + 1 < g->n[2]; k++)
        for (int64_t j = 1; j + 1 < g->n[1]; j++)
            for (int64_t i = 1; i + 1 < g->n[0]; i++) {
                const size_t v = (size_t)((k * g->n[1] + j) * g->n[0] + i);
                double index[3] = {(double)i, (double)j, (double)k};
                if (fabs(d[v]) <= half && number++ % each == 0)
                    place_of_voxel(maps, state, v, index, out);
            }
}

sdm_status sdm_fit_places_create(const fit_maps *maps, const fit_state *state, size_t most,
                                 fit_places *out, sdm_error *err)
{
    sdm_status s = places_allocate(maps->n_params, most, out, err);
    if (s) return s;
    if (fit_maps_direct(maps))
        s = places_of_mesh(maps, state, most, out, err);
    else
        places_of_map(maps, state, most, out);
    if (s) sdm_fit_places_dispose(out);
    return s;
}
