/* Common parts of the tests of phantoms: two shapes, grids, options. Include after cmocka.h. */
#ifndef SDM_TEST_PHANTOM_TOOLS_H
#define SDM_TEST_PHANTOM_TOOLS_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/builtin_shapes.h"
#include "sdm/phantom.h"

#define PI 3.14159265358979323846

/* A block so large that a small grid around the origin meets only its face x = 0: a half space,
 * inside is x < 0. */
static inline int block_mesh(const void *self, const sdm_host *host,
                             const sdm_option_value *options, const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    static const uint32_t tri[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6},
                                        {0, 1, 4}, {1, 5, 4}, {2, 6, 3}, {3, 6, 7},
                                        {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    const int failed = host->reserve(host, out, 8, 12);
    if (failed) return failed;
    for (int i = 0; i < 8; i++) {
        out->vert[3 * i] = i & 1 ? 0 : -p[0];
        out->vert[3 * i + 1] = i & 2 ? p[0] : -p[0];
        out->vert[3 * i + 2] = i & 4 ? p[0] : -p[0];
    }
    memcpy(out->tri, tri, sizeof tri);
    return 0;
}

static const sdm_param BLOCK_PARAMS[] = {{"edge", "mm", 1, 100, 50, "half of the edge"}};
static const sdm_shape BLOCK = {.abi = SDM_SHAPE_ABI,
                                .size = sizeof(sdm_shape),
                                .name = "block",
                                .summary = "a block",
                                .params = BLOCK_PARAMS,
                                .n_params = 1,
                                .mesh = block_mesh};

static sdm_registry *registry;
static sdm_instance *block, *ellipsoid;

static inline int set_up(void **state)
{
    (void)state;
    const sdm_named_text edge = {"edge", "0.1"};
    if (sdm_registry_create(&registry, NULL) || sdm_builtin_shapes_add(registry, NULL)) return 1;
    return sdm_instance_create(&BLOCK, NULL, 0, NULL, &block, NULL) ||
           sdm_instance_create(sdm_registry_find(registry, "ellipsoid", NULL), &edge, 1, NULL,
                               &ellipsoid, NULL);
}

static inline int tear_down(void **state)
{
    (void)state;
    sdm_instance_free(ellipsoid);
    sdm_instance_free(block);
    sdm_registry_free(registry);
    return 0;
}

/* Options without blur and noise, inside 1 and outside 0: the phantom's values are the fractions of
 * the voxels that lie inside. */
static inline sdm_phantom_opts plain(void)
{
    return (sdm_phantom_opts){.inside = {1, 0}, .outside = {0, 0}, .supersampling = 3, .seed = 7};
}

/* An oblique, left-handed grid around the origin with a different spacing along each axis. */
static inline sdm_grid oblique(int64_t nx, int64_t ny, int64_t nz)
{
    const double a = 0.4, ca = cos(a), sa = sin(a), b = -0.7, cb = cos(b), sb = sin(b);
    sdm_grid g = {.n = {nx, ny, nz},
                  .spacing = {0.3, 0.2, 0.45},
                  .dir = {ca, -sa * cb, -sa * sb, sa, ca * cb, ca * sb, 0, sb, -cb}};
    const double middle[3] = {0.5 * (double)(nx - 1), 0.5 * (double)(ny - 1),
                              0.5 * (double)(nz - 1)};
    double centre[3];
    sdm_grid_world(&g, middle, centre);
    for (int i = 0; i < 3; i++) g.origin[i] = -centre[i];
    return g;
}

/* A phantom image of the shape (caller frees). label: [count] or NULL. */
static inline float *make(const sdm_instance *shape, const double *p, const sdm_pose *pose,
                          const sdm_phantom_opts *o, const sdm_grid *g, uint8_t *label)
{
    sdm_error err;
    float *v = calloc(sdm_grid_count(g), sizeof *v);
    if (!v) abort();
    if (sdm_phantom_make(shape, p, pose, o, g, v, label, &err)) fail_msg("%s", err.text);
    return v;
}

static inline void close_to(const char *what, double got, double expected, double tolerance)
{
    if (!(fabs(got - expected) <= tolerance))
        fail_msg("%s is %g, expected %g +- %g", what, got, expected, tolerance);
}

#endif
