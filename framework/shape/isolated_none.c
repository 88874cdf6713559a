/* Replaces the files isolated*.c in builds without plug-ins and on systems other than Linux. */
#include "sdm/internal/isolation.h"
#include "shape_internal.h"

sdm_status sdm_registry_isolate(sdm_registry *r, const sdm_isolation *how, sdm_error *err)
{
    (void)r, (void)how;
    return sdm_fail(err, SDM_E_UNSUPPORTED,
                    "plug-ins in processes of their own need Linux and a build with "
                    "SDM_PLUGINS=ON");
}

bool sdm_is_isolated(const sdm_instance *s)
{
    (void)s;
    return false;
}

size_t sdm_isolated_ends(const sdm_instance *s)
{
    (void)s;
    return 0;
}

sdm_status sdm_isolated_repeat(const sdm_instance *s, const double *p, size_t n, int n_threads,
                               sdm_repeat *out, sdm_error *err)
{
    (void)s, (void)p, (void)n, (void)n_threads, (void)out;
    return sdm_fail(err, SDM_E_UNSUPPORTED, "no shape is isolated");
}

int sdm_isolation_worker(int n, char **argument)
{
    (void)n, (void)argument;
    return 1;
}
