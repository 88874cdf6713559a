/* The shape of a subcommand that names none. */
#define _XOPEN_SOURCE 700 // realpath()
#include <stdlib.h>
#include <string.h>

#include "shapes_command.h"

sdm_status cli_only_shape(const cli_args *args, const sdm_registry *registry, const char *usage,
                          const char **name, sdm_error *err)
{
    size_t n = 0;
    for (size_t i = 0; i < sdm_registry_count(registry); i++) {
        bool given = false;
        for (size_t k = 0; k < args->plugins.n; k++) {
            char *path = realpath(args->plugins.items[k], NULL);
            given = given || (path && !strcmp(path, sdm_registry_origin(registry, i)));
            free(path);
        }
        if (!given) continue;
        *name = sdm_registry_at(registry, i)->name;
        n++;
    }
    if (n == 1) return SDM_OK;
    if (n == 0)
        return sdm_fail(err, SDM_E_ARG, "usage: sdmgen shapes %s, or --plugin FILE with one shape",
                        usage);
    return sdm_fail(err, SDM_E_ARG,
                    "shapes %.*s: --plugin has %zu shapes: name one, for example %s",
                    (int)strcspn(usage, " "), usage, n, *name);
}
