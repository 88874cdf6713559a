/* Points of a shape, their score in an image, and the climb to a maximum of the score. */
#include "pattern.h"

#include <math.h>
#include <string.h>

#include "fit/data/map_fields.h"
#include "fit/data/source_params.h"
#include "sdm/internal/mat3.h"
#include "sdm/memory.h"

// largest number of points in the shape, and around it
enum { POINTS_INSIDE = 500, POINTS_AROUND = 700 };
// where the layer around the shape begins and ends, in inradii from the surface
#define LAYER_BEGIN 0.25
#define LAYER_END 1.25
// number of times that the steps of a climb are halved, and of steps with one length
enum { HALVINGS = 3, CLIMB_STEPS = 12 };

// 0: in the shape; 1: around it; -1: neither
static int side_of(const fit_pattern *p, double distance)
{
    if (distance < 0) return 0;
    return distance > LAYER_BEGIN * p->inradius && distance < LAYER_END * p->inradius ? 1 : -1;
}

// takes `wanted` voxels of a side, or all, spread evenly over their order in the map
static void points_take(fit_pattern *p, const fit_maps *maps, int side, size_t total, size_t wanted)
{
    const sdm_grid *g = &maps->grid;
    size_t v = 0, seen = 0, taken = 0;
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++, v++) {
                if (side_of(p, maps->distance[v]) != side) continue;
                if (++seen * wanted <= taken * total) continue;
                double *x = p->points[p->n++];
                sdm_grid_world(g, (const double[3]){(double)i, (double)j, (double)k}, x);
                for (int a = 0; a < 3; a++) x[a] -= p->centre[a];
                taken++;
            }
}

static sdm_status points_make(fit_pattern *p, const fit_maps *maps, sdm_error *err)
{
    size_t total[2] = {0, 0};
    for (size_t v = 0; v < maps->n_voxels; v++) {
        const int side = side_of(p, maps->distance[v]);
        if (side >= 0) total[side]++;
    }
    if (!total[0] || !total[1])
        return sdm_fail(err, SDM_E_QUALITY,
                        "the map of the shape at the start has no voxel %s: a finer map, or a "
                        "larger one, is needed",
                        total[0] ? "around the shape" : "inside");
    const size_t wanted[2] = {total[0] < POINTS_INSIDE ? total[0] : POINTS_INSIDE,
                              total[1] < POINTS_AROUND ? total[1] : POINTS_AROUND};
    const sdm_status s = SDM_ALLOC(&p->points, wanted[0] + wanted[1] + 2, "points", err);
    for (int side = 0; side < 2 && !s; side++) {
        points_take(p, maps, side, total[side], wanted[side]);
        if (!side) p->n_inside = p->n;
    }
    return s;
}

// start parameters within their bounds
static void params_choose(const sdm_fit_source *source, const double *given, size_t n, double *out)
{
    for (size_t k = 0; k < n; k++) {
        double low, high;
        const char *name;
        sdm_fit_bounds(source, k, &low, &high, &name);
        double x = given ? given[k] : 0;
        if (!given && source->model) x = sdm_model_get_info(source->model)->params[k].def;
        if (!given && !source->model) x = sdm_instance_params(source->shape, &(size_t){0})[k].def;
        out[k] = fmin(fmax(x, low), high);
    }
}

sdm_status sdm_fit_pattern_make(const sdm_fit_source *source, const sdm_fit_opts *opts,
                                fit_pattern *out, sdm_error *err)
{
    double params[FIT_PARAMS_MAX];
    fit_extent extent;
    fit_maps maps;
    *out = (fit_pattern){0};
    sdm_status s = sdm_fit_maps_create(source, false, opts, &maps, err);
    if (s) return s;
    params_choose(source, opts->start_params, maps.n_params, params);
    s = sdm_fit_maps_make(&maps, params, false, err);
    if (!s) s = sdm_fit_extent(&maps, &extent, err);
    if (!s) {
        memcpy(out->centre, extent.centre, sizeof out->centre);
        out->reach = extent.reach;
        out->inradius = sdm_fit_inradius(&maps);
        s = points_make(out, &maps, err);
    }
    sdm_fit_maps_dispose(&maps);
    return s;
}

void sdm_fit_pattern_dispose(fit_pattern *p)
{
    sdm_free(p->points);
    *p = (fit_pattern){0};
}

// likeness at an index of l, 0 .. 255; beyond its boxes that of the last one
static double look(const fit_likeness *l, const double index[3])
{
    int64_t low[3];
    double part[3];
    for (int a = 0; a < 3; a++) {
        const double last = (double)(l->n[a] - 2),
                     x = index[a] > 0 ? index[a] < last ? index[a] : last : 0;
        low[a] = (int64_t)x;
        part[a] = x - (double)low[a];
    }
    const uint8_t *v = l->values + (low[2] * l->n[1] + low[1]) * l->n[0] + low[0];
    const int64_t dy = l->n[0], dz = l->n[0] * l->n[1];
    double plane[2];
    for (int k = 0; k < 2; k++, v += dz) {
        const double a = v[0] + part[0] * (v[1] - v[0]), b = v[dy] + part[0] * (v[dy + 1] - v[dy]);
        plane[k] = a + part[1] * (b - a);
    }
    return plane[0] + part[2] * (plane[1] - plane[0]);
}

double sdm_fit_pattern_score(const fit_pattern *p, const fit_likeness *l, const sdm_grid *g,
                             const fit_place *place, size_t stride)
{
    double origin[3], turn[9], sum[2] = {0, 0}, count[2] = {0, 0};
    sdm_fit_likeness_index(l, g, place->at, origin);
    for (int i = 0; i < 9; i++) turn[i] = place->size * place->rotation[i] / l->edge[i / 3];
    for (size_t i = 0; i < p->n; i += stride) {
        double index[3];
        m3_apply(turn, p->points[i], index);
        for (int a = 0; a < 3; a++) index[a] += origin[a];
        sum[i >= p->n_inside] += look(l, index);
        count[i >= p->n_inside]++;
    }
    return (sum[0] / count[0] - sum[1] / count[1]) / 255;
}

// place moved along axis 0 .. 2 by `step` mm, turned about axis 3 .. 5 by step / reach, or (6) of
// another size
static fit_place moved(const fit_place *from, int axis, double step, double reach)
{
    fit_place to = *from;
    if (axis < 3) {
        to.at[axis] += step;
        return to;
    }
    if (axis == 6) {
        to.size = fmin(fmax(to.size * (1 + step / reach), 0.75), 4.0 / 3);
        return to;
    }
    sdm_pose pose = {{0, 0, 0}, {0, 0, 0}};
    double turn[9];
    pose.rotation[axis - 3] = step / reach;
    sdm_pose_matrix(&pose, turn);
    m3_product(turn, from->rotation, to.rotation);
    return to;
}

double sdm_fit_pattern_climb(const fit_pattern *p, const fit_likeness *l, const sdm_grid *g,
                             size_t stride, fit_place *place)
{
    const double edge = fmax(l->edge[0], fmax(l->edge[1], l->edge[2]));
    double best = sdm_fit_pattern_score(p, l, g, place, stride), step = 2 * edge;
    for (int halving = 0; halving < HALVINGS; halving++, step *= 0.5)
        for (int n = 0; n < CLIMB_STEPS; n++) {
            fit_place next = *place;
            for (int move = 0; move < 14; move++) {
                const fit_place to =
                    moved(place, move / 2, move % 2 ? -step : step, 0.7 * p->reach);
                const double score = sdm_fit_pattern_score(p, l, g, &to, stride);
                if (score > best) best = score, next = to;
            }
            if (!memcmp(&next, place, sizeof next)) break;
            *place = next;
        }
    return best;
}
