/* Interpolates exact maps at points of the exact surface, and counts shapes that the grid cuts. */
#include "surface_check.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/part_audit.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/same_triangles.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"
#include "streams.h"
#include "trilinear.h"

enum { SHAPES = 4, POINTS = 500 };

/* Sums over the points of one shape. */
typedef struct surface_sums {
    double square, thin, n;
} surface_sums;

/* The mesh of a surface with the areas of its triangles, summed up. */
typedef struct surface_mesh {
    const sdm_mesh *mesh;
    double *area; // [n_tri] of the triangles up to this one, mm^2
} surface_mesh;

static void triangle_of(const sdm_mesh *m, size_t t, double corner[3][3])
{
    for (int c = 0; c < 3; c++)
        for (int a = 0; a < 3; a++)
            corner[c][a] = m->vert[3 * (size_t)m->tri[3 * t + (size_t)c] + (size_t)a];
}

/* x[3] = random point of the surface, uniform by area; normal[3] = unit normal there. */
static void draw_point(const surface_mesh *s, uint64_t seed, uint64_t index, double x[3],
                       double normal[3])
{
    double u[3], corner[3][3];
    for (uint64_t k = 0; k < 3; k++) u[k] = sdm_rng_uniform(seed, STREAM_SURFACE, 3 * index + k);
    const double at = u[0] * s->area[s->mesh->n_tri - 1];
    size_t low = 0, high = s->mesh->n_tri - 1;
    while (low < high) {
        const size_t middle = (low + high) / 2;
        if (s->area[middle] > at)
            high = middle;
        else
            low = middle + 1;
    }
    triangle_of(s->mesh, low, corner);
    const double root = sqrt(u[1]), b = root * (1 - u[2]), c = root * u[2];
    v3_triangle_normal(corner[0], corner[1], corner[2], normal);
    const double length = v3_norm(normal);
    for (int a = 0; a < 3; a++) {
        x[a] = (1 - b - c) * corner[0][a] + b * corner[1][a] + c * corner[2][a];
        normal[a] /= length > 0 ? length : 1;
    }
}

/* index[3] = the index coordinates of x; false if x is outside of the grid. */
static bool index_of(const sdm_grid *g, const double x[3], double index[3])
{
    sdm_grid_index(g, x, index);
    for (int a = 0; a < 3; a++)
        if (!(index[a] >= 0 && index[a] < (double)g->n[a] - 1)) return false;
    return true;
}

/* Adds up the points of the surface of e. map: scratch memory for a map of the grid. */
static sdm_status check_surface(const dataset *d, const sdm_exact *e, size_t shape, float *map,
                                surface_sums *sums, sdm_error *err)
{
    surface_mesh s = {.mesh = sdm_exact_surface(e)};
    if (!s.mesh->n_tri) return SDM_OK;
    const double voxel = trainer_dataset_voxel(d);
    sdm_status status = sdm_exact_map(e, d->grid, map, err);
    if (!status) status = SDM_ALLOC(&s.area, s.mesh->n_tri, "surface", err);
    for (size_t t = 0; t < s.mesh->n_tri && !status; t++) {
        double corner[3][3], normal[3];
        triangle_of(s.mesh, t, corner);
        v3_triangle_normal(corner[0], corner[1], corner[2], normal);
        s.area[t] = (t ? s.area[t - 1] : 0) + v3_norm(normal) / 2;
    }
    for (size_t i = 0; i < POINTS && !status; i++) {
        double x[3], normal[3], inside[3], index[3];
        draw_point(&s, d->seed, shape * POINTS + i, x, normal);
        if (!index_of(d->grid, x, index)) continue;
        const double value = trainer_trilinear(d->grid, map, index);
        // one voxel below the surface a ball of this radius touches it at x alone, if it fits in
        v3_along(x, -voxel, normal, inside);
        sums->square += value * value;
        sums->thin += sdm_exact_point(e, inside, NULL, NULL, NULL) > -0.9 * voxel;
        sums->n++;
    }
    sdm_free(s.area);
    return status;
}

bool trainer_is_cut(const sdm_mesh *m, const sdm_grid *g)
{
    return sdm_grid_mesh_beyond(g, m, NULL) > 0;
}

sdm_status trainer_exact_within(const dataset *d, const double *p, int n_threads, sdm_exact **out,
                                sdm_error *err)
{
    const sdm_exact_opts opts = {.n_threads = n_threads};
    sdm_mesh mesh = {0};
    *out = NULL;
    sdm_status s = sdm_instance_mesh(d->shape, p, &mesh, err);
    if (!s && !trainer_is_cut(&mesh, d->grid)) s = sdm_exact_create(&mesh, &opts, out, err);
    sdm_mesh_dispose(&mesh);
    return s;
}

/* Adds 1 to *inside_out if parts of the mesh are inside out and stay so, and to *open if it has
 * open or badly oriented edges; lowers *thickness to that of the thinnest part. */
static sdm_status check_parts(const sdm_mesh *m, size_t *inside_out, size_t *open,
                              double *thickness, sdm_error *err)
{
    sdm_part_audit audit = {0};
    const sdm_status s = sdm_part_audit_make(m, SDM_AUDIT_WALLS, NULL, &audit, err);
    *inside_out += !s && audit.inside_out;
    *open += !s && !audit.mesh.closed;
    *thickness = fmin(*thickness, sdm_part_audit_thickness(&audit)); // fmin() ignores NaN
    sdm_part_audit_dispose(&audit);
    return s;
}

sdm_status trainer_surface_check(const dataset *d, int n_threads, surface_check *out,
                                 sdm_error *err)
{
    const sdm_exact_opts opts = {.n_threads = n_threads};
    surface_sums sums = {0};
    sdm_mesh mesh = {0};
    float *map = NULL;
    double thickness = NAN;
    size_t cut = 0, compared = 0, inside_out = 0, open = 0;
    sdm_status s = SDM_ALLOC(&map, sdm_grid_count(d->grid), "surface", err);
    for (size_t i = 0; i < d->n_holdout && !s; i++) {
        sdm_exact *e = NULL;
        s = sdm_instance_mesh(d->shape, d->holdout_params + i * d->n_params, &mesh, err);
        if (!s) cut += trainer_is_cut(&mesh, d->grid);
        if (s || i >= SHAPES) continue;
        s = check_parts(&mesh, &inside_out, &open, &thickness, err);
        compared++;
        if (!s) s = sdm_exact_create(&mesh, &opts, &e, err);
        if (!s) s = check_surface(d, e, i, map, &sums, err);
        sdm_exact_free(e);
    }
    sdm_mesh_dispose(&mesh);
    sdm_free(map);
    *out = (surface_check){.rms_mm = sums.n > 0 ? sqrt(sums.square / sums.n) : NAN,
                           .thin = sums.n > 0 ? sums.thin / sums.n : NAN,
                           .thickness_mm = thickness,
                           .cut = d->n_holdout ? (double)cut / (double)d->n_holdout : 0,
                           .inside_out = compared ? (double)inside_out / (double)compared : 0,
                           .open = compared ? (double)open / (double)compared : 0};
    return s;
}

sdm_status trainer_find_triangles_param(const dataset *d, size_t *param, sdm_error *err)
{
    sdm_mesh low = {0}, high = {0};
    double p[SDM_POD_MAX_PARAMS];
    sdm_status s = SDM_OK;
    *param = d->n_params;
    for (size_t k = 0; k < d->n_params && !s && d->n_holdout && *param == d->n_params; k++) {
        memcpy(p, d->holdout_params, d->n_params * sizeof *p);
        p[k] = d->min[k];
        s = sdm_instance_mesh(d->shape, p, &low, err);
        p[k] = d->max[k];
        if (!s) s = sdm_instance_mesh(d->shape, p, &high, err);
        if (!s && !sdm_mesh_same_triangles(&low, &high)) *param = k;
    }
    sdm_mesh_dispose(&low);
    sdm_mesh_dispose(&high);
    return s;
}
