/* What the loading of a path of plug-ins has skipped, beside the messages (registry.h). */
#pragma once

#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Is message `index` about a folder that cannot be read? false: about a file, or there are fewer
 * messages. */
bool sdm_registry_skipped_folder(const sdm_registry *r, size_t index);

#ifdef __cplusplus
}
#endif
