/* The runtime inside of a page: see page_runtime.h. */
#include "page_runtime.h"

#include <math.h>
#include <stdlib.h>

#include "sdm/builtin_shapes.h"
#include "sdm/internal/mesh_measures.h"
#include "sdm/isosurface.h"
#include "sdm/map.h"
#include "sdm/memory.h"
#include "sdm/runtime.h"

/* Indices of voxels that differ by less are taken for equal. */
#define NEAR 1e-6

static sdm_error failure;
static sdm_model *model;
static sdm_instance *shape; // NULL: only the network computes maps
static const sdm_model_info *info;
static double *params; // [n_params]
static double *ranges; // [n_params][2] least and largest value of each parameter
static float *values;  // [nz][ny][nx]
static sdm_result result;

// the surface of the map
static float *vertices; // [n_vert][6] position in mm, normal
static sdm_mesh mesh;
static bool cut;
static double measures[8]; // volume, area, smallest and largest coordinates
static double own_measures[SDM_MEASURES_MAX], mesh_measures[SDM_MESH_MEASURES];

const char *page_message(void) { return failure.text; }

void *page_alloc(size_t size) { return malloc(size); }

/* shape = an instance of the model's shape, from which the exact engine makes maps. NULL if the
   shape is no built-in one or needs a data file: a page has neither plug-ins nor files. */
static void open_shape(void)
{
    sdm_registry *shapes = NULL;
    sdm_status s = sdm_registry_create(&shapes, &failure);
    if (!s) s = sdm_builtin_shapes_add(shapes, &failure);
    if (!s) s = sdm_runtime_instance(model, shapes, &shape, &failure);
    if (s) shape = NULL;
}

static sdm_status prepare(sdm_error *err)
{
    const size_t count = sdm_grid_count(&info->grid);
    sdm_status s = SDM_ALLOC(&params, info->n_params, "parameters", err);
    if (!s) s = SDM_ALLOC(&ranges, 2 * info->n_params, "ranges", err);
    if (!s) s = SDM_ALLOC(&values, count, "map", err);
    if (s) return s;
    size_t n = 0;
    const sdm_param *of_shape = shape ? sdm_instance_params(shape, &n) : NULL;
    for (size_t i = 0; i < info->n_params; i++) {
        params[i] = info->params[i].def;
        ranges[2 * i] = of_shape ? of_shape[i].min : info->params[i].min;
        ranges[2 * i + 1] = of_shape ? of_shape[i].max : info->params[i].max;
    }
    return SDM_OK;
}

int page_open(uint8_t *bytes, size_t size)
{
    sdm_status s = sdm_model_open_memory("the model of this page", bytes, size, &model, &failure);
    free(bytes);
    if (s) return 1;
    info = sdm_model_get_info(model);
    open_shape();
    return prepare(&failure) ? 1 : 0;
}

double *page_params(void) { return params; }
size_t page_n_params(void) { return info->n_params; }

const double *page_ranges(void) { return ranges; }

int page_map(void)
{
    const sdm_generate_opts opts = {.policy = shape ? SDM_RANGE_EXACT : SDM_RANGE_REFUSE,
                                    .exact_shape = shape};
    return sdm_generate(model, params, &opts, values, &result, &failure) ? 1 : 0;
}

int page_exact(void)
{
    const sdm_exact_opts opts = {0};
    return sdm_exact_shape_map(shape, params, &opts, &info->grid, values, NULL, &failure) ? 1 : 0;
}

int page_knows_shape(void) { return shape != NULL; }

int page_was_exact(void) { return result.source == SDM_SOURCE_EXACT; }

const float *page_values(void) { return values; }
size_t page_n_values(void) { return sdm_grid_count(&info->grid); }

/* Adds weight times the slopes of the map along the axes of the grid, by central differences, at a
 * voxel. */
static void add_slopes(const int64_t at[3], double weight, double sum[3])
{
    const sdm_grid *g = &info->grid;
    const float *value = values + sdm_grid_voxel(g, at[0], at[1], at[2]);
    const int64_t step[3] = {1, g->n[0], g->n[0] * g->n[1]};
    for (int a = 0; a < 3; a++) {
        const int64_t up = at[a] + 1 < g->n[a] ? step[a] : 0, down = at[a] > 0 ? step[a] : 0;
        if (!up && !down) continue; // one layer of voxels
        const double span = (up && down ? 2 : 1) * g->spacing[a];
        sum[a] += weight * ((double)value[up] - (double)value[-down]) / span;
    }
}

/* normal[3] = the direction of the gradient at x (mm), a vertex of the surface: between the two
 * voxels at the ends of its edge of the grid. */
static void normal_at(const double x[3], float normal[3])
{
    const sdm_grid *g = &info->grid;
    double index[3], share[3], sum[3] = {0}, n[3];
    int64_t low[3];
    int between = 0; // bits of the axes along which x lies between two voxels: mostly one
    sdm_grid_index(g, x, index);
    for (int a = 0; a < 3; a++) {
        low[a] = (int64_t)fmin(fmax(floor(index[a] + NEAR), 0), (double)g->n[a] - 1);
        share[a] = fmin(fmax(index[a] - (double)low[a], 0), 1);
        between |= (share[a] > NEAR) << a;
    }
    for (int corner = 0; corner < 8; corner++) {
        if (corner & ~between) continue;
        int64_t at[3];
        double weight = 1;
        for (int a = 0; a < 3; a++) {
            const int high = corner >> a & 1;
            at[a] = low[a] + high;
            weight *= high ? share[a] : 1 - share[a];
            if (at[a] >= g->n[a]) weight = 0;
        }
        if (weight > NEAR) add_slopes(at, weight, sum);
    }
    for (int a = 0; a < 3; a++)
        n[a] = g->dir[3 * a] * sum[0] + g->dir[3 * a + 1] * sum[1] + g->dir[3 * a + 2] * sum[2];
    const double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int a = 0; a < 3; a++) normal[a] = (float)(length > 0 ? n[a] / length : 0);
}

/* Measures the map and its surface. */
static sdm_status measure(void)
{
    double area = 0;
    for (int a = 0; a < 3; a++) measures[2 + a] = INFINITY, measures[5 + a] = -INFINITY;
    for (size_t t = 0; t < mesh.n_tri; t++) {
        const double *p = mesh.vert + 3 * mesh.tri[3 * t], *q = mesh.vert + 3 * mesh.tri[3 * t + 1],
                     *r = mesh.vert + 3 * mesh.tri[3 * t + 2];
        double u[3], v[3];
        for (int a = 0; a < 3; a++) u[a] = q[a] - p[a], v[a] = r[a] - p[a];
        const double n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                             u[0] * v[1] - u[1] * v[0]};
        area += sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) / 2;
    }
    for (size_t i = 0; i < mesh.n_vert; i++)
        for (int a = 0; a < 3; a++) {
            const double x = mesh.vert[3 * i + (size_t)a];
            measures[2 + a] = fmin(measures[2 + a], x);
            measures[5 + a] = fmax(measures[5 + a], x);
        }
    measures[1] = area;
    return sdm_map_volume(&info->grid, values, 1, &measures[0], &failure);
}

int page_surface(void)
{
    sdm_mesh_dispose(&mesh);
    free(vertices);
    vertices = NULL;
    sdm_status s = sdm_isosurface(&info->grid, values, 0, &mesh, &cut, &failure);
    if (!s) s = SDM_ALLOC(&vertices, 6 * mesh.n_vert + 1, "surface", &failure);
    if (s) return 1;
    for (size_t i = 0; i < mesh.n_vert; i++) {
        for (size_t a = 0; a < 3; a++) vertices[6 * i + a] = (float)mesh.vert[3 * i + a];
        normal_at(mesh.vert + 3 * i, vertices + 6 * i + 3);
    }
    return measure() ? 1 : 0;
}

const float *page_vertices(void) { return vertices; }
size_t page_n_vertices(void) { return mesh.n_vert; }
const uint32_t *page_triangles(void) { return mesh.tri; }
size_t page_n_triangles(void) { return mesh.n_tri; }

const double *page_measures(void) { return measures; }
int page_is_cut(void) { return cut; }

size_t page_n_own_measures(void) { return shape ? sdm_instance_shape(shape)->n_measures : 0; }

const double *page_own_measures(double depth)
{
    const sdm_measure *table = sdm_instance_shape(shape)->measures;
    const size_t n = page_n_own_measures();
    size_t n_depths = 0;
    for (size_t i = 0; i < n; i++)
        if (table[i].of_depth) n_depths = 1;
    sdm_measures got;
    sdm_error refused = {0};
    const sdm_status s = sdm_shape_measure_own(shape, params, &depth, n_depths, &got, &refused);
    for (size_t i = 0; i < n; i++) own_measures[i] = s ? NAN : got.at[i].value;
    return own_measures;
}

const double *page_mesh_measures(void)
{
    sdm_measures got;
    sdm_error refused = {0};
    const sdm_status s = sdm_shape_measure(shape, params, NULL, 0, &got, &refused);
    for (size_t i = 0; i < SDM_MESH_MEASURES; i++)
        mesh_measures[i] = s ? NAN : got.at[got.n - SDM_MESH_MEASURES + i].value;
    return mesh_measures;
}
