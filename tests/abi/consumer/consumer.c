/* Uses the installed libraries as an external project would. Usage: consumer FOLDER [PLUGIN.so] */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/exact.h"
#include "sdm/export.h"
#include "sdm/registry.h"
#include "sdm/runtime.h"
#ifdef WITH_IMAGE
#include "sdm/image.h"
#endif
#ifdef WITH_PICTURE
#include "sdm/picture.h"
#endif
#ifdef WITH_VDB
#include "sdm/vdb.h"
#endif

static void require_ok(sdm_status s, const sdm_error *err)
{
    if (!s) return;
    fprintf(stderr, "%s: %s\n", sdm_status_name(s), err->text);
    exit(1);
}

static void require(int right, const char *what)
{
    if (right) return;
    fprintf(stderr, "wrong: %s\n", what);
    exit(1);
}

// Map of an octahedron of radius 2 mm. Also checks the distance of its centre: that of its faces, 2
// / sqrt(3).
static void octahedron_map(const sdm_grid *grid, float *values, sdm_error *err)
{
    static double vert[] = {2, 0, 0, -2, 0, 0, 0, 2, 0, 0, -2, 0, 0, 0, 2, 0, 0, -2};
    static uint32_t tri[] = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4,
                             2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    const sdm_mesh mesh = {.vert = vert, .tri = tri, .n_vert = 6, .n_tri = 8};
    sdm_exact *engine = NULL;
    require_ok(sdm_exact_create(&mesh, NULL, &engine, err), err);
    require_ok(sdm_exact_map(engine, grid, values, err), err);
    require(fabs(sdm_exact_point(engine, (const double[3]){0, 0, 0}, NULL, NULL, NULL) +
                 2 / sqrt(3.0)) < 1e-12,
            "distance at the middle");
    sdm_exact_free(engine);
}

static void use_plugin(const char *file, sdm_error *err)
{
    sdm_registry *registry = NULL;
    require_ok(sdm_registry_create(&registry, err), err);
    require_ok(sdm_registry_load(registry, file, err), err);
    require(sdm_registry_count(registry) > 0, "number of shapes in the plug-in");
    const sdm_shape *shape = sdm_registry_at(registry, 0);
    sdm_instance *instance = NULL;
    require_ok(sdm_instance_create(shape, NULL, 0, NULL, &instance, err), err);
    size_t n;
    const sdm_param *params = sdm_instance_params(instance, &n);
    double p[64];
    require(n <= 64, "number of parameters");
    for (size_t i = 0; i < n; i++) p[i] = params[i].def;
    sdm_mesh mesh = {0};
    sdm_audit audit;
    require_ok(sdm_instance_mesh(instance, p, &mesh, err), err);
    require_ok(sdm_mesh_audit(&mesh, &audit, err), err);
    double size = 0;
    for (int a = 0; a < 3; a++) size = fmax(size, audit.max[a] - audit.min[a]);
    const double centre[3] = {(audit.min[0] + audit.max[0]) / 2, (audit.min[1] + audit.max[1]) / 2,
                              (audit.min[2] + audit.max[2]) / 2};
    const sdm_grid grid = sdm_grid_centred((const int64_t[3]){24, 24, 24}, size * 1.2 / 24, centre);
    float *values = malloc(sdm_grid_count(&grid) * sizeof *values);
    require(values != NULL, "memory");
    require_ok(sdm_exact_shape_map(instance, p, NULL, &grid, values, NULL, err), err);
    size_t inside = 0;
    for (size_t i = 0; i < sdm_grid_count(&grid); i++) inside += values[i] < 0;
    require(inside > 0 && inside < sdm_grid_count(&grid) && values[0] > 0,
            "inside of the plug-in's shape");
    printf("plug-in shape %s: %zu parameters, %zu triangles, %zu voxels inside\n", shape->name, n,
           mesh.n_tri, inside);
    free(values);
    sdm_mesh_dispose(&mesh);
    sdm_instance_free(instance);
    sdm_registry_free(registry);
}

int main(int argc, char **argv)
{
    if (argc < 2) return 2;
    sdm_error err = {0};
    const sdm_grid grid =
        sdm_grid_centred((const int64_t[3]){30, 30, 30}, 0.2, (const double[3]){0.01, 0.02, 0.03});
    float *values = malloc(sdm_grid_count(&grid) * sizeof *values);
    require(values != NULL, "memory");
    octahedron_map(&grid, values, &err);
    char path[4096];
#ifdef WITH_IMAGE
    snprintf(path, sizeof path, "%s/map.nrrd", argv[1]);
    require_ok(sdm_image_write(path, &grid, values, "octahedron", &err), &err);
#endif
#ifdef WITH_PICTURE
    snprintf(path, sizeof path, "%s/map.svg", argv[1]);
    require_ok(sdm_picture_slices(path, &grid,
                                  &(sdm_picture_map){.title = "octahedron", .values = values}, 1,
                                  NULL, 0, &err),
               &err);
#endif
#ifdef WITH_VDB
    snprintf(path, sizeof path, "%s/map.vdb", argv[1]);
    require_ok(sdm_vdb_write(path, &grid, values, NULL, NULL, &err), &err);
    require_ok(sdm_vdb_verify(path, NULL, &err), &err);
#endif
    snprintf(path, sizeof path, "%s/no_model.sdm", argv[1]);
    sdm_model *model = NULL;
    require(sdm_model_open(path, &model, &err) == SDM_E_IO, "status of a missing model");
    if (argc > 2) use_plugin(argv[2], &err);
    free(values);
    printf("sdmgen %s\n", SDM_VERSION_TEXT);
    return 0;
}
