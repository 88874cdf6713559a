/* Shapes without options, each with one of the faults of faulty_shape.h: unfit_FAULT. `sound` has
 * none; `picky` aborts with one of the choices of its option; `sided` keeps a mesh, and compares
 * the parameters alone with it, not the option. */
#include "faulty_shape.h"

/* clang-format off */
#define UNFIT(fault)                                                                               \
    static int fault##_mesh(const void *self, const sdm_host *host,                                \
                            const sdm_option_value *options, const double *p, sdm_mesh_out *out)   \
    {                                                                                              \
        (void)options;                                                                             \
        const sdm_option_value value = {0, #fault};                                                \
        return faulty_mesh(self, host, &value, p, out);                                            \
    }                                                                                              \
    static int fault##_velocity(const void *self, const sdm_host *host,                            \
                                const sdm_option_value *options, const double *p, size_t n_vert,   \
                                double *velocity)                                                  \
    {                                                                                              \
        (void)options;                                                                             \
        const sdm_option_value value = {0, #fault};                                                \
        return faulty_velocity(self, host, &value, p, n_vert, velocity);                           \
    }
/* clang-format on */

#define TABLE(fault)                                                                               \
    {                                                                                              \
        .abi = SDM_SHAPE_ABI, .size = sizeof(sdm_shape), .name = "unfit_" #fault,                  \
        .summary = "test", .params = FAULTY_PARAMS, .n_params = 2, .mesh = fault##_mesh,           \
        .velocity = fault##_velocity                                                               \
    }

UNFIT(none)
UNFIT(fail)
UNFIT(open)
UNFIT(handle)
UNFIT(sizes)
UNFIT(wires)
UNFIT(jump)
UNFIT(velocity)
UNFIT(unlike)
UNFIT(shared)
UNFIT(edge)
UNFIT(cache)
UNFIT(caches)
UNFIT(lapse)
UNFIT(small)

static const sdm_option PICKY_OPTIONS[] = {
    {"mode", SDM_OPTION_CHOICE, "", 0, 0, 0, "none|abort", "x"}};

static const sdm_option SIDED_OPTIONS[] = {
    {"step", SDM_OPTION_INT, "", 1, 2, 1, NULL, "x"},
    {"side", SDM_OPTION_CHOICE, "", 0, 0, 0, "right|left", "x"}};

static int sided_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                      const double *p, sdm_mesh_out *out)
{
    static _Thread_local double key[2], edge;
    (void)self;
    const int failed = host->reserve(host, out, 8, 12);
    if (failed) return failed;
    if (key[0] != p[0] || key[1] != p[1]) {
        memcpy(key, p, sizeof key);
        edge = options[1].number > 0 ? p[0] : 2 * p[0];
    }
    faulty_box(out, 0, (const double[3]){0, 0, 0}, (const double[3]){edge, p[0], p[1]}, 0);
    return 0;
}

static const sdm_shape SHAPES[] = {TABLE(none),
                                   TABLE(fail),
                                   TABLE(open),
                                   TABLE(handle),
                                   TABLE(sizes),
                                   TABLE(wires),
                                   TABLE(jump),
                                   TABLE(velocity),
                                   TABLE(unlike),
                                   TABLE(shared),
                                   TABLE(edge),
                                   TABLE(cache),
                                   TABLE(caches),
                                   TABLE(lapse),
                                   TABLE(small),
                                   {.abi = SDM_SHAPE_ABI,
                                    .size = sizeof(sdm_shape),
                                    .name = "picky",
                                    .summary = "test",
                                    .params = FAULTY_PARAMS,
                                    .n_params = 2,
                                    .options = PICKY_OPTIONS,
                                    .n_options = 1,
                                    .mesh = faulty_mesh,
                                    .velocity = faulty_velocity},
                                   {.abi = SDM_SHAPE_ABI,
                                    .size = sizeof(sdm_shape),
                                    .name = "sided",
                                    .summary = "test",
                                    .params = FAULTY_PARAMS,
                                    .n_params = 2,
                                    .options = SIDED_OPTIONS,
                                    .n_options = 2,
                                    .mesh = sided_mesh}};

const sdm_shape *sdm_plugin_shape(uint32_t index)
{
    return index < sizeof SHAPES / sizeof *SHAPES ? &SHAPES[index] : NULL;
}
