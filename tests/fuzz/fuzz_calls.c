/* Fuzz target of the public functions: the input is a list of calls with their arguments, which are
 * within the documented preconditions: arrays have their documented lengths, numbers are anything.
 * Every call returns success or an error with a message. */
#include <math.h>
#include <string.h>

#include "fuzz_reader.h"
#include "sdm/builtin_shapes.h"
#include "sdm/field.h"
#include "sdm/isosurface.h"
#include "sdm/map.h"
#include "sdm/memory.h"
#include "sdm/meshfile.h"
#include "sdm/pose.h"
#include "sdm/volume.h"

enum { CALLS_MAX = 24, VOXELS_MAX = 1000, PARAMS_MAX = 8, POINTS = 8, TRIANGLES_MAX = 500 };

/* What the calls work on; NULL: there is none yet. */
typedef struct objects {
    const uint8_t *at, *end; /* the rest of the input */
    sdm_grid grid;           /* a valid one of at most VOXELS_MAX voxels */
    sdm_mesh mesh, other;
    sdm_exact *engine;
    size_t n_vert; /* of the mesh of the engine */
    const sdm_model *model;
    sdm_field *field;
    sdm_instance *shape;
    float values[VOXELS_MAX], array[(PARAMS_MAX + 3) * VOXELS_MAX];
    double x[3 * POINTS], p[PARAMS_MAX];
    sdm_error err;
} objects;

static sdm_registry *registry;
static sdm_model *models[2];

static void set_up(void)
{
    fuzz_require(!sdm_registry_create(&registry, NULL) && !sdm_builtin_shapes_add(registry, NULL));
    fuzz_require(!sdm_model_open(SDM_SOURCE_FOLDER "/tests/golden/imnet.sdm", &models[0], NULL));
    fuzz_require(!sdm_model_open(SDM_SOURCE_FOLDER "/tests/golden/pod_fine.sdm", &models[1], NULL));
}

static unsigned byte(objects *o) { return o->at < o->end ? *o->at++ : 0; }

/* A number of any kind. */
static double real(objects *o)
{
    static const double special[] = {0,    -0.0, 1,     -1,    0.5,  1e-300, -1e-300, 1e300,
                                     1e30, 1e70, 1e-70, 1e100, 1e38, 1e-8,   NAN,     INFINITY};
    const unsigned b = byte(o);
    if (b < 16) return special[b];
    return ((double)b - 136) / (b & 1 ? 8 : 64) + (double)byte(o) / 4096;
}

static void check(objects *o, sdm_status s) { fuzz_check_status(s, &o->err); }

/* Values within the ranges of n parameters, or one that is anything. */
static void choose_params(objects *o, size_t n, double min, double max, size_t i)
{
    if (i < n && i < PARAMS_MAX) o->p[i] = min + (max - min) * byte(o) / 255;
    if (byte(o) == 1) o->p[byte(o) % PARAMS_MAX] = real(o);
}

static void model_params(objects *o)
{
    const sdm_model_info *info = sdm_model_get_info(o->model);
    for (size_t i = 0; i < info->n_params; i++)
        choose_params(o, info->n_params, info->params[i].min, info->params[i].max, i);
}

static void new_grid(objects *o)
{
    sdm_grid g = {.dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (int d = 0; d < 3; d++) {
        const unsigned b = byte(o);
        g.n[d] = b > 250 ? INT64_MIN + (int64_t)b * ((int64_t)1 << 40) : b % 16;
        g.spacing[d] = real(o);
        g.origin[d] = real(o);
    }
    if (byte(o) & 1) g.dir[0] = -1;
    if (byte(o) == 7) g.dir[byte(o) % 9] = real(o);
    const sdm_status s = sdm_grid_check(&g, &o->err);
    check(o, s);
    if (!s && sdm_grid_count(&g) <= VOXELS_MAX) o->grid = g;
}

static void new_mesh(objects *o)
{
    const size_t n_vert = byte(o) % 10, n_tri = byte(o) % 16;
    if (sdm_mesh_reserve(&o->mesh, n_vert, n_tri, &o->err)) return;
    for (size_t i = 0; i < 3 * n_vert; i++) o->mesh.vert[i] = real(o);
    for (size_t i = 0; i < 3 * n_tri; i++)
        o->mesh.tri[i] = n_vert && byte(o) != 3 ? byte(o) % (uint32_t)n_vert : byte(o);
}

static void new_shape(objects *o)
{
    size_t n;
    const sdm_shape *shape = sdm_registry_at(registry, byte(o) % sdm_registry_count(registry));
    sdm_instance_free(o->shape);
    check(o, sdm_instance_create(shape, NULL, 0, NULL, &o->shape, &o->err));
    const sdm_param *params = o->shape ? sdm_instance_params(o->shape, &n) : NULL;
    for (size_t i = 0; params && i < n; i++) choose_params(o, n, params[i].min, params[i].max, i);
    if (!params || n > PARAMS_MAX || !strcmp(shape->name, "cochlea")) return; // takes too long
    const sdm_status s = sdm_instance_mesh(o->shape, o->p, &o->mesh, &o->err);
    check(o, s);
    double distance;
    if (!s) check(o, sdm_instance_distance(o->shape, o->p, o->x, &distance, &o->err));
    // larger meshes take too long for a fuzzer
    if (o->mesh.n_tri > TRIANGLES_MAX) sdm_mesh_dispose(&o->mesh);
}

static void change_mesh(objects *o)
{
    sdm_audit audit;
    switch (byte(o) % 3) {
    case 0:
        check(o, sdm_mesh_audit(&o->mesh, &audit, &o->err));
        break;
    case 1:
        check(o, sdm_mesh_copy(&o->mesh, &o->other, &o->err));
        break;
    default:
        sdm_mesh_dispose(&o->mesh);
        check(o, sdm_isosurface(&o->grid, o->values, (float)real(o), &o->mesh, NULL, &o->err));
    }
}

static void new_engine(objects *o)
{
    const unsigned b = byte(o);
    const sdm_exact_opts opts = {.sign = (sdm_sign_method)(b % 4),
                                 .keep_overlap = b & 4,
                                 .n_threads = 1,
                                 .memory_limit = b & 8 ? (size_t)byte(o) << 8 : 0};
    sdm_exact_free(o->engine);
    o->n_vert = o->mesh.n_vert;
    const sdm_status s = sdm_exact_create(&o->mesh, &opts, &o->engine, &o->err);
    check(o, s);
    fuzz_require((s == SDM_OK) == (o->engine != NULL));
}

static void use_engine(objects *o)
{
    if (!o->engine) return;
    float *const a = o->array;
    double at[3 * POINTS], gradient[3 * POINTS], velocity[3 * 512] = {0};
    uint32_t triangle[VOXELS_MAX];
    sdm_blocks blocks = {0};
    sdm_sign_certificate certificate;
    sdm_check checked;
    const sdm_exact_layers layers = {o->values, a, a + 3 * VOXELS_MAX, triangle, real(o)};
    const sdm_exact_at out = {at, gradient, NULL, triangle};
    switch (byte(o) % 8) {
    case 0:
        check(o, sdm_exact_map(o->engine, &o->grid, o->values, &o->err));
        break;
    case 1:
        check(o, sdm_exact_map_layers(o->engine, &o->grid, &layers, &o->err));
        break;
    case 2:
        check(o, sdm_exact_map_blocks(o->engine, &o->grid, real(o), &blocks, &o->err));
        sdm_blocks_dispose(&blocks);
        break;
    case 3:
        check(o, sdm_exact_points(o->engine, o->x, POINTS, &out, &o->err));
        break;
    case 4:
        fuzz_require(sdm_exact_distance(o->engine, o->x) >= 0 ||
                     isnan(sdm_exact_point(o->engine, o->x, at, gradient, triangle)));
        break;
    case 5:
        for (size_t i = 0; i < 3 * o->n_vert && i < 24; i++) velocity[i] = real(o);
        if (o->n_vert <= 512)
            check(o, sdm_exact_map_derivative(o->engine, &o->grid, velocity, 1, NULL, a, &o->err));
        break;
    case 6:
        check(o, sdm_exact_certify(o->engine, &o->grid, o->values, &certificate, &o->err));
        break;
    default:
        check(o, sdm_check_map(o->engine, &o->grid, o->values, &checked, &o->err));
    }
}

static sdm_generate_opts options(objects *o)
{
    const unsigned b = byte(o);
    return (sdm_generate_opts){.policy = (sdm_range_policy)(b % 3),
                               .exact_shape = b & 4 ? o->shape : NULL,
                               .n_threads = 1,
                               .outside = (sdm_outside)(b / 8 % 3)};
}

static void use_model(objects *o)
{
    const sdm_generate_opts opts = options(o);
    sdm_result result;
    float *const a = o->array;
    double direction[PARAMS_MAX];
    o->model = models[byte(o) % 2];
    const sdm_model_info *info = sdm_model_get_info(o->model);
    model_params(o);
    for (int i = 0; i < PARAMS_MAX; i++) direction[i] = real(o);
    // arrays of the grid of the model, and of the grid of the calls
    if (sdm_grid_count(&info->grid) > VOXELS_MAX || info->n_params > PARAMS_MAX) return;
    switch (byte(o) % 7) {
    case 0:
        check(o, sdm_generate(o->model, o->p, &opts, o->values, &result, &o->err));
        break;
    case 1:
        check(o, sdm_generate_jacobian(o->model, o->p, &opts, o->values, a, &result, &o->err));
        break;
    case 2:
        check(o,
              sdm_generate_jvp(o->model, o->p, direction, &opts, o->values, a, &result, &o->err));
        break;
    case 3:
        check(o, sdm_generate_vjp(o->model, o->p, o->values, &opts, direction, &result, &o->err));
        break;
    case 4:
        check(o, sdm_generate_grid(o->model, o->p, &opts, &o->grid, o->values, NULL, &result,
                                   &o->err));
        break;
    case 5:
        check(o, sdm_generate_points(o->model, o->p, &opts, o->x, POINTS, o->values, a, NULL,
                                     &result, &o->err));
        break;
    default:
        sdm_field_free(o->field);
        check(o, sdm_field_create(o->model, &opts, byte(o) & 1, &o->field, &o->err));
        if (o->field && sdm_field_set_params(o->field, o->p, NULL, &o->err)) {
            sdm_field_free(o->field);
            o->field = NULL;
        }
    }
}

static void use_field(objects *o)
{
    if (!o->field) return;
    float value, gradient[3];
    sdm_blocks blocks = {0};
    switch (byte(o) % 3) {
    case 0:
        check(o, sdm_field_point(o->field, o->x, &value, gradient, NULL, &o->err));
        break;
    case 1:
        check(o, sdm_field_points(o->field, o->x, POINTS, o->values, NULL, o->array, &o->err));
        break;
    default:
        check(o, sdm_field_band(o->field, &o->grid, real(o), &blocks, &o->err));
        sdm_blocks_dispose(&blocks);
    }
}

static void use_map(objects *o)
{
    double volume;
    switch (byte(o) % 3) {
    case 0:
        for (size_t i = 0; i < sdm_grid_count(&o->grid); i++) o->values[i] = (float)real(o);
        break;
    case 1:
        check(o, sdm_map_gradient(&o->grid, o->values, 1, o->array, &o->err));
        break;
    default:
        check(o, sdm_map_volume(&o->grid, o->values, 1, &volume, &o->err));
    }
}

static void use_pose(objects *o)
{
    sdm_pose pose[2];
    double x[3];
    for (int i = 0; i < 2; i++) {
        for (int d = 0; d < 3; d++) {
            pose[i].rotation[d] = real(o);
            pose[i].translation[d] = real(o);
        }
        if (sdm_pose_check(&pose[i], &o->err)) return;
    }
    const sdm_pose both = sdm_pose_compose(&pose[0], &pose[1]), back = sdm_pose_inverse(&both);
    sdm_pose_apply(&back, o->x, x);
    sdm_pose_apply_inverse(&back, x, x);
}

/* Writes the mesh or the map and reads it again. */
static void use_file(objects *o)
{
    static const char *const mesh[] = {"a.ply", "a.stl", "a.obj", "a.off", "a.vtk", "a.vtp"};
    static const char *const image[] = {"a.nii", "a.nrrd", "a.mha", "a.nii.gz"};
    const unsigned b = byte(o);
    sdm_volume volume = {0};
    const char *path = fuzz_file(b & 1 ? mesh[b / 2 % 6] : image[b / 2 % 4], o->at, 0);
    sdm_status s =
        b & 1 ? sdm_mesh_write(path, &o->mesh, &o->err)
              : sdm_volume_write(path, &o->grid, o->values, SDM_VOXEL_FLOAT32, "fuzz", &o->err);
    check(o, s);
    if (s) return;
    if (b & 1) {
        sdm_mesh_dispose(&o->other);
        check(o, sdm_mesh_read(path, &o->other, &o->err));
    } else {
        check(o, sdm_volume_read(path, &volume, &o->err));
    }
    sdm_volume_dispose(&volume);
}

static void new_points(objects *o)
{
    for (int i = 0; i < 3 * POINTS; i++) o->x[i] = real(o);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static void (*const calls[])(objects *) = {new_grid,   new_mesh,   new_shape, change_mesh,
                                               new_engine, use_engine, use_model, use_field,
                                               use_map,    use_pose,   use_file,  new_points};
    static objects o;
    if (!registry) set_up();
    o = (objects){.at = data, .end = data + size, .model = models[0]};
    o.grid = (sdm_grid){{4, 3, 2}, {0, 0, 0}, {1, 1, 1}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (int i = 0; i < CALLS_MAX && o.at < o.end; i++)
        calls[byte(&o) % (sizeof calls / sizeof *calls)](&o);
    sdm_field_free(o.field);
    sdm_exact_free(o.engine);
    sdm_instance_free(o.shape);
    sdm_mesh_dispose(&o.mesh);
    sdm_mesh_dispose(&o.other);
    return 0;
}
