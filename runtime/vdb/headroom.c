/* Allocates what OpenVDB will need, and frees it. */
#define _DEFAULT_SOURCE // sysconf(_SC_NPROCESSORS_ONLN)
#include "headroom.h"

#include <unistd.h>

#include "sdm/internal/heap.h"
#include "sdm/memory.h"

/* Leaves of 4 bytes a value are at least a third full in a band of 3 voxels, and there are two
 * grids. */
#define BYTES_A_VALUE 24
#define BYTES_OF_OPENVDB ((size_t)32 << 20)
/* A stack of 8 MB, and what a thread takes for buffers and its own heap. */
#define BYTES_A_THREAD ((size_t)16 << 20)

sdm_status sdm_vdb_headroom(uint64_t values, sdm_error *err)
{
    const long processors = sysconf(_SC_NPROCESSORS_ONLN);
    const size_t threads = processors > 1 ? (size_t)processors : 1;
    void *grids = NULL, *others = NULL;
    sdm_status s = sdm_alloc_unset(&grids, values, BYTES_A_VALUE, "level set", err);
    if (!s)
        s = sdm_alloc_unset(&others, BYTES_OF_OPENVDB + threads * BYTES_A_THREAD, 1,
                            "threads of OpenVDB", err);
    sdm_free(others);
    sdm_free(grids);
    return s;
}
