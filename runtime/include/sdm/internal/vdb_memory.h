/* Where memory ends inside OpenVDB and it cannot report that. */
#pragma once

#include "sdm/internal/shared.h"

#ifdef __cplusplus
extern "C" {
#endif

/* From now on calls end(), which must not return, where memory ends in a thread or a destructor of
 * a C++ library: no exception can leave these, and the process would abort. end() may run in any
 * thread and has no memory. */
SDM_INTERNAL_API void sdm_vdb_on_memory_end(void (*end)(void));

#ifdef __cplusplus
}
#endif
