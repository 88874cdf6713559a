/* Replaces loader.c in builds without shared objects (SDM_PLUGINS=OFF, WebAssembly): loading a
 * plug-in fails with SDM_E_UNSUPPORTED. */
#include "shape_internal.h"

sdm_status sdm_registry_load(sdm_registry *r, const char *file, sdm_error *err)
{
    if (!r || !file || !file[0])
        return sdm_fail(err, SDM_E_ARG, "registry and file are needed to load a plug-in");
    return sdm_fail(err, SDM_E_UNSUPPORTED,
                    "plug-in %s: built without shared objects (SDM_PLUGINS=OFF); link the shape "
                    "and add it with "
                    "sdm_registry_add()",
                    file);
}

sdm_status sdm_registry_load_path(sdm_registry *r, const char *path, sdm_error *err)
{
    if (!r) return sdm_fail(err, SDM_E_ARG, "a registry is needed to load plug-ins");
    return path && *path ? sdm_registry_load(r, path, err) : SDM_OK;
}
