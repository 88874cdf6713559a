/* List of the built-in shapes, generated from shapes.def. */
#include "sdm/builtin_shapes.h"

#define SHAPE(name) extern const sdm_shape sdm_shape_##name;
#include "shapes.def"
#undef SHAPE

static const sdm_shape *const LIST[] = {
#define SHAPE(name) &sdm_shape_##name,
#include "shapes.def"
#undef SHAPE
};

sdm_status sdm_builtin_shapes_add(sdm_registry *registry, sdm_error *err)
{
    for (size_t i = 0; i < sizeof LIST / sizeof *LIST; i++) {
        const sdm_status s = sdm_registry_add(registry, LIST[i], "built in", err);
        if (s) return s;
    }
    return SDM_OK;
}
