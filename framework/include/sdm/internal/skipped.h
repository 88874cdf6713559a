/* What sdm_registry_load_path() has skipped, beside the message of sdm_registry_skipped(). */
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
