/* Table of all methods, and look-up by name. */
#include <string.h>

#include "method.h"

static const sdm_method *const methods[] = {&sdm_method_exact, &sdm_method_naive, &sdm_method_cells,
                                            &sdm_method_octree, &sdm_method_edt};
enum { N_METHODS = sizeof methods / sizeof *methods };

size_t sdm_method_count(void) { return N_METHODS; }
const sdm_method *sdm_method_at(size_t i) { return i < N_METHODS ? methods[i] : NULL; }

const sdm_method *sdm_method_find(const char *name, sdm_error *err)
{
    for (size_t i = 0; i < N_METHODS && name; i++)
        if (!strcmp(name, methods[i]->name)) return methods[i];
    (void)sdm_fail(err, SDM_E_ARG, "unknown method '%s': need exact, naive, cells, octree or edt",
                   name ? name : "");
    return NULL;
}
