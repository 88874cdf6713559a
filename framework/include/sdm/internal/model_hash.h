/* The cryptographic hash of a model file, by which a model is pinned. */
#pragma once

#include "sdm/internal/sha256.h"
#include "sdm/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* text = the SHA-256 of the file from which the model was read: of the bytes that are in use, not
 * of those that are on the disk now. Returns text. [any thread] */
const char *sdm_model_sha256(const sdm_model *m, char text[SDM_SHA256_TEXT]);

#ifdef __cplusplus
}
#endif
