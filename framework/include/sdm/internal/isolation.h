/* Plug-ins in processes of their own: a plug-in that crashes, hangs, exits, floods or damages
 * memory gives an error there, and the program goes on. */
#pragma once

#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How the plug-ins of a registry are isolated. */
typedef struct sdm_isolation {
    /* path of a program that gives its arguments to sdm_isolation_worker() when the first one is
     * SDM_ISOLATION_COMMAND; stays valid as long as the registry */
    const char *program;
    double seconds; /* longest time of a callback; loading a plug-in may take 30 s more */
    uint64_t bytes; /* memory of each worker process beyond that of the program */
    /* Called once for each plug-in that prints something; any thread. May be NULL. */
    void (*notice)(const char *text);
} sdm_isolation;

#define SDM_ISOLATION_COMMAND "shape-worker"

/* From now on sdm_registry_load() loads plug-ins into worker processes: what an instance of such a
 * shape computes has the same bits, and whatever a callback does there, the caller gets
 * SDM_E_PLUGIN with callback and reason. Each thread that calls at the same time has a worker; a
 * worker that was ended is replaced at the next call. Workers end with the instance, the registry
 * or the program. This is no protection against malice: a worker has all the rights of the user.
 * SDM_E_UNSUPPORTED: not on this system, or a build without plug-ins. */
sdm_status sdm_registry_isolate(sdm_registry *r, const sdm_isolation *how, sdm_error *err);

/* The work of a worker process: argument[0] is SDM_ISOLATION_COMMAND. Returns the exit code. */
int sdm_isolation_worker(int n, char **argument);

#ifdef __cplusplus
}
#endif
