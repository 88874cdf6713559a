/* Whether there is memory for OpenVDB: its threads end the whole program when they get none, so
   that has to be known before. Internal to the level set library. */
#pragma once

#include <stdint.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* SDM_E_NOMEM unless there is room, at this moment, for a grid with this number of stored values,
   for the copy that is read back, and for the stacks and heaps of OpenVDB's threads. */
sdm_status sdm_vdb_headroom(uint64_t values, sdm_error *err);

#ifdef __cplusplus
}
#endif
