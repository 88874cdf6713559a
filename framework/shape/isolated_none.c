/* Replaces the files isolated*.c in builds without plug-ins and on systems other than Linux. */
#include "sdm/internal/isolation.h"

sdm_status sdm_registry_isolate(sdm_registry *r, const sdm_isolation *how, sdm_error *err)
{
    (void)r, (void)how;
    return sdm_fail(err, SDM_E_UNSUPPORTED,
                    "plug-ins in processes of their own need Linux and a build with "
                    "SDM_PLUGINS=ON");
}

int sdm_isolation_worker(int n, char **argument)
{
    (void)n, (void)argument;
    return 1;
}
