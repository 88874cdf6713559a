/* Plug-ins that break the rules of the plug-in interface: each VARIANT is built as a shared object
 * of its own, and test_abi checks that it is refused. */
#include "sdm/shape.h"

#define WRONG_ABI 1
#define NO_SYMBOL 2
#define NO_SHAPE 3
#define ENDLESS 4
#define TAKEN_NAME 5
#define SECOND_BAD 6
#define UNDEFINED 7

static const sdm_param PARAMS[] = {{"size", "mm", 1, 2, 1.5, "size"}};

static int mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options, (void)p, (void)out;
    return host->fail(host, "never called");
}

#if VARIANT == NO_SYMBOL
const sdm_shape *some_other_name(uint32_t index);
#define sdm_plugin_shape some_other_name
#endif

#if VARIANT == UNDEFINED
int a_function_without_definition(void);
#endif

const sdm_shape *sdm_plugin_shape(uint32_t index)
{
    static sdm_shape shape = {.abi = SDM_SHAPE_ABI,
                              .size = sizeof(sdm_shape),
                              .name = "lone",
                              .summary = "test",
                              .params = PARAMS,
                              .n_params = 1,
                              .mesh = mesh};
    switch (VARIANT) {
    case WRONG_ABI:
        shape.abi = 2;
        break;
    case NO_SHAPE:
        return 0;
    case ENDLESS: { // a new shape with a new name for every index, without end
        static char name[8] = "s000000";
        for (uint32_t i = 6, n = index; i > 0; i--, n /= 10) name[i] = (char)('0' + n % 10);
        static char names[300][8];
        for (uint32_t k = 0; k < 8; k++) names[index % 300][k] = name[k];
        shape.name = names[index % 300];
        return &shape;
    }
    case TAKEN_NAME:
        shape.name = "torus";
        break;
    case SECOND_BAD:
        if (index == 1) shape.mesh = 0;
        return index < 2 ? &shape : 0;
    default:
        break;
    }
#if VARIANT == UNDEFINED
    return a_function_without_definition() ? &shape : 0;
#else
    return index == 0 ? &shape : 0;
#endif
}
